// How near poses and morph weights of a bank are to the clips that it is made of.
#pragma once

#include <span>

#include "dermis/clips.h"
#include "dermis/verify.h"

namespace dermis::samples {

/// Whether a bank may jump a little earlier or later than its clip does at a time inside the clip.
/// Poses have no bound there.
bool isNearJump(const ClipView& clip, double time);

/// Compares the pose of a skin with `reference::samplePose`, which must have bounds. Of each joint
/// it compares the point there with its bound A, and three directions with B: what they are off by,
/// for each unit of distance. Those of all points on the joint's axes follow. If the inverse bind
/// matrix is singular, the joint must only be finite; if numbers leave the range of float32, it may
/// be anything. Vertices of the result are joints; the numbers count points.
Comparison comparePose(std::span<const JointMatrix> pose, const reference::SampledPose& expected,
                       const SkeletonSkin& skin);
/// The same for `reference::sampleWeights`. Vertices of the result are weights.
Comparison compareWeights(std::span<const float> weights,
                          const reference::SampledWeights& expected);

}  // namespace dermis::samples
