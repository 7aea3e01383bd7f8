#include "tick_poses.h"

#include <algorithm>
#include <optional>

#include "dermis/verify.h"
#include "kit/clip_check.h"
#include "kit/program.h"

namespace crowd {

using namespace dermis;
using namespace dermis::samples;

TickPoses::TickPoses(const Character& character, const PackedClips& bank, BatchTarget& target)
    : character_(&character) {
  const Skeleton skeleton = character.skeleton();
  const std::vector<ClipView> clips = gltf::clips(character.model());
  for (std::uint32_t clip = 0; clip < character.clipCount(); ++clip) {
    std::vector<std::vector<ClipLayer>> plays(character.tickCount(clip));
    for (std::uint32_t tick = 0; tick < plays.size(); ++tick) {
      const std::optional<ClipLayer> layer = character.layer({clip, tick});
      if (layer) plays[tick].push_back(*layer);
    }
    poses_.push_back(must(target.samplePoses(bank, plays)));
    for (std::uint32_t tick = 0; tick < plays.size(); ++tick) {
      for (std::uint32_t skin = 0; skin < bank.skinCount(); ++skin) {
        const reference::SampledPose exact =
            must(reference::samplePose(skeleton, clips, {}, plays[tick], skin, &bank));
        worst_ = std::max(
            worst_,
            comparePose(pose({clip, tick}, skin), exact, skeleton.skins[skin]).worstPosition);
      }
    }
  }
}

std::span<const JointMatrix> TickPoses::pose(PoseKey key, std::uint32_t skin) const {
  return poses_[key.clip][key.tick * character_->jointCounts().size() + skin];
}

}  // namespace crowd
