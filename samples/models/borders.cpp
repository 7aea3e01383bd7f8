#include "borders.h"

#include <algorithm>
#include <cmath>
#include <glm/geometric.hpp>
#include <limits>

#include "relax.h"

namespace dermis::models {
namespace {

constexpr int bisections = 16;
constexpr int smoothingSteps = 4;
constexpr double normalStep = 1e-4;

// How far along from one point to another the region changes, 0 to 1.
double crossing(const Vec3& from, const Vec3& to, const RegionAt& regionAt) {
  const std::size_t region = regionAt(from);
  double low = 0.0;
  double high = 1.0;
  for (int step = 0; step < bisections; ++step) {
    const double middle = 0.5 * (low + high);
    (regionAt(from + (to - from) * middle) == region ? low : high) = middle;
  }
  return 0.5 * (low + high);
}

using Neighbors = std::vector<std::vector<std::uint32_t>>;

// Of every edge across a border the nearer end moves onto it; a vertex with several such edges
// takes the nearest.
std::vector<bool> moveOntoBorders(std::vector<Vec3>& positions, const Neighbors& neighbors,
                                  const RegionAt& regionAt) {
  std::vector<std::size_t> regions;
  regions.reserve(positions.size());
  for (const Vec3& position : positions) regions.push_back(regionAt(position));
  std::vector<Vec3> next = positions;
  std::vector<bool> isOnBorder(positions.size(), false);
  for (std::size_t vertex = 0; vertex < positions.size(); ++vertex) {
    double nearest = std::numeric_limits<double>::max();
    for (const std::uint32_t neighbor : neighbors[vertex]) {
      if (regions[vertex] == regions[neighbor]) continue;
      const Vec3 edge = positions[neighbor] - positions[vertex];
      const double fraction = crossing(positions[vertex], positions[neighbor], regionAt);
      const double distance = fraction * fraction * glm::dot(edge, edge);
      if (fraction > 0.5 || distance >= nearest) continue;
      nearest = distance;
      next[vertex] = positions[vertex] + edge * fraction;
      isOnBorder[vertex] = true;
    }
  }
  positions.swap(next);
  return isOnBorder;
}

}  // namespace

void snapToBorders(std::vector<Vec3>& positions, const std::vector<std::uint32_t>& indices,
                   const RegionAt& regionAt, const Field& field) {
  const Neighbors neighbors = neighborsOf(positions.size(), indices);
  const std::vector<bool> isOnBorder = moveOntoBorders(positions, neighbors, regionAt);
  for (int step = 0; step < smoothingSteps; ++step) {
    std::vector<Vec3> next = positions;
    for (std::size_t vertex = 0; vertex < positions.size(); ++vertex) {
      const auto& around = neighbors[vertex];
      const bool isNearBorder = std::any_of(around.begin(), around.end(),
                                            [&](std::uint32_t each) { return isOnBorder[each]; });
      if (isOnBorder[vertex] || !isNearBorder) continue;
      Vec3 sum(0.0);
      for (const std::uint32_t neighbor : around) sum += positions[neighbor];
      const Vec3 offset = sum / static_cast<double>(around.size()) - positions[vertex];
      const Vec3 normal = unit(gradient(field, positions[vertex], normalStep));
      next[vertex] += perpendicular(offset, normal) * 0.5;
    }
    positions.swap(next);
  }
  project(positions, field);
}

void paint(Mesh& mesh, const RegionAt& regionAt, const std::vector<Vec3>& colors) {
  const std::size_t noRegion = colors.size();
  const std::size_t vertexCount = mesh.positions.size();
  std::vector<std::size_t>& regions = mesh.regions;
  regions.assign(vertexCount, noRegion);
  // copies[vertex * regions + region]: the vertex that stands for this one in that region.
  std::vector<std::uint32_t> copies(vertexCount * colors.size(), 0);
  mesh.colors.assign(vertexCount, Vec3(0.0));
  for (std::size_t first = 0; first < mesh.indices.size(); first += 3) {
    const Vec3 middle =
        (mesh.positions[mesh.indices[first]] + mesh.positions[mesh.indices[first + 1]] +
         mesh.positions[mesh.indices[first + 2]]) /
        3.0;
    const std::size_t region = regionAt(middle);
    for (std::size_t corner = first; corner < first + 3; ++corner) {
      const std::uint32_t vertex = mesh.indices[corner];
      if (regions[vertex] == noRegion) {
        regions[vertex] = region;
        mesh.colors[vertex] = colors[region];
      }
      if (regions[vertex] == region) continue;
      std::uint32_t& copy = copies[vertex * colors.size() + region];
      if (copy == 0) {
        copy = static_cast<std::uint32_t>(mesh.positions.size());
        mesh.positions.push_back(Vec3(mesh.positions[vertex]));
        mesh.normals.push_back(Vec3(mesh.normals[vertex]));
        mesh.influences.push_back(Influences(mesh.influences[vertex]));
        mesh.colors.push_back(colors[region]);
        regions.push_back(region);
      }
      mesh.indices[corner] = copy;
    }
  }
}

}  // namespace dermis::models
