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
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <cstdio>
#include <cstdlib>
#include <functional>
#include <memory>
#include <string>
#include <thread>
#include <utility>
#include <vector>

#include "clips/bank.h"
#include "clips/sample.h"
#include "cpu/clip_plan.h"
#include "dermis/clips.h"
#include "dermis/cpu.h"
#include "dermis/gltf.h"

#ifdef DERMIS_BENCH_OZZ
#include "ozz/animation/offline/animation_builder.h"
#include "ozz/animation/offline/animation_optimizer.h"
#include "ozz/animation/offline/raw_animation.h"
#include "ozz/animation/offline/raw_skeleton.h"
#include "ozz/animation/offline/skeleton_builder.h"
#include "ozz/animation/runtime/animation.h"
#include "ozz/animation/runtime/blending_job.h"
#include "ozz/animation/runtime/local_to_model_job.h"
#include "ozz/animation/runtime/sampling_job.h"
#include "ozz/animation/runtime/skeleton.h"
#include "ozz/base/maths/simd_math.h"
#include "ozz/base/maths/soa_transform.h"
#endif

namespace {

using namespace dermis;

[[noreturn]] void fail(const std::string& what) {
  std::fprintf(stderr, "dermis_clips_cpu_benchmark: error: %s\n", what.c_str());
  std::exit(1);
}

template <typename T>
T must(Result<T> result) {
  if (!result) fail(result.error().message);
  return *std::move(result);
}

struct Figure {
  std::array<ClipLayer, 2> layers;
};

struct Subject {
  Subject(const std::string& path, std::uint32_t count)
      : model(must(gltf::load(path))),
        skeleton(gltf::skeleton(model)),
        clips(gltf::clips(model)),
        bank(must(packClips(skeleton, clips))) {
    if (clips.empty()) fail("the model has no clips");
    for (std::uint32_t skin = 0; skin < bank.skinCount(); ++skin) joints += bank.jointCount(skin);
    const auto clipCount = static_cast<std::uint32_t>(clips.size());
    for (std::uint32_t i = 0; i < count; ++i) {
      const float weight = 0.2f + 0.6f * static_cast<float>(i % 97) / 97;
      const std::uint32_t second =
          (i + 1 + i / clipCount % std::max(clipCount - 1, 1u)) % clipCount;
      figures.push_back({{ClipLayer{.clip = i % clipCount, .time = 0.37 * i, .weight = weight},
                          ClipLayer{.clip = second, .time = 0.23 * i, .weight = 1 - weight}}});
    }
  }

  gltf::Model model;
  Skeleton skeleton;
  std::vector<ClipView> clips;
  PackedClips bank;
  std::uint32_t joints = 0;
  std::vector<Figure> figures;
};

/// Samples figures `first` to `end`, `seconds` after the beginning.
struct Contender {
  std::string name;
  std::function<void(std::uint32_t first, std::uint32_t end, double seconds)> sample;
  std::function<void()> prepare = [] {};
  std::array<double, 2> best{1e9, 1e9};  ///< seconds, on one thread and on two
};

/// Forward, inside the clip.
std::array<ClipLayer, 2> layersAt(const Figure& figure, double seconds) {
  std::array<ClipLayer, 2> layers = figure.layers;
  for (ClipLayer& layer : layers) layer.time += seconds;
  return layers;
}

using Poses = std::vector<std::vector<JointMatrix>>;

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

#ifdef DERMIS_BENCH_OZZ
namespace animation = ozz::animation;

/// The nodes that the bank has, and the clips.
class Ozz {
 public:
  explicit Ozz(const Subject& subject) : subject_(subject) {
    makeSkeleton();
    for (const ClipView& clip : subject.clips) addClip(clip);
    for (std::size_t i = 0; i < subject.figures.size(); ++i) {
      contexts_.push_back(std::make_unique<animation::SamplingJob::Context>(joints()));
      contexts_.push_back(std::make_unique<animation::SamplingJob::Context>(joints()));
      models_.emplace_back(static_cast<std::size_t>(joints()));
    }
  }

  std::size_t bytes() const {
    std::size_t sum = 0;
    for (const auto& clip : clips_) sum += clip->size();
    return sum;
  }

  void sample(std::uint32_t figure, double seconds) {
    struct Buffers {
      std::vector<ozz::math::SoaTransform> locals[2], blended;
    };
    static thread_local Buffers buffers;
    const auto count = static_cast<std::size_t>(skeleton_->num_soa_joints());
    buffers.blended.resize(count);
    std::array<animation::BlendingJob::Layer, 2> layers;
    const auto at = layersAt(subject_.figures[figure], seconds);
    for (std::size_t i = 0; i < 2; ++i) {
      buffers.locals[i].resize(count);
      const animation::Animation& clip = *clips_[at[i].clip];
      const double duration = double{clip.duration()};
      animation::SamplingJob job;
      job.animation = &clip;
      job.context = contexts_[2 * figure + i].get();
      job.ratio = static_cast<float>(std::fmod(at[i].time, duration) / duration);
      job.output = ozz::make_span(buffers.locals[i]);
      if (!job.Run()) fail("ozz: SamplingJob");
      layers[i].transform = ozz::make_span(buffers.locals[i]);
      layers[i].weight = at[i].weight;
    }
    animation::BlendingJob blend;
    blend.layers = ozz::span<const animation::BlendingJob::Layer>(layers.data(), 2);
    blend.rest_pose = skeleton_->joint_rest_poses();
    blend.output = ozz::make_span(buffers.blended);
    if (!blend.Run()) fail("ozz: BlendingJob");
    animation::LocalToModelJob compose;
    compose.skeleton = skeleton_.get();
    compose.input = ozz::make_span(buffers.blended);
    compose.output = ozz::make_span(models_[figure]);
    if (!compose.Run()) fail("ozz: LocalToModelJob");
  }

  /// The largest difference of joint positions from those of Dermis.
  double difference(const Poses& poses) const {
    const ClipBank bank(subject_.bank);
    double largest = 0;
    for (std::size_t figure = 0; figure < poses.size(); ++figure) {
      const BankSkin skin = bank.skin(0);
      for (std::size_t joint = 0; joint < skin.jointCount; ++joint) {
        const std::uint32_t node = bank.words[skin.nodes + joint];
        if (node == noNode) continue;
        const auto bind = bank.at<Affine<float>>(skin.matrices + 12 * joint);
        float columns[4][4];
        for (int i = 0; i < 4; ++i)
          ozz::math::StorePtrU(models_[figure][jointOf_[node]].cols[i], columns[i]);
        for (std::size_t row = 0; row < 3; ++row) {
          double sum = double{columns[3][row]};
          for (std::size_t k = 0; k < 3; ++k) sum += double{columns[k][row]} * double{bind[k][3]};
          largest = std::max(largest, std::abs(sum - double{poses[figure][joint].m[row][3]}));
        }
      }
    }
    return largest;
  }

 private:
  int joints() const { return skeleton_->num_joints(); }

  void makeSkeleton() {
    namespace offline = animation::offline;
    using Joint = offline::RawSkeleton::Joint;
    const ClipBank bank(subject_.bank);
    const std::size_t nodes = bank.header.nodeCount;
    const std::function<Joint(std::size_t)> make = [&](std::size_t number) {
      const BankNode node = bank.node(number);
      Joint joint;
      joint.name = std::to_string(number).c_str();
      const auto& r = node.rotation;
      joint.transform = {{node.translation[0], node.translation[1], node.translation[2]},
                         {r[0], r[1], r[2], r[3]},
                         {node.scale[0], node.scale[1], node.scale[2]}};
      for (std::size_t i = 0; i < nodes; ++i) {
        if (bank.node(i).parent == number) joint.children.push_back(make(i));
      }
      return joint;
    };
    offline::RawSkeleton raw;
    for (std::size_t i = 0; i < nodes; ++i) {
      if (bank.node(i).parent == noNode) raw.roots.push_back(make(i));
    }
    skeleton_ = offline::SkeletonBuilder()(raw);
    if (skeleton_ == nullptr) fail("ozz: SkeletonBuilder");
    jointOf_.resize(nodes);
    jointOfSource_.resize(subject_.skeleton.nodes.size(), -1);
    for (int i = 0; i < joints(); ++i) {
      jointOf_[nodeOf(i)] = static_cast<std::size_t>(i);
      jointOfSource_[bank.node(nodeOf(i)).source] = i;
    }
  }

  /// Keys at equal times would be refused, so a later one is a bit later.
  template <typename Keys, typename Value>
  static void addKeys(const ChannelView& channel, float duration, Keys& keys, const Value& value) {
    if (channel.interpolation == Interpolation::cubicSpline) fail("a channel is a cubic spline");
    float last = -1;
    const auto add = [&](float time, std::size_t key) {
      if (time <= last) time = std::nextafter(last, 1e9f);
      last = time;
      if (time >= 0 && time <= duration) keys.push_back({time, value(key)});
    };
    for (std::size_t i = 0; i < channel.times.size(); ++i) {
      if (i > 0 && channel.interpolation == Interpolation::step)
        add(std::nextafter(channel.times[i], 0.0f), i - 1);
      add(channel.times[i], i);
    }
  }

  void addClip(const ClipView& clip) {
    namespace offline = animation::offline;
    offline::RawAnimation raw;
    raw.duration = static_cast<float>(clip.duration);
    raw.tracks.resize(static_cast<std::size_t>(joints()));
    for (int i = 0; i < joints(); ++i) {
      const ozz::math::Transform rest = restOf(i);
      raw.tracks[static_cast<std::size_t>(i)].translations.push_back({0, rest.translation});
      raw.tracks[static_cast<std::size_t>(i)].rotations.push_back({0, rest.rotation});
      raw.tracks[static_cast<std::size_t>(i)].scales.push_back({0, rest.scale});
    }
    for (const ChannelView& channel : clip.channels) {
      const int joint = jointOfSource_[channel.node];
      if (joint < 0) continue;
      auto& track = raw.tracks[static_cast<std::size_t>(joint)];
      const auto vector = [&](std::size_t key) {
        const float* const v = &channel.values[3 * key];
        return ozz::math::Float3(v[0], v[1], v[2]);
      };
      if (channel.path == ChannelPath::translation) {
        track.translations.clear();
        addKeys(channel, raw.duration, track.translations, vector);
      } else if (channel.path == ChannelPath::scale) {
        track.scales.clear();
        addKeys(channel, raw.duration, track.scales, vector);
      } else if (channel.path == ChannelPath::rotation) {
        track.rotations.clear();
        addKeys(channel, raw.duration, track.rotations, [&](std::size_t key) {
          const float* const v = &channel.values[4 * key];
          return ozz::math::Quaternion(v[0], v[1], v[2], v[3]);
        });
      }
    }
    offline::RawAnimation optimized;
    if (!offline::AnimationOptimizer()(raw, *skeleton_, &optimized))
      fail("ozz: AnimationOptimizer");
    clips_.push_back(offline::AnimationBuilder()(optimized));
    if (clips_.back() == nullptr) fail("ozz: AnimationBuilder");
  }

  /// Of the bank: the name of the joint.
  std::size_t nodeOf(int joint) const {
    const char* const name = skeleton_->joint_names()[static_cast<std::size_t>(joint)];
    return static_cast<std::size_t>(std::atoi(name));
  }

  ozz::math::Transform restOf(int joint) const {
    const ClipBank bank(subject_.bank);
    const BankNode node = bank.node(nodeOf(joint));
    const auto& r = node.rotation;
    return {{node.translation[0], node.translation[1], node.translation[2]},
            {r[0], r[1], r[2], r[3]},
            {node.scale[0], node.scale[1], node.scale[2]}};
  }

  const Subject& subject_;
  ozz::unique_ptr<animation::Skeleton> skeleton_;
  std::vector<ozz::unique_ptr<animation::Animation>> clips_;
  std::vector<std::size_t> jointOf_;  ///< of each node of the bank
  std::vector<int> jointOfSource_;    ///< of each node of the skeleton
  std::vector<std::unique_ptr<animation::SamplingJob::Context>> contexts_;  ///< two for each figure
  std::vector<std::vector<ozz::math::Float4x4>> models_;
};
#endif

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
