#include "vertex_normals.h"

#include <cmath>
#include <cstddef>

#include <glm/geometric.hpp>
#include <glm/vec3.hpp>

namespace dermis::cli {
namespace {

glm::dvec3 vectorAt(std::span<const float> values, std::size_t index) {
  return glm::dvec3(values[index * 3], values[index * 3 + 1], values[index * 3 + 2]);
}

}  // namespace

std::vector<float> computeNormals(std::span<const float> positions,
                                  std::span<const std::uint32_t> triangles) {
  std::vector<glm::dvec3> sums(positions.size() / 3, glm::dvec3(0.0));
  for (std::size_t corner = 0; corner + 2 < triangles.size(); corner += 3) {
    const glm::dvec3 a = vectorAt(positions, triangles[corner]);
    const glm::dvec3 b = vectorAt(positions, triangles[corner + 1]);
    const glm::dvec3 c = vectorAt(positions, triangles[corner + 2]);
    const glm::dvec3 area = glm::cross(b - a, c - a);
    for (std::size_t i = 0; i < 3; ++i) sums[triangles[corner + i]] += area;
  }
  std::vector<float> normals;
  normals.reserve(positions.size());
  for (const glm::dvec3& sum : sums) {
    const double length = glm::length(sum);
    const glm::dvec3 normal =
        length > 0 && std::isfinite(length) ? sum / length : glm::dvec3(0, 0, 1);
    for (int i = 0; i < 3; ++i) normals.push_back(static_cast<float>(normal[i]));
  }
  return normals;
}

}  // namespace dermis::cli
