// Poses of the sample models as other people's software skins them: tests/golden has some hundred
// vertices of each, and the scripts that wrote them. They need nothing but this repository.

#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <filesystem>
#include <fstream>
#include <map>
#include <span>
#include <sstream>
#include <string>
#include <tuple>
#include <vector>

#include "dermis_command.h"
#include "every_skinner.h"
#include "test_paths.h"

namespace dermis::test {
namespace {

using Position = std::array<double, 3>;

/// One vertex in one pose.
struct ForeignVertex {
  std::size_t vertex = 0;
  Position bind{};
  std::vector<Position> skinned;  ///< by column: linear, and dual quaternions where there are two
};

/// Model, clip and time.
using PoseName = std::tuple<std::string, std::string, std::string>;
using ForeignPoses = std::map<PoseName, std::vector<ForeignVertex>>;

ForeignPoses readPoses(const std::string& name) {
  ForeignPoses poses;
  std::ifstream file(std::string(sourceFolder) + "/tests/golden/" + name);
  for (std::string line; std::getline(file, line);) {
    if (line.starts_with('#')) continue;
    std::istringstream fields(line);
    std::string model, clip, time;
    ForeignVertex vertex;
    fields >> model >> clip >> time >> vertex.vertex;
    const auto read = [&fields](Position& point) -> bool {
      return static_cast<bool>(fields >> point[0] >> point[1] >> point[2]);
    };
    EXPECT_TRUE(read(vertex.bind)) << line;
    for (Position point; read(point);) vertex.skinned.push_back(point);
    poses[{model, clip, time}].push_back(vertex);
  }
  return poses;
}

double distance(const Position& a, const Position& b) {
  return std::hypot(a[0] - b[0], a[1] - b[1], a[2] - b[2]);
}

/// Of the bind pose: its box' diagonal.
double sizeOf(const std::vector<ForeignVertex>& vertices) {
  Position low = vertices[0].bind, high = low;
  for (const ForeignVertex& vertex : vertices) {
    for (std::size_t axis = 0; axis < 3; ++axis) {
      low[axis] = std::min(low[axis], vertex.bind[axis]);
      high[axis] = std::max(high[axis], vertex.bind[axis]);
    }
  }
  return distance(low, high);
}

Position pointAt(std::span<const float> positions, std::size_t vertex) {
  Position point{};
  for (std::size_t axis = 0; axis < 3; ++axis)
    point[axis] = static_cast<double>(positions[3 * vertex + axis]);
  return point;
}

/// The largest distance of all vertices, over the model's size.
double farthest(const std::vector<ForeignVertex>& vertices, std::size_t column,
                std::span<const float> positions) {
  double worst = 0;
  for (const ForeignVertex& vertex : vertices) {
    if (3 * vertex.vertex + 2 >= positions.size() || column >= vertex.skinned.size())
      return HUGE_VAL;
    const double apart = distance(vertex.skinned[column], pointAt(positions, vertex.vertex));
    if (!(apart <= worst)) worst = apart;
    if (std::isnan(worst)) return HUGE_VAL;
  }
  return worst / sizeOf(vertices);
}

constexpr std::array foreignMethods{Method::linear, Method::dualQuaternion};

class ForeignPosesTest : public SkinnerTest {
 protected:
  /// The models are built from code, which may change; then it is not the skinning that is wrong.
  static void expectSameModel(const std::vector<ForeignVertex>& vertices, const cli::Scene& scene) {
    std::vector<float> bind;
    for (const cli::ScenePart& part : scene.parts) {
      const auto& positions = part.primitive->positions;
      bind.insert(bind.end(), positions.begin(), positions.end());
    }
    for (const ForeignVertex& vertex : vertices) {
      ASSERT_LT(3 * vertex.vertex + 2, bind.size());
      ASSERT_LT(distance(vertex.bind, pointAt(bind, vertex.vertex)), 1e-6)
          << "the model has changed: run the scripts of tests/golden again";
    }
  }

  /// Every pose of the file, by as many methods as it has, within `tolerance` of the model's size.
  void expectAgreement(const std::string& file, std::size_t columns, std::size_t poseCount,
                       double tolerance) const {
    const ForeignPoses poses = readPoses(file);
    ASSERT_EQ(poses.size(), poseCount);
    double worst = 0;
    for (const auto& [name, vertices] : poses) {
      const auto& [model, clipName, time] = name;
      SCOPED_TRACE(model + ", " + clipName + " at " + time + " s");
      ASSERT_GE(vertices.size(), 200u);
      const Result<cli::Scene> scene =
          cli::loadScene(std::filesystem::path(sampleModels) / (model + ".glb"), {});
      ASSERT_TRUE(scene.ok()) << scene.error().message;
      expectSameModel(vertices, *scene);
      const Result<std::uint32_t> clip = cli::chooseClip(*scene, clipName);
      ASSERT_TRUE(clip.ok()) << clip.error().message;
      for (std::size_t column = 0; column < columns; ++column) {
        const auto skinned = [&](double seconds, Method method) {
          return skinScene(*scene, cli::scenePose(*scene, *clip, seconds), method);
        };
        const Method method = foreignMethods[column];
        const double seconds = std::stod(time);
        const double error = farthest(vertices, column, skinned(seconds, method));
        EXPECT_LE(error, tolerance) << methodName(method);
        worst = std::max(worst, error);
        // What is close to that is told from it: another time, another method.
        EXPECT_GT(farthest(vertices, column, skinned(seconds + 0.001, method)), 3 * tolerance);
        EXPECT_GT(farthest(vertices, column, skinned(seconds, foreignMethods[1 - column])),
                  3 * tolerance);
      }
    }
    RecordProperty("worst", std::to_string(worst * 1e6) + "e-6");
  }

  samples::OpenDevice* device_ = nullptr;
};

// By three.mjs, in double precision; joint matrices are float32 here. Worst when this was written:
// 6e-8 and, on lavapipe, 1.1e-7. The tolerances are fitted to that.
TEST_P(ForeignPosesTest, ThreeJsAgrees) {
  expectAgreement("three.tsv", 1, 7, isReference() ? 2.5e-7 : 4e-7);
}

// By blender.py, in float: its bones and its modifier round, each a few times. Worst: 5e-7.
TEST_P(ForeignPosesTest, BlenderAgreesWithAndWithoutPreserveVolume) {
  expectAgreement("blender.tsv", 2, 6, 1.5e-6);
}

INSTANTIATE_TEST_SUITE_P(Skinners, ForeignPosesTest, ::testing::ValuesIn(skinnerNames()),
                         [](const auto& skinner) { return skinner.param; });

}  // namespace
}  // namespace dermis::test
