// The check: copies the output back, and compares every vertex of every displayed instance with the
// reference in double precision.
#pragma once

#include <cstdint>
#include <deque>
#include <memory>
#include <string>
#include <vector>

#include "crowd.h"
#include "kit/buffer.h"
#include "kit/device.h"
#include "references.h"
#include "shown_poses.h"

namespace crowd {

struct CheckTotals {
  std::uint32_t frames = 0;
  std::uint64_t instances = 0;
  std::uint64_t vertices = 0;  ///< compared with their bound
  std::uint64_t failures = 0;  ///< instances with a vertex outside its bound
  std::string firstFailure;    ///< a sentence
  double worst = 0;            ///< the largest error ÷ its bound
};

class CrowdCheck {
 public:
  /// `device` is null on the CPU.
  CrowdCheck(dermis::samples::Device* device, const Character& character)
      : device_(device), character_(&character), references_(character) {}

  /// Records a copy of the output, after `Crowd::skinFrame`, and keeps what is expected.
  dermis::Result<void> capture(const Crowd& crowd, const ShownPoses& shown, std::uint64_t frame,
                               VkCommandBuffer commandBuffer);
  /// Copies the output of the frame, on the CPU.
  dermis::Result<void> captureOnCpu(const Crowd& crowd, const ShownPoses& shown,
                                    std::uint64_t frame);
  /// Compares what was captured in frames that the GPU has completed.
  dermis::Result<void> compareUpTo(std::uint64_t completedFrame);

  const CheckTotals& totals() const { return totals_; }

 private:
  struct Instance {
    ShownInstance shown;
    dermis::InstanceOutput output;
  };
  struct Capture {
    std::uint64_t frame = 0;
    std::vector<Instance> instances;
    dermis::samples::MappedBuffer output;
    std::vector<std::byte> onCpu;  ///< the output, if it was skinned there

    std::span<const std::byte> bytes() const {
      return onCpu.empty() ? output.bytes() : std::span<const std::byte>(onCpu);
    }
  };
  /// The result for one instance.
  struct MeshFinding {
    dermis::Result<void> done;
    double worst = 0;
    std::uint64_t compared = 0;  ///< vertices, in the current pose
    std::uint32_t firstFailure = 0;
    bool passed = false;
  };

  dermis::Result<std::vector<Instance>> displayedBy(const Crowd& crowd,
                                                    const ShownPoses& shown) const;
  dermis::Result<dermis::samples::MappedBuffer> readBackBuffer(std::uint64_t size);
  dermis::Result<void> prepareReferences(const Capture& capture);
  double distanceFrom(PoseKey pose, std::uint32_t part, const Capture& capture,
                      const dermis::OutputAttribute& attribute) const;
  std::vector<ShownPose> byLikelihood(const Capture& capture, const Instance& instance) const;
  MeshFinding check(const Capture& capture, const Instance& instance) const;
  MeshFinding checkPose(const Capture& capture, const Instance& instance,
                        const ShownPose& pose) const;
  void count(const Capture& capture, const Instance& instance, const MeshFinding& finding);

  dermis::samples::Device* device_;
  const Character* character_;
  References references_;
  std::deque<Capture> captures_;
  std::vector<dermis::samples::MappedBuffer> unused_;  ///< to read back into
  CheckTotals totals_;
};

}  // namespace crowd
