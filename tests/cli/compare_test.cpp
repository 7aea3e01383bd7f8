// `dermis compare`: numbers that are known from theory stand in its columns. What a method costs is
// the machine's affair: no test here asks for a time, other than that there is one. On a device:
// ComparisonCommandTest.

#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <fstream>
#include <iterator>
#include <map>
#include <nlohmann/json.hpp>
#include <numbers>
#include <set>
#include <string>
#include <utility>
#include <vector>

#include "dermis/layout.h"
#include "dermis_command.h"
#include "kit/method_rotation.h"
#include "ply.h"
#include "test_paths.h"

namespace dermis::test {
namespace {

const std::string barFile = std::string(sampleModels) + "/bar.glb";
const std::string arm = std::string(sampleModels) + "/arm.glb";

struct Compared {
  CommandResult result;
  nlohmann::json json;
  std::map<std::string, nlohmann::json> methods;
};

/// Runs `compare` with --json besides.
Compared compare(std::vector<std::string> arguments) {
  const std::string path = outFile("compare.json");
  arguments.insert(arguments.begin(), "compare");
  arguments.insert(arguments.end(), {"--json", path});
  Compared compared;
  compared.result = dermis(arguments);
  std::ifstream file(path);
  compared.json = nlohmann::json::parse(
      std::string(std::istreambuf_iterator<char>(file), std::istreambuf_iterator<char>()), nullptr,
      false);
  if (compared.json.is_object()) {
    for (const nlohmann::json& method : compared.json["methods"])
      compared.methods[method["method"].get<std::string>()] = method;
  }
  return compared;
}

double number(const Compared& compared, Method method, const char* group, const char* name) {
  return compared.methods.at(std::string(methodName(method)))[group][name].get<double>();
}

// TRUTHS.md, lines 9 to 11. Rings and sides are fine enough for 2e-4 of the volume.
TEST(CompareCommandTest, TheTubeKeepsWhatTheorySays) {
  const Compared compared = compare({barFile, "--device", "cpu"});
  ASSERT_EQ(compared.result.status, 0) << compared.result.errors;
  ASSERT_EQ(compared.methods.size(), allMethods.size());
  const auto twist = [&](Method method, const char* name) {
    return number(compared, method, "twist", name);
  };
  const auto bend = [&](Method method, const char* name) {
    return number(compared, method, "bend", name);
  };
  EXPECT_NEAR(twist(Method::linear, "radius"), 0.5, 1e-6);  // cos(60°)
  EXPECT_NEAR(twist(Method::linear, "volume"), 0.5, 2e-4);
  EXPECT_NEAR(bend(Method::linear, "section"), std::numbers::sqrt2 / 2, 1e-6);  // cos(45°)
  EXPECT_NEAR(bend(Method::linear, "volume"), 5.0 / 6, 2e-4);
  for (const Method method : {Method::dualQuaternion, Method::dualQuaternionIterative,
                              Method::logMatrix, Method::sphericalBlend}) {
    EXPECT_NEAR(twist(method, "radius"), 1, 1e-6) << methodName(method);
    EXPECT_NEAR(twist(method, "volume"), 1, 2e-4) << methodName(method);
    EXPECT_NEAR(bend(method, "section"), 1, 1e-6) << methodName(method);
    EXPECT_NEAR(bend(method, "volume"), 1, 2e-4) << methodName(method);
  }
  // Rotations about one axis, that the turned joint's translation does not move.
  EXPECT_NEAR(twist(Method::quaternionTranslation, "radius"), 1, 1e-6);
  EXPECT_NEAR(twist(Method::blended, "radius"), 0.75, 1e-6) << "half of either";
  // What centres of rotation are good for: no collapse, and less of a bulge.
  EXPECT_NEAR(twist(Method::centerOfRotation, "radius"), 1, 1e-6);
  EXPECT_NEAR(bend(Method::centerOfRotation, "section"), 1, 1e-6);
  const double bulge = bend(Method::dualQuaternion, "reach");
  EXPECT_GT(bulge, 1.3);
  EXPECT_LT(bend(Method::centerOfRotation, "reach"), bulge - 0.1);
  EXPECT_LT(bend(Method::bulgeControlled, "reach"), bulge - 0.1);
}

TEST(CompareCommandTest, SharesOfTheWholeMeshMoveTheirMethodsOnly) {
  const Compared none = compare({arm, "--time", "0.5", "--device", "cpu",
                                 "--dual-quaternion-weight", "0", "--bulge-strength", "0"});
  const Compared all = compare({arm, "--time", "0.5", "--device", "cpu", "--dual-quaternion-weight",
                                "1", "--bulge-strength", "1"});
  ASSERT_EQ(none.result.status, 0) << none.result.errors;
  ASSERT_EQ(all.result.status, 0) << all.result.errors;
  EXPECT_NEAR(number(none, Method::blended, "twist", "radius"), 0.5, 1e-6);
  EXPECT_NEAR(number(all, Method::blended, "twist", "radius"), 1, 1e-6);
  EXPECT_NEAR(number(none, Method::bulgeControlled, "bend", "reach"),
              number(none, Method::dualQuaternion, "bend", "reach"), 1e-9);
  EXPECT_LT(number(all, Method::bulgeControlled, "bend", "reach"),
            number(all, Method::dualQuaternion, "bend", "reach") - 0.1);
  EXPECT_EQ(number(none, Method::dualQuaternion, "bend", "reach"),
            number(all, Method::dualQuaternion, "bend", "reach"));
  // On the model too.
  EXPECT_NEAR(number(none, Method::blended, "difference", "largest"),
              number(none, Method::linear, "difference", "largest"), 1e-12);
  EXPECT_GT(number(none, Method::linear, "difference", "largest"), 1e-3);
  EXPECT_NEAR(number(all, Method::blended, "difference", "largest"), 0, 1e-12);
}

TEST(CompareCommandTest, TheReferenceIsNotTimed) {
  // It needs no driver.
  const CommandResult result =
      dermis({"compare", barFile, "--device", "reference"},
             {"VK_DRIVER_FILES=/nonexistent.json", "VK_ICD_FILENAMES=/nonexistent.json"});
  EXPECT_EQ(result.status, 0) << result.errors;
  EXPECT_NE(result.output.find("nothing"), std::string::npos) << result.output;
  const Compared compared = compare({barFile, "--device", "reference"});
  for (const auto& [name, method] : compared.methods) {
    EXPECT_TRUE(method["time"].is_null()) << name;
    EXPECT_GT(method["instructions"].get<int>(), 20) << name;
  }
}

TEST(CompareCommandTest, TheCpuTimesTheEverydayMethods) {
  const std::vector<std::string> noDriver{"VK_DRIVER_FILES=/nonexistent.json",
                                          "VK_ICD_FILENAMES=/nonexistent.json"};
  const CommandResult result = dermis(
      {"compare", barFile, "--device", "cpu", "--instances", "10", "--repetitions", "2"}, noDriver);
  EXPECT_EQ(result.status, 0) << result.errors;
  EXPECT_NE(result.output.find("one thread"), std::string::npos) << result.output;
  const Compared compared = compare({barFile, "--device", "cpu", "--instances", "10"});
  EXPECT_EQ(compared.json["clock"], "oneThread");
  EXPECT_EQ(compared.json["instances"], 10);
  for (const Method method : allMethods) {
    const nlohmann::json& own = compared.methods.at(std::string(methodName(method)));
    EXPECT_EQ(own["time"].is_null(), isForComparison(method)) << methodName(method);
    EXPECT_GT(own["instructions"].get<int>(), 20) << methodName(method);
  }
}

TEST(CompareCommandTest, WhatIsWrongHasItsStatus) {
  const std::string broken = outFile("broken.glb");
  std::ofstream(broken, std::ios::binary) << "glTF is not what this is";
  const std::string noSkin = outFile("noskin.gltf");
  std::ofstream(noSkin) << R"({"asset": {"version": "2.0"}})";
  const std::vector<std::pair<int, std::vector<std::string>>> wrong{
      {2, {"compare"}},
      {2, {"compare", barFile, "--device", "cpu", "--time", "nan"}},
      {2, {"compare", barFile, "--device", "cpu", "--animation", "7"}},
      {2, {"compare", barFile, "--device", "cpu", "--repetitions", "0"}},
      {2, {"compare", barFile, "--device", "cpu", "--repetitions", "-1"}},
      {2, {"compare", barFile, "--device", "cpu", "--repetitions", "100000"}},
      {2, {"compare", barFile, "--device", "cpu", "--instances", "0"}},
      {2, {"compare", barFile, "--device", "cpu", "--dual-quaternion-weight", "1.5"}},
      {2, {"compare", barFile, "--device", "cpu", "--bulge-strength", "-0.1"}},
      {2, {"compare", barFile, "--device", "cpu", "--bulge-strength", "nan"}},
      {2, {"skin", barFile, "-o", outFile("a.ply"), "--device", "cpu", "--bulge-strength", "2"}},
      {2,
       {"skin", barFile, "-o", outFile("a.ply"), "--device", "cpu", "--dual-quaternion-weight",
        "-1"}},
      {3, {"compare", broken}},
      {3, {"compare", noSkin}},
      {3, {"compare", outFile("does not exist.glb")}},
      {5, {"compare", barFile, "--device", "cpu", "--json", "/nonexistent/folder/out.json"}},
  };
  for (const auto& [status, arguments] : wrong) {
    const CommandResult result = dermis(arguments);
    SCOPED_TRACE(::testing::PrintToString(arguments));
    EXPECT_EQ(result.status, status);
    expectOneErrorLine(result);
  }
}

TEST(CompareCommandTest, AnUnknownDeviceEndsWithFour) {
  REQUIRE_DEVICE();
  const CommandResult result = dermis({"compare", barFile, "--device", "no such device"});
  EXPECT_EQ(result.status, 4);
  expectOneErrorLine(result);
}

TEST(CompareCommandTest, TooManyVerticesAreWrongUsage) {
  REQUIRE_DEVICE();
  const CommandResult result = dermis({"compare", barFile, "--instances", "4000000"});
  EXPECT_EQ(result.status, 2);
  expectOneErrorLine(result);
}

TEST(CompareCommandTest, SkinTakesEveryMethodAndNamesThemAll) {
  const CommandResult unknown =
      dermis({"skin", barFile, "-o", outFile("a.ply"), "--device", "cpu", "--method", "cubic"});
  EXPECT_EQ(unknown.status, 2);
  const CommandResult help = dermis({"skin", "--help"});
  EXPECT_EQ(help.status, 0);
  for (const Method method : allMethods) {
    const std::string name(methodName(method));
    EXPECT_NE(unknown.errors.find(name), std::string::npos) << unknown.errors;
    EXPECT_NE(help.output.find(name), std::string::npos) << help.output;
    const CommandResult result =
        dermis({"skin", barFile, "-o", outFile(name + ".ply"), "--time", "1", "--device",
                isForComparison(method) ? "reference" : "cpu", "--method", name});
    EXPECT_EQ(result.status, 0) << name << ": " << result.errors;
    EXPECT_TRUE(readPly(outFile(name + ".ply")).has_value()) << name;
  }
}

// `verify` does not try every method with every way to store.
TEST(CompareCommandTest, EveryMethodMeetsEveryValueOfEveryParameter) {
  DeviceLimits all;
  all.maxStorageBuffersPerStage = storageBuffersWanted;
  for (const DeviceLimits& limits : std::array{all, DeviceLimits{}}) {
    const std::vector<samples::OutputCase> outputs = samples::outputCases(limits);
    const std::vector<std::vector<Method>> methods = samples::shareOutMethods(outputs);
    ASSERT_EQ(methods.size(), outputs.size());
    std::map<std::pair<std::size_t, std::uint32_t>, std::set<Method>> met;
    std::size_t uses = 0;
    for (std::size_t output = 0; output < outputs.size(); ++output) {
      EXPECT_FALSE(methods[output].empty()) << outputs[output].name();
      const std::set<Method> once(methods[output].begin(), methods[output].end());
      EXPECT_EQ(once.size(), methods[output].size()) << outputs[output].name();
      uses += once.size();
      const std::vector<std::uint32_t> values = samples::parameterValues(outputs[output]);
      for (std::size_t parameter = 0; parameter < values.size(); ++parameter)
        met[{parameter, values[parameter]}].insert(once.begin(), once.end());
    }
    for (const auto& [value, by] : met) {
      EXPECT_EQ(by.size(), allMethods.size())
          << "parameter " << value.first << ", value " << value.second;
    }
    EXPECT_LE(uses, 3 * outputs.size()) << "that is what it is for";
  }
}

}  // namespace
}  // namespace dermis::test
