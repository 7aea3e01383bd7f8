// What benchmarks of clips measure: a model, and the same in ozz-animation where it was built with
// -DDERMIS_BENCH_OZZ=FOLDER.
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <cstdio>
#include <cstdlib>
#include <functional>
#include <memory>
#include <string>
#include <utility>
#include <vector>

#include "affine.h"
#include "clips/bank.h"
#include "dermis/clips.h"
#include "dermis/gltf.h"
#include "kit/bench/clip_pair.h"

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

namespace dermis::bench {

[[noreturn]] inline void fail(const std::string& what) {
  std::fprintf(stderr, "error: %s\n", what.c_str());
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
    for (std::uint32_t i = 0; i < count; ++i)
      figures.push_back({samples::clipPair(clipCount, i, 0)});
  }

  gltf::Model model;
  Skeleton skeleton;
  std::vector<ClipView> clips;
  PackedClips bank;
  std::uint32_t joints = 0;
  std::vector<Figure> figures;
};

/// Forward, inside the clip.
inline std::array<ClipLayer, 2> layersAt(const Figure& figure, double seconds) {
  std::array<ClipLayer, 2> layers = figure.layers;
  for (ClipLayer& layer : layers) layer.time += seconds;
  return layers;
}

using Poses = std::vector<std::vector<JointMatrix>>;

#ifdef DERMIS_BENCH_OZZ
namespace animation = ozz::animation;

/// The nodes that the bank has, and the clips.
class Ozz {
 public:
  /// With the tolerance of ozz-animation's optimizer, in meters; by default its own.
  explicit Ozz(const Subject& subject, float tolerance = 1e-3f)
      : subject_(subject), tolerance_(tolerance) {
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

  /// Whether `pose` is possible: between two nodes that move is none that does not.
  bool isComparable() const {
    const ClipBank bank(subject_.bank);
    for (std::size_t i = 0; i < bank.header.nodeCount; ++i) {
      if (bank.node(i).fixed != 0 && bank.node(i).parent != noNode) return false;
    }
    return true;
  }

  /// The pose of skin 0 in a clip, as Dermis has it.
  std::vector<JointMatrix> pose(std::uint32_t clip, double seconds) const {
    animation::SamplingJob::Context context(joints());
    std::vector<ozz::math::SoaTransform> locals(
        static_cast<std::size_t>(skeleton_->num_soa_joints()));
    std::vector<ozz::math::Float4x4> models(static_cast<std::size_t>(joints()));
    animation::SamplingJob sample;
    sample.animation = clips_[clip].get();
    sample.context = &context;
    sample.ratio = static_cast<float>(seconds / double{clips_[clip]->duration()});
    sample.output = ozz::make_span(locals);
    animation::LocalToModelJob compose;
    compose.skeleton = skeleton_.get();
    compose.input = ozz::make_span(locals);
    compose.output = ozz::make_span(models);
    if (!sample.Run() || !compose.Run()) fail("ozz: sampling a clip");
    const ClipBank bank(subject_.bank);
    const BankSkin skin = bank.skin(0);
    std::vector<JointMatrix> pose(skin.jointCount);
    for (std::size_t joint = 0; joint < pose.size(); ++joint) {
      const auto bind = bank.at<Affine<float>>(skin.matrices + 12 * joint);
      const std::uint32_t node = bank.words[skin.nodes + joint];
      Affine<double> global{{{1, 0, 0, 0}, {0, 1, 0, 0}, {0, 0, 1, 0}}};
      if (node != noNode) {
        float columns[4][4];
        for (int i = 0; i < 4; ++i)
          ozz::math::StorePtrU(models[jointOf_[node]].cols[i], columns[i]);
        for (std::size_t row = 0; row < 3; ++row) {
          for (std::size_t i = 0; i < 4; ++i) global[row][i] = double{columns[i][row]};
        }
        // What is folded into a root is above all that ozz-animation knows.
        std::uint32_t root = node;
        while (bank.node(root).parent != noNode) root = bank.node(root).parent;
        if (bank.node(root).fixed != 0)
          global = multiply(inDouble(bank.at<Affine<float>>(bank.node(root).fixed)), global);
      }
      const Affine<double> matrix = multiply(global, bind);
      for (std::size_t row = 0; row < 3; ++row) {
        for (std::size_t i = 0; i < 4; ++i)
          pose[joint].m[row][i] = static_cast<float>(matrix[row][i]);
      }
    }
    return pose;
  }

 private:
  static Affine<double> inDouble(const Affine<float>& matrix) {
    Affine<double> result;
    for (std::size_t row = 0; row < 3; ++row)
      std::copy_n(matrix[row].begin(), 4, result[row].begin());
    return result;
  }

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
    offline::AnimationOptimizer optimizer;
    optimizer.setting.tolerance = tolerance_;
    if (!optimizer(raw, *skeleton_, &optimized)) fail("ozz: AnimationOptimizer");
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
  float tolerance_;
  ozz::unique_ptr<animation::Skeleton> skeleton_;
  std::vector<ozz::unique_ptr<animation::Animation>> clips_;
  std::vector<std::size_t> jointOf_;  ///< of each node of the bank
  std::vector<int> jointOfSource_;    ///< of each node of the skeleton
  std::vector<std::unique_ptr<animation::SamplingJob::Context>> contexts_;  ///< two for each figure
  std::vector<std::vector<ozz::math::Float4x4>> models_;
};
#endif

}  // namespace dermis::bench
