// The arm from shoulder to finger tips, shared by the arm and the figure.
#pragma once

#include <vector>

#include "loft.h"

namespace dermis::models {

struct Piece {
  Solid solid;
  double blend;
};

// Where the joints are along the arm, in metres from the shoulder.
inline constexpr double elbowAlong = 0.285;
inline constexpr double wristAlong = 0.540;
inline constexpr double knuckleAlong = 0.632;

// The arm lies along `frame.along`, bends at the elbow towards `frame.front`, and its palm looks
// away from `frame.side`; the thumb is on the front.
std::vector<Piece> armPieces(const Frame& frame);

// The thumb alone, to tell its vertices from the palm's.
Solid thumb(const Frame& frame);
Vec3 thumbBase(const Frame& frame);
Vec3 thumbTip(const Frame& frame);

// The middle of the arm's cross-section at a place along it.
Vec3 armCenter(const Frame& frame, double along);

}  // namespace dermis::models
