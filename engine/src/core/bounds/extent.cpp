#include "bounds/extent.h"

#include <algorithm>
#include <cmath>

#include "strict_floating_point.h"

namespace dermis::bounds {
namespace {

/// The index in `Extent::reach` of a direction (x, y, z) with components −1, 0 and 1.
constexpr std::uint8_t indexOf(int x, int y, int z) {
  for (int i = 0; i < 13; ++i) {
    const auto& d = Extent::directions[i];
    if (d[0] == x && d[1] == y && d[2] == z) return static_cast<std::uint8_t>(2 * i);
    if (d[0] == -x && d[1] == -y && d[2] == -z) return static_cast<std::uint8_t>(2 * i + 1);
  }
  return 0;
}

struct Triangle {
  std::uint8_t face = 0, edge = 0, corner = 0;
};

/// The triangle by the signs of x, y and z (bits 0 to 2: negative) and by which is larger, without
/// their signs (bit 3: y > x, bit 4: z > y, bit 5: z > x). A table, since branches would be
/// mispredicted.
constexpr std::array<Triangle, 64> makeTriangles() {
  std::array<Triangle, 64> triangles{};
  for (std::size_t code = 0; code < 64; ++code) {
    const bool yx = (code & 8) != 0, zy = (code & 16) != 0, zx = (code & 32) != 0;
    const int largest = yx ? (zy ? 2 : 1) : (zx ? 2 : 0);
    const int least = yx ? (zx ? 0 : (zy ? 0 : 2)) : (zy ? 1 : 2);
    int sign[3] = {(code & 1) != 0 ? -1 : 1, (code & 2) != 0 ? -1 : 1, (code & 4) != 0 ? -1 : 1};
    triangles[code].corner = indexOf(sign[0], sign[1], sign[2]);
    int edge[3] = {sign[0], sign[1], sign[2]};
    edge[least] = 0;
    triangles[code].edge = indexOf(edge[0], edge[1], edge[2]);
    int face[3] = {0, 0, 0};
    face[largest] = sign[largest];
    triangles[code].face = indexOf(face[0], face[1], face[2]);
  }
  return triangles;
}

constexpr std::array<Triangle, 64> triangles = makeTriangles();

struct Interval {
  double min, max;
};

Interval intervalOf(double x, double y, double z, const Extent& extent) {
  const double a = std::abs(x), b = std::abs(y), c = std::abs(z);
  const double largest = std::max(std::max(a, b), c), least = std::min(std::min(a, b), c);
  const double middle = std::max(std::min(a, b), std::min(std::max(a, b), c));
  const std::size_t code =
      static_cast<std::size_t>(x < 0) | static_cast<std::size_t>(y < 0) << 1 |
      static_cast<std::size_t>(z < 0) << 2 | static_cast<std::size_t>(b > a) << 3 |
      static_cast<std::size_t>(c > b) << 4 | static_cast<std::size_t>(c > a) << 5;
  const Triangle& triangle = triangles[code];
  const double face = largest - middle, edge = middle - least;
  const auto reach = [&](unsigned opposite) {
    return face * static_cast<double>(extent.reach[triangle.face ^ opposite]) +
           edge * static_cast<double>(extent.reach[triangle.edge ^ opposite]) +
           least * static_cast<double>(extent.reach[triangle.corner ^ opposite]);
  };
  return {-reach(1), reach(0)};
}

}  // namespace

Reach::Reach(const Range& box) {
  for (std::size_t i = 0; i < 13; ++i) {
    double low = 0, high = 0;
    for (std::size_t axis = 0; axis < 3; ++axis) {
      const double d = Extent::directions[i][axis];
      low += std::min(d * box.min[axis], d * box.max[axis]);
      high += std::max(d * box.min[axis], d * box.max[axis]);
    }
    values[2 * i] = high;
    values[2 * i + 1] = -low;
  }
}

void Reach::add(const Reach& other) {
  for (std::size_t i = 0; i < values.size(); ++i) values[i] = std::max(values[i], other.values[i]);
}

Extent Reach::extent() const {
  Extent extent;
  for (std::size_t i = 0; i < values.size(); ++i) extent.reach[i] = roundUp(values[i]);
  return extent;
}

Range imageOf(const AffineMap& map, const Extent& extent) {
  Range image;
  for (std::size_t row = 0; row < 3; ++row) {
    const Interval interval =
        intervalOf(map.linear[0][row], map.linear[1][row], map.linear[2][row], extent);
    image.min[row] = interval.min + map.offset[row];
    image.max[row] = interval.max + map.offset[row];
  }
  return image;
}

Range rangeOf(const Extent& extent) {
  Range range;
  for (std::size_t axis = 0; axis < 3; ++axis) {
    range.max[axis] = static_cast<double>(extent.reach[2 * axis]);
    range.min[axis] = -static_cast<double>(extent.reach[2 * axis + 1]);
  }
  return range;
}

}  // namespace dermis::bounds
