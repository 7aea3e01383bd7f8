// What a scene costs the CPU, without a device: changes by one call for each instance and by one
// call for all, and plans of frames in which all instances move, or none.

#include <benchmark/benchmark.h>

#include <cstddef>
#include <cstdint>
#include <cstdlib>
#include <map>
#include <vector>

#include "planned_scene.h"

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
    const MeshHandle mesh = *planned.addMesh(info);
    for (std::uint32_t i = 0; i < count; ++i) {
      poses.push_back(*scene.addPose(jointCount));
      InstanceDescription description;
      description.mesh = mesh;
      description.pose = poses.back();
      instances.push_back(*scene.addInstance(description));
    }
    runFrame();
  }
  static SceneCommandsDescription description() {
    SceneCommandsDescription description;
    description.scene.jointCapacity = Capacity::fixed(10'000 * jointCount);
    description.scene.instanceCapacity = Capacity::fixed(10'000);
    description.scene.outputCapacity = Capacity::fixed(std::uint64_t{10'000} * 1000 * 12);
    description.limits.maxStorageBufferRange = 1u << 30;
    return description;
  }
  void runFrame() {
    ++frame;
    if (!scene.beginFrame(frame, frame - 1) || !planned.plan() || !planned.commit()) std::abort();
  }

  test::PlannedScene planned{description()};
  Scene& scene = planned.scene();
  std::vector<PoseHandle> poses;
  std::vector<InstanceHandle> instances;
  std::vector<std::byte> mapped = std::vector<std::byte>(4 << 20);  ///< lent for the tables
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
    if (!crowd.planned.planOnce(crowd.mapped) || !crowd.planned.commit())
      return state.SkipWithError("a plan failed");
  }
  state.SetItemsProcessed(state.iterations() * state.range(0));
}

/// Alternates instances of two sizes and removes all of one size, which leaves a gap between any
/// two others. Before them are two small ones, and a gap that is too small for these.
struct Gaps {
  Gaps(std::uint32_t count, std::uint32_t kept, std::uint32_t removed) {
    instance.pose = *scene.addPose(1);
    add(2);
    std::vector<InstanceHandle> holes{add(1)};
    add(2);
    for (std::uint32_t i = 0; i < count; ++i) {
      add(kept);
      holes.push_back(add(removed));
    }
    for (const InstanceHandle hole : holes) {
      if (!scene.removeInstance(hole)) std::abort();
    }
    if (!scene.beginFrame(1, 0) || !planned.plan() || !planned.commit() || !scene.beginFrame(2, 1))
      std::abort();
  }
  static SceneCommandsDescription description() {
    SceneCommandsDescription description;
    description.scene.meshCapacity = Capacity::fixed(1 << 20);
    description.scene.instanceCapacity = Capacity::fixed(400'000);
    description.scene.outputCapacity = Capacity::fixed(std::uint64_t{1} << 26);
    description.limits.maxStorageBufferRange = 1u << 30;
    return description;
  }
  MeshHandle meshOf(std::uint32_t vertexCount) {
    MeshHandle& mesh = meshes[vertexCount];
    MeshInfo info;
    info.vertexCount = vertexCount;
    info.requiredJoints = info.maxInfluences = 1;
    info.byteSize = 1024;
    if (!mesh) mesh = *planned.addMesh(info);
    return mesh;
  }
  InstanceHandle add(std::uint32_t vertexCount) {
    instance.mesh = meshOf(vertexCount);
    return *scene.addInstance(instance);
  }

  test::PlannedScene planned{description()};
  Scene& scene = planned.scene();
  std::map<std::uint32_t, MeshHandle> meshes;
  InstanceDescription instance;
};

/// No instance fits a gap before it. But for two, they are a little larger than every gap, and
/// these two fit every gap after them: the worst case.
void compactNothing(benchmark::State& state) {
  Gaps gaps(static_cast<std::uint32_t>(state.range(0)), 5, 4);
  for ([[maybe_unused]] auto iteration : state) {
    if (gaps.scene.compact(1 << 16) != 0) return state.SkipWithError("something moved");
  }
  state.SetItemsProcessed(state.iterations() * state.range(0));
}

/// Gaps of 48 bytes hold 44 bytes at a multiple of 44 in few cases, and these are taken.
void addWithAnotherStride(benchmark::State& state) {
  Gaps gaps(static_cast<std::uint32_t>(state.range(0)), 5, 4);
  gaps.instance.layout.stride = 44;
  for (std::int64_t i = 0; i < state.range(0); ++i) gaps.add(1);
  for ([[maybe_unused]] auto iteration : state) {
    const InstanceHandle added = gaps.add(1);
    if (!gaps.scene.removeInstance(added)) return state.SkipWithError("it was not added");
  }
}

BENCHMARK(compactNothing)->Name("scene/compact_nothing")->Arg(1000)->Arg(10'000)->Arg(100'000);
BENCHMARK(addWithAnotherStride)
    ->Name("scene/add_with_another_stride")
    ->Arg(1000)
    ->Arg(10'000)
    ->Arg(100'000);
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
