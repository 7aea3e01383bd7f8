// The legs of the walk: where a foot is at each moment, and how a leg reaches there.
#pragma once

#include "figure.h"

namespace dermis::models {

inline constexpr double strideLength =
    1.36;  // metres from a heel strike to the next one of the same foot
inline constexpr double walkDuration = 1.1;  // seconds for a stride

// A left foot in the model's space. Angles are in radians against the ground, positive with the
// toes up.
struct FootPose {
  Vec3 ankle;
  double pitch;
  double toePitch;
};

// The left foot at a phase of the stride, 0 to 1, with the heel strike at 0.
FootPose footAt(double phase);

// The turns, in the model's space, that bring a left leg from rest to a pose.
struct LegTurns {
  Quat thigh;
  Quat shin;
  Quat foot;
  Quat toes;
};
LegTurns reach(const Vec3& hip, const FootPose& foot);

// How much farther than the leg is long the ankle would be, in metres: more than 0 means that the
// foot slides.
double overreach(const Vec3& hip, const FootPose& foot);

}  // namespace dermis::models
