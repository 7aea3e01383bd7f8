// How fast the CPU path samples figures, beside ozz-animation where it was built with
// -DDERMIS_BENCH_OZZ=FOLDER: two SamplingJobs, a BlendingJob and a LocalToModelJob on the same
// nodes and clips, after ozz-animation's optimizer with its own tolerance. Dermis multiplies by the
// inverse bind matrices, too. All take turns in one process; the best round counts.
//
//   dermis_clips_cpu_benchmark MODEL [FIGURES [ROUNDS]]    1,000 figures, 100 rounds
//
// Clips, times and weights differ from figure to figure. A round is a frame:
// times advance by a sixtieth of a second, forward, as ozz-animation prefers it.

#include <algorithm>
#include <array>
#include <chrono>
#include <cstddef>
#include <cstdint>
#include <cstdio>
#include <cstdlib>
#include <functional>
#include <string>
#include <thread>
#include <utility>
#include <vector>

#include "clips/sample.h"
#include "clips_subject.h"
#include "cpu/clip_plan.h"
#include "dermis/clips.h"
#include "dermis/cpu.h"

namespace {

using namespace dermis;
using namespace dermis::bench;

/// Samples figures `first` to `end`, `seconds` after the beginning.
struct Contender {
  std::string name;
  std::function<void(std::uint32_t first, std::uint32_t end, double seconds)> sample;
  std::function<void()> prepare = [] {};
  std::array<double, 2> best{1e9, 1e9};  ///< seconds, on one thread and on two
};

Contender dermisContender(const Subject& subject, const cpu::ClipPlan& plan,
                          std::string_view target, Poses& poses) {
  Contender contender;
  contender.name = "dermis, " + std::string(target);
  contender.prepare = [target] {
    if (!cpu::setTarget(target)) std::exit(1);
  };
  contender.sample = [&subject, &plan, &poses](std::uint32_t first, std::uint32_t end,
                                               double seconds) {
    static thread_local cpu::ClipScratch scratch;
    scratch.prepare(plan);
    for (std::uint32_t i = first; i < end; ++i) {
      const auto layers = must(packLayers(subject.bank, layersAt(subject.figures[i], seconds), ""));
      cpu::dispatchSampling(plan, layers, scratch, poses[i]);
    }
  };
  return contender;
}

Contender plainContender(const Subject& subject, Poses& poses) {
  Contender contender;
  contender.name = "samplePose, the same bits without SIMD";
  contender.sample = [&subject, &poses](std::uint32_t first, std::uint32_t end, double seconds) {
    static thread_local std::vector<Affine<float>> nodes;
    nodes.resize(subject.bank.nodeCount());
    for (std::uint32_t i = first; i < end; ++i) {
      const auto layers = must(packLayers(subject.bank, layersAt(subject.figures[i], seconds), ""));
      sampleNodes(subject.bank, layers, nodes);
      std::size_t joint = 0;
      for (std::uint32_t skin = 0; skin < subject.bank.skinCount(); ++skin) {
        const std::uint32_t count = subject.bank.jointCount(skin);
        poseSkin(subject.bank, skin, nodes, std::span(poses[i]).subspan(joint, count));
        joint += count;
      }
    }
  };
  return contender;
}

double secondsOf(const Contender& contender, std::uint32_t figures, double at, bool onTwoThreads) {
  using Clock = std::chrono::steady_clock;
  const auto begin = Clock::now();
  if (onTwoThreads) {
    std::thread other([&] { contender.sample(figures / 2, figures, at); });
    contender.sample(0, figures / 2, at);
    other.join();
  } else {
    contender.sample(0, figures, at);
  }
  return std::chrono::duration<double>(Clock::now() - begin).count();
}

}  // namespace

int main(int argc, char** argv) {
  if (argc < 2) fail("usage: dermis_clips_cpu_benchmark MODEL [FIGURES [ROUNDS]]");
  const auto argument = [&](int index, int otherwise) {
    return static_cast<std::uint32_t>(argc > index ? std::max(std::atoi(argv[index]), 1)
                                                   : otherwise);
  };
  const Subject subject(argv[1], argument(2, 1000));
  const std::uint32_t rounds = argument(3, 100);
  const auto figures = static_cast<std::uint32_t>(subject.figures.size());
  const cpu::ClipPlan plan(subject.bank);
  Poses poses(figures, std::vector<JointMatrix>(subject.joints));
  std::vector<Contender> contenders;
#ifdef DERMIS_BENCH_OZZ
  Ozz ozz(subject);
  contenders.emplace_back().name = "ozz-animation";
  contenders.back().sample = [&](std::uint32_t first, std::uint32_t end, double seconds) {
    for (std::uint32_t i = first; i < end; ++i) ozz.sample(i, seconds);
  };
#endif
  contenders.push_back(plainContender(subject, poses));
  for (const std::string_view target : cpu::targetNames())
    contenders.push_back(dermisContender(subject, plan, target, poses));
  double at = 0;
  for (std::uint32_t round = 0; round < rounds; ++round) {
    for (const bool onTwoThreads : {false, true}) {
      at += 1.0 / 60;
      for (Contender& contender : contenders) {
        contender.prepare();
        double& best = contender.best[onTwoThreads ? 1 : 0];
        best = std::min(best, secondsOf(contender, figures, at, onTwoThreads));
      }
    }
  }
  std::printf("%s: %u nodes, %u joints, %zu clips, %u figures of two clips; bytes of clips: %zu\n",
              argv[1], subject.bank.nodeCount(), subject.joints, subject.clips.size(), figures,
              subject.bank.bytes().size());
#ifdef DERMIS_BENCH_OZZ
  std::printf("ozz-animation: bytes of clips: %zu; farthest joint from that of Dermis: %g\n",
              ozz.bytes(), ozz.difference(poses));
#endif
  std::printf("%-42s %9s %6s %9s %6s\n", "microseconds a figure", "1 thread", "", "2 threads", "");
  for (const Contender& contender : contenders) {
    std::printf("%-42s %9.3f %6.2f %9.3f %6.2f\n", contender.name.c_str(),
                1e6 * contender.best[0] / figures, contenders[0].best[0] / contender.best[0],
                1e6 * contender.best[1] / figures, contenders[0].best[1] / contender.best[1]);
  }
  return 0;
}
