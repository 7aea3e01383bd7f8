#include "played_clips.h"

#include <algorithm>
#include <array>
#include <utility>

#include "scene_meshes.h"

namespace dermis::test {
namespace {

constexpr std::uint32_t chain = 20, beside = chain, faces = 21;  ///< nodes

Skeleton skeletonOf(std::span<const std::uint32_t> bent, std::span<const std::uint32_t> turned,
                    std::span<const JointMatrix> inverseBind) {
  Skeleton skeleton;
  for (std::uint32_t node = 0; node < chain; ++node) {
    skeleton.nodes.push_back({.translation = {0.1, 0.3, -0.05}});
    if (node > 0) skeleton.nodes.back().parent = node - 1;
  }
  skeleton.nodes.push_back({.parent = 0, .translation = {0.4, 0, 0}, .rotation = {0.6, 0, 0, 0.8}});
  static constexpr std::array<float, 4> weights{0, 0.25f, 0, 0.5f};
  for (const std::size_t count : {3u, 4u}) {
    skeleton.nodes.push_back({.parent = 0});
    skeleton.nodes.back().weights = std::span(weights).first(count);
  }
  skeleton.skins = {{"bent", bent, inverseBind}, {"turned", turned, inverseBind}};
  return skeleton;
}

Result<PackedClips> pack() {
  static constexpr std::array<std::uint32_t, 8> bent{19, 1, 2, 14, 3, 8, 0, 9};
  static constexpr std::array<std::uint32_t, 8> turned{0, 1, 2, 7, 4, beside, 1, 0};
  static const std::vector<JointMatrix> inverseBind(8);
  static constexpr std::array<float, 4> times{0, 0.25f, 0.5f, 1};
  static constexpr std::array<float, 16> turns{0, 0, 0,    1,    0.6f, 0,     0, 0.8f,
                                               0, 0, 0.6f, 0.8f, 0,    0.28f, 0, 0.96f};
  static constexpr std::array<float, 16> others{0, 0, 0.6f, 0.8f,  0, 0.28f, 0, 0.96f,
                                                0, 0, 0,    -1.0f, 0, 0,     0, 1};
  static constexpr std::array<float, 12> places{0.1f, 0.3f, 0,     0.4f, 0.3f, 0.1f,
                                                0.1f, 0.6f, -0.2f, 0.1f, 0.3f, 0};
  static constexpr std::array<float, 12> scales{1, 1, 1, 1.5f, 1, 0.75f, 1, 2, 1, 1, 1, 1};
  using enum ChannelPath;
  ClipView walk{.name = "walk", .duration = 1};
  walk.channels = {{.node = 1, .path = translation, .times = times, .values = places}};
  for (std::uint32_t node = 1; node < chain; ++node) {
    const std::span<const float> values = node % 3 == 1 ? turns : others;
    walk.channels.push_back({.node = node, .path = rotation, .times = times, .values = values});
  }
  ClipView jump{.name = "jump", .duration = 1, .wraps = false};
  jump.channels = {{.node = beside, .path = rotation, .times = times, .values = others},
                   {.node = 4,
                    .path = rotation,
                    .interpolation = Interpolation::step,
                    .times = times,
                    .values = turns}};
  // Weights that are 0 at times.
  static constexpr std::array<float, 12> threes{0, 1, 0, 0, 0.5f, 0, 0.75f, 0, 0, 0, 0, 0};
  static constexpr std::array<float, 16> fours{0, 0, 0, 0, 1,     0, 0, -0.5f,
                                               0, 0, 0, 0, 0.25f, 1, 1, 0.5f};
  walk.channels.push_back({.node = faces, .path = weights, .times = times, .values = threes});
  walk.channels.push_back({.node = faces + 1, .path = weights, .times = times, .values = fours});
  jump.channels.push_back({faces, weights, Interpolation::step, times, threes});
  jump.channels.push_back({faces + 1, weights, Interpolation::step, times, fours});
  ClipView swell{.name = "swell", .duration = 1, .additive = true};
  swell.channels = {{.node = 8, .path = scale, .times = times, .values = scales},
                    {.node = 1, .path = rotation, .times = times, .values = others},
                    {.node = faces + 1, .path = weights, .times = times, .values = fours}};
  const std::array clips{std::move(walk), std::move(jump), std::move(swell)};
  std::array<float, faces + 2> mask{};
  std::fill(mask.begin() + 2, mask.end(), 0.5f);
  const std::array<std::span<const float>, 1> masks{mask};
  return packClips(skeletonOf(bent, turned, inverseBind), clips, {.masks = masks});
}

}  // namespace

const PackedClips& playedClips() {
  static const PackedClips clips = must(pack());
  return clips;
}

std::span<const ClipLayer> playedLayers(std::uint32_t play) {
  using Layers = std::vector<ClipLayer>;
  constexpr std::uint32_t walk = 0, jump = 1, swell = 2;
  static const std::array<Layers, playCount> plays{
      Layers{},
      {{walk, 0.3}},
      {{walk, -7.9, 0.25f}, {jump, 0.77, 0.75f}},
      {{jump, 5}},
      {{jump, 0.6, 1, 1}},
      {{walk, 0.3}, {swell, 0.4, -0.5f}},
      {{swell, 12.3, 1, 0, true}, {walk, 1, 3}, {swell, 0.1, 0.7f, 1}, {jump, 0.1, 2, 1}},
      {{walk, 0.3, 0}},
      {{swell, 0.9}},
      {{walk, 1e6, 1, 0, true}, {walk, 0.55, 0.5f}}};
  return plays[play];
}

std::uint32_t weightedNode(std::uint32_t targets) {
  return targets == 3 ? faces : faces + 1;
}

std::vector<MorphWeight> playedMorphs(std::uint32_t play, std::uint32_t targets) {
  std::vector<float> weights(targets);
  must(sampleWeights(playedClips(), playedLayers(play), weightedNode(targets), weights));
  std::vector<MorphWeight> morphs;
  for (std::uint32_t target = 0; target < targets; ++target) {
    if (weights[target] != 0) morphs.push_back({target, weights[target]});
  }
  return morphs;
}

std::vector<JointMatrix> playedPose(std::uint32_t play, std::uint32_t skin) {
  std::vector<JointMatrix> pose(playedClips().jointCount(skin));
  must(samplePose(playedClips(), playedLayers(play), skin, pose));
  return pose;
}

}  // namespace dermis::test
