#include "mesh.h"

#include <algorithm>
#include <glm/geometric.hpp>

namespace dermis::models {

Mesh partOf(const Mesh& mesh, const Part& part) {
  Mesh result;
  std::vector<std::uint32_t> places(mesh.positions.size(), 0);
  std::vector<bool> isInside(mesh.positions.size(), false);
  for (std::size_t vertex = 0; vertex < mesh.positions.size(); ++vertex) {
    const std::size_t region = mesh.regions[vertex];
    if (std::find(part.regions.begin(), part.regions.end(), region) == part.regions.end()) continue;
    isInside[vertex] = true;
    places[vertex] = static_cast<std::uint32_t>(result.positions.size());
    result.positions.push_back(mesh.positions[vertex]);
    result.normals.push_back(mesh.normals[vertex]);
    result.colors.push_back(mesh.colors[vertex]);
    result.influences.push_back(mesh.influences[vertex]);
    result.regions.push_back(region);
  }
  for (std::size_t first = 0; first < mesh.indices.size(); first += 3) {
    if (!isInside[mesh.indices[first]]) continue;
    for (std::size_t corner = first; corner < first + 3; ++corner)
      result.indices.push_back(places[mesh.indices[corner]]);
  }
  return result;
}

std::vector<std::vector<std::uint32_t>> neighborsOf(std::size_t vertexCount,
                                                    const std::vector<std::uint32_t>& indices) {
  std::vector<std::vector<std::uint32_t>> neighbors(vertexCount);
  for (std::size_t corner = 0; corner < indices.size(); corner += 3) {
    for (std::size_t side = 0; side < 3; ++side) {
      const std::uint32_t from = indices[corner + side];
      const std::uint32_t to = indices[corner + (side + 1) % 3];
      neighbors[from].push_back(to);
      neighbors[to].push_back(from);
    }
  }
  for (auto& list : neighbors) {
    std::sort(list.begin(), list.end());
    list.erase(std::unique(list.begin(), list.end()), list.end());
  }
  return neighbors;
}

std::vector<Vec3> smoothNormals(const std::vector<Vec3>& positions,
                                const std::vector<std::uint32_t>& indices) {
  std::vector<Vec3> normals(positions.size(), Vec3(0.0));
  for (std::size_t first = 0; first < indices.size(); first += 3) {
    const Vec3& a = positions[indices[first]];
    // Its length is twice the area.
    const Vec3 across =
        glm::cross(positions[indices[first + 1]] - a, positions[indices[first + 2]] - a);
    for (std::size_t corner = first; corner < first + 3; ++corner)
      normals[indices[corner]] += across;
  }
  for (Vec3& normal : normals) normal = unit(normal);
  return normals;
}

}  // namespace dermis::models
