// What rigs cost on the CPU: 8 twists, 6 correctives of 8 examples over a joint, 2 chains of 8
// segments, 60 written joints. Each corrective drives four weights and a joint. Beside it the
// skinning of a mesh by dual quaternions, positions and normals in float32. All take turns in one
// process, on one thread; the best round counts.
//
//   dermis_rig_cpu_benchmark [POSES [VERTICES [ROUNDS]]]    1,000 poses, 3,000 vertices, 30 rounds

#include <algorithm>
#include <chrono>
#include <cstddef>
#include <cstdint>
#include <cstdio>
#include <cstdlib>
#include <functional>
#include <span>
#include <string>
#include <utility>
#include <vector>

#include "cpu/task.h"
#include "dermis/cpu.h"
#include "dermis/rig.h"
#include "kit/bench/crowd.h"
#include "made_rig.h"

namespace {

using namespace dermis;

template <typename T>
T must(Result<T> result) {
  if (result) return *std::move(result);
  std::fprintf(stderr, "dermis_rig_cpu_benchmark: error: %s\n", result.error().message.c_str());
  std::exit(1);
}
void must(const Result<void>& result) {
  if (result) return;
  std::fprintf(stderr, "dermis_rig_cpu_benchmark: error: %s\n", result.error().message.c_str());
  std::exit(1);
}

/// Poses of a rig, whose driven joints follow the written ones in memory, as in scenes.
struct Rigged {
  explicit Rigged(std::uint32_t poseCount) : rig(must(packRig(test::MadeRig(1, {}).view()))) {
    const test::MadeRig made(1, {});
    const std::size_t written = rig.writtenJoints(), joints = written + rig.drivenJoints();
    const std::size_t weights = rig.givenWeights() + rig.drivenWeights();
    matrices.resize(joints * poseCount);
    numbers.resize(weights * poseCount);
    for (std::uint32_t i = 0; i < poseCount; ++i) {
      const std::span<JointMatrix> pose = std::span(matrices).subspan(joints * i, joints);
      std::ranges::copy(made.pose(i), pose.begin());
      const std::span<float> own = std::span(numbers).subspan(weights * i, weights);
      poses.push_back(
          {pose.first(written), own.first(rig.givenWeights()), pose.subspan(written), own});
    }
    scratch.prepare(rig);
  }

  PackedRig rig;
  std::vector<JointMatrix> matrices;
  std::vector<float> numbers;
  std::vector<cpu::RigPose> poses;
  cpu::RigScratch scratch;
};

/// Instances side by side in memory.
struct Skinned {
  Skinned(std::uint32_t vertexCount, std::uint32_t instanceCount)
      : crowd(must(samples::longFigure(vertexCount, instanceCount))),
        mesh(must(cpu::Mesh::create(*crowd.mesh))) {
    job.mesh = &mesh;
    job.method = Method::dualQuaternion;
    job.places = must(placeVertices({.normals = VertexFormat::float32x3}, vertexCount));
    output.resize(job.places.size * instanceCount / sizeof(output[0]) + 1);
    for (std::uint32_t i = 0; i < instanceCount; ++i) {
      cpu::Instance& instance = instances.emplace_back();
      instance.pose = crowd.poses[i];
      instance.output.fill(reinterpret_cast<std::byte*>(output.data()) + job.places.size * i);
    }
  }

  void skin() {
    constexpr std::size_t together = 16;
    for (std::size_t i = 0; i < instances.size(); i += together) {
      job.instances = std::span(instances).subspan(i, std::min(together, instances.size() - i));
      must(cpu::skin(job));
    }
  }

  struct alignas(64) CacheLine {
    std::byte bytes[64];
  };
  samples::Crowd crowd;
  cpu::Mesh mesh;
  cpu::Job job;
  std::vector<CacheLine> output;
  std::vector<cpu::Instance> instances;
};

struct Contender {
  std::string name;
  std::size_t target;  ///< its instruction set
  std::size_t count;   ///< of poses or instances
  std::function<void()> run;
  double best = 1e9;  ///< seconds
};

}  // namespace

int main(int argc, char** argv) {
  const auto argument = [&](int index, int otherwise) {
    return static_cast<std::uint32_t>(argc > index ? std::max(std::atoi(argv[index]), 1)
                                                   : otherwise);
  };
  const std::uint32_t poseCount = argument(1, 1000), vertexCount = argument(2, 3000);
  Rigged rigged(poseCount);
  Skinned skinned(vertexCount, std::min(poseCount, 200u));
  const std::vector<std::string_view> targets = cpu::targetNames();
  std::vector<Contender> contenders;
  for (std::size_t i = 0; i < targets.size(); ++i) {
    const std::string suffix = ", " + std::string(targets[i]);
    contenders.push_back(
        {"skinning" + suffix, i, skinned.instances.size(), [&] { skinned.skin(); }});
    contenders.push_back({"the rig" + suffix, i, poseCount,
                          [&] { cpu::dispatchRigs(rigged.rig, rigged.poses, rigged.scratch); }});
  }
  contenders.push_back({"the rig, evaluateRig", 0, poseCount,
                        [&] { cpu::evaluatePlainly(rigged.rig, rigged.poses, rigged.scratch); }});
  for (std::uint32_t round = 0; round < argument(3, 30); ++round) {
    for (Contender& contender : contenders) {
      must(cpu::setTarget(targets[contender.target]));
      using Clock = std::chrono::steady_clock;
      const auto begin = Clock::now();
      contender.run();
      contender.best =
          std::min(contender.best, std::chrono::duration<double>(Clock::now() - begin).count());
    }
  }
  std::printf("%u poses of %u written and %u driven joints; %u vertices an instance\n", poseCount,
              rigged.rig.writtenJoints(), rigged.rig.drivenJoints(), vertexCount);
  std::printf("%-30s %13s %20s\n", "microseconds each", "", "share of skinning");
  for (const Contender& contender : contenders) {
    const Contender& skinning = contenders[2 * contender.target];
    const double each = contender.best / static_cast<double>(contender.count);
    std::printf("%-30s %13.3f %19.1f%%\n", contender.name.c_str(), 1e6 * each,
                100 * each / (skinning.best / static_cast<double>(skinning.count)));
  }
  return 0;
}
