#include "polygonize.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <utility>

namespace dermis::models {
namespace {

constexpr std::uint32_t notCrossed = std::numeric_limits<std::uint32_t>::max();

// The field at every corner of the grid.
class Samples {
 public:
  Samples(const Field& field, const Grid& grid) : grid_(grid) {
    values_.resize(count(0) * count(1) * count(2));
    for (int z = 0; z <= grid.cells[2]; z += blockSize) {
      for (int y = 0; y <= grid.cells[1]; y += blockSize) {
        for (int x = 0; x <= grid.cells[0]; x += blockSize) sampleBlock(field, {x, y, z});
      }
    }
  }

  double at(const std::array<int, 3>& corner) const { return values_[indexOf(corner)]; }
  Vec3 position(const std::array<int, 3>& corner) const {
    return grid_.low + Vec3(corner[0], corner[1], corner[2]) * grid_.cell;
  }

 private:
  static constexpr int blockSize = 4;
  // Fields are distances only near their surface; this much of one is trusted far away.
  static constexpr double trust = 0.4;

  std::size_t count(std::size_t axis) const {
    return static_cast<std::size_t>(grid_.cells[axis]) + 1;
  }
  std::size_t indexOf(const std::array<int, 3>& corner) const {
    return (static_cast<std::size_t>(corner[2]) * count(1) + static_cast<std::size_t>(corner[1])) *
               count(0) +
           static_cast<std::size_t>(corner[0]);
  }

  // Most blocks are far from the surface: one value serves all their corners, as only its sign
  // matters.
  void sampleBlock(const Field& field, const std::array<int, 3>& first) {
    const double half = 0.5 * (blockSize - 1);
    const Vec3 middle = position(first) + Vec3(half * grid_.cell);
    const double distance = field(middle);
    const bool isFar = std::abs(distance) * trust > half * std::sqrt(3.0) * grid_.cell;
    std::array<int, 3> corner{};
    for (corner[2] = first[2]; corner[2] < std::min(first[2] + blockSize, grid_.cells[2] + 1);
         ++corner[2]) {
      for (corner[1] = first[1]; corner[1] < std::min(first[1] + blockSize, grid_.cells[1] + 1);
           ++corner[1]) {
        for (corner[0] = first[0]; corner[0] < std::min(first[0] + blockSize, grid_.cells[0] + 1);
             ++corner[0]) {
          values_[indexOf(corner)] = isFar ? distance : field(position(corner));
        }
      }
    }
  }

  const Grid& grid_;
  std::vector<double> values_;
};

std::array<int, 3> moved(std::array<int, 3> corner, std::size_t axis, int by) {
  corner[axis] += by;
  return corner;
}

// An edge of a cell: it goes along `axis` and lies at bits 0 and 1 of `place` on the next two axes.
constexpr std::size_t edgeIndex(std::size_t axis, std::size_t place) {
  return axis * 4 + place;
}

// Which of a cell's edges belong to one sheet of the surface. A cell that two sheets pass gets two
// vertices; with one for both, the sheets would grow together there and the mesh would not be a
// manifold.
class Sheets {
 public:
  explicit Sheets(const std::array<bool, 8>& isInside) {
    for (std::size_t edge = 0; edge < 12; ++edge) sheet_[edge] = edge;
    for (std::size_t axis = 0; axis < 3; ++axis) {
      for (std::size_t side = 0; side < 2; ++side) joinOnFace(isInside, axis, side);
    }
  }
  std::size_t of(std::size_t edge) const { return sheet_[edge]; }

 private:
  // Where a face has two inside corners opposite each other, each is cut off by itself; the cell
  // beyond the face decides alike.
  void joinOnFace(const std::array<bool, 8>& isInside, std::size_t axis, std::size_t side) {
    const std::size_t u = (axis + 1) % 3;
    const std::size_t v = (axis + 2) % 3;
    std::array<std::size_t, 4> edges{};
    std::size_t count = 0;
    const auto inside = [&](std::size_t atU, std::size_t atV) {
      return isInside[(side << axis) | (atU << u) | (atV << v)];
    };
    // Edge along u: its places are (v, axis). Edge along v: its places are (axis, u).
    const auto alongU = [&](std::size_t atV) { return edgeIndex(u, atV | (side << 1U)); };
    const auto alongV = [&](std::size_t atU) { return edgeIndex(v, side | (atU << 1U)); };
    for (std::size_t at = 0; at < 2; ++at) {
      if (inside(0, at) != inside(1, at)) edges[count++] = alongU(at);
      if (inside(at, 0) != inside(at, 1)) edges[count++] = alongV(at);
    }
    if (count == 2) join(edges[0], edges[1]);
    if (count < 4) return;
    for (std::size_t corner = 0; corner < 4; ++corner) {
      const std::size_t atU = corner & 1U;
      const std::size_t atV = corner >> 1U;
      if (inside(atU, atV)) join(alongU(atV), alongV(atU));
    }
  }

  void join(std::size_t a, std::size_t b) {
    const std::size_t from = sheet_[b];
    const std::size_t to = sheet_[a];
    for (std::size_t& sheet : sheet_) {
      if (sheet == from) sheet = to;
    }
  }

  std::array<std::size_t, 12> sheet_{};
};

class Net {
 public:
  Net(const Field& field, const Grid& grid) : grid_(grid), samples_(field, grid) {
    cells_.assign(static_cast<std::size_t>(grid.cells[0]) *
                      static_cast<std::size_t>(grid.cells[1]) *
                      static_cast<std::size_t>(grid.cells[2]),
                  notCrossed);
    forEachCell([this](const std::array<int, 3>& cell) { addVertices(cell); });
    forEachCell([this](const std::array<int, 3>& cell) {
      for (std::size_t axis = 0; axis < 3; ++axis) addQuad(cell, axis);
    });
  }

  QuadMesh take() { return std::move(mesh_); }

 private:
  using EdgeVertices = std::array<std::uint32_t, 12>;

  template <typename Visit>
  void forEachCell(const Visit& visit) {
    std::array<int, 3> cell{};
    for (cell[2] = 0; cell[2] < grid_.cells[2]; ++cell[2]) {
      for (cell[1] = 0; cell[1] < grid_.cells[1]; ++cell[1]) {
        for (cell[0] = 0; cell[0] < grid_.cells[0]; ++cell[0]) visit(cell);
      }
    }
  }

  std::uint32_t& at(const std::array<int, 3>& cell) {
    return cells_[(static_cast<std::size_t>(cell[2]) * static_cast<std::size_t>(grid_.cells[1]) +
                   static_cast<std::size_t>(cell[1])) *
                      static_cast<std::size_t>(grid_.cells[0]) +
                  static_cast<std::size_t>(cell[0])];
  }

  bool isInside(const std::array<int, 3>& corner) const { return samples_.at(corner) < 0.0; }

  // For each sheet in the cell, the mean of the places where it crosses the cell's edges.
  void addVertices(const std::array<int, 3>& cell) {
    std::array<bool, 8> inside{};
    for (std::size_t corner = 0; corner < 8; ++corner) {
      const int bits = static_cast<int>(corner);
      inside[corner] =
          isInside({cell[0] + (bits & 1), cell[1] + (bits >> 1 & 1), cell[2] + (bits >> 2)});
    }
    if (std::all_of(inside.begin(), inside.end(), [&](bool each) { return each == inside[0]; }))
      return;

    const Sheets sheets(inside);
    std::array<Vec3, 12> sums{};
    std::array<int, 12> crossings{};
    for (std::size_t axis = 0; axis < 3; ++axis) {
      for (int place = 0; place < 4; ++place) {
        const auto from = moved(moved(cell, (axis + 1) % 3, place & 1), (axis + 2) % 3, place >> 1);
        const auto to = moved(from, axis, 1);
        if (isInside(from) == isInside(to)) continue;
        const double a = samples_.at(from);
        const double fraction = a / (a - samples_.at(to));
        const Vec3 start = samples_.position(from);
        const std::size_t sheet = sheets.of(edgeIndex(axis, static_cast<std::size_t>(place)));
        sums[sheet] += start + (samples_.position(to) - start) * fraction;
        ++crossings[sheet];
      }
    }
    EdgeVertices vertices{};
    for (std::size_t sheet = 0; sheet < 12; ++sheet) {
      if (crossings[sheet] == 0) continue;
      const auto vertex = static_cast<std::uint32_t>(mesh_.positions.size());
      mesh_.positions.push_back(sums[sheet] / static_cast<double>(crossings[sheet]));
      for (std::size_t edge = 0; edge < 12; ++edge) {
        if (sheets.of(edge) == sheet) vertices[edge] = vertex;
      }
    }
    at(cell) = static_cast<std::uint32_t>(edgeVertices_.size());
    edgeVertices_.push_back(vertices);
  }

  // The quad across the grid edge that starts at this corner and goes along `axis`.
  void addQuad(const std::array<int, 3>& corner, std::size_t axis) {
    const std::size_t u = (axis + 1) % 3;
    const std::size_t v = (axis + 2) % 3;
    if (corner[u] == 0 || corner[v] == 0) return;
    const bool startsInside = isInside(corner);
    if (startsInside == isInside(moved(corner, axis, 1))) return;
    const auto vertex = [&](int backU, int backV) {
      const std::size_t place =
          static_cast<std::size_t>(backU) + 2 * static_cast<std::size_t>(backV);
      return edgeVertices_[at(moved(moved(corner, u, -backU), v, -backV))][edgeIndex(axis, place)];
    };
    Quad quad = {vertex(1, 1), vertex(0, 1), vertex(0, 0), vertex(1, 0)};
    if (!startsInside) std::swap(quad[1], quad[3]);
    mesh_.quads.push_back(quad);
  }

  const Grid& grid_;
  Samples samples_;
  std::vector<std::uint32_t> cells_;  // into edgeVertices_
  std::vector<EdgeVertices> edgeVertices_;
  QuadMesh mesh_;
};

}  // namespace

Grid gridOver(const Vec3& low, const Vec3& high, double cell) {
  const Vec3 extent = (high - low) / cell;
  const std::array<int, 3> cells = {static_cast<int>(std::ceil(extent.x)),
                                    static_cast<int>(std::ceil(extent.y)),
                                    static_cast<int>(std::ceil(extent.z))};
  const Vec3 size = Vec3(cells[0], cells[1], cells[2]) * cell;
  return {(low + high - size) * 0.5, cell, cells};
}

QuadMesh polygonize(const Field& field, const Grid& grid) {
  return Net(field, grid).take();
}

}  // namespace dermis::models
