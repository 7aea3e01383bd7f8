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
  std::map<PlainKernel, std::unique_ptr<PlainScene>> plain;
  std::map<Method, std::unique_ptr<BenchScene>> scenes;
};

/// How far the plain kernel's floats are from those of Dermis, at most; NaN counts as infinitely
/// far.
double greatestDifference(std::span<const std::byte> plain, std::span<const std::byte> dermis,
                          bool ofPositions) {
  constexpr std::size_t stride = 24, positionSize = 12;
  double greatest = 0;
  for (std::size_t place = 0; place + 4 <= std::min(plain.size(), dermis.size()); place += 4) {
    if (ofPositions && place % stride >= positionSize) continue;
    float a, b;
    std::memcpy(&a, plain.data() + place, 4);
    std::memcpy(&b, dermis.data() + place, 4);
    const double difference = std::abs(static_cast<double>(a) - static_cast<double>(b));
    if (!(difference <= greatest)) greatest = std::isnan(difference) ? HUGE_VAL : difference;
  }
  return greatest;
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

/// A baseline that does not do the same work is none.
std::string disagreement(CrowdScenes& scenes, PlainKernel kernel) {
  if (kernel == PlainKernel::copy) return {};
  const Method method = kernel == PlainKernel::linear ? Method::linear : Method::dualQuaternion;
  const std::span<const std::byte> plain = scenes.plain.at(kernel)->output();
  const std::span<const std::byte> dermis = sceneOf(scenes, method).output();
  if (plain.size() != dermis.size()) return "the outputs differ in size";
  // The plain linear kernel's normals go by the blended matrix, which is not what they should.
  const double difference = greatestDifference(plain, dermis, kernel == PlainKernel::linear);
  if (difference <= 1e-4) return {};
  return "the plain kernel is " + std::to_string(difference) + " from Dermis";
}

void measurePlain(benchmark::State& state, CrowdScenes& scenes, PlainKernel kernel) {
  std::unique_ptr<PlainScene>& plain = scenes.plain[kernel];
  if (plain == nullptr) {
    plain = std::make_unique<PlainScene>(*benchDevice(), scenes.crowd, kernel);
    if (const std::string text = disagreement(scenes, kernel); !text.empty())
      return state.SkipWithError(text.c_str());
  }
  for ([[maybe_unused]] auto iteration : state) state.SetIterationTime(plain->skin());
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
void registerCrowd(const std::string& name, Result<Crowd> crowd, std::vector<Ratio>& ratios) {
  static std::vector<std::unique_ptr<CrowdScenes>> all;
  if (!crowd) {
    std::printf("%s: skipped: %s\n", name.c_str(), crowd.error().message.c_str());
    return;
  }
  std::printf("%s: '%s', %u vertices, %u joints\n", name.c_str(), crowd->name.c_str(),
              crowd->vertexCount(), crowd->jointCount());
  CrowdScenes& scenes = *all.emplace_back(std::make_unique<CrowdScenes>(std::move(*crowd)));
  for (const auto& [kernel, plain] : {std::pair{PlainKernel::dualQuaternion, "/plain"},
                                      {PlainKernel::linear, "/plain_linear"},
                                      {PlainKernel::copy, "/copy"}}) {
    add(name + plain, [&scenes, kernel = kernel](benchmark::State& state) {
      measurePlain(state, scenes, kernel);
    });
  }
  for (const Method method : {Method::dualQuaternion, Method::linear}) {
    add(name + "/" + std::string(methodName(method)),
        [&scenes, method](benchmark::State& state) { measure(state, scenes, method); });
  }
  ratios.push_back(
      {name + "/plain", name + "/dual_quaternion", name + ": the plain kernel / dual quaternions"});
  ratios.push_back(
      {name + "/plain_linear", name + "/linear", name + ": the plain linear kernel / linear"});
  ratios.push_back(
      {name + "/dual_quaternion", name + "/copy", name + ": dual quaternions / a copy"});
  ratios.push_back(
      {name + "/dual_quaternion", name + "/linear", name + ": dual quaternions / linear"});
}

}  // namespace

std::vector<Ratio> registerCrowdBenchmarks() {
  std::vector<Ratio> ratios;
  registerCrowd("crowd/1000_of_four_influences", longFigure(10'000, instanceCount), ratios);
  const std::filesystem::path models = test::sampleModels;
  registerCrowd("crowd/1000_figure", loadCrowd(models / "figure.glb", instanceCount), ratios);
  const std::string real = "crowd/1000_real_model";
  if (const test::TestData data = test::findTestData(); data.folder) {
    const std::filesystem::path model = *data.folder / "models/CesiumMan/glTF-Binary/CesiumMan.glb";
    registerCrowd(real, loadCrowd(model, instanceCount), ratios);
  } else {
    std::printf("%s: skipped: %s\n", real.c_str(), data.absence.c_str());
  }
  return ratios;
}

}  // namespace dermis::bench
