#include "crowd_benchmark.h"

#include <benchmark/benchmark.h>

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <cstring>
#include <filesystem>
#include <functional>
#include <map>
#include <memory>
#include <optional>
#include <string>

#include "bench_scene.h"
#include "crowd.h"
#include "plain_scene.h"
#include "test_data_folder.h"
#include "test_paths.h"

namespace dermis::bench {
namespace {

constexpr std::uint32_t instanceCount = 1000;

/// A crowd on the device, in every way in which it is skinned: made once, since that takes longer
/// than a measurement.
struct CrowdScenes {
  explicit CrowdScenes(Crowd loaded) : crowd(std::move(loaded)) {}

  Crowd crowd;
  std::unique_ptr<PlainScene> plain;
  std::map<Method, std::unique_ptr<BenchScene>> scenes;
};

/// How far the plain kernel's floats are from those of Dermis, at most; NaN counts as infinitely
/// far.
double greatestDifference(std::span<const std::byte> plain, std::span<const std::byte> dermis) {
  double greatest = 0;
  for (std::size_t place = 0; place + 4 <= std::min(plain.size(), dermis.size()); place += 4) {
    float a, b;
    std::memcpy(&a, plain.data() + place, 4);
    std::memcpy(&b, dermis.data() + place, 4);
    const double difference = std::abs(static_cast<double>(a) - static_cast<double>(b));
    if (!(difference <= greatest)) greatest = std::isnan(difference) ? HUGE_VAL : difference;
  }
  return greatest;
}

/// A baseline that does not do the same work is none.
std::string disagreement(const CrowdScenes& scenes) {
  const std::span<const std::byte> plain = scenes.plain->output();
  const std::span<const std::byte> dermis = scenes.scenes.at(Method::dualQuaternion)->output();
  if (plain.size() != dermis.size()) return "the outputs differ in size";
  const double difference = greatestDifference(plain, dermis);
  if (difference <= 1e-4) return {};
  return "the plain kernel is " + std::to_string(difference) + " from Dermis";
}

BenchScene& sceneOf(CrowdScenes& scenes, Method method) {
  std::unique_ptr<BenchScene>& scene = scenes.scenes[method];
  if (scene == nullptr) {
    samples::OpenDevice& open = *benchDevice();
    scene = std::make_unique<BenchScene>(open, scenes.crowd.requests(method),
                                         samples::OutputLayout(), open.context.tuning());
  }
  return *scene;
}

void count(benchmark::State& state, const Crowd& crowd) {
  const double vertices = static_cast<double>(crowd.vertexCount()) * crowd.instanceCount();
  state.counters["vertices/s"] =
      benchmark::Counter(vertices, benchmark::Counter::kIsIterationInvariantRate);
}

void measurePlain(benchmark::State& state, CrowdScenes& scenes) {
  if (scenes.plain == nullptr) {
    scenes.plain = std::make_unique<PlainScene>(*benchDevice(), scenes.crowd);
    sceneOf(scenes, Method::dualQuaternion);
    if (const std::string text = disagreement(scenes); !text.empty())
      return state.SkipWithError(text.c_str());
  }
  for ([[maybe_unused]] auto iteration : state) state.SetIterationTime(scenes.plain->skin());
  count(state, scenes.crowd);
}

void measure(benchmark::State& state, CrowdScenes& scenes, Method method) {
  BenchScene& scene = sceneOf(scenes, method);
  for ([[maybe_unused]] auto iteration : state) state.SetIterationTime(scene.skin());
  count(state, scenes.crowd);
}

void add(const std::string& name, std::function<void(benchmark::State&)> run) {
  benchmark::RegisterBenchmark(name.c_str(), std::move(run))
      ->UseManualTime()
      ->Unit(benchmark::kMillisecond);
}

/// The crowd lives until the process ends: its benchmarks refer to it.
void registerCrowd(const std::string& name, const std::filesystem::path& path,
                   std::vector<Ratio>& ratios) {
  static std::vector<std::unique_ptr<CrowdScenes>> all;
  Result<Crowd> crowd = loadCrowd(path, instanceCount);
  if (!crowd) {
    std::printf("%s: skipped: %s\n", name.c_str(), crowd.error().message.c_str());
    return;
  }
  std::printf("%s: '%s', %u vertices, %u joints\n", name.c_str(), crowd->name.c_str(),
              crowd->vertexCount(), crowd->jointCount());
  CrowdScenes& scenes = *all.emplace_back(std::make_unique<CrowdScenes>(std::move(*crowd)));
  add(name + "/plain", [&scenes](benchmark::State& state) { measurePlain(state, scenes); });
  for (const Method method : {Method::dualQuaternion, Method::linear}) {
    add(name + "/" + std::string(methodName(method)),
        [&scenes, method](benchmark::State& state) { measure(state, scenes, method); });
  }
  ratios.push_back(
      {name + "/plain", name + "/dual_quaternion", name + ": the plain kernel / dual quaternions"});
  ratios.push_back(
      {name + "/dual_quaternion", name + "/linear", name + ": dual quaternions / linear"});
}

}  // namespace

std::vector<Ratio> registerCrowdBenchmarks() {
  std::vector<Ratio> ratios;
  registerCrowd("crowd/1000_figure", std::filesystem::path(test::sampleModels) / "figure.glb",
                ratios);
  const std::string real = "crowd/1000_real_model";
  if (const test::TestData data = test::findTestData(); data.folder) {
    registerCrowd(real, *data.folder / "models/CesiumMan/glTF-Binary/CesiumMan.glb", ratios);
  } else {
    std::printf("%s: skipped: %s\n", real.c_str(), data.absence.c_str());
  }
  return ratios;
}

}  // namespace dermis::bench
