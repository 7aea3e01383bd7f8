#include "loft.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <glm/geometric.hpp>
#include <utility>

namespace dermis::models {
namespace {

using Values = std::array<double, 5>;

Values valuesOf(const Section& section) {
  return {section.centerSide, section.centerFront, section.halfWidth, section.front, section.back};
}

// The slope at an inner section is that between its neighbors; the curve is level at both ends.
double slopeAt(const std::vector<Section>& sections, std::size_t index, std::size_t value) {
  if (index == 0 || index + 1 == sections.size()) return 0.0;
  const Section& before = sections[index - 1];
  const Section& after = sections[index + 1];
  return (valuesOf(after)[value] - valuesOf(before)[value]) / (after.along - before.along);
}

double ellipseDistance(double x, double y, double radiusX, double radiusY) {
  const double sx = x / radiusX;
  const double sy = y / radiusY;
  const double inUnits = std::sqrt(sx * sx + sy * sy);
  const double slope = std::sqrt(sx * sx / (radiusX * radiusX) + sy * sy / (radiusY * radiusY));
  if (slope < 1e-9) return -std::min(radiusX, radiusY);
  return inUnits * (inUnits - 1.0) / slope;
}

Bound boundOf(const Frame& frame, const std::vector<Section>& sections) {
  const double middle = 0.5 * (sections.front().along + sections.back().along);
  double radius = 0.0;
  for (const Section& section : sections) {
    const double across = std::max({section.halfWidth, section.front, section.back}) +
                          std::abs(section.centerSide) + std::abs(section.centerFront);
    const double along = section.along - middle;
    radius = std::max(radius, std::sqrt(across * across + along * along));
  }
  // Curves may swing a little past their sections.
  return {frame.toModel({0.0, middle, 0.0}), radius * 1.05};
}

}  // namespace

Vec3 Frame::toLocal(const Vec3& point) const {
  const Vec3 offset = point - origin;
  return {glm::dot(offset, side), glm::dot(offset, along), glm::dot(offset, front)};
}

Vec3 Frame::toModel(const Vec3& local) const {
  return origin + side * local.x + along * local.y + front * local.z;
}

Section sectionAt(const std::vector<Section>& sections, double along) {
  if (along <= sections.front().along) return sections.front();
  if (along >= sections.back().along) return sections.back();
  std::size_t index = 0;
  while (sections[index + 1].along < along) ++index;

  const double span = sections[index + 1].along - sections[index].along;
  const double t = (along - sections[index].along) / span;
  const double t2 = t * t;
  const double t3 = t2 * t;
  const Values from = valuesOf(sections[index]);
  const Values to = valuesOf(sections[index + 1]);
  Values result{};
  for (std::size_t value = 0; value < result.size(); ++value) {
    result[value] = (2.0 * t3 - 3.0 * t2 + 1.0) * from[value] + (3.0 * t2 - 2.0 * t3) * to[value] +
                    (t3 - 2.0 * t2 + t) * span * slopeAt(sections, index, value) +
                    (t3 - t2) * span * slopeAt(sections, index + 1, value);
  }
  return {along, result[0], result[1], result[2], result[3], result[4]};
}

Solid loft(const Frame& frame, std::vector<Section> sections, double endBlend) {
  const Bound bound = boundOf(frame, sections);
  const auto field = [frame, endBlend, sections = std::move(sections)](const Vec3& point) {
    const Vec3 local = frame.toLocal(point);
    const Section section = sectionAt(sections, local.y);
    const double x = local.x - section.centerSide;
    const double y = local.z - section.centerFront;
    const double across =
        ellipseDistance(x, y, section.halfWidth, y > 0.0 ? section.front : section.back);
    const double past = std::max(sections.front().along - local.y, local.y - sections.back().along);
    return smoothMaximum(across, past, endBlend);
  };
  return {field, bound};
}

}  // namespace dermis::models
