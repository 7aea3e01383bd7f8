// The sample models: their bytes are the same everywhere, and their geometry is sound.
#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cstdint>
#include <glm/common.hpp>
#include <glm/geometric.hpp>
#include <map>
#include <string>
#include <utility>

#include "figure.h"
#include "models.h"

namespace {

using namespace dermis::models;

std::uint64_t fnv1a(const std::vector<std::byte>& bytes) {
  std::uint64_t hash = 0xCBF29CE484222325U;
  for (const std::byte each : bytes)
    hash = (hash ^ std::to_integer<std::uint64_t>(each)) * 0x100000001B3U;
  return hash;
}

// Vertices that stand in one place count as one: a border of colors doubles them.
std::vector<std::size_t> weld(const std::vector<Vec3>& positions, std::size_t& count) {
  std::map<std::array<double, 3>, std::size_t> places;
  std::vector<std::size_t> place;
  for (const Vec3& position : positions) {
    const std::array<double, 3> key = {position.x, position.y, position.z};
    place.push_back(places.emplace(key, places.size()).first->second);
  }
  count = places.size();
  return place;
}

class SampleModel : public testing::TestWithParam<Model (*)()> {
 protected:
  const Model model_ = GetParam()();
};

TEST_P(SampleModel, IsClosedAndOrientedAlike) {
  const Mesh& mesh = model_.mesh;
  std::size_t vertexCount = 0;
  const std::vector<std::size_t> place = weld(mesh.positions, vertexCount);
  std::map<std::pair<std::size_t, std::size_t>, int> edges;
  for (std::size_t first = 0; first < mesh.indices.size(); first += 3) {
    for (std::size_t side = 0; side < 3; ++side) {
      ++edges[{place[mesh.indices[first + side]], place[mesh.indices[first + (side + 1) % 3]]}];
    }
  }
  for (const auto& [edge, count] : edges) {
    ASSERT_EQ(count, 1) << edge.first << " to " << edge.second;
    ASSERT_EQ(edges.count({edge.second, edge.first}), 1U) << edge.first << " to " << edge.second;
  }
  const std::size_t faces = mesh.indices.size() / 3;
  EXPECT_EQ(vertexCount + faces, edges.size() / 2 + 2) << "one piece without handles";
}

TEST_P(SampleModel, TrianglesHaveAreaAndFaceOutwards) {
  const Mesh& mesh = model_.mesh;
  double volume = 0.0;
  for (std::size_t first = 0; first < mesh.indices.size(); first += 3) {
    const std::array<std::uint32_t, 3> corner = {mesh.indices[first], mesh.indices[first + 1],
                                                 mesh.indices[first + 2]};
    const Vec3& a = mesh.positions[corner[0]];
    const Vec3& b = mesh.positions[corner[1]];
    const Vec3& c = mesh.positions[corner[2]];
    const Vec3 across = glm::cross(b - a, c - a);
    volume += glm::dot(a, glm::cross(b, c)) / 6.0;
    ASSERT_GT(glm::length(across), 1e-6) << "triangle " << first / 3;
    const Vec3 normals =
        mesh.normals[corner[0]] + mesh.normals[corner[1]] + mesh.normals[corner[2]];
    EXPECT_GT(glm::dot(across, normals), 0.0) << "triangle " << first / 3;
  }
  EXPECT_GT(volume, 0.001);
  for (const Vec3& normal : mesh.normals) ASSERT_NEAR(glm::length(normal), 1.0, 1e-12);
}

TEST_P(SampleModel, WeightsSumToExactlyOne) {
  const Mesh& mesh = model_.mesh;
  ASSERT_EQ(mesh.influences.size(), mesh.positions.size());
  ASSERT_LT(mesh.positions.size(), 65536U);
  for (const Influences& influences : mesh.influences) {
    float sum = 0.0F;
    for (std::size_t influence = 0; influence < 4; ++influence) {
      ASSERT_GE(influences.weights[influence], 0.0F);
      ASSERT_LT(influences.joints[influence], model_.skeleton.joints.size());
      sum += influences.weights[influence];
    }
    ASSERT_EQ(sum, 1.0F);
  }
}

TEST_P(SampleModel, ClipsEndAsTheyBegin) {
  ASSERT_FALSE(model_.clips.empty());
  for (const Clip& clip : model_.clips) {
    ASSERT_EQ(clip.times.size(), clip.poses.size());
    EXPECT_EQ(clip.times.front(), 0.0);
    for (std::size_t joint = 0; joint < model_.skeleton.joints.size(); ++joint) {
      EXPECT_EQ(clip.poses.front()[joint].turn, clip.poses.back()[joint].turn) << clip.name;
      EXPECT_EQ(clip.poses.front()[joint].offset, clip.poses.back()[joint].offset) << clip.name;
    }
  }
}

TEST_P(SampleModel, IsOneBinaryGltf) {
  const std::vector<std::byte> bytes = writeGlb(model_);
  const auto word = [&](std::size_t at) {
    std::uint32_t value = 0;
    for (std::size_t byte = 0; byte < 4; ++byte) {
      value |= std::to_integer<std::uint32_t>(bytes[at + byte]) << (8U * byte);
    }
    return value;
  };
  ASSERT_GT(bytes.size(), 28U);
  EXPECT_EQ(word(0), 0x46546C67U);
  EXPECT_EQ(word(4), 2U);
  EXPECT_EQ(word(8), bytes.size());
}

std::string nameOf(const testing::TestParamInfo<Model (*)()>& instance) {
  return instance.param == barModel ? "Bar" : instance.param == armModel ? "Arm" : "Figure";
}

INSTANTIATE_TEST_SUITE_P(All, SampleModel, testing::Values(barModel, armModel, figureModel),
                         nameOf);

// A change here is a change of what everybody's pictures and golden files show: make it on purpose.
constexpr std::size_t barSize = 194744;
constexpr std::uint64_t barHash = 0xF46A22FE4EBF4314U;
constexpr std::size_t armSize = 346180;
constexpr std::uint64_t armHash = 0xB607E1AA2607AC86U;
constexpr std::size_t figureSize = 649856;
constexpr std::uint64_t figureHash = 0xA2525DA45729B15CU;

TEST(SampleModels, BytesArePinned) {
  const std::vector<std::byte> bar = makeBar();
  EXPECT_EQ(bar.size(), barSize);
  EXPECT_EQ(fnv1a(bar), barHash);
  const std::vector<std::byte> arm = makeArm();
  EXPECT_EQ(arm.size(), armSize);
  EXPECT_EQ(fnv1a(arm), armHash);
  const std::vector<std::byte> figure = makeFigure();
  EXPECT_EQ(figure.size(), figureSize);
  EXPECT_EQ(fnv1a(figure), figureHash);
}

TEST(SampleModels, BarHasTwoJointsAndALinearBlend) {
  const Model bar = barModel();
  EXPECT_EQ(bar.skeleton.joints.size(), 2U);
  for (std::size_t vertex = 0; vertex < bar.mesh.positions.size(); ++vertex) {
    const Influences& influences = bar.mesh.influences[vertex];
    const float second = influences.joints[0] == 1 ? influences.weights[0] : influences.weights[1];
    const double expected =
        std::min(std::max((bar.mesh.positions[vertex].x - 0.3) / 0.4, 0.0), 1.0);
    ASSERT_NEAR(second, expected, 0.005) << "vertex " << vertex;
  }
}

TEST(SampleModels, ArmHasThreeJoints) {
  const Model arm = armModel();
  EXPECT_EQ(arm.skeleton.joints.size(), 3U);
  EXPECT_GT(arm.mesh.positions.size(), 2000U);
}

TEST(SampleModels, FigureIsAPersonOfOneMetreSeventyFive) {
  const Model figure = figureModel();
  EXPECT_GE(figure.mesh.positions.size(), 5000U);
  EXPECT_EQ(figure.skeleton.joints.size(), boneCount);
  Vec3 low(1e3);
  Vec3 high(-1e3);
  for (const Vec3& position : figure.mesh.positions) {
    low = glm::min(low, position);
    high = glm::max(high, position);
  }
  EXPECT_NEAR(low.y, 0.0, 0.001);
  EXPECT_NEAR(high.y, 1.75, 0.005);
  EXPECT_NEAR(low.x, -high.x, 0.001);
}

TEST(SampleModels, TheFiguresPartsAreAllOfIt) {
  const Model figure = figureModel();
  EXPECT_EQ(figure.parts.size(), 5U);
  std::size_t vertices = 0;
  std::size_t corners = 0;
  for (const Part& part : figure.parts) {
    const Mesh mesh = partOf(figure.mesh, part);
    EXPECT_GT(mesh.indices.size(), 0U) << part.name;
    EXPECT_EQ(mesh.influences.size(), mesh.positions.size()) << part.name;
    for (const std::uint32_t index : mesh.indices) ASSERT_LT(index, mesh.positions.size());
    vertices += mesh.positions.size();
    corners += mesh.indices.size();
  }
  EXPECT_EQ(vertices, figure.mesh.positions.size());
  EXPECT_EQ(corners, figure.mesh.indices.size());
}

// The bones of one side, by their names.
bool isOnSide(const std::string& name, const std::string& side) {
  return name.rfind(side, 0) == 0;
}

bool isOfLeg(const std::string& name) {
  return name.find("Thigh") != std::string::npos || name.find("Shin") != std::string::npos ||
         name.find("Foot") != std::string::npos || name.find("Toes") != std::string::npos;
}

TEST(SampleModels, WeightsOfTheFigureStayInTheirLimb) {
  const Model figure = figureModel();
  for (std::size_t vertex = 0; vertex < figure.mesh.positions.size(); ++vertex) {
    const Vec3& position = figure.mesh.positions[vertex];
    const Influences& influences = figure.mesh.influences[vertex];
    for (std::size_t influence = 0; influence < 4; ++influence) {
      if (influences.weights[influence] == 0.0F) continue;
      const std::string& name = figure.skeleton.joints[influences.joints[influence]].name;
      const std::string where = name + " at vertex " + std::to_string(vertex);
      // Away from the middle no bone of the other side has a say.
      EXPECT_FALSE(position.x > 0.05 && isOnSide(name, "right")) << where;
      EXPECT_FALSE(position.x < -0.05 && isOnSide(name, "left")) << where;
      EXPECT_FALSE(position.y > 1.06 && isOfLeg(name)) << where;
      EXPECT_FALSE(position.y < 0.66 && !isOfLeg(name)) << where;
    }
  }
}

}  // namespace
