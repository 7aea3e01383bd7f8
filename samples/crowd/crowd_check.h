// What instances of a crowd must show after a frame, from the documentation of SceneRecorder and
// not from its code. Compares their poses with the clips of the file, and their vertices with the
// double-precision reference of these poses.
#pragma once

#include <cstddef>
#include <cstdint>
#include <map>
#include <mutex>
#include <optional>
#include <span>
#include <string>
#include <utility>
#include <vector>

#include "dermis/clips.h"
#include "dermis/layout.h"
#include "dermis/scene.h"
#include "dermis/verify.h"
#include "kit/batch_runner.h"
#include "kit/character.h"

namespace crowd {

using dermis::samples::Playing;

/// What an engine asked for an instance in a frame.
struct AskedInstance {
  dermis::InstanceHandle handle;
  std::uint32_t part = 0;
  Playing playing;
  bool isVisible = false;
  bool teleports = false;
  std::uint32_t updateInterval = 1;
};

/// What an instance played for its positions and its previous positions.
struct ShownPose {
  Playing current, previous;

  friend bool operator==(const ShownPose&, const ShownPose&) = default;
};

/// A visible instance: where its vertices are, and what they may show.
struct ShownInstance {
  dermis::InstanceHandle handle;
  std::uint32_t part = 0;
  dermis::InstanceOutput output;
  /// All vertices must show one of them. If the GPU culls there may be several, since the CPU does
  /// not know in which frames the GPU skinned the instance.
  std::vector<ShownPose> poses;
};

class CrowdCheck {
 public:
  struct Totals {
    std::uint32_t frames = 0;
    std::uint64_t instances = 0;
    std::uint64_t vertices = 0;  ///< compared with their bound
    std::uint64_t failures = 0;  ///< instances with a vertex outside its bound
    std::string firstFailure;    ///< a sentence
    double worst = 0;            ///< the largest error of a vertex ÷ its bound
    std::uint64_t poses = 0;     ///< compared with the clips
    double worstPose = 0;        ///< the largest error of a pose ÷ its bound
  };

  /// Instances are skinned by `method`, with previous positions. Poses are sampled from `bank` by
  /// `target`, which does it as the scene: the bits of a pose depend only on what is played. All
  /// arguments must outlive it.
  CrowdCheck(const dermis::samples::Character& character, const dermis::PackedClips& bank,
             dermis::samples::BatchTarget& target, dermis::Method method)
      : character_(&character), bank_(&bank), target_(&target), method_(method) {}

  /// Call it once for each frame, after it has been recorded or planned, with all instances.
  /// `skinned` is `skinnedInstances` of the scene.
  void follow(std::uint64_t frame, std::span<const AskedInstance> instances,
              std::span<const dermis::InstanceHandle> skinned, bool culledOnGpu);

  /// The visible instances of the frame that was followed last.
  std::vector<ShownInstance> shown(const dermis::Scene& scene) const;

  /// Compares `shown` instances of a frame on all cores. Offsets of outputs count from the
  /// beginning of `bytes`. Throws `Failure` if the target or the reference fails.
  void compare(std::uint64_t frame, std::span<const ShownInstance> instances,
               std::span<const std::byte> bytes);

  const Totals& totals() const { return totals_; }
  /// Empty if nothing is wrong.
  std::string complaint() const;

 private:
  struct Skinned {
    ShownPose pose;
    std::uint64_t frame = 0;  ///< in which it was skinned

    friend bool operator==(const Skinned&, const Skinned&) = default;
  };
  struct Followed {
    dermis::InstanceHandle handle;
    std::uint32_t part = 0;
    std::uint64_t frame = 0;       ///< the last frame with this instance
    std::vector<Skinned> skinned;  ///< the possible ones
    bool isVisible = false;
    bool restarts = false;  ///< it has teleported since it was skinned
    std::uint32_t interval = 0;
    std::uint64_t intervalSince = 0;
  };
  struct Finding {
    std::uint64_t compared = 0;  ///< vertices, in the current pose
    std::uint64_t failures = 0;  ///< vertices, in the first of both poses that has any
    std::uint32_t firstFailure = 0;
    double worst = 0;
  };
  /// Figures at the same tick of a clip have the same pose, so results are kept; those of fades are
  /// for one frame.
  struct Expected {
    std::once_flag once;
    std::optional<dermis::reference::SkinnedMesh> mesh;
  };
  using Poses = std::vector<std::vector<dermis::JointMatrix>>;  ///< by skin

  void follow(Followed& followed, const AskedInstance& asked, bool maySkin, bool mayRest);
  /// Samples what these instances may show and was not sampled yet, in one batch.
  void samplePoses(std::span<const ShownInstance> instances);
  const dermis::reference::SkinnedMesh& expected(std::uint32_t part, const Playing& playing);
  Finding check(const ShownInstance& instance, std::span<const std::byte> bytes);
  Finding check(const ShownInstance& instance, const ShownPose& pose,
                std::span<const std::byte> bytes);

  const dermis::samples::Character* character_;
  const dermis::PackedClips* bank_;
  dermis::samples::BatchTarget* target_;
  dermis::Method method_;
  std::uint64_t frame_ = 0;
  std::vector<Followed> followed_;  ///< by the index of the handle
  std::uint64_t overdue_ = 0;       ///< how often an instance was not skinned although it had to be
  std::map<Playing, Poses> poses_;
  std::mutex mutex_;  ///< of `expected_`
  std::map<std::pair<std::uint32_t, Playing>, Expected> expected_;
  Totals totals_;
};

}  // namespace crowd
