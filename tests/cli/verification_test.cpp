// How `dermis verify` shares its cases out among threads.

#include <gtest/gtest.h>

#include <array>
#include <atomic>
#include <chrono>
#include <fstream>
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
#include "kit/batch_runner.h"
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

std::string readText(const std::string& path) {
  std::ifstream file(path);
  return {std::istreambuf_iterator<char>(file), std::istreambuf_iterator<char>()};
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

TEST(VerificationTest, QuickSkinsWithEveryMethodOfTheDeviceInAnyNumberOfThreads) {
  REQUIRE_DEVICE();
  const std::string json = expectTheSameInThreads({"verify", "--quick"});
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

}  // namespace
}  // namespace dermis::test
