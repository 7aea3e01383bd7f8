// The expected contents of the output, derived from the documentation of SkinningSystem, not from
// its code: which pose each instance must show after a frame, and which pose its previous positions
// must show.
#pragma once

#include <cstdint>
#include <vector>

#include "character.h"
#include "crowd.h"
#include "dermis/scene.h"

namespace crowd {

/// The poses of an instance's positions and previous positions.
struct ShownPose {
  PoseKey current, previous;
  std::uint64_t since = 0;  ///< the frame in which it was skinned

  friend bool operator==(const ShownPose&, const ShownPose&) = default;
};

/// A displayed instance.
struct ShownInstance {
  dermis::InstanceHandle handle;
  std::uint32_t part = 0;
  /// One pose. With culling on the GPU there may be several, since the CPU does not know in which
  /// frames the GPU skinned the instance.
  std::vector<ShownPose> poses;
};

/// Sums over frames.
struct ShownCounts {
  std::uint64_t instances = 0;
  std::uint64_t displayed = 0;
  std::uint64_t outOfView = 0;
};

class ShownPoses {
 public:
  explicit ShownPoses(const Character& character) : parts_(character.parts().size()) {}

  /// Call it after each record.
  void follow(const Crowd& crowd, std::uint64_t frame);

  /// The instances that are displayed in the last frame passed to `follow`.
  std::vector<ShownInstance> displayed() const;
  const ShownCounts& counts() const { return counts_; }
  /// How often an instance was not skinned although its interval had passed or it was new.
  std::uint64_t overdue() const { return overdue_; }

 private:
  struct Entry {
    dermis::InstanceHandle handle;
    std::vector<ShownPose> poses;
    bool isDisplayed = false;
    bool restarts = false;  ///< it has teleported since it was skinned
    std::uint32_t interval = 0;
    std::uint64_t intervalSince = 0;
  };
  enum class Skinned : std::uint8_t { no, yes, unknown };

  void markSkinned(const Crowd& crowd);
  void followInstance(const Crowd& crowd, const FigureFrame& now, Entry& entry,
                      std::uint64_t frame);
  void display(const FigureFrame& now, Entry& entry, std::uint64_t frame, Skinned skinned);

  std::size_t parts_;
  std::vector<Entry> entries_;         ///< by figure, then part
  std::vector<std::uint8_t> skinned_;  ///< by the index of an instance's handle
  ShownCounts counts_;
  std::uint64_t overdue_ = 0;
};

}  // namespace crowd
