// How `dermis verify` shares its cases out among threads, and which cases it has.

#include <gtest/gtest.h>

#include <array>
#include <atomic>
#include <chrono>
#include <cmath>
#include <iterator>
#include <map>
#include <memory>
#include <nlohmann/json.hpp>
#include <set>
#include <span>
#include <stdexcept>
#include <string>
#include <thread>
#include <tuple>
#include <vector>

#include "dermis_command.h"
#include "gltf_builder.h"
#include "kit/batch_runner.h"
#include "kit/clip_check.h"
#include "kit/verification_product.h"

namespace dermis::test {
namespace {

const std::string barModel = std::string(sampleModels) + "/bar.glb";

std::shared_ptr<samples::BatchTarget> makeTarget() {
  return std::make_shared<samples::CpuTarget>();
}

TEST(TargetPoolTest, EachTaskRunsOnceWithATargetOfItsThread) {
  samples::TargetPool pool(makeTarget(), makeTarget, 3);
  std::array<std::atomic<int>, 100> ran{};
  std::array<std::atomic<samples::BatchTarget*>, 7> pinned{};
  std::size_t done = 0;
  for (int round = 0; round < 4; ++round) {
    const Result<void> result =
        pool.run({.tasks = ran.size(), .pinnedTasks = pinned.size(), .done = [&done] { ++done; }},
                 [&](std::size_t index, samples::BatchTarget& target) -> Result<void> {
                   ++ran[index];
                   if (index < pinned.size()) {
                     samples::BatchTarget* before = pinned[index].exchange(&target);
                     EXPECT_TRUE(before == nullptr || before == &target) << index;
                   }
                   return {};
                 });
    EXPECT_TRUE(result);
  }
  EXPECT_EQ(done, 4 * ran.size());
  for (const std::atomic<int>& times : ran) EXPECT_EQ(times, 4);
  const std::set<samples::BatchTarget*> used(pinned.begin(), pinned.end());
  EXPECT_EQ(used.size(), 3u);
}

// What is reported does not depend on which thread was first.
TEST(TargetPoolTest, TheFirstErrorInTheirOrderIsReported) {
  samples::TargetPool pool(makeTarget(), makeTarget, 2);
  std::atomic<bool> tenRuns = false;
  const Result<void> result =
      pool.run({.tasks = 40, .pinnedTasks = 5},
               [&](std::size_t index, samples::BatchTarget&) -> Result<void> {
                 if (index < 9) return {};
                 // 9 ends while 10 runs.
                 if (index == 9) tenRuns.wait(false);
                 if (index == 10) {
                   tenRuns = true;
                   tenRuns.notify_all();
                   std::this_thread::sleep_for(std::chrono::milliseconds(50));
                 }
                 return Error{ErrorCode::invalidMesh, std::to_string(index)};
               });
  ASSERT_FALSE(result);
  EXPECT_EQ(result.error().message, "9");
}

TEST(TargetPoolTest, WhatATaskThrowsIsThrownAgain) {
  samples::TargetPool pool(makeTarget(), makeTarget, 2);
  const auto fail = [](std::size_t, samples::BatchTarget&) -> Result<void> {
    throw std::length_error("too long");
  };
  EXPECT_THROW((void)pool.run({.tasks = 8}, fail), std::length_error);
}

TEST(TargetPoolTest, DoesWithoutTargetsThatCannotBeMade) {
  int asked = 0;
  samples::TargetPool pool(
      makeTarget(),
      [&asked]() -> Result<std::shared_ptr<samples::BatchTarget>> {
        if (++asked == 2) return Error{ErrorCode::vulkanError, "no more devices"};
        return makeTarget();
      },
      8);
  std::atomic<int> ran = 0;
  for (int round = 0; round < 2; ++round) {
    EXPECT_TRUE(pool.run({.tasks = 20}, [&ran](std::size_t, samples::BatchTarget&) -> Result<void> {
      ++ran;
      return {};
    }));
  }
  EXPECT_EQ(ran, 40);
  EXPECT_EQ(asked, 2);
}

/// With 1 and 3 threads the reports and the output are equal. Returns the path of one in JSON.
std::string expectTheSameInThreads(std::vector<std::string> command) {
  const std::string json = outFile("verify.json"), junit = outFile("verify.xml");
  command.insert(command.end(), {"--json", json, "--junit", junit, "--threads", "1"});
  const CommandResult one = dermis(command);
  const std::string jsonOfOne = readText(json), junitOfOne = readText(junit);
  EXPECT_EQ(one.status, 0) << one.output << one.errors;
  EXPECT_GT(jsonOfOne.size(), 1000u);
  command.back() = "3";
  const CommandResult three = dermis(command);
  EXPECT_EQ(three.status, 0) << three.output << three.errors;
  EXPECT_EQ(three.output, one.output);
  EXPECT_EQ(readText(json), jsonOfOne);
  EXPECT_EQ(readText(junit), junitOfOne);
  return json;
}

/// With the methods of a device, which it is not.
struct EveryMethod : samples::CpuTarget {
  std::span<const Method> methods() const override { return allMethods; }
  DeviceLimits limits() const override {
    DeviceLimits limits;
    limits.maxStorageBuffersPerStage = storageBuffersWanted;
    return limits;
  }
};

/// How many values of another parameter a method meets.
template <typename ValueOf>
std::size_t valuesBeside(Method method, std::span<const samples::RandomCase> cases,
                         ValueOf valueOf) {
  std::set<decltype(valueOf(cases[0]))> values;
  for (const samples::RandomCase& one : cases) {
    if (one.method == method) values.insert(valueOf(one));
  }
  return values.size();
}

// Of the formats that a vertex without gaps may have, each with each.
TEST(VerificationTest, OutputCasesCombineEveryTwoFormats) {
  DeviceLimits limits;
  limits.maxStorageBuffersPerStage = storageBuffersWanted;
  std::set<std::tuple<int, VertexFormat, VertexFormat>> pairs;
  for (const samples::OutputCase& output : samples::outputCases(limits)) {
    SCOPED_TRACE(output.name());
    const samples::OutputLayout& layout = output.layout;
    const std::uint32_t length =
        formatSize(layout.positions) + formatSize(layout.normals) + formatSize(layout.tangents);
    EXPECT_EQ(length % 4, 0u);
    EXPECT_TRUE(!layout.motion || formatSize(layout.positions) % 4 == 0);
    pairs.insert({0, layout.positions, layout.normals});
    pairs.insert({1, layout.positions, layout.tangents});
    pairs.insert({2, layout.normals, layout.tangents});
  }
  EXPECT_EQ(pairs.size(), 6u * 10 + 6 * 7 + 10 * 7);
}

// What a kernel is chosen by, and what it branches on.
TEST(VerificationTest, QuickCasesMeetEveryMethod) {
  const EveryMethod target;
  const std::vector<samples::RandomCase> quick =
      samples::randomCases(target, samples::Coverage::quick);
  EXPECT_LE(quick.size(), samples::randomCases(target).size() / 2);
  for (const Method method : allMethods) {
    SCOPED_TRACE(methodName(method));
    using Case = samples::RandomCase;
    EXPECT_EQ(valuesBeside(method, quick, [](const Case& c) { return c.output.layout.positions; }),
              3u);
    EXPECT_EQ(valuesBeside(method, quick, [](const Case& c) { return c.output.layout.normals; }),
              3u);
    EXPECT_EQ(valuesBeside(method, quick, [](const Case& c) { return c.output.layout.tangents; }),
              3u);
    EXPECT_EQ(valuesBeside(method, quick, [](const Case& c) { return c.output.layout.motion; }),
              2u);
    EXPECT_EQ(valuesBeside(method, quick, [](const Case& c) { return c.output.layout.bounds; }),
              2u);
    EXPECT_EQ(valuesBeside(method, quick, [](const Case& c) { return c.influences; }), 3u);
    EXPECT_EQ(valuesBeside(method, quick, [](const Case& c) { return c.rigidity; }), 3u);
    EXPECT_GT(valuesBeside(method, quick, [](const Case& c) { return c.morphs; }), 1u);
  }
}

/// How many cases a report has of each method.
std::map<std::string, std::size_t> casesByMethod(const std::string& json) {
  std::map<std::string, std::size_t> count;
  const nlohmann::json report = nlohmann::json::parse(readText(json));
  for (const nlohmann::json& model : report.at("models")) {
    for (const nlohmann::json& one : model.at("cases")) ++count[one.at("method")];
  }
  return count;
}

/// Clips of a model: all have one channel.
void addClip(FileBuilder& file, const char* name, int node, const char* path,
             const std::vector<float>& times, std::size_t values) {
  file.json["animations"].push_back(
      {{"name", name},
       {"samplers", {{{"input", file.addFloats(times, "SCALAR")}, {"output", values}}}},
       {"channels", {{{"sampler", 0}, {"target", {{"node", node}, {"path", path}}}}}}});
}

/// Writes a figure with a morph target, a clip that turns it and one that grows its target.
std::string modelWithClips(const std::string& name) {
  FileBuilder file = skinnedTriangle();
  file.primitive()["targets"] = {
      {{"POSITION", file.addFloats({0, 0, 1, 0, 0, 1, 0, 0, 1}, "VEC3")}}};
  file.json["skins"][0]["name"] = "figure";
  addClip(file, "bend", 2, "rotation", {0, 1},
          file.addFloats({0, 0, 0, 1, 0.6f, 0, 0, 0.8f}, "VEC4"));
  addClip(file, "grow", 0, "weights", {0, 2}, file.addFloats({0.25f, 0.75f}, "SCALAR"));
  return file.writtenTo(outFile(name));
}

// Each of the threads opens the device. That the report is the same for any number of them is
// tested on the CPU below.
TEST(VerificationTest, QuickSkinsWithEveryMethodOfTheDeviceInThreads) {
  REQUIRE_DEVICE();
  const std::string json = outFile("quick.json");
  const CommandResult result = dermis({"verify", modelWithClips("quick.gltf"), "--random",
                                       "--quick", "--json", json, "--threads", "3"});
  EXPECT_EQ(result.status, 0) << result.output << result.errors;
  EXPECT_NE(readText(json).find("\"morph weights\""), std::string::npos);
  const std::map<std::string, std::size_t> count = casesByMethod(json);
  for (const Method method : allMethods)
    EXPECT_TRUE(count.contains(std::string(methodName(method)))) << methodName(method);
}

TEST(VerificationTest, QuickLeavesOutCasesOfAModelToo) {
  const std::string json = outFile("all.json"), quickJson = outFile("quick_bar.json");
  EXPECT_EQ(dermis({"verify", barModel, "--device", "cpu", "--json", json}).status, 0);
  EXPECT_EQ(dermis({"verify", barModel, "--quick", "--device", "cpu", "--json", quickJson}).status,
            0);
  const std::map<std::string, std::size_t> all = casesByMethod(json),
                                           quick = casesByMethod(quickJson);
  ASSERT_EQ(quick.size(), all.size());
  for (const auto& [method, count] : quick) EXPECT_LT(count, all.at(method)) << method;
}

TEST(VerificationTest, ThreadsChangeNothingOnTheCpu) {
  expectTheSameInThreads({"verify", barModel, "--random", "--device", "cpu"});
}

TEST(VerificationTest, ClipsAreVerifiedAsScenesPlayThem) {
  const std::string model = modelWithClips("clips.gltf");
  const std::string json = outFile("clips.json"), junit = outFile("clips.xml");
  const CommandResult result =
      dermis({"verify", model, "--device", "cpu", "--json", json, "--junit", junit});
  EXPECT_EQ(result.status, 0) << result.output << result.errors;

  std::map<std::string, std::set<std::string>> parts;  // by pose
  std::set<std::string> skinnedPoses, skinnedBy;
  std::uint64_t points = 0;
  double worst = 0;
  const nlohmann::json report = nlohmann::json::parse(readText(json));
  for (const nlohmann::json& one : report.at("models")[0].at("cases")) {
    if (one.at("variant") == "in the sampled pose") {
      EXPECT_EQ(one.at("vertices"), 3) << one;
      skinnedPoses.insert(one.at("pose").get<std::string>());
      skinnedBy.insert(one.at("method").get<std::string>());
    }
    if (one.at("method") != "clips") continue;
    EXPECT_GT(one.at("points").get<int>(), 0) << one;
    points += one.at("points").get<std::uint64_t>();
    worst = std::max(worst, one.at("worstPositionOfBound").get<double>());
    parts[one.at("pose")].insert(one.at("mesh").get<std::string>() + ", " +
                                 one.at("variant").get<std::string>());
  }
  for (const char* pose :
       {"rest pose", "clip 0 'bend' at 0 s", "clip 0 'bend' at 0.31 s", "clip 1 'grow' at 3.54 s",
        "clip 1 'grow' at 3.54 s, held",
        "clip 0 'bend' at 0.31 s, weight 0.25 + clip 1 'grow' at 1.54 s, weight 0.75, mask 1",
        "clip 1 'grow' at 1.54 s, weight 0.75, mask 1 + additive clip 0 'bend' at 0.4 s"}) {
    EXPECT_EQ(parts[pose],
              (std::set<std::string>{"skin 0 'figure', joint matrices", "node 0, morph weights"}))
        << pose;
  }
  EXPECT_EQ(parts.size(), 13u);
  EXPECT_EQ(skinnedPoses.size(), 13u);
  EXPECT_EQ(skinnedBy.size(), samples::CpuTarget().methods().size());
  EXPECT_GT(worst, 0);
  const std::string line = "passed  " + model + "  clips: 13 plays, " + std::to_string(points) +
                           " points and morph weights compared; worst ";
  EXPECT_NE(result.output.find(line), std::string::npos) << result.output;
  EXPECT_NE(readText(junit).find("<testcase classname=\"dermis.verify.clips\" name=\"node 0, clip "
                                 "1 'grow' at 0 s, morph weights\"/>"),
            std::string::npos);
}

TEST(VerificationTest, ClipsThatCannotBePackedAreAWarning) {
  FileBuilder file = skinnedTriangle();
  // For so long a clip, keys cannot be near enough to each other.
  addClip(file, "fast", 2, "rotation", {0, 0.001f, 0.002f, 5000},
          file.addFloats({0, 0, 0, 1, 1, 0, 0, 0, 0, 0, 0, 1, 0, 0, 0, 1}, "VEC4"));
  const std::string json = outFile("fast.json");
  const CommandResult result = dermis({"verify", file.writtenTo(outFile("fast.gltf")), "--quick",
                                       "--device", "cpu", "--json", json});
  EXPECT_EQ(result.status, 0) << result.output << result.errors;
  EXPECT_NE(result.errors.find("clips are not verified: "), std::string::npos) << result.errors;
  EXPECT_FALSE(casesByMethod(json).contains("clips"));
}

TEST(VerificationTest, PosesAndWeightsAwayFromTheClipsAreFound) {
  const std::array<std::uint32_t, 2> joints{0, 1};
  std::array<JointMatrix, 2> inverseBind, pose;
  const SkeletonSkin skin{"skin", joints, inverseBind};
  reference::SampledPose expected;
  expected.joints.resize(2, {{{1, 0, 0, 0}, {0, 1, 0, 0}, {0, 0, 1, 0}}});
  expected.bounds = {{0.1, 0.01}, {0.1, 0.01}};
  const auto compare = [&] { return samples::comparePose(pose, expected, skin); };
  EXPECT_TRUE(compare().passed());
  EXPECT_EQ(compare().compared, 8u);
  pose[1].m[0][3] = 0.09f;
  EXPECT_TRUE(compare().passed());
  pose[1].m[0][3] = 0.11f;
  pose[1].m[2][1] = 0.02f;
  EXPECT_EQ(compare().failures, 2u);
  EXPECT_EQ(compare().firstFailure, 1u);
  EXPECT_NEAR(compare().worstPosition, 2, 1e-6);
  pose[1].m[2][1] = NAN;
  EXPECT_GT(compare().failures, 0u);
  // Without an inverse: only finite.
  expected.bounds[1] = {1e30, HUGE_VAL};
  EXPECT_EQ(compare().failures, 1u);
  // Out of range: anything.
  expected.bounds[1] = {HUGE_VAL, HUGE_VAL};
  EXPECT_TRUE(compare().passed());
  EXPECT_EQ(compare().exempt.outOfRange, 1u);
  expected.bounds[1] = {1e30, HUGE_VAL};
  pose[1].m[2][1] = 5;
  EXPECT_TRUE(compare().passed());
  EXPECT_EQ(compare().exempt.onlyFinite, 1u);

  const std::array<float, 2> weights{0.5f, 0.25f};
  EXPECT_TRUE(samples::compareWeights(weights, {{0.5, 0.2}, {0.1, 0.1}}).passed());
  const Comparison wrong = samples::compareWeights(weights, {{0.5, 0.1}, {0.1, 0.1}});
  EXPECT_EQ(wrong.failures, 1u);
  EXPECT_EQ(wrong.firstFailure, 1u);
}

}  // namespace
}  // namespace dermis::test
