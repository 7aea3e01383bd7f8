// The code that an engine adds to skin a crowd: a SkinningSystem, and for each figure the handles
// of its poses and instances.
//
// Figures are skinned in the space of the character. The vertex shader that draws a figure applies
// its transform. So a figure that moves without changing its pose is not skinned again, and float32
// is as exact far from the origin as near it.
#pragma once

#include <cstdint>
#include <memory>
#include <span>
#include <string>
#include <vector>

#include "character.h"
#include "crowd_system.h"
#include "dermis/dermis.h"
#include "dermis/vulkan/vulkan.h"
#include "figures.h"
#include "kit/buffer.h"
#include "kit/device.h"

namespace crowd {

struct CrowdOptions {
  std::uint32_t framesInFlight = 3;
  std::uint64_t outputBudget = 0;  ///< bytes; 0: enough for all figures
  bool culledOnGpu = false;        ///< the GPU decides which instances are visible
  bool measuresGpuTime = false;    ///< requires a queue with timestamps
};

/// The handles of a figure.
struct CrowdFigure {
  std::vector<dermis::PoseHandle> poses;          ///< by skin; empty: it is not there
  std::vector<dermis::InstanceHandle> instances;  ///< by part
  FigureFrame now;

  bool isThere() const { return !instances.empty(); }
};

class Crowd {
 public:
  static constexpr dermis::Method method = dermis::Method::dualQuaternion;

  /// Builds pipelines, so call it from a loading thread. The arguments must outlive the crowd.
  static dermis::Result<Crowd> create(dermis::samples::Device& device,
                                      dermis::vulkan::Context& context, const Character& character,
                                      const Figures& script, const CrowdOptions& options);

  /// The same on the CPU, without Vulkan.
  static dermis::Result<Crowd> createOnCpu(const Character& character, const Figures& script,
                                           const CrowdOptions& options);

  /// Call it in each frame, outside a render pass.
  dermis::Result<void> skinFrame(std::uint64_t frame, std::uint64_t completedFrame,
                                 VkCommandBuffer commandBuffer);
  /// Call it in each frame. Uses all cores.
  dermis::Result<void> skinOnCpu(std::uint64_t frame);

  /// Call it after the last frame, for each frame that the GPU has completed. `statistics` then
  /// returns the GPU time and counts of that frame.
  dermis::Result<void> complete(std::uint64_t frame, std::uint64_t completedFrame) {
    return system_.onDevice()->beginFrame(frame, completedFrame);
  }

  const CrowdSystem& system() const { return system_; }
  /// On the CPU, the time of the jobs takes the place of the GPU time.
  dermis::vulkan::SystemStatistics statistics() const;
  std::span<const CrowdFigure> figures() const { return figures_; }
  bool isCulledOnGpu() const { return options_.culledOnGpu; }
  /// How often there was no room for a figure. It is added when there is room.
  std::uint64_t refusals() const { return refusals_; }

 private:
  Crowd(dermis::samples::Device* device, const Character& character, const Figures& script,
        const CrowdOptions& options, CrowdSystem system)
      : device_(device),
        character_(&character),
        script_(&script),
        options_(options),
        system_(std::move(system)),
        figures_(script.count()) {}

  dermis::InstanceDescription describe(const Part& part) const;
  dermis::Result<void> add(CrowdFigure& figure);
  dermis::Result<void> remove(CrowdFigure& figure);
  dermis::Result<void> comeAndGo(std::uint64_t frame);
  dermis::Result<void> moveAll(std::uint64_t frame);
  dermis::Result<void> move(const CrowdFigure& figure);
  dermis::Result<VkBuffer> writeVisibility(std::uint64_t frame);

  dermis::samples::Device* device_;  ///< null on the CPU
  const Character* character_;
  const Figures* script_;
  CrowdOptions options_;
  CrowdSystem system_;
  double planSeconds_ = 0, jobSeconds_ = 0;  ///< of the last frame on the CPU
  std::vector<dermis::MeshHandle> meshes_;   ///< by part
  std::vector<CrowdFigure> figures_;
  /// For culling on the GPU: the words that a culling kernel would write, for each frame in flight.
  std::vector<dermis::samples::MappedBuffer> visibility_;
  std::uint64_t refusals_ = 0;
};

}  // namespace crowd
