#include "relax.h"

#include <algorithm>
#include <cmath>
#include <glm/geometric.hpp>

namespace dermis::models {
namespace {

constexpr double differenceStep = 1e-4;
constexpr double pull = 0.5;
// A step of the projection is held to this, so that a kink of the field throws no vertex away.
constexpr double longestStep = 0.005;

Vec3 projected(const Vec3& point, const Field& field) {
  const Vec3 slope = gradient(field, point, differenceStep);
  const double steepness = glm::dot(slope, slope);
  if (steepness < 1e-6) return point;
  const double amount = field(point) / steepness;
  const double longest = longestStep / std::sqrt(steepness);
  return point - slope * std::clamp(amount, -longest, longest);
}

std::vector<std::vector<std::uint32_t>> quadNeighbors(const QuadMesh& mesh) {
  std::vector<std::vector<std::uint32_t>> neighbors(mesh.positions.size());
  for (const Quad& quad : mesh.quads) {
    // Each inner edge is met once in each direction, so one direction is enough.
    for (std::size_t side = 0; side < 4; ++side) {
      neighbors[quad[side]].push_back(quad[(side + 1) % 4]);
    }
  }
  return neighbors;
}

// The triangle of a corner of a quad and the two after it: 1 if all sides are equal, 0 if it
// has no area.
double evenness(const QuadMesh& mesh, const Quad& quad, std::size_t corner) {
  const Vec3& a = mesh.positions[quad[corner % 4]];
  const Vec3& b = mesh.positions[quad[(corner + 1) % 4]];
  const Vec3& c = mesh.positions[quad[(corner + 2) % 4]];
  const Vec3 across = glm::cross(b - a, c - a);
  const double sides = glm::dot(b - a, b - a) + glm::dot(c - b, c - b) + glm::dot(a - c, a - c);
  return 2.0 * std::sqrt(3.0 * glm::dot(across, across)) / sides;
}

}  // namespace

void project(std::vector<Vec3>& positions, const Field& field) {
  for (Vec3& position : positions) position = projected(position, field);
}

void relax(QuadMesh& mesh, const Field& field, int steps) {
  const auto neighbors = quadNeighbors(mesh);
  for (int step = 0; step < steps; ++step) {
    std::vector<Vec3> next = mesh.positions;
    for (std::size_t vertex = 0; vertex < next.size(); ++vertex) {
      Vec3 sum(0.0);
      for (const std::uint32_t neighbor : neighbors[vertex]) sum += mesh.positions[neighbor];
      const Vec3& here = mesh.positions[vertex];
      const Vec3 middle = sum / static_cast<double>(neighbors[vertex].size());
      const Vec3 normal = unit(gradient(field, here, differenceStep));
      next[vertex] = projected(here + perpendicular(middle - here, normal) * pull, field);
    }
    mesh.positions.swap(next);
  }
  project(mesh.positions, field);
}

std::vector<std::uint32_t> triangulate(const QuadMesh& mesh) {
  std::vector<std::uint32_t> indices;
  indices.reserve(mesh.quads.size() * 6);
  for (const Quad& quad : mesh.quads) {
    const auto worstFrom = [&](std::size_t start) {
      return std::min(evenness(mesh, quad, start), evenness(mesh, quad, start + 2));
    };
    const std::size_t start = worstFrom(0) >= worstFrom(1) ? 0 : 1;
    for (const std::size_t corner : std::array<std::size_t, 6>{0, 1, 2, 0, 2, 3}) {
      indices.push_back(quad[(start + corner) % 4]);
    }
  }
  return indices;
}

}  // namespace dermis::models
