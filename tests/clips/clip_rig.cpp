#include "clip_rig.h"

#include <algorithm>
#include <cmath>
#include <cstring>
#include <filesystem>
#include <utility>

#ifdef __linux__
#include <sys/resource.h>
#endif

#include <glm/geometric.hpp>
#include <glm/mat4x4.hpp>
#include <glm/matrix.hpp>
#include <glm/vec3.hpp>
#include <glm/vec4.hpp>

#include "dermis/verify.h"
#include "few_cases.h"
#include "gltf_builder.h"
#include "kit/clip_check.h"
#include "matrix_of.h"
#include "model_files.h"
#include "random_number.h"
#include "scene_meshes.h"
#include "test_data.h"
#include "test_paths.h"

namespace dermis::test {
namespace {

using glm::dmat4;
using glm::dvec3;
using glm::dvec4;

/// Column-major, as in a file.
constexpr std::array<double, 16> sheared{1,    0.1, 0,   0, 0.3, 0.9, 0, 0,
                                         -0.2, 0,   1.2, 0, 0.1, 0.5, 0, 1};

gltf::Node node(const char* name, std::uint32_t parent, std::array<double, 3> translation) {
  gltf::Node result;
  result.name = name;
  result.parent = parent;
  result.translation = translation;
  return result;
}

/// With the inverses of the matrices at rest.
gltf::Skin skin(const gltf::Model& model, const char* name, std::vector<std::uint32_t> joints) {
  gltf::Skin result{name, std::move(joints), {}};
  const std::vector<Transform> globals = gltf::nodeGlobals(model, noIndex, 0);
  for (const std::uint32_t joint : result.joints)
    result.inverseBindMatrices.push_back(
        toJointMatrix(glm::mat4(glm::inverse(matrixOf(globals[joint])))));
  return result;
}

double largestEntry(const dmat4& matrix) {
  double largest = 0;
  for (int column = 0; column < 4; ++column)
    for (int row = 0; row < 3; ++row) largest = std::max(largest, std::abs(matrix[column][row]));
  return largest;
}

std::function<ClipSampler(const PackedClips&)> makeSampler;

}  // namespace

void setClipSampler(std::function<ClipSampler(const PackedClips& clips)> make) {
  makeSampler = std::move(make);
}

gltf::Channel channel(std::uint32_t node, ChannelPath path, Floats times, Floats values,
                      Interpolation interpolation) {
  gltf::Channel result;
  result.node = node;
  result.path = path;
  result.interpolation = interpolation;
  result.components = path == ChannelPath::rotation ? 4 : 3;
  result.times = std::move(times);
  result.values = std::move(values);
  return result;
}

gltf::Model armRig() {
  gltf::Model model;
  model.nodes = {node("hand", arm::upper, {0, 0.6, 0}),
                 node("root", noIndex, {0.1, 0, 0.2}),
                 node("upper", arm::shoulder, {0.2, 0.4, 0}),
                 node("body", arm::root, {0, 1, 0}),
                 node("prop", arm::hand, {}),
                 node("shoulder", arm::collar, {}),
                 node("collar", arm::body, {0.3, 0.2, -0.1}),
                 node("stand", noIndex, {2, 0, 0})};
  model.nodes[arm::prop].matrix = sheared;
  model.nodes[arm::shoulder].matrix = sheared;
  model.nodes[arm::collar].rotation = {0.48, 0, 0.6, 0.64};
  model.nodes[arm::collar].scale = {1, 1.5, 0.75};
  model.nodeOrder = {arm::root,     arm::stand, arm::body, arm::collar,
                     arm::shoulder, arm::upper, arm::hand, arm::prop};
  model.skins = {skin(model, "figure",
                      {arm::hand, arm::upper, arm::body, arm::prop, arm::root, arm::shoulder}),
                 skin(model, "stand", {arm::stand, arm::root})};

  using enum ChannelPath;
  gltf::Clip wave{"wave", 1.25, {}};
  wave.channels = {
      channel(arm::hand, rotation, {0, 0.21f, 0.5f, 1.25f},
              {0, 0, 0, 1, 0, 0, 0.6f, 0.8f, 0.6f, 0, 0, 0.8f, 0, 0, 0, 1}),
      channel(arm::upper, rotation, {0.1f, 0.7f, 1.1f},
              {0, 0.28f, 0, 0.96f, 0.36f, 0.48f, 0, 0.8f, 0, 0.28f, 0, 0.96f}),
      channel(arm::upper, scale, {0, 0.6f, 1.25f}, {1, 1, 1, 1.5f, 0.8f, 1, 1, 1, 1}),
      channel(arm::body, translation, {0, 0.5f, 1.25f},
              {0,     0, 0, 0, 1, 0, 1, 0, 0, 0.5f, 0, 0, 0.5f, 1.2f, 0.1f, 0, 0.3f, 0,  //
               -0.4f, 0, 0, 0, 1, 0, 0, 0, 0},
              Interpolation::cubicSpline)};
  gltf::Clip reach{"reach", 0.8, {}};
  reach.channels = {
      channel(arm::hand, rotation, {0, 0.8f}, {0, 0, 0, 1, 0.6f, 0, 0, 0.8f}),
      channel(arm::body, translation, {0, 0.3f, 0.8f}, {0, 1, 0, 0.3f, 1.1f, 0, 0.5f, 1, 0.2f}),
      channel(arm::body, rotation, {0.2f, 0.6f}, {0, 0, 0, 1, 0, 0.6f, 0, 0.8f})};
  model.clips = {std::move(wave), std::move(reach)};
  return model;
}

PackedRig::PackedRig(gltf::Model from)
    : model(std::move(from)), skeleton(gltf::skeleton(model)), clips(gltf::clips(model)) {
  dvec3 low(HUGE_VAL), high(-HUGE_VAL);
  for (const Transform& global : gltf::nodeGlobals(model, noIndex, 0)) {
    const dvec3 place(matrixOf(global)[3]);
    low = glm::min(low, place);
    high = glm::max(high, place);
  }
  if (glm::length(high - low) > 0) extent_ = glm::length(high - low);
}

std::vector<std::span<const float>> PackedRig::maskSpans() const {
  return {masks.begin(), masks.end()};
}

Result<PackedClips> PackedRig::tryToPack() {
  const std::vector<std::span<const float>> spans = maskSpans();
  options.masks = spans;
  Result<PackedClips> packed = packClips(skeleton, clips, options, &report);
  options.masks = {};
  return packed;
}

bool PackedRig::pack() {
  Result<PackedClips> packed = tryToPack();
  if (!packed) {
    ADD_FAILURE() << packed.error().message;
    return false;
  }
  EXPECT_EQ(report.byteCount, packed->bytes().size());
  EXPECT_GT(report.maxError, 0);
  EXPECT_LE(report.worstError, report.maxError);
  EXPECT_EQ(packed->clipCount(), clips.size());
  EXPECT_EQ(packed->maskCount(), masks.size());
  EXPECT_EQ(packed->skinCount(), skeleton.skins.size());
  bank = std::move(*packed);
  if (makeSampler) sampler_ = makeSampler(*bank);
  return true;
}

std::vector<JointMatrix> PackedRig::sample(std::span<const ClipLayer> layers,
                                           std::uint32_t skin) const {
  if (sampler_) return sampler_(layers, skin);
  std::vector<JointMatrix> pose(bank->jointCount(skin));
  const Result<void> sampled = samplePose(*bank, layers, skin, pose);
  EXPECT_TRUE(sampled.ok()) << sampled.error().message;
  return pose;
}

double PackedRig::check(std::span<const ClipLayer> layers) const {
  double worst = 0;
  const std::size_t skins = skeleton.skins.size();
  for (std::size_t i = 0; i < std::min<std::size_t>(skins, 4); ++i) {
    const auto skin = static_cast<std::uint32_t>(checkedSkins_++ % skins);
    worst = std::max(worst, checkSkin(layers, skin));
  }
  return worst;
}

Result<reference::SampledPose> PackedRig::expected(std::span<const ClipLayer> layers,
                                                   std::uint32_t skin) const {
  return reference::samplePose(skeleton, clips, maskSpans(), layers, skin, &*bank,
                               options.rootMotion ? &*options.rootMotion : nullptr);
}

double PackedRig::checkSkin(std::span<const ClipLayer> layers, std::uint32_t skin) const {
  const std::vector<JointMatrix> pose = sample(layers, skin);
  const Result<reference::SampledPose> expected = this->expected(layers, skin);
  if (!expected) {
    ADD_FAILURE() << expected.error().message;
    return HUGE_VAL;
  }
  double worst = 0;
  for (std::size_t joint = 0; joint < pose.size(); ++joint) {
    const dmat4 sampled = matrixOf(pose[joint].m);
    EXPECT_TRUE(std::isfinite(largestEntry(sampled))) << "joint " << joint;
    const auto [atJoint, perDistance, shape] = expected->bounds.at(joint);
    // Without an inverse there is no frame of the joint.
    if (!std::isfinite(atJoint) || !std::isfinite(perDistance)) continue;
    // A rotation changes no length.
    const auto stretchOf = [](const auto& matrix, const dvec3& toward) {
      return glm::length(dvec3(matrix * dvec4(toward, 0))) / glm::length(toward);
    };
    const dmat4 source = matrixOf(expected->joints[joint]);
    const dmat4 error =
        (sampled - source) * glm::inverse(matrixOf(skeleton.skins[skin].inverseBind[joint].m));
    for (const double distance : {0.0, 1e-3 * extent_, extent_, 10 * extent_}) {
      for (int direction = 0; direction < 27; ++direction) {
        const dvec3 toward(direction % 3 - 1, direction / 3 % 3 - 1, direction / 9 - 1);
        if ((toward == dvec3(0)) != (distance == 0)) continue;
        const dvec3 point = distance == 0 ? dvec3(0) : distance * glm::normalize(toward);
        const double off = glm::length(dvec3(error * dvec4(point, 1)));
        const double bound = atJoint + perDistance * distance;
        if (off > 0) worst = std::max(worst, off / bound);
        if (distance != extent_) continue;
        const double stretched = std::abs(stretchOf(sampled, toward) - stretchOf(source, toward));
        if (stretched > 0) worst = std::max(worst, stretched / shape);
      }
    }
  }
  EXPECT_LE(worst, 1) << "skin " << skin;
  return worst;
}

double PackedRig::checkWeights(std::span<const ClipLayer> layers) const {
  double worst = 0;
  for (std::uint32_t node = 0; node < skeleton.nodes.size(); ++node) {
    std::vector<float> weights(bank->weightCount(node));
    EXPECT_EQ(weights.size(), skeleton.nodes[node].weights.size());
    const Result<void> sampled = sampleWeights(*bank, layers, node, weights);
    EXPECT_TRUE(sampled.ok()) << sampled.error().message;
    const Result<reference::SampledWeights> expected =
        reference::sampleWeights(skeleton, clips, maskSpans(), layers, node, &*bank);
    if (!expected) {
      ADD_FAILURE() << expected.error().message;
      return HUGE_VAL;
    }
    for (std::size_t i = 0; i < weights.size(); ++i) {
      const double off = std::abs(double{weights[i]} - expected->weights.at(i));
      EXPECT_LE(off, expected->bounds.at(i)) << "node " << node << ", weight " << i;
      if (off > 0) worst = std::max(worst, off / expected->bounds[i]);
    }
  }
  return worst;
}

bool PackedRig::isNearJump(const ClipLayer& layer) const {
  return samples::isNearJump(clips[layer.clip],
                             double{clipTime(bank->clip(layer.clip), layer.time, layer.hold)});
}

std::vector<ClipLayer> randomLayers(const PackedRig& rig, std::mt19937& random) {
  std::vector<ClipLayer> layers(below(random, maxClipLayers + 1));
  for (ClipLayer& layer : layers) {
    layer.clip = below(random, rig.clips.size());
    const ClipView& clip = rig.clips[layer.clip];
    const double least = clip.additive ? -1 : 0;
    layer.weight = static_cast<float>(chance(random, 15) ? 0 : between(random, least, 1.5));
    layer.mask = below(random, rig.masks.size() + 1);
    layer.hold = chance(random, 20);
    for (int attempt = 0; attempt < 100; ++attempt) {
      layer.time = clip.duration * between(random, -1, 3);
      if (!rig.isNearJump(layer)) break;
    }
    if (rig.isNearJump(layer)) layer.time = 0;
  }
  return layers;
}

namespace {

/// Returns the number of models. Of the test data it loads every `everyFile`-th.
std::uint32_t forEachModelWith(const std::function<bool(gltf::Model&)>& isWanted,
                               std::uint32_t maxClips, std::size_t everyFile,
                               const std::function<void(gltf::Model, std::uint32_t)>& call) {
  std::vector<std::filesystem::path> files;
  for (const char* name : {"arm.glb", "bar.glb", "figure.glb"})
    files.push_back(std::filesystem::path(sampleModels) / name);
  if (const auto data = testDataFolder()) {
    const std::vector<std::filesystem::path> more = modelFiles(*data);
    for (std::size_t i = 0; i < more.size(); i += everyFile) files.push_back(more[i]);
  }
  std::uint32_t number = 0;
  for (const std::filesystem::path& file : files) {
    SCOPED_TRACE(file.string());
    gltf::Model model = loaded(gltf::load(file));
    if (!isWanted(model)) continue;
    if (model.clips.size() > maxClips) model.clips.resize(maxClips);
    call(std::move(model), number++);
  }
  return number;
}

bool animatesWeights(const gltf::Clip& clip) {
  return std::ranges::count(clip.channels, ChannelPath::weights, &gltf::Channel::path) > 0;
}

}  // namespace

void forEachAnimatedModel(std::uint32_t maxClips,
                          const std::function<void(gltf::Model, std::uint32_t)>& call) {
  const auto isWanted = [](const gltf::Model& model) {
    return !model.skins.empty() && !model.clips.empty();
  };
  EXPECT_GE(forEachModelWith(isWanted, maxClips, hasFewCases ? 10 : 1, call),
            testDataFolder() ? fewer(20u, 4u) : 3u);
}

void forEachMorphedModel(std::uint32_t maxClips,
                         const std::function<void(gltf::Model, std::uint32_t)>& call) {
  const auto isWanted = [](gltf::Model& model) {
    std::erase_if(model.clips, [](const gltf::Clip& clip) { return !animatesWeights(clip); });
    if (model.skins.empty()) model.skins.push_back({"made", {0}, {JointMatrix{}}});
    return !model.clips.empty();
  };
  EXPECT_GE(forEachModelWith(isWanted, maxClips, 1, call), testDataFolder() ? 3u : 0u);
}

std::uint64_t peakKilobytes() {
#if defined(__linux__) && !defined(__SANITIZE_THREAD__)
  rusage usage{};
  getrusage(RUSAGE_SELF, &usage);
  return static_cast<std::uint64_t>(usage.ru_maxrss);
#else
  return 0;
#endif
}

bool areSame(std::span<const JointMatrix> a, std::span<const JointMatrix> b) {
  return a.size() == b.size() &&
         (a.empty() || std::memcmp(a.data(), b.data(), a.size_bytes()) == 0);
}

}  // namespace dermis::test
