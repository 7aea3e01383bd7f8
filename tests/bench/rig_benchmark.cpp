// What rigs cost in a SceneRecorder: poses that the CPU writes in each frame, with and without a
// rig of 8 twists, 6 correctives of 8 examples over a joint and 2 chains of 8 segments, beside the
// cost of skinning 3,000 vertices by dual quaternions. What the drivers take is the difference to
// poses of which the CPU writes all joints, the driven ones, too; the rest is the conversion of
// more joints to a palette. Process CPU time of the best of several frames; with lavapipe that is
// what the device takes, too.
//
//   dermis_rig_benchmark [POSES [FRAMES]]    1,000 poses, 20 frames

#include <fmt/format.h>

#include <algorithm>
#include <charconv>
#include <cstdint>
#include <cstring>
#include <ctime>
#include <vector>

#include "dermis/rig.h"
#include "kit/device.h"
#include "kit/random_rig.h"
#include "made_rig.h"
#include "system_engine.h"

namespace dermis::bench {
namespace {

using test::must;

double processSeconds() {
  std::timespec now{};
  clock_gettime(CLOCK_PROCESS_CPUTIME_ID, &now);
  return static_cast<double>(now.tv_sec) + 1e-9 * static_cast<double>(now.tv_nsec);
}

enum class Driven : std::uint8_t { absent, byTheRig, written };

/// Poses with an instance each, all written in each frame.
class Poses {
 public:
  Poses(samples::OpenDevice& open, const test::MadeRig& made, std::uint32_t count,
        std::uint32_t vertexCount, Driven driven)
      : engine_(*open.device, open.context, description(open, count, vertexCount)) {
    const PackedRig rig = must(packRig(made.view()));
    const std::uint32_t joints = rig.writtenJoints();
    engine_.begin();
    InstanceDescription instance;
    instance.layout.normals = VertexFormat::float32x3;
    instance.mesh =
        engine_.addMesh(must(pack(samples::randomMesh(1, vertexCount, joints, 4).view(), joints)));
    PoseOptions options;
    if (driven == Driven::byTheRig) options.rig = must(engine_->addRig(PackedRig(rig)));
    for (std::uint32_t i = 0; i < count; ++i) {
      std::vector<JointMatrix>& pose = matrices_.emplace_back(made.pose(i));
      if (driven == Driven::written) {
        std::vector<float> weights(rig.drivenWeights());
        std::vector<JointMatrix> others(rig.drivenJoints());
        must(evaluateRig(rig, pose, {}, others, weights));
        pose.insert(pose.end(), others.begin(), others.end());
      }
      const auto count = static_cast<std::uint32_t>(pose.size());
      instance.pose = poses_.emplace_back(must(engine_->addPose(count, options)));
      if (i == 0) must(engine_.recorder().prepare(instance));
      must(engine_->addInstance(instance));
    }
    engine_.submit();
  }

  double bestFrame(std::uint32_t frames) {
    double best = 1e9;
    for (std::uint32_t frame = 0; frame < frames; ++frame) {
      engine_.begin();
      engine_.finish();
      const double begin = processSeconds();
      for (std::size_t i = 0; i < poses_.size(); ++i)
        std::ranges::copy(matrices_[i], must(engine_->writePose(poses_[i])).begin());
      engine_.submit();
      engine_.finish();
      best = std::min(best, processSeconds() - begin);
    }
    return best;
  }

 private:
  static vulkan::SceneRecorderDescription description(samples::OpenDevice& open,
                                                      std::uint32_t count,
                                                      std::uint32_t vertexCount) {
    vulkan::SceneRecorderDescription description;
    description.tuning = open.context.tuning();
    description.scene.instanceCapacity.initial = count;
    description.scene.boundsCapacity = Capacity::fixed(0);
    description.scene.outputCapacity.initial = std::uint64_t{count} * (24 * vertexCount + 256);
    return description;
  }

  test::SystemEngine engine_;
  std::vector<std::vector<JointMatrix>> matrices_;
  std::vector<PoseHandle> poses_;
};

std::uint32_t numberOr(int argc, char** argv, int place, std::uint32_t otherwise) {
  if (argc > place) std::from_chars(argv[place], argv[place] + std::strlen(argv[place]), otherwise);
  return otherwise;
}

void run(int argc, char** argv) {
  const std::uint32_t count = numberOr(argc, argv, 1, 1000), frames = numberOr(argc, argv, 2, 20);
  samples::OpenDevice open = must(samples::openDevice({}));
  const test::MadeRig made(1, {});
  Poses plain(open, made, count, 3, Driven::absent), rigged(open, made, count, 3, Driven::byTheRig),
      written(open, made, count, 3, Driven::written),
      skinned(open, made, count, 3000, Driven::absent);
  double least = 1e9, withRig = 1e9, allWritten = 1e9, withVertices = 1e9;
  for (std::uint32_t frame = 0; frame < frames; ++frame) {  // in turn
    least = std::min(least, plain.bestFrame(1));
    withRig = std::min(withRig, rigged.bestFrame(1));
    allWritten = std::min(allWritten, written.bestFrame(1));
    withVertices = std::min(withVertices, skinned.bestFrame(1));
  }
  const double rig = (withRig - least) / count, drivers = (withRig - allWritten) / count,
               vertices = (withVertices - least) / count;
  fmt::print("{}; {} poses of 60 joints\n", open.device->info().name, count);
  fmt::print("3,000 vertices: {:.2f} us\n", 1e6 * vertices);
  fmt::print("a rig: {:.2f} us a pose, {:.3f} of them; of which drivers {:.2f} us, {:.3f}\n",
             1e6 * rig, rig / vertices, 1e6 * drivers, drivers / vertices);
}

}  // namespace
}  // namespace dermis::bench

int main(int argc, char** argv) {
  dermis::bench::run(argc, argv);
  return 0;
}
