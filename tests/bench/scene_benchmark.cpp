// What a scene costs the CPU, without a device: changes by one call for each instance and by one
// call for all, and plans of frames in which all instances move, or none.

#include <benchmark/benchmark.h>

#include <cstdint>
#include <cstdlib>
#include <vector>

#include "dermis/scene.h"

namespace dermis::bench {
namespace {

constexpr std::uint32_t jointCount = 24;

/// A scene of many instances. They share one mesh; each has its own pose.
struct Crowd {
  explicit Crowd(std::uint32_t count) {
    MeshInfo info;
    info.vertexCount = 1000;
    info.requiredJoints = jointCount;
    info.maxInfluences = 4;
    info.byteSize = 1 << 16;
    const MeshHandle mesh = *scene.addMesh(info);
    for (std::uint32_t i = 0; i < count; ++i) {
      poses.push_back(*scene.addPose(jointCount));
      InstanceDescription description;
      description.mesh = mesh;
      description.pose = poses.back();
      instances.push_back(*scene.addInstance(description));
    }
    runFrame();
  }
  static SceneDescription description() {
    SceneDescription description;
    description.jointCapacity = Capacity::fixed(10'000 * jointCount);
    description.instanceCapacity = Capacity::fixed(10'000);
    description.outputCapacity = Capacity::fixed(std::uint64_t{10'000} * 1000 * 12);
    description.limits.maxStorageBufferRange = 1u << 30;
    return description;
  }
  void runFrame() {
    ++frame;
    if (!scene.beginFrame(frame, frame - 1) || !scene.plan(plan) || !scene.commit()) std::abort();
  }

  Scene scene = *Scene::create(description());
  std::vector<PoseHandle> poses;
  std::vector<InstanceHandle> instances;
  Plan plan;
  std::uint64_t frame = 0;
};

/// Shows or hides every instance and sets its interval, as engines do after culling.
void changeOneByOne(benchmark::State& state) {
  Crowd crowd(static_cast<std::uint32_t>(state.range(0)));
  bool isVisible = true;
  for ([[maybe_unused]] auto iteration : state) {
    isVisible = !isVisible;
    InstanceChange change;
    change.visible = isVisible;
    change.updateInterval = isVisible ? 1 : 2;
    for (const InstanceHandle instance : crowd.instances) {
      change.instance = instance;
      if (!crowd.scene.change(change)) return state.SkipWithError("a change failed");
    }
  }
  state.SetItemsProcessed(state.iterations() * state.range(0));
}

void setVisibility(benchmark::State& state) {
  Crowd crowd(static_cast<std::uint32_t>(state.range(0)));
  std::vector<InstanceVisibility> views(crowd.instances.size());
  bool isVisible = true;
  for ([[maybe_unused]] auto iteration : state) {
    isVisible = !isVisible;
    for (std::size_t i = 0; i < views.size(); ++i)
      views[i] = {crowd.instances[i], isVisible, isVisible ? 1u : 2u};
    if (!crowd.scene.setVisibility(views)) return state.SkipWithError("a change failed");
  }
  state.SetItemsProcessed(state.iterations() * state.range(0));
}

void planFrames(benchmark::State& state, bool moves) {
  Crowd crowd(static_cast<std::uint32_t>(state.range(0)));
  for ([[maybe_unused]] auto iteration : state) {
    state.PauseTiming();
    ++crowd.frame;
    if (!crowd.scene.beginFrame(crowd.frame, crowd.frame - 1)) std::abort();
    for (const PoseHandle pose : crowd.poses) {
      if (moves && !crowd.scene.writePose(pose)) std::abort();
    }
    state.ResumeTiming();
    if (!crowd.scene.plan(crowd.plan) || !crowd.scene.commit())
      return state.SkipWithError("a plan failed");
  }
  state.SetItemsProcessed(state.iterations() * state.range(0));
}

BENCHMARK(changeOneByOne)->Name("scene/change_one_by_one")->Arg(10'000);
BENCHMARK(setVisibility)->Name("scene/set_visibility")->Arg(10'000);
BENCHMARK_CAPTURE(planFrames, all, true)
    ->Name("scene/plan_all_move")
    ->Arg(1)
    ->Arg(1000)
    ->Arg(10'000);
BENCHMARK_CAPTURE(planFrames, none, false)->Name("scene/plan_none_moves")->Arg(1)->Arg(10'000);

}  // namespace
}  // namespace dermis::bench
