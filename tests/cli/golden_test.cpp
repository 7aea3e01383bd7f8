// Poses from other programs: every line of golden/manifest.jsonl, both methods, through `dermis
// skin`.

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <fstream>
#include <nlohmann/json.hpp>

#include "ply.h"
#include "run_command.h"
#include "test_data.h"
#include "test_device.h"
#include "test_paths.h"

namespace dermis::test {
namespace {

struct Golden {
  std::vector<double> values;  ///< linear positions, then dual-quaternion positions
  std::size_t vertices() const { return values.size() / 6; }
  double at(bool dualQuaternion, std::size_t vertex, std::size_t axis) const {
    return values[(dualQuaternion ? values.size() / 2 : 0) + vertex * 3 + axis];
  }
  /// The diagonal of the linear positions' box plus the largest coordinate.
  double size() const {
    double diagonal = 0, largest = 0;
    for (std::size_t axis = 0; axis < 3; ++axis) {
      double low = HUGE_VAL, high = -HUGE_VAL;
      for (std::size_t vertex = 0; vertex < vertices(); ++vertex) {
        const double value = at(false, vertex, axis);
        if (std::isnan(value)) continue;
        low = std::min(low, value);
        high = std::max(high, value);
        largest = std::max(largest, std::abs(value));
      }
      diagonal = std::hypot(diagonal, high - low);
    }
    return diagonal + largest;
  }
};

Golden readGolden(const std::filesystem::path& path) {
  Golden golden;
  std::ifstream file(path, std::ios::binary);
  for (double value; file.read(reinterpret_cast<char*>(&value), sizeof(value));)
    golden.values.push_back(value);
  return golden;
}

/// The largest distance over the model's size.
double skinAndCompare(const std::filesystem::path& model, const std::string& animation,
                      const std::string& time, bool dualQuaternion, const std::string& device,
                      const Golden& golden) {
  // Of the running test alone: others may run at the same time.
  std::string test = ::testing::UnitTest::GetInstance()->current_test_info()->name();
  std::replace(test.begin(), test.end(), '/', '_');
  const std::string out = ::testing::TempDir() + "golden_" + test + ".ply";
  const CommandResult result = runCommand(
      {dermisProgram, "skin", model.string(), "-o", out, "--animation", animation, "--time", time,
       "--method", dualQuaternion ? "dual_quaternion" : "linear", "--device", device});
  EXPECT_EQ(result.status, 0) << result.errors;
  const std::optional<Ply> ply = readPly(out);
  if (!ply || ply->positions.size() != golden.vertices()) {
    ADD_FAILURE() << "the PLY file is not as it should be";
    return HUGE_VAL;
  }
  double worst = 0;
  for (std::size_t vertex = 0; vertex < golden.vertices(); ++vertex) {
    double squared = 0;
    for (std::size_t axis = 0; axis < 3; ++axis) {
      const double difference = golden.at(dualQuaternion, vertex, axis) -
                                static_cast<double>(ply->positions[vertex][axis]);
      squared += difference * difference;
      // NaN stands where the file's own weights are NaN; what we write must be finite even there.
      EXPECT_TRUE(std::isfinite(ply->positions[vertex][axis])) << "vertex " << vertex;
    }
    if (!std::isnan(squared)) worst = std::max(worst, std::sqrt(squared));
  }
  return worst / golden.size();
}

class GoldenTest : public ::testing::TestWithParam<const char*> {
 protected:
  void SetUp() override {
    const std::optional<std::filesystem::path> data = testDataFolder();
    if (!data) GTEST_SKIP() << noTestData;
    data_ = *data;
    std::string reason;
    if (std::string(GetParam()) != "cpu" && testDevice(true, reason) == nullptr) {
      ASSERT_FALSE(isContinuousIntegration()) << reason;
      GTEST_SKIP() << reason;
    }
  }

  std::filesystem::path data_;
};

TEST_P(GoldenTest, EveryPoseAgrees) {
  std::ifstream manifest(data_ / "golden" / "manifest.jsonl");
  std::size_t poses = 0;
  double worst = 0;
  for (std::string line; std::getline(manifest, line);) {
    const nlohmann::json entry = nlohmann::json::parse(line);
    const Golden golden = readGolden(data_ / "golden" / entry["golden"].get<std::string>());
    std::string animation = entry["anim"].get<std::string>();
    if (animation == "-") animation = "none";
    SCOPED_TRACE(line.substr(0, 160));
    for (const bool dualQuaternion : {false, true}) {
      const double error =
          skinAndCompare(data_ / "models" / entry["file"].get<std::string>(), animation,
                         entry["time"].dump(), dualQuaternion, GetParam(), golden);
      EXPECT_LE(error, 1e-5) << (dualQuaternion ? "dual_quaternion" : "linear");
      worst = std::max(worst, error);
    }
    ++poses;
  }
  EXPECT_GE(poses, 76u);
  RecordProperty("worst", std::to_string(worst));
}

// Blender 3.4.1's armature modifier, preserve volume off, then on: an independent dual-quaternion
// skinner. Its floats, and the importer's, agree to 6e-6 of the figure's size.
TEST_P(GoldenTest, BlenderAgrees) {
  const Golden golden = readGolden(data_ / "golden" / "CesiumMan.blender.f64");
  for (const bool dualQuaternion : {false, true}) {
    EXPECT_LE(skinAndCompare(data_ / "models" / "CesiumMan/glTF-Binary/CesiumMan.glb", "0", "0.37",
                             dualQuaternion, GetParam(), golden),
              1e-5);
  }
}

INSTANTIATE_TEST_SUITE_P(Devices, GoldenTest, ::testing::Values("cpu", "auto"),
                         [](const ::testing::TestParamInfo<const char*>& device) {
                           return std::string(device.param);
                         });

}  // namespace
}  // namespace dermis::test
