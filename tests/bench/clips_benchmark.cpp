// What clips cost in a SceneRecorder: figures of a model, each with a pair of clips and a phase of
// its own, all blended and sampled in each frame, beside the cost of skinning 3,000 vertices with
// rigid poses that the CPU writes. Poses of clips may scale, which makes them dearer to convert to
// palettes. So what sampling and composing take is the difference to figures whose poses the CPU
// writes, but which are of these clips. Process CPU time of the best of several frames, and the
// CPU's share: `play`, plan and record.
//
//   dermis_clips_benchmark MODEL [FIGURES [FRAMES [MAX-ERROR]]]

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <charconv>
#include <chrono>
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <ctime>
#include <span>
#include <utility>
#include <vector>

#include "dermis/clips.h"
#include "dermis/gltf.h"
#include "kit/bench/clip_pair.h"
#include "kit/device.h"
#include "kit/random_rig.h"
#include "system_engine.h"

namespace dermis::bench {
namespace {

using test::must;

double processSeconds() {
  std::timespec now{};
  clock_gettime(CLOCK_PROCESS_CPUTIME_ID, &now);
  return static_cast<double>(now.tv_sec) + 1e-9 * static_cast<double>(now.tv_nsec);
}

/// What a figure plays.
std::array<ClipLayer, 2> layersOf(const PackedClips& bank, std::uint32_t figure,
                                  std::uint32_t frame) {
  return samples::clipPair(bank.clipCount(), figure, frame / 60.0);
}

/// Figures with an instance each. They play clips, or have a pose that is written in each frame.
class Figures {
 public:
  Figures(samples::OpenDevice& open, const PackedClips& bank, std::uint32_t count,
          std::uint32_t vertexCount, std::vector<std::vector<JointMatrix>> written)
      : bank_(bank),
        engine_(*open.device, open.context, description(open, count, vertexCount)),
        written_(std::move(written)) {
    const std::uint32_t joints = bank.jointCount(0);
    engine_.begin();
    InstanceDescription instance;
    instance.layout.normals = VertexFormat::float32x3;
    instance.mesh =
        engine_.addMesh(must(pack(samples::randomMesh(1, vertexCount, joints, 4).view(), joints)));
    const ClipsHandle clips = must(engine_->addClips(PackedClips(bank)));
    for (std::uint32_t i = 0; i < count; ++i) {
      if (written_.empty()) {
        figures_.push_back(must(engine_->addFigure(clips)));
        instance.pose = must(engine_->pose(figures_.back()));
      } else {
        instance.pose =
            poses_.emplace_back(engine_.addPose(written_[0], {.promise = JointPromise::scaling}));
      }
      if (i == 0) must(engine_.recorder().prepare(instance));
      must(engine_->addInstance(instance));
    }
    engine_.submit();
  }

  struct Cost {
    double all = 1e9, engine = 1e9;  ///< seconds
  };
  Cost run(std::uint32_t frames) {
    Cost best;
    for (std::uint32_t frame = 0; frame < frames; ++frame) {
      engine_.begin();
      engine_.finish();
      const double begin = processSeconds();
      for (std::size_t i = 0; i < poses_.size(); ++i)
        engine_.writePose(poses_[i], written_[i % written_.size()]);
      const auto beforePlay = std::chrono::steady_clock::now();
      play(frame);
      const std::chrono::duration<double> played = std::chrono::steady_clock::now() - beforePlay;
      engine_.submit();
      engine_.finish();
      best.all = std::min(best.all, processSeconds() - begin);
      const test::LastFrame last = engine_.lastFrame();
      best.engine = std::min(best.engine, played.count() + last.planSeconds + last.recordSeconds);
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
  void play(std::uint32_t frame) {
    layers_.clear();
    plays_.clear();
    layers_.reserve(2 * figures_.size());
    for (std::uint32_t i = 0; i < figures_.size(); ++i) {
      for (const ClipLayer& layer : layersOf(bank_, i, frame)) layers_.push_back(layer);
      plays_.push_back({figures_[i], std::span(layers_).last(2)});
    }
    must(engine_->play(plays_));
  }

  const PackedClips& bank_;
  test::SystemEngine engine_;
  std::vector<std::vector<JointMatrix>> written_;  ///< in turn; empty: they play clips
  std::vector<PoseHandle> poses_;
  std::vector<FigureHandle> figures_;
  std::vector<ClipLayer> layers_;
  std::vector<FigurePlay> plays_;
};

std::uint32_t numberOr(int argc, char** argv, int place, std::uint32_t otherwise) {
  if (argc > place) std::from_chars(argv[place], argv[place] + std::strlen(argv[place]), otherwise);
  return otherwise;
}

int run(int argc, char** argv) {
  if (argc < 2) {
    fmt::print(stderr, "dermis_clips_benchmark MODEL [FIGURES [FRAMES [MAX-ERROR]]]\n");
    return 2;
  }
  const std::uint32_t count = numberOr(argc, argv, 2, 1000), frames = numberOr(argc, argv, 3, 8);
  const gltf::Model model = must(gltf::load(argv[1]));
  PackClipsReport report;
  const Skeleton skeleton = gltf::skeleton(model);
  const double maxError = argc > 4 ? std::atof(argv[4]) : 0;
  const PackedClips bank =
      must(packClips(skeleton, gltf::clips(model), {.maxError = maxError}, &report));
  samples::OpenDevice open = must(samples::openDevice({}));
  fmt::print("{}; {} clips of {} joints in {} bytes; {} figures\n", open.device->info().name,
             bank.clipCount(), bank.jointCount(0), report.byteCount, count);
  constexpr std::uint32_t few = 3, many = 3000;
  const auto cost = [&](std::uint32_t vertices, std::vector<std::vector<JointMatrix>> written) {
    return Figures(open, bank, count, vertices, std::move(written)).run(frames);
  };
  std::vector<std::vector<JointMatrix>> ofClips;
  for (std::uint32_t i = 0; i < 10 * bank.clipCount(); ++i) {
    const std::array<ClipLayer, 2> layers = layersOf(bank, i, 0);
    must(samplePose(bank, layers, 0, ofClips.emplace_back(bank.jointCount(0))));
  }
  const Figures::Cost sampled = cost(few, {}), written = cost(few, ofClips),
                      skinned = cost(many, {samples::randomPose(1, bank.jointCount(0),
                                                                samples::Rigidity::rigid)});
  const double perFigure = 1e6 / count;
  fmt::print(
      "us a figure: sampled and converted {:.2f}, written and converted {:.2f}, with {} vertices "
      "{:.2f}\n",
      sampled.all * perFigure, written.all * perFigure, many, skinned.all * perFigure);
  fmt::print("sampled - written / with {} vertices: {:.3f}; sampled / with {} vertices: {:.3f}\n",
             many, (sampled.all - written.all) / skinned.all, many, sampled.all / skinned.all);
  fmt::print("play, plan and record: {:.3f} us a figure; written: {:.3f}\n",
             sampled.engine * perFigure, written.engine * perFigure);
  return 0;
}

}  // namespace
}  // namespace dermis::bench

int main(int argc, char** argv) {
  return dermis::bench::run(argc, argv);
}
