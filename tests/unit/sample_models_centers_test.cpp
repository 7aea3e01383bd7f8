// Centres of rotation of a whole figure: those of the direct sum over all its triangles.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <glm/geometric.hpp>
#include <map>
#include <vector>

#include "centers.h"
#include "models.h"

namespace {

using dermis::models::Mesh;
using dermis::models::Vec3;
using Weights = std::map<std::uint32_t, double>;

Weights weightsOf(const Mesh& mesh, std::size_t vertex) {
  Weights weights;
  for (std::size_t slot = 0; slot < 4; ++slot) {
    const auto weight = static_cast<double>(mesh.influences[vertex].weights[slot]);
    if (weight != 0) weights[mesh.influences[vertex].joints[slot]] += weight;
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

TEST(SampleModelCenters, OfTheFigureAreThoseOfTheDirectSum) {
  const dermis::models::Model model = dermis::models::figureModel();
  const Mesh& mesh = model.mesh;
  const auto vertexCount = static_cast<std::uint32_t>(mesh.positions.size());
  std::vector<float> positions;
  for (const Vec3& position : mesh.positions) {
    for (int axis = 0; axis < 3; ++axis) positions.push_back(static_cast<float>(position[axis]));
  }
  constexpr auto stride = static_cast<std::uint32_t>(sizeof(dermis::models::Influences));
  dermis::InfluenceSet set;
  set.joints = {mesh.influences[0].joints.data(), vertexCount, stride,
                dermis::ComponentType::uint16, 4};
  set.weights = {mesh.influences[0].weights.data(), vertexCount, stride,
                 dermis::ComponentType::float32, 4};
  dermis::MeshView view;
  view.name = "figure";
  view.vertexCount = vertexCount;
  view.positions = dermis::floatAttribute(positions.data(), vertexCount, 3);
  view.influenceSets = {&set, 1};
  const auto centers = dermis::test::centersOf(view, 64, mesh.indices);
  ASSERT_TRUE(centers.ok()) << centers.error().message;

  std::vector<Weights> triangles;
  std::vector<Vec3> centroids;
  std::vector<double> areas;
  double size = 0;
  for (std::size_t first = 0; first < mesh.indices.size(); first += 3) {
    const std::uint32_t* corners = &mesh.indices[first];
    Weights& weights = triangles.emplace_back();
    for (int corner = 0; corner < 3; ++corner) {
      for (const auto& [joint, weight] : weightsOf(mesh, corners[corner]))
        weights[joint] += weight / 3;
    }
    const Vec3 &a = mesh.positions[corners[0]], &b = mesh.positions[corners[1]],
               &c = mesh.positions[corners[2]];
    centroids.push_back((a + b + c) / 3.0);
    areas.push_back(glm::length(glm::cross(b - a, c - a)) / 2);
    size = std::max(size, glm::length(a - mesh.positions[0]));
  }
  int summed = 0;
  for (std::uint32_t vertex = 0; vertex < vertexCount; vertex += 41) {
    const Weights weights = weightsOf(mesh, vertex);
    Vec3 moment(0.0);
    double sum = 0;
    for (std::size_t t = 0; t < triangles.size(); ++t) {
      const double factor = similarity(weights, triangles[t]) * areas[t];
      moment += factor * centroids[t];
      sum += factor;
    }
    if (sum == 0) continue;
    ++summed;
    const float* center = &(*centers)[3 * std::size_t{vertex}];
    const Vec3 found(static_cast<double>(center[0]), static_cast<double>(center[1]),
                     static_cast<double>(center[2]));
    EXPECT_LE(glm::length(found - moment / sum), 1e-6 * size) << vertex;
  }
  EXPECT_GE(summed, 100) << "many vertices have several joints";
}

}  // namespace
