#include "centers/gather.h"

#include <algorithm>
#include <numeric>

#include <glm/geometric.hpp>

#include "attribute.h"
#include "pack/influences.h"

namespace dermis::centers {
namespace {

/// The triangles that matter, in their order.
struct Triangles {
  InfluenceLists influences;  ///< the mean of their vertices', by rising joint
  std::vector<Moment> moments;
};

using Corners = std::span<const std::uint32_t>;

/// In double precision neither overflows, nor comes to 0 by underflow, for any float32 positions.
Moment momentOf(const Vertices& vertices, Corners corners) {
  const glm::dvec3 a(vertices.positions[corners[0]]);
  const glm::dvec3 b(vertices.positions[corners[1]]);
  const glm::dvec3 c(vertices.positions[corners[2]]);
  const double area = 0.5 * glm::length(glm::cross(b - a, c - a));
  const glm::dvec3 moment = area * ((a + b + c) / 3.0);
  return {moment.x, moment.y, moment.z, area};
}

/// Sums are exact, as the weights are multiples of 2^-48: they do not depend on the corners' order.
void meanInfluences(const Vertices& vertices, Corners corners, std::vector<Influence>& mean) {
  mean.clear();
  for (const std::uint32_t corner : corners) {
    const std::span<const Influence> influences = vertices.influences[corner];
    mean.insert(mean.end(), influences.begin(), influences.end());
  }
  std::sort(mean.begin(), mean.end(),
            [](const Influence& a, const Influence& b) { return a.joint < b.joint; });
  std::size_t kept = 0;
  for (const Influence& influence : mean) {
    if (kept > 0 && mean[kept - 1].joint == influence.joint) {
      mean[kept - 1].weight += influence.weight;
    } else {
      mean[kept++] = influence;
    }
  }
  mean.resize(kept);
  for (Influence& influence : mean) influence.weight /= 3;
}

Triangles gatherTriangles(const Vertices& vertices, std::span<const std::uint32_t> indices) {
  Triangles triangles;
  std::vector<Influence> mean;
  for (std::size_t first = 0; first < indices.size(); first += 3) {
    const Corners corners = indices.subspan(first, 3);
    const Moment moment = momentOf(vertices, corners);
    if (moment.sum == 0) continue;
    meanInfluences(vertices, corners, mean);
    if (mean.size() < 2) continue;
    triangles.influences.add(mean);
    triangles.moments.push_back(moment);
  }
  return triangles;
}

bool less(std::span<const Influence> a, std::span<const Influence> b) {
  return std::lexicographical_compare(
      a.begin(), a.end(), b.begin(), b.end(), [](const Influence& x, const Influence& y) {
        return x.joint != y.joint ? x.joint < y.joint : x.weight < y.weight;
      });
}

bool equal(std::span<const Influence> a, std::span<const Influence> b) {
  return std::equal(a.begin(), a.end(), b.begin(), b.end(),
                    [](const Influence& x, const Influence& y) {
                      return x.joint == y.joint && x.weight == y.weight;
                    });
}

/// Triangles of equal weights become one group; groups of the same joints stand together.
std::vector<Group> group(const Triangles& triangles) {
  std::vector<std::uint32_t> order(triangles.moments.size());
  std::iota(order.begin(), order.end(), 0u);
  std::stable_sort(order.begin(), order.end(), [&](std::uint32_t a, std::uint32_t b) {
    return less(triangles.influences[a], triangles.influences[b]);
  });
  std::vector<Group> groups;
  for (const std::uint32_t triangle : order) {
    const std::span<const Influence> influences = triangles.influences[triangle];
    if (groups.empty() || !equal(groups.back().influences, influences)) {
      groups.push_back({influences, {}});
    }
    groups.back().moment.add(triangles.moments[triangle], 1);
  }
  return groups;
}

}  // namespace

Vertices gatherVertices(const MeshView& mesh) {
  Vertices vertices;
  std::vector<PackedInfluence> packed;
  std::vector<Influence> influences;
  for (std::uint32_t vertex = 0; vertex < mesh.vertexCount; ++vertex) {
    vertices.positions.emplace_back(loadPosition(mesh, vertex, 0), loadPosition(mesh, vertex, 1),
                                    loadPosition(mesh, vertex, 2));
    packInfluences(mesh, vertex, packed);
    influences.clear();
    for (const PackedInfluence& influence : packed) {
      influences.push_back({influence.joint, influence.weight});
    }
    vertices.influences.add(influences);
  }
  return vertices;
}

PairIndex indexTriangles(const Vertices& vertices, std::span<const std::uint32_t> indices) {
  const Triangles triangles = gatherTriangles(vertices, indices);
  return PairIndex(group(triangles));
}

}  // namespace dermis::centers
