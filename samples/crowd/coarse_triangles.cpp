#include "coarse_triangles.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <limits>
#include <map>
#include <set>
#include <tuple>
#include <utility>

using namespace dermis;

namespace crowd {
namespace {

using Point = std::array<float, 3>;
using Cell = std::array<std::int64_t, 3>;

Point pointOf(const gltf::Primitive& primitive, std::size_t vertex) {
  const float* p = &primitive.positions[vertex * 3];
  return {p[0], p[1], p[2]};
}

Cell cellOf(const Point& point, double size) {
  Cell cell{};
  for (std::size_t axis = 0; axis < 3; ++axis)
    cell[axis] = static_cast<std::int64_t>(std::floor(static_cast<double>(point[axis]) / size));
  return cell;
}

double longestSide(std::span<const Part> parts) {
  Point least = pointOf(*parts.front().source, 0), most = least;
  for (const Part& part : parts) {
    for (std::size_t vertex = 0; vertex < part.source->vertexCount; ++vertex) {
      const Point point = pointOf(*part.source, vertex);
      for (std::size_t axis = 0; axis < 3; ++axis) {
        least[axis] = std::min(least[axis], point[axis]);
        most[axis] = std::max(most[axis], point[axis]);
      }
    }
  }
  float side = 0;
  for (std::size_t axis = 0; axis < 3; ++axis) side = std::max(side, most[axis] - least[axis]);
  return side;
}

/// Points that vertices of several parts have in common.
std::set<Point> sharedPoints(std::span<const Part> parts) {
  std::map<Point, std::size_t> firstPart;
  std::set<Point> shared;
  for (std::size_t part = 0; part < parts.size(); ++part) {
    const gltf::Primitive& primitive = *parts[part].source;
    for (std::size_t vertex = 0; vertex < primitive.vertexCount; ++vertex) {
      const Point point = pointOf(primitive, vertex);
      if (firstPart.emplace(point, part).first->second != part) shared.insert(point);
    }
  }
  return shared;
}

double squareDistance(const Point& a, const Cell& cell, double size) {
  double sum = 0;
  for (std::size_t axis = 0; axis < 3; ++axis) {
    const double d = static_cast<double>(a[axis]) - (static_cast<double>(cell[axis]) + 0.5) * size;
    sum += d * d;
  }
  return sum;
}

/// Returns the vertex that represents each vertex: the one of its cell that is nearest to the
/// middle of the cell. Vertices that another part has, too, are preferred, so that both parts
/// choose the same one.
std::vector<std::uint32_t> representatives(const gltf::Primitive& primitive,
                                           const std::set<Point>& shared, double cellSize) {
  struct Choice {
    bool isInner = true;
    double distance = std::numeric_limits<double>::infinity();
    Point point{};
    std::uint32_t vertex = 0;
  };
  std::map<Cell, Choice> choices;
  for (std::uint32_t vertex = 0; vertex < primitive.vertexCount; ++vertex) {
    const Point point = pointOf(primitive, vertex);
    const Cell cell = cellOf(point, cellSize);
    const Choice choice{!shared.contains(point), squareDistance(point, cell, cellSize), point,
                        vertex};
    Choice& best = choices[cell];
    if (std::tie(choice.isInner, choice.distance, choice.point) <
        std::tie(best.isInner, best.distance, best.point))
      best = choice;
  }
  std::vector<std::uint32_t> chosen(primitive.vertexCount);
  for (std::uint32_t vertex = 0; vertex < primitive.vertexCount; ++vertex)
    chosen[vertex] = choices.at(cellOf(pointOf(primitive, vertex), cellSize)).vertex;
  return chosen;
}

}  // namespace

std::vector<std::vector<std::uint32_t>> coarseTriangles(std::span<const Part> parts, double cell) {
  const double cellSize = std::max(cell * longestSide(parts), 1e-9);
  const std::set<Point> shared = sharedPoints(parts);
  std::vector<std::vector<std::uint32_t>> all;
  for (const Part& part : parts) {
    const std::vector<std::uint32_t> chosen = representatives(*part.source, shared, cellSize);
    const std::vector<std::uint32_t>& triangles = part.source->triangles;
    std::vector<std::uint32_t>& coarse = all.emplace_back();
    for (std::size_t i = 0; i + 2 < triangles.size(); i += 3) {
      const std::array corners{chosen[triangles[i]], chosen[triangles[i + 1]],
                               chosen[triangles[i + 2]]};
      if (corners[0] == corners[1] || corners[1] == corners[2] || corners[2] == corners[0])
        continue;
      coarse.insert(coarse.end(), corners.begin(), corners.end());
    }
  }
  return all;
}

}  // namespace crowd
