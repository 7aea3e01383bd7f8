// Centers of rotation of a real figure: equal to the direct sum over all its triangles.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstring>
#include <glm/geometric.hpp>
#include <glm/vec3.hpp>
#include <map>
#include <string>
#include <vector>

#include "centers.h"
#include "dermis/gltf.h"
#include "test_paths.h"

namespace dermis::test {
namespace {

using Weights = std::map<std::uint32_t, double>;

Weights weightsOf(const gltf::Influences& influences, std::size_t vertex) {
  Weights weights;
  for (std::size_t slot = 4 * vertex; slot < 4 * vertex + 4; ++slot) {
    float weight;
    std::memcpy(&weight, &influences.weights[slot * sizeof(float)], sizeof(float));
    if (weight != 0) weights[std::to_integer<std::uint32_t>(influences.joints[slot])] += weight;
  }
  return weights;
}

// Le and Hodgins 2016, σ = 0.1.
double similarity(const Weights& i, const Weights& t) {
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

TEST(GltfCentersTest, CentersOfTheFigureAreThoseOfTheDirectSum) {
  const Result<gltf::Model> model = gltf::load(std::string(sampleModels) + "/figure.glb");
  ASSERT_TRUE(model.ok()) << model.error().message;
  const gltf::Primitive& primitive = model->meshes[0].primitives[0];
  const gltf::Influences& influences = primitive.influences.at(0);
  ASSERT_EQ(influences.jointType, ComponentType::uint8);
  ASSERT_EQ(influences.weightType, ComponentType::float32);
  const gltf::PrimitiveView view(primitive);
  const auto centers = centersOf(view.mesh(), 64, primitive.triangles);
  ASSERT_TRUE(centers.ok()) << centers.error().message;

  const auto position = [](const std::vector<float>& values, std::size_t vertex) {
    return glm::dvec3(values[3 * vertex], values[3 * vertex + 1], values[3 * vertex + 2]);
  };
  std::vector<Weights> triangles;
  std::vector<glm::dvec3> centroids;
  std::vector<double> areas;
  double size = 0;
  for (std::size_t first = 0; first < primitive.triangles.size(); first += 3) {
    Weights& weights = triangles.emplace_back();
    glm::dvec3 corners[3];
    for (std::size_t corner = 0; corner < 3; ++corner) {
      const std::uint32_t vertex = primitive.triangles[first + corner];
      corners[corner] = position(primitive.positions, vertex);
      for (const auto& [joint, weight] : weightsOf(influences, vertex))
        weights[joint] += weight / 3;
    }
    const auto& [a, b, c] = corners;
    centroids.push_back((a + b + c) / 3.0);
    areas.push_back(glm::length(glm::cross(b - a, c - a)) / 2);
    size = std::max(size, glm::length(a - position(primitive.positions, 0)));
  }
  int summed = 0;
  for (std::uint32_t vertex = 0; vertex < primitive.vertexCount; vertex += 13) {
    const Weights weights = weightsOf(influences, vertex);
    glm::dvec3 moment(0.0);
    double sum = 0;
    for (std::size_t t = 0; t < triangles.size(); ++t) {
      const double factor = similarity(weights, triangles[t]) * areas[t];
      moment += factor * centroids[t];
      sum += factor;
    }
    if (sum == 0) continue;
    ++summed;
    EXPECT_LE(glm::length(position(*centers, vertex) - moment / sum), 1e-6 * size) << vertex;
  }
  EXPECT_GE(summed, 50) << "many vertices have several joints";
}

}  // namespace
}  // namespace dermis::test
