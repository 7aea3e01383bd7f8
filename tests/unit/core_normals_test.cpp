// Normals for meshes that have none.
#include "dermis/mesh.h"

#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <string>
#include <vector>

namespace dermis::test {
namespace {

using Floats = std::vector<float>;
using Indices = std::vector<std::uint32_t>;

/// A roof: two triangles that share the ridge 0 1. The left one is three times as large. Vertex 4
/// is in no triangle, and triangle 2 has no area.
struct NormalsTest : public testing::Test {
  NormalsTest() {
    mesh.name = "Roof";
    mesh.vertexCount = 5;
    mesh.positions = attributeView(positions.data(), 5, 3);
  }

  void expectRefused(ErrorCode code, const std::string& message) const {
    for (const auto& result : {smoothNormals(mesh, triangles), flatNormals(mesh, triangles)}) {
      ASSERT_FALSE(result.ok()) << message;
      EXPECT_EQ(result.error().code, code);
      EXPECT_EQ(result.error().message, message);
    }
  }
  static void expectNear(const Result<Floats>& result, const Floats& expected) {
    ASSERT_TRUE(result.ok()) << result.error().message;
    ASSERT_EQ(result->size(), expected.size());
    for (std::size_t i = 0; i < expected.size(); ++i)
      EXPECT_NEAR((*result)[i], expected[i], 1e-7) << i;
  }

  Floats positions{0, 0, 0, 0, 1, 0, -3, 0, 0, 0, 0, -1, 7, 7, 7};
  Indices triangles{0, 1, 2, 1, 0, 3, 1, 1, 0};
  MeshView mesh;
};

TEST_F(NormalsTest, SmoothOnesAreWeightedByArea) {
  const float x = 1 / std::sqrt(10.0f), z = 3 / std::sqrt(10.0f);
  expectNear(smoothNormals(mesh, triangles), {x, 0, z, x, 0, z, 0, 0, 1, 1, 0, 0, 0, 0, 1});
}

TEST_F(NormalsTest, FlatOnesBelongToTheCornersOfTriangles) {
  expectNear(flatNormals(mesh, triangles),
             {0, 0, 1, 0, 0, 1, 0, 0, 1, 1, 0, 0, 1, 0, 0, 1, 0, 0, 0, 0, 1, 0, 0, 1, 0, 0, 1});
  expectNear(flatNormals(mesh, {}), {});
}

TEST_F(NormalsTest, PositionsAreScaled) {
  mesh.positionScale = {1, 1, 3};  // both triangles have the same area now
  mesh.positionOffset = {5, 5, 5};
  const float half = std::sqrt(0.5f);
  const Result<Floats> smooth = smoothNormals(mesh, triangles);
  ASSERT_TRUE(smooth.ok());
  EXPECT_NEAR((*smooth)[0], half, 1e-7);
  EXPECT_NEAR((*smooth)[2], half, 1e-7);
}

TEST_F(NormalsTest, PositionsThatAreNotFiniteGiveADirection) {
  positions[0] = std::numeric_limits<float>::quiet_NaN();
  positions[1] = std::numeric_limits<float>::infinity();
  expectNear(smoothNormals(mesh, triangles), {0, 0, 1, 0, 0, 1, 0, 0, 1, 0, 0, 1, 0, 0, 1});
  const Floats up{0, 0, 1, 0, 0, 1, 0, 0, 1};
  expectNear(flatNormals(mesh, std::span(triangles).first(3)), up);
  for (const float size : {1e-40f, 3e38f}) {
    positions = {0, 0, 0, 0, size, 0, 0, 0, size};
    mesh.vertexCount = mesh.positions.count = 3;
    expectNear(flatNormals(mesh, Indices{0, 1, 2}), {1, 0, 0, 1, 0, 0, 1, 0, 0});
  }
}

TEST_F(NormalsTest, WrongViewsAndTrianglesAreRefused) {
  triangles[4] = 5;
  expectRefused(ErrorCode::invalidArgument,
                "mesh 'Roof', triangle 1: vertex 5 is outside the mesh, which has 5 vertices");
  triangles.resize(8);
  expectRefused(ErrorCode::invalidArgument, "mesh 'Roof': 8 vertex indices: not a multiple of 3");
  mesh.positions.count = 4;
  expectRefused(ErrorCode::invalidMesh, "mesh 'Roof': there are 4 positions for 5 vertices");
  mesh.positions = {};
  expectRefused(ErrorCode::invalidMesh, "mesh 'Roof': it has no positions");
  mesh.vertexCount = 0;
  expectRefused(ErrorCode::invalidMesh, "mesh 'Roof': it has no vertices");
}

}  // namespace
}  // namespace dermis::test
