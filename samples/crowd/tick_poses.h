// The poses of a character at all ticks of its clips, as figures that play them have: sampled by
// what executes the crowd's frames, and compared with the clips of the file.
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "dermis/clips.h"
#include "kit/character.h"
#include "kit/device.h"

namespace crowd {

class TickPoses {
 public:
  /// As the CPU samples them: `samplePose`.
  TickPoses(const dermis::samples::Character& character, const dermis::PackedClips& bank);
  /// As the device does. The bits of a pose depend only on what is played.
  TickPoses(const dermis::samples::Character& character, const dermis::PackedClips& bank,
            dermis::samples::OpenDevice& open);

  std::span<const dermis::JointMatrix> pose(dermis::samples::PoseKey key, std::uint32_t skin) const;

  /// The largest distance of a point that a joint moves from where the file's clips have it,
  /// divided by its bound (`reference::samplePose`). Points at the joint, and a meter away.
  double worst() const { return worst_; }

 private:
  void check(const dermis::PackedClips& bank);

  const dermis::samples::Character* character_;
  std::vector<std::vector<std::vector<dermis::JointMatrix>>> poses_;  ///< by clip; by tick, skin
  double worst_ = 0;
};

}  // namespace crowd
