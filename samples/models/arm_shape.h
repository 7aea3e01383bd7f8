// The arm from shoulder to fingertips, used by the arm and the figure.
#pragma once

#include <vector>

#include "loft.h"

namespace dermis::models {

struct Piece {
  Solid solid;
  double blend;
};

// Positions of the joints along the arm, in meters from the shoulder.
inline constexpr double elbowAlong = 0.285;
inline constexpr double wristAlong = 0.540;
inline constexpr double knuckleAlong = 0.632;

// The arm extends along `frame.along` and bends at the elbow towards `frame.front`. The palm faces
// away from `frame.side`. The thumb is on the front.
std::vector<Piece> armPieces(const Frame& frame);

// The thumb alone, to distinguish its vertices from those of the palm.
Solid thumb(const Frame& frame);
Vec3 thumbBase(const Frame& frame);
Vec3 thumbTip(const Frame& frame);

// The center of the arm's cross-section at a position along the arm.
Vec3 armCenter(const Frame& frame, double along);

}  // namespace dermis::models
