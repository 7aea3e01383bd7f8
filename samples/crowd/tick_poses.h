// The poses of a character at all ticks of its clips, as figures that play them have: sampled by
// what executes the crowd's frames, and compared with the clips of the file.
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "dermis/clips.h"
#include "kit/batch_runner.h"
#include "kit/character.h"

namespace crowd {

class TickPoses {
 public:
  /// As the target samples them. The bits of a pose depend only on what is played.
  TickPoses(const dermis::samples::Character& character, const dermis::PackedClips& bank,
            dermis::samples::BatchTarget& target);

  std::span<const dermis::JointMatrix> pose(dermis::samples::PoseKey key, std::uint32_t skin) const;

  /// The largest `Comparison::worstPosition` of `comparePose`.
  double worst() const { return worst_; }

 private:
  const dermis::samples::Character* character_;
  std::vector<std::vector<std::vector<dermis::JointMatrix>>> poses_;  ///< by clip; by tick, skin
  double worst_ = 0;
};

}  // namespace crowd
