// What banks of clips and rigs are made of: from the caller, and for the caller.
#pragma once

#include <array>
#include <cstdint>
#include <deque>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "convert.h"
#include "dermis/clips.h"
#include "dermis/dermis.h"
#include "dermis/rig.h"

namespace dermis::c {

/// Views of the skeleton and the clips that the caller has.
struct ClipsOfCaller {
  explicit ClipsOfCaller(const dermis_clips_source& source);
  ClipsOfCaller(const ClipsOfCaller&) = delete;
  ClipsOfCaller& operator=(const ClipsOfCaller&) = delete;

  Skeleton skeleton;
  std::vector<ClipView> clips;
  std::vector<std::span<const float>> masks;
  std::optional<RootMotionOptions> rootMotion;
};

void appendLayers(std::span<const dermis_clip_layer> layers, std::vector<ClipLayer>& to);

/// What a source points to. The keys remain those of the views.
struct ClipsForCaller {
  ClipsForCaller(const Skeleton& skeleton, std::span<const ClipView> views);
  ClipsForCaller(const ClipsForCaller&) = delete;
  ClipsForCaller& operator=(const ClipsForCaller&) = delete;

  dermis_clips_source source{};

 private:
  std::deque<std::string> names_;
  std::deque<std::array<double, 12>> matrices_;
  std::deque<std::vector<dermis_channel>> channels_;
  std::vector<dermis_node> nodes_;
  std::vector<dermis_skin> skins_;
  std::vector<dermis_clip_view> clips_;
};

std::vector<RigJoint> rigJointsOf(const dermis_rig_joint* joints, std::uint32_t count);
ChainDriver chainOf(const dermis_chain& chain);

/// A view of the rig that the caller has.
struct RigOfCaller {
  explicit RigOfCaller(const dermis_rig_source* source);
  RigOfCaller(const RigOfCaller&) = delete;
  RigOfCaller& operator=(const RigOfCaller&) = delete;

  RigView view;

 private:
  CorrectiveDriver correctiveOf(const dermis_corrective& corrective);

  std::vector<RigJoint> joints_;
  std::vector<TwistDriver> twists_;
  std::vector<CorrectiveDriver> correctives_;
  std::vector<ChainDriver> chains_;
  std::vector<LinearDriver> linears_;
  std::deque<std::vector<JointOffset>> offsets_;  ///< of each corrective
};

}  // namespace dermis::c
