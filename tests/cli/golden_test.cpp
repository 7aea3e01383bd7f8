// Poses from other programs: every line of golden/manifest.jsonl, both methods, skinned as `dermis
// skin` does it, and two of them by the command itself.

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <nlohmann/json.hpp>
#include <span>
#include <string>
#include <vector>

#include "dermis_command.h"
#include "every_skinner.h"
#include "golden_file.h"
#include "ply.h"
#include "test_data.h"

namespace dermis::test {
namespace {

/// The largest distance over the model's size. `positions`: 3 floats a vertex.
double compareWith(const Golden& golden, bool dualQuaternion, std::span<const float> positions) {
  if (positions.size() != 3 * golden.vertices() || golden.vertices() == 0) {
    ADD_FAILURE() << positions.size() / 3 << " vertices, not " << golden.vertices();
    return HUGE_VAL;
  }
  double worst = 0;
  std::size_t compared = 0;
  for (std::size_t vertex = 0; vertex < golden.vertices(); ++vertex) {
    double squared = 0;
    for (std::size_t axis = 0; axis < 3; ++axis) {
      const float position = positions[3 * vertex + axis];
      const double difference =
          golden.at(dualQuaternion, vertex, axis) - static_cast<double>(position);
      squared += difference * difference;
      // NaN stands where the file's own weights are NaN; what we write must be finite even there.
      EXPECT_TRUE(std::isfinite(position)) << "vertex " << vertex;
    }
    if (std::isnan(squared)) continue;
    worst = std::max(worst, std::sqrt(squared));
    ++compared;
  }
  EXPECT_GT(compared, 0u);
  return worst / golden.size();
}

/// One pose of a model, by one method.
struct GoldenPose {
  std::filesystem::path model;
  std::string animation;  ///< as for `--animation`
  double time = 0;
  bool dualQuaternion = false;
};

class GoldenTest : public SkinnerTest {
 protected:
  void SetUp() override {
    const std::optional<std::filesystem::path> data = testDataFolder();
    if (!data) GTEST_SKIP() << noTestData;
    data_ = *data;
    SkinnerTest::SetUp();
  }

  /// All positions of the scene, 3 a vertex.
  std::vector<float> skin(const cli::Scene& scene, const GoldenPose& pose) const {
    const Result<std::uint32_t> clip = cli::chooseClip(scene, pose.animation);
    EXPECT_TRUE(clip.ok()) << (clip ? "" : clip.error().message);
    if (!clip) return {};
    return skinScene(scene, cli::scenePose(scene, *clip, pose.time),
                     pose.dualQuaternion ? Method::dualQuaternion : Method::linear);
  }

  double skinAndCompare(const cli::Scene& scene, GoldenPose pose, const Golden& golden) const {
    double worst = 0;
    for (const bool dualQuaternion : {false, true}) {
      pose.dualQuaternion = dualQuaternion;
      const double error = compareWith(golden, dualQuaternion, skin(scene, pose));
      EXPECT_LE(error, 1e-5) << (dualQuaternion ? "dual_quaternion" : "linear");
      worst = std::max(worst, error);
    }
    return worst;
  }

  std::filesystem::path data_;
  samples::OpenDevice* device_ = nullptr;
};

TEST_P(GoldenTest, EveryPoseAgrees) {
  std::size_t poses = 0;
  double worst = 0;
  // Poses of one model follow each other.
  std::filesystem::path loaded;
  Result<cli::Scene> scene = Error{};
  for (const nlohmann::json& entry : goldenManifest(data_)) {
    SCOPED_TRACE(entry["golden"].get<std::string>());
    const Golden golden = readGolden(data_ / "golden" / entry["golden"].get<std::string>());
    const std::filesystem::path model = data_ / "models" / entry["file"].get<std::string>();
    if (model != loaded) scene = cli::loadScene(loaded = model, {});
    ASSERT_TRUE(scene.ok()) << scene.error().message;
    std::string animation = entry["anim"].get<std::string>();
    if (animation == "-") animation = "none";
    const GoldenPose pose{model, animation, entry["time"].get<double>()};
    worst = std::max(worst, skinAndCompare(*scene, pose, golden));
    ++poses;
  }
  EXPECT_GE(poses, 76u);
  RecordProperty("worst", std::to_string(worst));
}

// Blender 3.4.1's armature modifier, preserve volume off, then on: an independent dual-quaternion
// skinner. Its floats, and the importer's, agree to 6e-6 of the figure's size.
TEST_P(GoldenTest, BlenderAgrees) {
  const Golden golden = readGolden(data_ / "golden" / "CesiumMan.blender.f64");
  const std::filesystem::path model = data_ / "models" / "CesiumMan/glTF-Binary/CesiumMan.glb";
  const Result<cli::Scene> scene = cli::loadScene(model, {});
  ASSERT_TRUE(scene.ok()) << scene.error().message;
  skinAndCompare(*scene, {model, "0", 0.37}, golden);
}

// From the options to the file, with the command itself.
TEST_P(GoldenTest, TheCommandWritesWhatAgrees) {
  const Golden golden = readGolden(data_ / "golden" / "CesiumMan.blender.f64");
  const std::filesystem::path model = data_ / "models" / "CesiumMan/glTF-Binary/CesiumMan.glb";
  for (const bool dualQuaternion : {false, true}) {
    std::string out = outFile("pose.ply");
    std::replace(out.begin() + static_cast<std::ptrdiff_t>(::testing::TempDir().size()), out.end(),
                 '/', '_');
    const CommandResult result =
        dermis({"skin", model.string(), "-o", out, "--animation", "0", "--time", "0.37", "--method",
                dualQuaternion ? "dual_quaternion" : "linear", "--device",
                isReference() ? "reference"
                : onDevice()  ? "auto"
                              : "cpu"});
    ASSERT_EQ(result.status, 0) << result.errors;
    const std::optional<Ply> ply = readPly(out);
    ASSERT_TRUE(ply.has_value()) << "the PLY file is not as it should be";
    std::vector<float> positions;
    for (const auto& position : ply->positions)
      positions.insert(positions.end(), position.begin(), position.end());
    EXPECT_LE(compareWith(golden, dualQuaternion, positions), 1e-5);
  }
}

INSTANTIATE_TEST_SUITE_P(Skinners, GoldenTest, ::testing::ValuesIn(skinnerNames()),
                         [](const auto& skinner) { return skinner.param; });

}  // namespace
}  // namespace dermis::test
