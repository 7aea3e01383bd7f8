#include "clip_verification.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <iterator>
#include <map>
#include <optional>
#include <span>
#include <string_view>
#include <utility>
#include <vector>

#include "dermis/clips.h"
#include "dermis/gltf.h"
#include "dermis/verify.h"
#include "kit/clip_check.h"
#include "kit/memory_left.h"
#include "kit/text.h"

namespace dermis::cli {
namespace {

/// The clips of a scene, and their bank.
struct Animations {
  Skeleton skeleton;                 ///< with the skins that the scene uses
  std::vector<std::uint32_t> skins;  ///< their numbers in the file
  std::vector<ClipView> clips;       ///< of the file; then the first one again, additive
  std::vector<float> mask;
  std::optional<PackedClips> bank;

  bool hasAdditive() const { return clips.back().additive; }
};

/// The second half of each skin's joints has the factor 1, other nodes have 0.25.
std::vector<float> maskOf(const Skeleton& skeleton) {
  std::vector<float> mask(skeleton.nodes.size(), 0.25f);
  for (const SkeletonSkin& skin : skeleton.skins) {
    for (const std::uint32_t joint : skin.joints.subspan(skin.joints.size() / 2)) mask[joint] = 1;
  }
  return mask;
}

Animations animationsOf(const Scene& scene, samples::Coverage coverage) {
  Animations animations;
  animations.skeleton = gltf::skeleton(*scene.model);
  std::vector<SkeletonSkin> used;
  for (std::uint32_t skin = 0; skin < scene.model->skins.size(); ++skin) {
    const auto uses = [skin](const ScenePart& part) {
      return part.mesh != nullptr && part.source.skin == skin;
    };
    if (!std::ranges::any_of(scene.parts, uses)) continue;
    animations.skins.push_back(skin);
    used.push_back(animations.skeleton.skins[skin]);
  }
  animations.skeleton.skins = std::move(used);
  animations.clips = gltf::clips(*scene.model);
  if (coverage == samples::Coverage::quick && animations.clips.size() > 2)
    animations.clips.resize(2);
  animations.mask = maskOf(animations.skeleton);
  return animations;
}

/// Packs, with the additive clip if that is possible.
Result<void> packWithAdditive(Animations& animations) {
  std::vector<ClipView>& clips = animations.clips;
  const std::span<const float> mask = animations.mask;
  const PackClipsOptions options{.masks = {&mask, 1}};
  clips.push_back(clips[0]);
  clips.back().additive = true;
  Result<PackedClips> packed = packClips(animations.skeleton, clips, options);
  if (!packed) {
    clips.pop_back();
    packed = packClips(animations.skeleton, clips, options);
  }
  if (!packed) return packed.error();
  animations.bank = std::move(*packed);
  return {};
}

// ---- What is played.

struct Play {
  std::string name;  ///< "clip 0 'walk' at 0.3 s, weight 0.25 + clip 1 'run' at 1 s, mask 1"
  std::vector<ClipLayer> layers;
};

class PlayList {
 public:
  explicit PlayList(const Animations& animations) : animations_(animations) {}

  std::vector<Play> all(samples::Coverage coverage) {
    const auto last = static_cast<std::uint32_t>(animations_.bank->clipCount() - 1);
    const std::uint32_t count = animations_.hasAdditive() ? last : last + 1;
    add({});
    for (std::uint32_t clip = 0; clip < count; ++clip) {
      add({layer(clip, 1.77)});  // it wraps
      if (coverage == samples::Coverage::quick) continue;
      add({layer(clip, 0)});
      add({layer(clip, 0.31)});
      add({layer(clip, 1.77, {.hold = true})});
    }
    const ClipLayer first = layer(0, 0.31, {.weight = 0.25f});
    const ClipLayer second = layer(count > 1 ? 1 : 0, 0.77, {.weight = 0.75f, .mask = 1});
    const ClipLayer third = layer(count - 1, 0.52, {.weight = 0.5f});
    add({first, second});
    add({first, second, third});
    if (animations_.hasAdditive()) {
      add({second, layer(last, 0.4)});
      add({first, second, third, layer(last, 0.6, {.weight = -0.5f, .mask = 1})});
    } else {
      add({first, second, third, layer(0, 0.9, {.weight = 0.125f})});
    }
    return std::move(plays_);
  }

 private:
  /// A layer at a share of the clip's duration, or a little later if the clip jumps there.
  ClipLayer layer(std::uint32_t clip, double share, ClipLayer made = {}) const {
    const ClipView& view = animations_.clips[clip];
    made.clip = clip;
    for (int attempt = 0; attempt < 16; ++attempt) {
      made.time = (share + 0.011 * attempt) * view.duration;
      const float inside = clipTime(animations_.bank->clip(clip), made.time, made.hold);
      if (!samples::isNearJump(view, double{inside})) return made;
    }
    made.time = 0;
    return made;
  }

  void add(std::vector<ClipLayer> layers) {
    std::string name;
    for (const ClipLayer& layer : layers) {
      const ClipView& clip = animations_.clips[layer.clip];
      name += name.empty() ? "" : " + ";
      name += clip.additive ? "additive clip 0" : fmt::format("clip {}", layer.clip);
      name += fmt::format(" {} at {:.4g} s", samples::inQuotes(clip.name), layer.time);
      if (layer.weight != 1) name += fmt::format(", weight {}", layer.weight);
      if (layer.mask != 0) name += fmt::format(", mask {}", layer.mask);
      if (layer.hold) name += ", held";
    }
    plays_.push_back({name.empty() ? "rest pose" : std::move(name), std::move(layers)});
  }

  const Animations& animations_;
  std::vector<Play> plays_;
};

// ---- What comes of it.

class PlayVerifier {
 public:
  PlayVerifier(const Scene& scene, const Animations& animations)
      : scene_(scene), animations_(animations), mask_(animations.mask) {}

  /// Bytes that the results of one play take, those in the making included.
  std::uint64_t bytesOfPlay() const {
    std::uint64_t bytes = 0;
    for (const SkeletonSkin& skin : animations_.skeleton.skins)
      bytes += sizeof(VerifiedCase) + 1024 + 3 * sizeof(JointMatrix) * skin.joints.size();
    bytes += scene_.parts.size() * (sizeof(VerifiedCase) + 1024);
    for (const SkeletonNode& node : animations_.skeleton.nodes)
      bytes += node.weights.empty() ? 0 : sizeof(VerifiedCase) + 1024 + 32 * node.weights.size();
    return bytes;
  }

  Result<std::vector<VerifiedCase>> verify(samples::BatchTarget& target,
                                           std::span<const Play> plays) const {
    std::vector<std::vector<ClipLayer>> layers;
    for (const Play& play : plays) layers.push_back(play.layers);
    const auto poses = target.samplePoses(*animations_.bank, layers);
    if (!poses) return poses.error();
    Weights weights;
    for (std::uint32_t node = 0; node < animations_.skeleton.nodes.size(); ++node) {
      if (animations_.bank->weightCount(node) == 0) continue;
      auto sampled = target.sampleWeights(*animations_.bank, layers, node);
      if (!sampled) return sampled.error();
      weights.emplace(node, *std::move(sampled));
    }
    std::vector<VerifiedCase> cases;
    auto pose = poses->begin();
    for (std::size_t number = 0; number < plays.size(); ++number) {
      const Play& play = plays[number];
      std::vector<PlayedSkin> skins;
      for (std::uint32_t skin = 0; skin < animations_.skins.size(); ++skin) {
        Result<reference::SampledPose> expected = verifyPose(play, skin, *pose, cases);
        if (!expected) return expected.error();
        skins.push_back({*pose++, *std::move(expected)});
      }
      if (Result<void> done = verifyVertices(target, play, number, skins, weights, cases); !done)
        return done.error();
      for (const auto& [node, ofPlays] : weights) {
        if (Result<void> done = verifyWeights(play, node, ofPlays[number], cases); !done)
          return done.error();
      }
    }
    return cases;
  }

 private:
  /// The pose that the target sampled, and that of the source.
  struct PlayedSkin {
    std::span<const JointMatrix> pose;
    reference::SampledPose expected;
  };
  using Weights = std::map<std::uint32_t, std::vector<std::vector<float>>>;  ///< by node and play

  Result<reference::SampledPose> verifyPose(const Play& play, std::uint32_t skin,
                                            std::span<const JointMatrix> pose,
                                            std::vector<VerifiedCase>& cases) const {
    Result<reference::SampledPose> expected =
        reference::samplePose(animations_.skeleton, animations_.clips, {&mask_, 1}, play.layers,
                              skin, &*animations_.bank);
    if (!expected) return expected.error();
    const SkeletonSkin& compared = animations_.skeleton.skins[skin];
    cases.push_back(newCase("skin", animations_.skins[skin], compared.name, play));
    cases.back().variant = "joint matrices";
    cases.back().comparison = samples::comparePose(pose, *expected, compared);
    return expected;
  }

  /// The active morph targets of a part, as the target sampled their weights.
  static std::vector<MorphWeight> morphsOf(const ScenePart& part, const Weights& weights,
                                           std::size_t number) {
    std::vector<MorphWeight> morphs;
    const auto sampled = weights.find(part.source.node);
    if (sampled == weights.end()) return morphs;
    const std::vector<float>& values = sampled->second[number];
    const std::size_t targets = std::min(values.size(), part.primitive->morphTargets.size());
    for (std::uint32_t target = 0; target < targets; ++target) {
      if (values[target] != 0 && std::isfinite(values[target]))
        morphs.push_back({target, values[target]});
    }
    return morphs;
  }

  /// Skins each part in the pose that the target sampled, by one of the methods that have bounds
  /// for it: another one in the next play. Meshes that need the joints of a rig are left out.
  Result<void> verifyVertices(samples::BatchTarget& target, const Play& play, std::size_t number,
                              std::span<const PlayedSkin> skins, const Weights& weights,
                              std::vector<VerifiedCase>& cases) const {
    struct Skinned {
      const ScenePart& part;
      const PlayedSkin& skin;
      Method method;
      std::vector<MorphWeight> morphs;
    };
    std::vector<Skinned> figures;
    for (std::size_t index = 0; index < scene_.parts.size(); ++index) {
      const ScenePart& part = scene_.parts[index];
      if (part.mesh == nullptr || scene_.rigs.contains(part.source.skin)) continue;
      std::vector<Method> methods;
      std::ranges::copy_if(target.methods(), std::back_inserter(methods), [&](Method method) {
        return !isForComparison(method) && part.mesh->allows(method);
      });
      const auto skin = static_cast<std::size_t>(
          std::ranges::find(animations_.skins, part.source.skin) - animations_.skins.begin());
      figures.push_back({part, skins[skin], methods[(number + index) % methods.size()],
                         morphsOf(part, weights, number)});
    }
    if (figures.empty()) return {};
    std::vector<samples::SkinRequest> requests;
    for (const Skinned& figure : figures) {
      samples::SkinRequest& request = requests.emplace_back();
      request.mesh = &figure.part.mesh->packed();
      request.pose = figure.skin.pose;
      request.method = figure.method;
      request.morphs = figure.morphs;
    }
    samples::RunOptions options;
    options.output.tangents = VertexFormat::float32x4;
    options.countUntouched = false;
    const Result<samples::BatchResult> result = target.run(requests, options);
    if (!result) return result.error();
    for (std::size_t index = 0; index < figures.size(); ++index) {
      const auto& [part, skin, method, morphs] = figures[index];
      const Result<reference::SkinnedMesh> expected =
          reference::skin(part.mesh->view(), skin.expected, method, morphs);
      if (!expected) return expected.error();
      const Result<Comparison> comparison =
          compareWithReference(*expected, result->instances[index].view(), exemptionsOf(*expected));
      if (!comparison) return comparison.error();
      VerifiedCase verified;
      verified.part = part.name;
      verified.method = methodName(method);
      verified.pose = play.name;
      verified.variant = "in the sampled pose";
      verified.comparison = *comparison;
      verified.status = result->instances[index].status;
      // There is nothing to compare if no vertex has a bound, as if its joint may be anywhere.
      if (verified.passed() || comparison->failures != 0) cases.push_back(std::move(verified));
    }
    return {};
  }

  Result<void> verifyWeights(const Play& play, std::uint32_t node, std::span<const float> weights,
                             std::vector<VerifiedCase>& cases) const {
    const Result<reference::SampledWeights> expected =
        reference::sampleWeights(animations_.skeleton, animations_.clips, {&mask_, 1}, play.layers,
                                 node, &*animations_.bank);
    if (!expected) return expected.error();
    cases.push_back(newCase("node", node, scene_.model->nodes[node].name, play));
    cases.back().variant = weightsVariant;
    cases.back().comparison = samples::compareWeights(weights, *expected);
    return {};
  }

  static VerifiedCase newCase(const char* what, std::uint32_t number, std::string_view name,
                              const Play& play) {
    VerifiedCase verified;
    verified.part = fmt::format("{} {}", what, number);
    if (!name.empty()) verified.part += " " + samples::inQuotes(name);
    verified.method = clipsMethod;
    verified.pose = play.name;
    return verified;
  }

  const Scene& scene_;
  const Animations& animations_;
  std::span<const float> mask_;
};

/// Plays that are sampled at once.
constexpr std::size_t playsOfTask = 64;

}  // namespace

Result<std::vector<VerifiedCase>> verifyClips(samples::TargetPool& pool, const Scene& scene,
                                              samples::Coverage coverage,
                                              std::vector<std::string>& warnings) {
  std::vector<VerifiedCase> all;
  if (scene.model->clips.empty()) return all;
  Animations animations = animationsOf(scene, coverage);
  if (const Result<void> packed = packWithAdditive(animations); !packed) {
    warnings.push_back(fmt::format("clips are not verified: {}", packed.error().message));
    return all;
  }
  const PlayVerifier verifier(scene, animations);
  const std::vector<Play> plays = PlayList(animations).all(coverage);
  if (!samples::spend(scene.model->memoryLeft, plays.size(), verifier.bytesOfPlay())) {
    warnings.push_back(
        "clips are not verified: their poses need more memory than the limit for a file of this "
        "size");
    return all;
  }
  std::vector<std::vector<VerifiedCase>> byTask((plays.size() + playsOfTask - 1) / playsOfTask);
  Result<void> done =
      pool.run({.tasks = byTask.size()},
               [&](std::size_t index, samples::BatchTarget& target) -> Result<void> {
                 const std::span<const Play> rest = std::span(plays).subspan(index * playsOfTask);
                 Result<std::vector<VerifiedCase>> verified =
                     verifier.verify(target, rest.first(std::min(rest.size(), playsOfTask)));
                 if (!verified) return verified.error();
                 byTask[index] = std::move(*verified);
                 return {};
               });
  if (!done) return done.error();
  for (std::vector<VerifiedCase>& cases : byTask) std::ranges::move(cases, std::back_inserter(all));
  return all;
}

}  // namespace dermis::cli
