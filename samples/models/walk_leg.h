// The legs of the walk: the pose of the foot at each time, and the rotations of the leg for it.
#pragma once

#include "figure.h"

namespace dermis::models {

// Meters from a heel strike to the next one of the same foot.
inline constexpr double strideLength = 1.36;
inline constexpr double walkDuration = 1.1;  // seconds per stride

// The pose of the left foot in model space. Angles are relative to the ground, in radians, and
// positive if the toes point up.
struct FootPose {
  Vec3 ankle;
  double pitch;
  double toePitch;
};

// The left foot at a phase of the stride, from 0 to 1. The heel strike is at 0.
FootPose footAt(double phase);

// The rotations, in model space, from the rest pose of the left leg to a pose.
struct LegTurns {
  Quat thigh;
  Quat shin;
  Quat foot;
  Quat toes;
};
LegTurns reach(const Vec3& hip, const FootPose& foot);

// The distance from hip to ankle minus the length of the leg, in meters. If it is above 0, the foot
// slides.
double overreach(const Vec3& hip, const FootPose& foot);

}  // namespace dermis::models
