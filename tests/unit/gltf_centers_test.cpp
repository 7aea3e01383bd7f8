// Centers of rotation of a real figure: equal to the direct sum over all its triangles.
#include <gtest/gtest.h>

#include <algorithm>
#include <cstring>
#include <glm/geometric.hpp>
#include <optional>
#include <string>
#include <vector>

#include "centers.h"
#include "dermis/gltf.h"
#include "test_paths.h"

namespace dermis::test {
namespace {

Weights weightsOf(const gltf::Influences& influences, std::size_t vertex) {
  Weights weights;
  for (std::size_t slot = 4 * vertex; slot < 4 * vertex + 4; ++slot) {
    float weight;
    std::memcpy(&weight, &influences.weights[slot * sizeof(float)], sizeof(float));
    if (weight != 0) weights[std::to_integer<std::uint32_t>(influences.joints[slot])] += weight;
  }
  return weights;
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

  std::vector<Weights> vertices;
  double size = 0;
  for (std::size_t vertex = 0; vertex < primitive.vertexCount; ++vertex) {
    vertices.push_back(weightsOf(influences, vertex));
    size = std::max(size, glm::length(vectorAt(primitive.positions, vertex) -
                                      vectorAt(primitive.positions, 0)));
  }
  const DirectSum direct(primitive.positions, vertices, primitive.triangles);
  int summed = 0;
  for (std::uint32_t vertex = 0; vertex < primitive.vertexCount; vertex += 13) {
    const std::optional<glm::dvec3> expected = direct.center(vertices[vertex]);
    if (!expected) continue;
    ++summed;
    EXPECT_LE(glm::length(vectorAt(*centers, vertex) - *expected), 1e-6 * size) << vertex;
  }
  EXPECT_GE(summed, 50) << "many vertices have several joints";
}

}  // namespace
}  // namespace dermis::test
