// What instances of a character must show after a frame, from the documentation of SceneRecorder
// and not from its code, and its comparison with the double-precision reference.
#pragma once

#include <cstddef>
#include <cstdint>
#include <functional>
#include <map>
#include <mutex>
#include <optional>
#include <span>
#include <string>
#include <utility>
#include <vector>

#include "dermis/layout.h"
#include "dermis/scene.h"
#include "dermis/verify.h"
#include "kit/character.h"
#include "kit/program.h"

namespace dermis::samples {

/// What an engine asked for an instance in a frame.
struct AskedInstance {
  InstanceHandle handle;
  std::uint32_t part = 0;
  PoseKey pose;
  bool isVisible = false;
  bool teleports = false;
  std::uint32_t updateInterval = 1;
};

/// The poses of an instance's positions and previous positions.
struct ShownPose {
  PoseKey current, previous;

  friend bool operator==(const ShownPose&, const ShownPose&) = default;
};

/// A visible instance: where its vertices are, and what they may show.
struct ShownInstance {
  InstanceHandle handle;
  std::uint32_t part = 0;
  InstanceOutput output;
  /// All vertices must show one of them. If the GPU culls there may be several, since the CPU does
  /// not know in which frames the GPU skinned the instance.
  std::vector<ShownPose> poses;
};

class CharacterCheck {
 public:
  struct Totals {
    std::uint32_t frames = 0;
    std::uint64_t instances = 0;
    std::uint64_t vertices = 0;  ///< compared with their bound
    std::uint64_t failures = 0;  ///< instances with a vertex outside its bound
    std::string firstFailure;    ///< a sentence
    double worst = 0;            ///< the largest error ÷ its bound
  };

  /// The joint matrices at a moment, for a skin of the character.
  using Poses = std::function<std::span<const JointMatrix>(PoseKey, std::uint32_t)>;

  /// `character`, and what `poses` returns, must outlive it. Instances are skinned by `method`,
  /// with previous positions.
  CharacterCheck(const Character& character, Poses poses, Method method)
      : character_(&character), poses_(std::move(poses)), method_(method) {}

  /// Call it once for each frame, after it has been recorded or planned, with all instances.
  /// `skinned` is `skinnedInstances` of the scene.
  void follow(std::uint64_t frame, std::span<const AskedInstance> instances,
              std::span<const InstanceHandle> skinned, bool culledOnGpu);

  /// The visible instances of the frame that was followed last.
  std::vector<ShownInstance> shown(const Scene& scene) const {
    std::vector<ShownInstance> all;
    for (const Followed& followed : followed_) {
      if (followed.frame != frame_ || !followed.isVisible) continue;
      ShownInstance& instance = all.emplace_back();
      instance.handle = followed.handle;
      instance.part = followed.part;
      instance.output = must(scene.output(followed.handle));
      for (const Skinned& skinned : followed.skinned) instance.poses.push_back(skinned.pose);
    }
    return all;
  }

  /// Compares `shown` instances of a frame on all cores. Offsets of outputs count from the
  /// beginning of `bytes`. Throws `Failure` if the reference fails.
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
    InstanceHandle handle;
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
  /// Figures at the same tick of a clip have the same pose, so results are kept.
  struct Expected {
    std::once_flag once;
    std::optional<reference::SkinnedMesh> mesh;
  };

  void follow(Followed& followed, const AskedInstance& asked, bool maySkin, bool mayRest);
  const reference::SkinnedMesh& expected(std::uint32_t part, PoseKey pose);
  Finding check(const ShownInstance& instance, std::span<const std::byte> bytes);
  Finding check(const ShownInstance& instance, const ShownPose& pose,
                std::span<const std::byte> bytes);

  const Character* character_;
  Poses poses_;
  Method method_;
  std::uint64_t frame_ = 0;
  std::vector<Followed> followed_;  ///< by the index of the handle
  std::uint64_t overdue_ = 0;       ///< how often an instance was not skinned although it had to be
  std::mutex mutex_;                ///< of `expected_`
  std::map<std::pair<std::uint32_t, PoseKey>, Expected> expected_;
  Totals totals_;
};

}  // namespace dermis::samples
