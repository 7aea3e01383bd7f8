#include "cross_section.h"

#include <algorithm>
#include <array>
#include <cstdint>

#include <glm/geometric.hpp>
#include <glm/vec3.hpp>

namespace dermis::cli {
namespace {

constexpr int planes = 65;  // odd: one is in the middle

glm::dvec3 at(std::span<const float> positions, std::uint32_t vertex) {
  const std::size_t first = std::size_t{vertex} * 3;
  return {positions[first], positions[first + 1], positions[first + 2]};
}

/// The areas of one section in bind pose and skinned, as vectors: the length is the area. Half the
/// sum of the cross products of its corners, which does not depend on the origin.
struct Areas {
  glm::dvec3 rest{0}, skinned{0};
};

class Plane {
 public:
  Plane(std::span<const float> rest, std::span<const float> skinned, double x)
      : rest_(rest), skinned_(skinned), x_(x) {}

  /// A segment of the section runs from the edge that goes down through the plane to the edge that
  /// goes up, so that all triangles have the same orientation.
  void cut(std::span<const std::uint32_t, 3> triangle, Areas& areas) const {
    std::array<glm::dvec3, 2> rest{}, skinned{};
    int crossed = 0;
    for (std::size_t corner = 0; corner < 3; ++corner) {
      const std::uint32_t a = triangle[corner], b = triangle[(corner + 1) % 3];
      if (isAbove(a) == isAbove(b)) continue;
      ++crossed;
      const std::size_t end = isAbove(a) ? 0 : 1;
      const double from = at(rest_, a).x, to = at(rest_, b).x;
      const double share = (x_ - from) / (to - from);
      rest[end] = glm::mix(at(rest_, a), at(rest_, b), share);
      skinned[end] = glm::mix(at(skinned_, a), at(skinned_, b), share);
    }
    if (crossed != 2) return;
    areas.rest += glm::cross(rest[0], rest[1]) / 2.0;
    areas.skinned += glm::cross(skinned[0], skinned[1]) / 2.0;
  }

 private:
  bool isAbove(std::uint32_t vertex) const { return at(rest_, vertex).x >= x_; }

  std::span<const float> rest_, skinned_;
  double x_;
};

}  // namespace

double leastSection(const gltf::Primitive& primitive, std::span<const float> positions,
                    const SectionRange& range) {
  double least = 1;
  const std::span<const std::uint32_t> indices(primitive.triangles);
  for (int index = 0; index < planes; ++index) {
    const Plane plane(primitive.positions, positions,
                      range.from + (range.to - range.from) * index / (planes - 1));
    Areas areas;
    for (std::size_t first = 0; first + 2 < indices.size(); first += 3)
      plane.cut(indices.subspan(first).first<3>(), areas);
    const double rest = glm::length(areas.rest);
    if (rest > 0) least = std::min(least, glm::length(areas.skinned) / rest);
  }
  return least;
}

}  // namespace dermis::cli
