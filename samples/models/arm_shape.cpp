#include "arm_shape.h"

namespace dermis::models {
namespace {

// Sections: along, middle (side, front), half width, front, back. The forearm comes forward a
// little, as an arm that hangs at rest does.
const std::vector<Section>& armSections() {
  static const std::vector<Section> sections = {
      {-0.030, -0.008, 0.000, 0.046, 0.046, 0.046}, {0.020, 0.000, 0.000, 0.055, 0.056, 0.055},
      {0.070, 0.002, 0.000, 0.053, 0.054, 0.053},   {0.120, 0.000, 0.002, 0.045, 0.050, 0.048},
      {0.180, 0.000, 0.003, 0.042, 0.050, 0.046},   {0.240, 0.000, 0.001, 0.039, 0.042, 0.042},
      {0.285, 0.000, 0.000, 0.038, 0.037, 0.040},   {0.325, 0.000, 0.006, 0.040, 0.042, 0.039},
      {0.370, 0.000, 0.011, 0.038, 0.042, 0.038},   {0.430, 0.000, 0.018, 0.032, 0.036, 0.034},
      {0.500, 0.000, 0.026, 0.024, 0.029, 0.028},   {0.540, 0.000, 0.031, 0.020, 0.027, 0.027},
      {0.575, -0.001, 0.036, 0.019, 0.033, 0.031},  {0.605, -0.002, 0.041, 0.017, 0.040, 0.037},
      {0.635, -0.003, 0.045, 0.015, 0.042, 0.040},  {0.650, -0.003, 0.047, 0.012, 0.040, 0.038}};
  return sections;
}

// In the arm's frame (side, along, front): where a finger starts, bends and ends.
struct Finger {
  Vec3 base;
  Vec3 middle;
  Vec3 tip;
  double radius;
};

const std::vector<Finger>& fingers() {
  static const std::vector<Finger> list = {
      {{-0.003, 0.628, 0.077}, {-0.010, 0.674, 0.092}, {-0.024, 0.706, 0.100}, 0.0092},
      {{-0.002, 0.636, 0.056}, {-0.010, 0.687, 0.064}, {-0.026, 0.723, 0.068}, 0.0095},
      {{-0.002, 0.634, 0.036}, {-0.011, 0.683, 0.036}, {-0.027, 0.718, 0.036}, 0.0092},
      {{-0.003, 0.625, 0.015}, {-0.011, 0.662, 0.007}, {-0.026, 0.691, 0.002}, 0.0086}};
  return list;
}

constexpr double fingerBlend = 0.008;
const Vec3 thumbRoot(-0.008, 0.572, 0.056);
const Vec3 thumbKnuckle(-0.015, 0.604, 0.090);
const Vec3 thumbEnd(-0.020, 0.646, 0.113);

}  // namespace

std::vector<Piece> armPieces(const Frame& frame) {
  std::vector<Piece> pieces;
  pieces.push_back({loft(frame, armSections(), 0.05), 0.04});
  for (const Finger& finger : fingers()) {
    const Vec3 middle = frame.toModel(finger.middle);
    pieces.push_back(
        {roundCone(frame.toModel(finger.base), middle, finger.radius * 1.08, finger.radius),
         fingerBlend});
    pieces.push_back(
        {roundCone(middle, frame.toModel(finger.tip), finger.radius, finger.radius * 0.92), 0.003});
  }
  pieces.push_back(
      {roundCone(frame.toModel(thumbRoot), frame.toModel(thumbKnuckle), 0.0165, 0.0125), 0.022});
  pieces.push_back({thumb(frame), 0.012});
  return pieces;
}

Solid thumb(const Frame& frame) {
  return roundCone(frame.toModel(thumbKnuckle), frame.toModel(thumbEnd), 0.0125, 0.0105);
}

Vec3 thumbBase(const Frame& frame) {
  return frame.toModel(thumbRoot);
}
Vec3 thumbTip(const Frame& frame) {
  return frame.toModel(thumbEnd);
}

Vec3 armCenter(const Frame& frame, double along) {
  const Section section = sectionAt(armSections(), along);
  return frame.toModel({section.centerSide, along, section.centerFront});
}

}  // namespace dermis::models
