// All centres of rotation of a mesh, on one thread, and the formula that they must follow.
#pragma once

#include <cmath>
#include <cstdint>
#include <map>
#include <optional>
#include <span>
#include <vector>

#include <glm/geometric.hpp>
#include <glm/vec3.hpp>

#include "dermis/mesh.h"

namespace dermis::test {

inline Result<std::vector<float>> centersOf(const MeshView& mesh, std::uint32_t jointCount,
                                            std::span<const std::uint32_t> triangles) {
  const Result<CenterOfRotationSolver> solver =
      CenterOfRotationSolver::make(mesh, jointCount, triangles);
  if (!solver) return solver.error();
  std::vector<float> centers(std::size_t{3} * solver->vertexCount());
  if (Result<void> solved = solver->solve(0, centers); !solved) return solved.error();
  return centers;
}

inline glm::dvec3 vectorAt(std::span<const float> values, std::size_t index) {
  return {values[3 * index], values[3 * index + 1], values[3 * index + 2]};
}

using Weights = std::map<std::uint32_t, double>;  ///< by joint

/// Le and Hodgins 2016, σ = 0.1.
inline double similarity(const Weights& i, const Weights& t) {
  double sum = 0;
  for (const auto& [j, ij] : i) {
    for (const auto& [k, ik] : i) {
      if (j == k || !t.contains(j) || !t.contains(k)) continue;
      const double difference = ij * t.at(k) - ik * t.at(j);
      sum += ij * ik * t.at(j) * t.at(k) * std::exp(-difference * difference / 0.01);
    }
  }
  return sum;
}

/// The formula itself, summed over all triangles without an index.
class DirectSum {
 public:
  DirectSum(std::span<const float> positions, std::span<const Weights> vertices,
            std::span<const std::uint32_t> triangles) {
    for (std::size_t first = 0; first < triangles.size(); first += 3) {
      Triangle& triangle = triangles_.emplace_back();
      glm::dvec3 corners[3];
      for (std::size_t corner = 0; corner < 3; ++corner) {
        const std::uint32_t vertex = triangles[first + corner];
        corners[corner] = vectorAt(positions, vertex);
        for (const auto& [joint, weight] : vertices[vertex]) triangle.weights[joint] += weight / 3;
      }
      const auto& [a, b, c] = corners;
      triangle.centroid = (a + b + c) / 3.0;
      triangle.area = glm::length(glm::cross(b - a, c - a)) / 2;
    }
  }
  /// Nothing where no triangle is similar.
  std::optional<glm::dvec3> center(const Weights& weights) const {
    glm::dvec3 moment(0.0);
    double sum = 0;
    for (const Triangle& triangle : triangles_) {
      const double factor = similarity(weights, triangle.weights) * triangle.area;
      moment += factor * triangle.centroid;
      sum += factor;
    }
    return sum > 0 ? std::optional(moment / sum) : std::nullopt;
  }

 private:
  struct Triangle {
    Weights weights;
    glm::dvec3 centroid{0.0};
    double area = 0;
  };
  std::vector<Triangle> triangles_;
};

}  // namespace dermis::test
