// What a scene costs in a SceneRecorder, from one instance to ten thousand: the GPU's time by
// timestamps, the time from submission to the fence and the CPU's without them, and memory. Prints
// a table of medians for instances of one mesh, and one for instances of twenty, of which few share
// what is read of a mesh.
//
//   dermis_system_benchmark [REPETITIONS [MOST-INSTANCES]]

#include <algorithm>
#include <charconv>
#include <chrono>
#include <cstdio>
#include <cstring>
#include <vector>

#include "bench_scene.h"
#include "dermis/mesh.h"
#include "kit/device.h"
#include "kit/random_rig.h"
#include "system_engine.h"

namespace dermis::bench {
namespace {

using test::must;

constexpr std::uint32_t jointCount = 24;

/// Meshes of different sizes; instances take them in turn.
struct Meshes {
  std::uint32_t count, meanVertexCount, difference;

  std::uint32_t vertexCount(std::uint32_t number) const {
    return meanVertexCount + number * difference - (count - 1) * difference / 2;
  }
};
constexpr Meshes oneMesh{1, 8000, 0}, manyMeshes{20, 3000, 100};

double secondsSince(std::chrono::steady_clock::time_point begin) {
  return std::chrono::duration<double>(std::chrono::steady_clock::now() - begin).count();
}

double median(std::vector<double> values) {
  std::ranges::sort(values);
  return values[values.size() / 2];
}

/// Joints are near each other, as in real meshes.
PackedMesh makeMesh(std::uint32_t number, std::uint32_t vertexCount) {
  samples::OwnedMesh mesh = samples::randomMesh(number, vertexCount, jointCount, 4);
  for (std::uint32_t vertex = 0; vertex < vertexCount; ++vertex) {
    for (std::uint32_t slot = 0; slot < 4; ++slot) {
      mesh.joints[vertex * 4 + slot] = (vertex * jointCount / vertexCount + slot) % jointCount;
      mesh.weights[vertex * 4 + slot] = 1.0f / static_cast<float>(slot + 1);
    }
  }
  return must(pack(mesh.view(), jointCount));
}

/// Seconds of one frame.
struct FrameCost {
  double gpu = 0;  ///< 0 where it is not measured
  double wall = 0;
  double record = 0;  ///< plan and record, on the CPU
  double poses = 0;   ///< writing all of them
};

/// Whether a scene asks for timestamps. They cost time themselves: lavapipe wakes its rasterizer's
/// threads for each, so that the wall's and the CPU's time are taken where there are none.
enum class GpuTime : std::uint8_t { notMeasured, measured };

/// Instances, each with a pose of its own.
class Scene {
 public:
  Scene(samples::OpenDevice& open, const Meshes& from, std::uint32_t instanceCount, GpuTime gpuTime)
      : engine_(*open.device, open.context, description(open, from, instanceCount, gpuTime)) {
    engine_.begin();
    std::vector<MeshHandle> meshes;
    for (std::uint32_t mesh = 0; mesh < std::min(from.count, instanceCount); ++mesh)
      meshes.push_back(engine_.addMesh(makeMesh(mesh, from.vertexCount(mesh))));
    InstanceDescription instance;
    instance.layout.normals = VertexFormat::float32x3;
    for (std::uint32_t i = 0; i < instanceCount; ++i) {
      instance.mesh = meshes[i % meshes.size()];
      vertexCount_ += engine_.vertexCount(instance.mesh);
      instance.pose = palettes_.emplace_back(
          engine_.addPose(poses_[0], {.promise = JointPromise::scaleIgnored}));
      if (i == 0) must(engine_.recorder().prepare(instance));
      must(engine_->addInstance(instance));
    }
    engine_.submit();
    engine_.finish();
  }

  /// A frame in which all instances move, or none.
  FrameCost run(bool moves) {
    engine_.begin();
    FrameCost cost;
    const auto beforePoses = std::chrono::steady_clock::now();
    const std::vector<JointMatrix>& pose = poses_[engine_.frame() % 2];
    for (std::size_t i = 0; moves && i < palettes_.size(); ++i)
      engine_.writePose(palettes_[i], pose);
    cost.poses = secondsSince(beforePoses);
    const auto beforeSubmission = std::chrono::steady_clock::now();
    engine_.submit();
    engine_.finish();
    lastFrame_ = engine_.lastFrame();
    cost.record = lastFrame_.planSeconds + lastFrame_.recordSeconds;
    cost.wall = secondsSince(beforeSubmission) - cost.record;
    engine_.begin();
    cost.gpu = engine_.recorder().statistics().gpuSeconds.value_or(0);
    engine_.submit();
    engine_.finish();
    return cost;
  }

  std::uint64_t vertexCount() const { return vertexCount_; }
  const test::LastFrame& lastFrame() const { return lastFrame_; }
  std::uint64_t deviceMemory() { return engine_.recorder().statistics().deviceMemory; }

 private:
  static vulkan::SceneRecorderDescription description(samples::OpenDevice& open, const Meshes& from,
                                                      std::uint32_t instanceCount,
                                                      GpuTime gpuTime) {
    vulkan::SceneRecorderDescription description;
    description.tuning = open.context.tuning();
    description.scene.jointCapacity = Capacity::fixed(instanceCount * jointCount);
    description.scene.instanceCapacity = Capacity::fixed(instanceCount);
    description.scene.boundsCapacity = Capacity::fixed(0);
    // Positions and normals, and what alignment takes.
    const std::uint64_t vertexCount =
        std::uint64_t{instanceCount} * (from.meanVertexCount + from.count * from.difference / 2);
    description.scene.outputCapacity =
        Capacity::fixed(vertexCount * 24 + std::uint64_t{instanceCount} * 256);
    description.measuresGpuTime = gpuTime == GpuTime::measured;
    return description;
  }

  const std::vector<std::vector<JointMatrix>> poses_{
      samples::randomPose(1, jointCount, samples::Rigidity::rigid),
      samples::randomPose(2, jointCount, samples::Rigidity::rigid)};
  test::SystemEngine engine_;
  std::vector<PoseHandle> palettes_;
  std::uint64_t vertexCount_ = 0;
  test::LastFrame lastFrame_;
};

/// Of at least so many frames and half a second: how a system places threads on cores lasts for
/// many short frames.
FrameCost measure(Scene& scene, bool moves, std::uint32_t repetitions) {
  constexpr double leastSeconds = 0.5;
  std::vector<double> gpu, wall, record, poses;
  const auto begin = std::chrono::steady_clock::now();
  for (std::uint32_t i = 0; i < repetitions || secondsSince(begin) < leastSeconds; ++i) {
    const FrameCost cost = scene.run(moves);
    gpu.push_back(cost.gpu);
    wall.push_back(cost.wall);
    record.push_back(cost.record);
    poses.push_back(cost.poses);
  }
  return {median(gpu), median(wall), median(record), median(poses)};
}

/// What a row of the table says.
struct Row {
  FrameCost moving, resting;
  double gpuSeconds = 0;
  test::LastFrame frame;  ///< a moving one
  double vertexCount = 0, deviceMemory = 0;
};

Row measureRow(samples::OpenDevice& open, const Meshes& from, std::uint32_t instances,
               std::uint32_t repetitions) {
  Row row;
  {
    Scene scene(open, from, instances, GpuTime::measured);
    for (int warmUp = 0; warmUp < 2; ++warmUp)
      scene.run(true);  // drivers compile, memory is touched
    row.gpuSeconds = measure(scene, true, repetitions).gpu;
  }
  Scene scene(open, from, instances, GpuTime::notMeasured);
  for (int warmUp = 0; warmUp < 2; ++warmUp) scene.run(true);
  row.moving = measure(scene, true, repetitions);
  row.frame = scene.lastFrame();
  row.resting = measure(scene, false, repetitions);
  row.vertexCount = static_cast<double>(scene.vertexCount());
  row.deviceMemory = static_cast<double>(scene.deviceMemory());
  return row;
}

void printRow(std::uint32_t instances, const Row& row) {
  const double count = instances;
  std::printf("%9u %9.2f %9.2f %9.2f %9.1f %9.1f %9.1f %10u %6u %8.1f\n", instances,
              row.vertexCount / 1e6, row.gpuSeconds / row.vertexCount * 1e9,
              row.moving.wall / row.vertexCount * 1e9, row.moving.record / count * 1e9,
              row.resting.record / count * 1e9, row.moving.poses / count * 1e9,
              row.frame.dispatches, row.frame.copies, row.deviceMemory / (1 << 20));
  std::fflush(stdout);
}

void printTable(samples::OpenDevice& open, const Meshes& from, std::uint32_t mostInstances,
                std::uint32_t repetitions) {
  std::printf("\nmeshes: %u of %s%u vertices, %u joints; dual quaternions, positions and normals\n",
              from.count, from.difference != 0 ? "about " : "", from.meanVertexCount, jointCount);
  std::printf("%9s %9s %9s %9s %9s %9s %9s %10s %6s %8s\n", "", "million", "GPU ns", "wall ns",
              "CPU ns/", "instance", "pose ns", "", "", "memory");
  std::printf("%9s %9s %9s %9s %9s %9s %9s %10s %6s %8s\n", "instances", "vertices", "/vertex",
              "/vertex", "moving", "at rest", "/palette", "dispatches", "copies", "MiB");
  Row ten, most;
  for (std::uint32_t instances = 1; instances <= mostInstances; instances *= 10) {
    most = measureRow(open, from, instances, repetitions);
    if (instances == 10) ten = most;
    printRow(instances, most);
  }
  if (ten.vertexCount == 0) return;
  std::printf("a vertex of 10 instances / of the most: %.2f GPU, %.2f wall\n",
              (ten.gpuSeconds / ten.vertexCount) / (most.gpuSeconds / most.vertexCount),
              (ten.moving.wall / ten.vertexCount) / (most.moving.wall / most.vertexCount));
}

std::uint32_t numberOr(int argc, char** argv, int index, std::uint32_t fallback) {
  std::uint32_t number = fallback;
  if (index < argc) std::from_chars(argv[index], argv[index] + std::strlen(argv[index]), number);
  return std::max(number, 1u);
}

}  // namespace
}  // namespace dermis::bench

int main(int argc, char** argv) {
  using namespace dermis::bench;
  auto* open = benchDevice();
  if (open == nullptr) return 4;
  const std::uint32_t repetitions = numberOr(argc, argv, 1, 11);
  const std::uint32_t mostInstances = numberOr(argc, argv, 2, 10'000);
  std::printf("driver: %s\n", dermis::samples::driverVersion(*open->device).c_str());
  for (const Meshes& from : {oneMesh, manyMeshes})
    printTable(*open, from, mostInstances, repetitions);
  return 0;
}
