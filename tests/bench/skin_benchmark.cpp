// What skinning costs: influences, morph targets, formats, extras. Time is that of a submission and
// the wait for it, of a batch of a hundred instances. And what `prepare` builds for a method and a
// layout.

#include <benchmark/benchmark.h>

#include <algorithm>
#include <cstdio>
#include <functional>
#include <string>
#include <vector>

#include "bench_scene.h"
#include "kit/random_rig.h"
#include "ratio_reporter.h"

namespace dermis::bench {
namespace {

using samples::OwnedMesh;

constexpr std::uint32_t vertexCount = 10'000;
constexpr std::uint32_t fewVertices = 64;  ///< so that palettes are what takes time
constexpr std::uint32_t jointCount = 50;
constexpr std::uint32_t instanceCount = 100;

/// Every vertex with exactly so many influences; joints are near each other, as in real meshes.
OwnedMesh evenMesh(std::uint32_t influences, std::uint32_t vertices = vertexCount) {
  OwnedMesh mesh = samples::randomMesh(1, vertices, jointCount, influences);
  for (std::uint32_t vertex = 0; vertex < vertices; ++vertex) {
    const std::uint32_t base = vertex * jointCount / vertices;
    for (std::uint32_t slot = 0; slot < influences; ++slot) {
      mesh.joints[vertex * influences + slot] = (base + slot) % jointCount;
      mesh.weights[vertex * influences + slot] = 1.0f / static_cast<float>(slot + 1);
    }
  }
  return mesh;
}

/// The first half of the vertices with one influence, the rest with four.
OwnedMesh halfRigidMesh() {
  OwnedMesh mesh = evenMesh(4);
  for (std::uint32_t vertex = 0; vertex < vertexCount / 2; ++vertex) {
    for (std::uint32_t slot = 1; slot < 4; ++slot) mesh.weights[vertex * 4 + slot] = 0;
  }
  return mesh;
}

/// A face full of targets: each displaces a tenth of the vertices, in one stretch.
OwnedMesh morphMesh(std::uint32_t targets) {
  OwnedMesh mesh = evenMesh(4);
  samples::addMorphs(mesh, 7, targets);
  for (std::uint32_t target = 0; target < targets; ++target) {
    samples::OwnedMorph& morph = mesh.morphs[target];
    const std::uint32_t count = vertexCount / 10;
    const std::uint32_t first = target * 937 % (vertexCount - count);
    morph.vertices.resize(count);
    for (std::uint32_t i = 0; i < count; ++i) morph.vertices[i] = first + i;
    for (std::vector<float>* values : {&morph.positions, &morph.normals}) values->resize(count * 3);
  }
  return mesh;
}

struct Scene {
  explicit Scene(OwnedMesh skinned, Method by = Method::dualQuaternion,
                 samples::Rigidity joints = samples::Rigidity::rigid)
      : mesh(std::move(skinned)),
        method(by),
        rigidity(joints),
        promise(joints == samples::Rigidity::rigid ? JointPromise::scaleIgnored
                                                   : JointPromise::scaling) {}

  OwnedMesh mesh;
  Method method;
  samples::Rigidity rigidity;
  JointPromise promise;
  samples::OutputLayout output;
  std::vector<MorphWeight> morphs;
};

void measure(benchmark::State& state, Scene scene) {
  samples::OpenDevice* open = benchDevice();  // main has seen that there is one
  const PackedMesh packed = *pack(scene.mesh.view(), jointCount);
  std::vector<std::vector<JointMatrix>> poses;
  for (std::uint32_t instance = 0; instance < instanceCount; ++instance)
    poses.push_back(samples::randomPose(instance, jointCount, scene.rigidity));
  std::vector<samples::SkinRequest> requests;
  for (const std::vector<JointMatrix>& pose : poses) {
    samples::SkinRequest& request = requests.emplace_back();
    request.mesh = &packed;
    request.pose = pose;
    request.promise = scene.promise;
    request.method = scene.method;
    request.morphs = scene.morphs;
    request.box = {{-4, -4, -4}, {4, 4, 4}};
  }
  BenchScene bench(*open, requests, scene.output, open->context.tuning());
  for ([[maybe_unused]] auto iteration : state) state.SetIterationTime(bench.skin());
  state.counters["vertices/s"] = benchmark::Counter(static_cast<double>(bench.vertexCount()),
                                                    benchmark::Counter::kIsIterationInvariantRate);
}

samples::OutputLayout layoutOf(VertexFormat positions, VertexFormat normals) {
  samples::OutputLayout layout;
  layout.positions = positions;
  layout.normals = normals;
  return layout;
}

Scene withLayout(const samples::OutputLayout& layout) {
  Scene scene(evenMesh(4));
  scene.output = layout;
  return scene;
}

samples::OutputLayout withMotion(bool motion) {
  samples::OutputLayout layout;
  layout.motion = motion;
  return layout;
}

samples::OutputLayout withBounds() {
  samples::OutputLayout layout;
  layout.bounds = true;
  return layout;
}

void add(const std::string& name, const std::function<Scene()>& make) {
  benchmark::RegisterBenchmark(name.c_str(),
                               [make](benchmark::State& state) { measure(state, make()); })
      ->UseManualTime()
      ->Unit(benchmark::kMillisecond);
}

/// Everything that instances of one method and layout may need, built while loading.
void measurePrepare(benchmark::State& state, Method method) {
  PipelineNeeds needs;
  needs.method = method;
  needs.layout.normals = VertexFormat::float32x3;
  std::size_t pipelines = 0;
  for (auto _ : state) {
    state.PauseTiming();
    Result<vulkan::Context> context = vulkan::Context::create(benchDevice()->device->description());
    if (!context) return state.SkipWithError(context.error().message.c_str());
    pipelines = dermis::pipelines(needs, context->limits(), context->tuning())->size();
    state.ResumeTiming();
    if (Result<void> built = context->prepare(needs); !built)
      return state.SkipWithError(built.error().message.c_str());
    state.PauseTiming();
    context = Error{};
    state.ResumeTiming();
  }
  state.counters["pipelines"] = static_cast<double>(pipelines);
}

void registerAll() {
  for (const Method method : allMethods) {
    benchmark::RegisterBenchmark(
        ("prepare/" + std::string(methodName(method))).c_str(),
        [method](benchmark::State& state) { measurePrepare(state, method); })
        ->Unit(benchmark::kMillisecond);
  }
  using enum VertexFormat;
  for (const Method method : allMethods) {
    add("method/" + std::string(methodName(method)),
        [method] { return Scene(evenMesh(4), method); });
  }
  add("method/two_phase",
      [] { return Scene(evenMesh(4), Method::dualQuaternion, samples::Rigidity::shear); });
  add("method/may_scale", [] {
    Scene scene(evenMesh(4));
    scene.promise = JointPromise::scaling;
    return scene;
  });
  add("palettes/shear", [] {
    return Scene(evenMesh(4, fewVertices), Method::dualQuaternion, samples::Rigidity::shear);
  });
  add("palettes/rigid", [] {
    return Scene(evenMesh(4, fewVertices), Method::dualQuaternion, samples::Rigidity::rigid);
  });
  add("influences/1", [] { return Scene(evenMesh(1)); });
  add("influences/2", [] { return Scene(evenMesh(2)); });
  add("influences/4", [] { return Scene(evenMesh(4)); });
  add("influences/8", [] { return Scene(evenMesh(8)); });
  add("influences/half_1_half_4", [] { return Scene(halfRigidMesh()); });
  add("morphs/3_of_3", [] {
    Scene scene(morphMesh(3));
    scene.morphs = {{0, 0.5f}, {1, 0.25f}, {2, 0.75f}};
    return scene;
  });
  add("morphs/3_of_300", [] {
    Scene scene(morphMesh(300));
    scene.morphs = {{0, 0.5f}, {1, 0.25f}, {2, 0.75f}};
    return scene;
  });
  add("morphs/0_of_300", [] { return Scene(morphMesh(300)); });
  add("output/float32", [] { return withLayout(layoutOf(float32x3, float32x3)); });
  add("output/float16", [] { return withLayout(layoutOf(float16x4, float16x4)); });
  add("output/snorm16_snorm8", [] { return withLayout(layoutOf(snorm16x4, snorm8x4)); });
  add("output/float32_octahedral16",
      [] { return withLayout(layoutOf(float32x3, octahedral16x2)); });
  add("output/float16x3_octahedral8",
      [] { return withLayout(layoutOf(float16x3, octahedral8x2)); });
  add("extras/none", [] { return withLayout({}); });
  add("extras/bounds", [] { return withLayout(withBounds()); });
  add("extras/previous_kept", [] { return withLayout(withMotion(true)); });
}

const std::vector<Ratio> ratios{
    {"method/dual_quaternion", "method/linear", "dual quaternions / linear"},
    {"method/two_phase", "method/linear", "two-phase / linear"},
    {"method/two_phase", "method/dual_quaternion", "two-phase / dual quaternions"},
    {"palettes/shear", "palettes/rigid", "palettes with joints that shear / rigid, few vertices"},
    {"method/may_scale", "method/dual_quaternion",
     "joints that may scale, but do not / joints that may not"},
    {"method/dual_quaternion_iterative", "method/dual_quaternion",
     "dual_quaternion_iterative / dual quaternions"},
    {"method/log_matrix", "method/dual_quaternion", "log_matrix / dual quaternions"},
    {"method/spherical_blend", "method/dual_quaternion", "spherical_blend / dual quaternions"},
    {"method/quaternion_translation", "method/dual_quaternion",
     "quaternion_translation / dual quaternions"},
    {"method/blended", "method/dual_quaternion", "blended / dual quaternions"},
    {"method/center_of_rotation", "method/dual_quaternion",
     "center_of_rotation / dual quaternions"},
    {"method/bulge_controlled", "method/dual_quaternion", "bulge_controlled / dual quaternions"},
    {"influences/1", "influences/4", "one influence a vertex / four"},
    {"influences/2", "influences/4", "two influences a vertex / four"},
    {"influences/8", "influences/4", "eight influences a vertex / four"},
    {"influences/half_1_half_4", "influences/4",
     "half the vertices with one, half with four / four"},
    {"morphs/3_of_300", "morphs/3_of_3", "300 morph targets, 3 active / 3 targets, 3 active"},
    {"morphs/3_of_3", "morphs/0_of_300", "3 active morph targets / none active"},
    {"output/float16", "output/float32", "float16x4 positions and normals / float32x3"},
    {"output/snorm16_snorm8", "output/float32", "snorm16x4 and snorm8x4 / float32x3"},
    {"output/float32_octahedral16", "output/float32", "float32x3 and octahedral16x2 / float32x3"},
    {"output/float16x3_octahedral8", "output/float32", "float16x3 and octahedral8x2 / float32x3"},
    {"extras/bounds", "extras/none", "with bounds / without"},
    {"extras/previous_kept", "extras/none", "previous positions kept / none"},
    {"scene/change_one_by_one", "scene/change_all",
     "10,000 instances hidden or shown, with an interval: a call each / one call"},
};

}  // namespace
}  // namespace dermis::bench

int main(int argc, char** argv) {
  using namespace dermis::bench;
  benchmark::Initialize(&argc, argv);
  if (benchmark::ReportUnrecognizedArguments(argc, argv)) return 1;
  const auto* open = benchDevice();
  if (open == nullptr) return 4;
  std::printf("device: %s\n", open->device->info().name.c_str());
  registerAll();
  RatioReporter reporter(ratios);
  benchmark::RunSpecifiedBenchmarks(&reporter);
  benchmark::Shutdown();
  return 0;
}
