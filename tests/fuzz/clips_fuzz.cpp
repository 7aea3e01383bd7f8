// libFuzzer: any bytes as a stored bank of clips, and any numbers as a skeleton with clips to pack.
// What is accepted must be safe to sample with any layers, by a function and in a scene, and to
// bound.

#include <algorithm>
#include <array>
#include <cstddef>
#include <cstdint>
#include <cstring>
#include <span>
#include <vector>

#include "changed_blob.h"
#include "dermis/clips.h"
#include "dermis/cpu.h"
#include "kernel_reads.h"

using namespace dermis;
using fuzz::require;

namespace {

/// Takes numbers from the data; zeros when it has ended.
class Input {
 public:
  explicit Input(std::span<const std::uint8_t> data) : data_(data) {}

  template <typename T>
  T take() {
    T value{};
    const std::size_t size = std::min(sizeof(T), data_.size());
    if (size != 0) std::memcpy(&value, data_.data(), size);
    data_ = data_.subspan(size);
    return value;
  }
  std::uint32_t below(std::uint32_t count) { return take<std::uint8_t>() % count; }
  /// A small number mostly, at times any bits.
  float number() {
    const auto byte = take<std::uint8_t>();
    return byte < 250 ? (static_cast<float>(byte) - 100) / 16 : take<float>();
  }
  std::span<const std::uint8_t> rest() const { return data_; }

 private:
  std::span<const std::uint8_t> data_;
};

/// A skeleton and clips, with the arrays that they point to.
struct Source {
  struct Keys {
    std::vector<float> times, values;
  };
  Skeleton skeleton;
  std::vector<std::vector<std::uint32_t>> joints;
  std::vector<std::vector<JointMatrix>> inverseBind;
  std::vector<std::vector<float>> weights;  ///< of nodes
  std::vector<std::vector<Keys>> keys;      ///< of channels, by clip
  std::vector<ClipView> clips;
  std::vector<std::vector<float>> masks;
  std::vector<std::span<const float>> maskViews;
};

SkeletonNode takeNode(Input& input) {
  SkeletonNode node;
  node.name = "node";
  node.parent = input.below(9) - 1;
  for (double& value : node.translation) value = double{input.number()};
  if (input.below(2) == 0)
    for (double& value : node.rotation) value = double{input.number()};
  if (input.below(4) == 0)
    for (double& value : node.scale) value = double{input.number()};
  if (input.below(4) == 0)
    for (auto& row : node.matrix.emplace())
      for (double& value : row) value = double{input.number()};
  return node;
}

void takeSkin(Input& input, Source& source) {
  auto& joints = source.joints.emplace_back(1 + input.below(6));
  auto& matrices = source.inverseBind.emplace_back(joints.size());
  for (std::uint32_t& joint : joints)
    joint = input.below(static_cast<std::uint32_t>(source.skeleton.nodes.size()) + 1);
  if (input.below(2) == 0)
    for (auto& row : matrices[0].m)
      for (float& value : row) value = input.number();
  source.skeleton.skins.push_back({"skin", joints, matrices});
}

Source::Keys takeKeys(Input& input, const ChannelView& channel, const Skeleton& skeleton) {
  Source::Keys keys;
  float time = input.number();
  for (std::uint32_t key = 1 + input.below(12); key > 0; --key) {
    keys.times.push_back(time);
    time += static_cast<float>(input.below(64)) / 64;
    if (input.below(32) == 0) time = input.number();
  }
  std::size_t width = channel.path == ChannelPath::rotation ? 4 : 3;
  if (channel.path == ChannelPath::weights && channel.node < skeleton.nodes.size())
    width = std::max<std::size_t>(1, skeleton.nodes[channel.node].weights.size());
  const std::size_t parts = channel.interpolation == Interpolation::cubicSpline ? 3 : 1;
  keys.values.resize(keys.times.size() * width * parts - (input.below(64) == 0 ? 1 : 0));
  for (float& value : keys.values) value = input.number();
  return keys;
}

void takeClip(Input& input, Source& source) {
  ClipView& clip = source.clips.emplace_back();
  clip.name = "clip";
  clip.duration = static_cast<double>(input.below(128)) / 32;
  if (input.below(32) == 0) clip.duration = double{input.number()};
  clip.wraps = input.below(2) == 0;
  clip.additive = input.below(3) == 0;
  clip.baseClip = input.below(4) - 1;
  clip.baseTime = double{input.number()};
  auto& keys = source.keys.emplace_back();
  for (std::uint32_t count = input.below(6); count > 0; --count) {
    ChannelView& channel = clip.channels.emplace_back();
    channel.node = input.below(static_cast<std::uint32_t>(source.skeleton.nodes.size()) + 1);
    channel.path = static_cast<ChannelPath>(input.below(16) == 0 ? input.below(6) : input.below(4));
    channel.interpolation = static_cast<Interpolation>(input.below(16) == 0 ? 3 : input.below(3));
    keys.push_back(takeKeys(input, channel, source.skeleton));
  }
  for (std::size_t i = 0; i < keys.size(); ++i) {
    clip.channels[i].times = keys[i].times;
    clip.channels[i].values = keys[i].values;
  }
}

Result<PackedClips> packSource(Input& input) {
  Source source;
  for (std::uint32_t count = 1 + input.below(8); count > 0; --count)
    source.skeleton.nodes.push_back(takeNode(input));
  source.weights.resize(source.skeleton.nodes.size());
  for (std::size_t node = 0; node < source.weights.size(); ++node) {
    source.weights[node].resize(input.below(3) * std::size_t{input.below(4)});
    for (float& weight : source.weights[node]) weight = input.number();
    source.skeleton.nodes[node].weights = source.weights[node];
  }
  for (std::uint32_t count = input.below(3) + 1; count > 0; --count) takeSkin(input, source);
  for (std::uint32_t count = input.below(4); count > 0; --count) takeClip(input, source);
  for (std::uint32_t count = input.below(3); count > 0; --count) {
    auto& mask = source.masks.emplace_back(source.skeleton.nodes.size());
    for (float& factor : mask) factor = static_cast<float>(input.below(256)) / 254;
  }
  source.maskViews.assign(source.masks.begin(), source.masks.end());
  PackClipsOptions options;
  options.masks = source.maskViews;
  if (input.below(2) == 0) options.maxError = double{input.number()};
  if (input.below(4) == 0) options.maxWeightError = double{input.number()};
  if (input.below(3) == 0)
    options.rootMotion = {.node = input.below(9),
                          .upAxis = input.below(32) == 0 ? 3 : input.below(3)};
  PackClipsReport report;
  Result<PackedClips> packed = packClips(source.skeleton, source.clips, options, &report);
  if (!packed) return packed;
  require(report.byteCount == packed->bytes().size());
  require(report.worstError <= report.maxError);
  // What is packed can be stored.
  require(PackedClips::fromBytes(packed->bytes()).ok());
  return packed;
}

/// Small, with masks, weights, a clip that is added, and one that does not wrap.
std::vector<std::uint32_t> makeGoodBank() {
  Skeleton skeleton;
  skeleton.nodes.resize(3);
  skeleton.nodes[1].parent = 0;
  skeleton.nodes[1].translation = {0, 1, 0};
  skeleton.nodes[2].parent = 1;
  skeleton.nodes[2].translation = {0.5, 1, 0};
  const std::array<float, 4> atRest{0, 0.5f, 1, 0};
  skeleton.nodes[2].weights = atRest;
  const std::array<std::uint32_t, 3> joints{0, 2, 1};
  const std::array<JointMatrix, 3> matrices;
  skeleton.skins = {{"all", joints, matrices},
                    {"few", std::span(joints).first(1), std::span(matrices).first(1)}};
  const std::array<float, 4> times{0, 0.25f, 0.25f, 1};
  const std::array<float, 16> rotations{0, 0, 0, 1, 0, 0, 0, 1, 0, 0.6f, 0, 0.8f, 0, 0.6f, 0, 0.8f};
  const std::array<float, 12> places{0, 0, 0, 0.1f, 0.2f, 0, 0.3f, 0, 0, 1, 0, 0.7f};
  using enum ChannelPath;
  std::array<ClipView, 3> clips;
  for (ClipView& clip : clips) clip.duration = 1;
  clips[0].channels = {{1, rotation, Interpolation::linear, times, rotations}};
  clips[0].channels.push_back({2, weights, Interpolation::linear, times, rotations});
  clips[1].channels = {{0, translation, Interpolation::step, times, places},
                       {2, scale, Interpolation::step, times, places}};
  clips[1].wraps = false;
  clips[2].channels = {{1, rotation, Interpolation::step, times, rotations}};
  clips[2].additive = true;
  clips[2].baseClip = 0;
  const std::array<float, 3> factors{0, 0.5f, 1};
  const std::array<std::span<const float>, 1> masks{factors};
  PackClipsOptions options;
  options.masks = masks;
  options.rootMotion = {.node = 0, .upAxis = 1};
  const Result<PackedClips> packed = packClips(skeleton, clips, options);
  require(packed.ok());
  return fuzz::wordsOf(packed->bytes());
}

/// Bytes as a bank, with a header that says what they are.
std::vector<std::uint32_t> bankOf(std::span<const std::uint32_t> good,
                                  std::span<const std::uint8_t> data) {
  std::vector<std::uint32_t> words = fuzz::wordsOf(std::as_bytes(data));
  if (words.size() < 4) return words;
  words[0] = good[0];
  words[1] = good[1];
  words[3] = static_cast<std::uint32_t>(words.size());
  return words;
}

std::vector<ClipLayer> sample(const PackedClips& bank, Input& input) {
  std::vector<ClipLayer> layers(input.below(maxClipLayers + 2));
  for (ClipLayer& layer : layers) {
    layer.clip = input.below(bank.clipCount() + 1);
    layer.time = double{input.number()} * double{input.number()};
    layer.weight = input.number();
    layer.mask = input.below(bank.maskCount() + 1);
    layer.hold = input.below(2) == 0;
    const ClipInfo info = bank.clip(layer.clip);
    if (layer.time - layer.time != 0) continue;  // not finite
    const float time = clipTime(info, layer.time, layer.hold);
    require(time >= 0 && time <= info.duration);
    const Result<RootMotion> motion = rootMotion(bank, layer.clip, 0, layer.time, layer.hold);
    require(motion.ok() || !motion.error().message.empty());
  }
  for (std::uint32_t skin = 0; skin < bank.skinCount(); ++skin) {
    // As long as it has to be: sanitizers see what is written behind it.
    std::vector<JointMatrix> pose(bank.jointCount(skin));
    const Result<void> sampled = samplePose(bank, layers, skin, pose);
    require(sampled.ok() || !sampled.error().message.empty());
    require(samplePose(bank, {}, skin, pose).ok());
  }
  for (std::uint32_t node = 0; node < 9; ++node) {
    (void)bank.error(node);
    std::vector<float> weights(bank.weightCount(node));
    const Result<void> sampled = sampleWeights(bank, layers, node, weights);
    require(sampled.ok() || !sampled.error().message.empty());
    require(sampleWeights(bank, {}, node, weights).ok());
  }
  return layers;
}

/// Boxes of a triangle that follows joint 0 of each skin, and a frame in which it plays.
void boundAndPlay(const PackedClips& bank, std::span<const ClipLayer> layers) {
  const std::array<float, 9> positions{0, 0, 0, 1, 0, 0, 0, 1, 0};
  const std::array<std::uint8_t, 3> joints{0, 0, 0};
  const std::array<float, 3> weights{1, 1, 1};
  const InfluenceSet influences{attributeView(joints.data(), 3, 1),
                                attributeView(weights.data(), 3, 1)};
  MeshView mesh;
  mesh.vertexCount = 3;
  mesh.positions = attributeView(positions.data(), 3, 3);
  mesh.influenceSets = {&influences, 1};
  const JointBounds bounds = *jointBounds(mesh, 1);
  std::vector<std::uint32_t> clips;
  for (std::uint32_t clip = 0; clip < std::min(bank.clipCount(), 4u); ++clip) clips.push_back(clip);

  Result<cpu::SceneRunner> runner = cpu::SceneRunner::create();
  require(runner.ok());
  Scene& scene = runner->scene();
  const ClipsHandle handle = *scene.addClips(PackedClips(bank));
  const Result<FigureHandle> figure = scene.addFigure(handle);
  InstanceDescription instance;
  instance.mesh = *scene.addMesh(*pack(mesh, 1));
  for (std::uint32_t skin = 0; skin < std::min(bank.skinCount(), 4u); ++skin) {
    for (const std::uint32_t clip : clips)
      (void)clipBounds(bank, clip, skin, bounds, Method::dualQuaternion);
    (void)blendBounds(bank, clips, skin, bounds, Method::linear);
    if (!figure) continue;
    instance.pose = *scene.pose(*figure, skin);
    (void)scene.addInstance(instance);
  }
  if (!figure) return;
  require(scene.beginFrame(1, 0).ok());
  (void)scene.play(std::array{FigurePlay{*figure, layers}});
  for (const cpu::PlannedJob& job : *runner->jobs()) cpu::run(job);
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  static const std::vector<std::uint32_t> good = makeGoodBank();
  Input input({data, size});
  Result<PackedClips> bank = Error{};
  const std::uint32_t way = input.below(3);
  if (way == 0) {
    bank = packSource(input);
  } else {
    // The layers come first, so that they do not move when a bank becomes longer.
    const std::span<const std::uint8_t> all = input.rest();
    const auto rest = all.subspan(std::min<std::size_t>(all.size(), 64));
    std::vector<std::uint32_t> words =
        way == 1 ? bankOf(good, rest) : fuzz::changedBlob(good, rest);
    fuzz::putChecksumRight(words);
    bank = PackedClips::fromBytes(std::as_bytes(std::span(words)));
  }
  if (!bank) {
    require(!bank.error().message.empty());
    return 0;
  }
  boundAndPlay(*bank, sample(*bank, input));
  return 0;
}
