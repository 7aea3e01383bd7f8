// Samples poses of a bank in float32, operation by operation, so that every processor gets the same
// bits.
#include "clips/sample.h"

#include <algorithm>
#include <bit>
#include <cmath>
#include <cstring>
#include <optional>
#include <string>
#include <vector>

#include "attribute.h"
#include "strict_floating_point.h"

namespace dermis {
namespace {

using Float4 = std::array<float, 4>;

struct LocalTransform {
  Float4 translation, rotation, scale;
};

/// A layer whose time is inside its clip.
struct Layer {
  BankClip clip;
  float time, weight;
  std::uint32_t mask;
};

float dot(const Float4& a, const Float4& b) {
  return a[0] * b[0] + a[1] * b[1] + a[2] * b[2] + a[3] * b[3];
}

Float4 normalized(const Float4& q) {
  const float squared = dot(q, q);
  if (!(squared > 0)) return {0, 0, 0, 1};
  const float length = std::sqrt(squared);
  return {q[0] / length, q[1] / length, q[2] / length, q[3] / length};
}

Float4 mix(const Float4& a, float share, const Float4& b, float other) {
  Float4 result;
  for (std::size_t i = 0; i < 4; ++i) result[i] = share * a[i] + other * b[i];
  return result;
}

/// Three numbers of a record.
Float4 vectorFrom(const float (&numbers)[3]) {
  return {numbers[0], numbers[1], numbers[2], 0};
}

/// Samples a track with keys.
Float4 sampleKeys(const ClipBank& bank, const Layer& layer, std::uint32_t word) {
  const std::uint32_t column = word & ((1u << trackColumnBits) - 1);
  const BankClass keys = bank.keyClass(layer.clip, word >> trackColumnBits & 255);
  const KeyFormat format = KeyFormat::of(keys.format);
  const float position = ClipBank::positionOf(layer.time, layer.clip, keys);
  const float last = static_cast<float>(keys.keyCount - 2);
  const float interval = std::min(std::floor(position), last);
  const auto row = static_cast<std::size_t>(interval);
  const float fraction = bank.fractionOf(position - interval, keys, row, column);
  const std::size_t half =
      2 * std::size_t{keys.keys} + row * keys.rowHalves + column * format.halves();
  const KeyBits from = readKey(bank.words, half, format);
  const KeyBits to = readKey(bank.words, half + keys.rowHalves, format);
  if (format.isRotation) {
    const Float4 a = rotationOf(from, format), b = rotationOf(to, format);
    return normalized(mix(a, 1 - fraction, b, dot(a, b) < 0 ? -fraction : fraction));
  }
  std::array<float, 8> range;
  std::memcpy(range.data(), &bank.words[keys.ranges + 8 * column], sizeof(range));
  return mix(vectorOf(from, range), 1 - fraction, vectorOf(to, range), fraction);
}

/// `track`: its place in the tracks of the clip.
Float4 sampleTrack(const ClipBank& bank, const Layer& layer, std::size_t track, bool isRotation,
                   const Float4& rest) {
  const std::uint32_t word = bank.words[layer.clip.tracks + track];
  switch (static_cast<TrackKind>(word >> 30)) {
    case TrackKind::rest:
      return rest;
    case TrackKind::constant: {
      Float4 value{};
      const std::size_t offset = word & 0x3fffffff;
      for (std::size_t i = 0; i < (isRotation ? 4u : 3u); ++i) value[i] = bank.number(offset + i);
      return value;
    }
    case TrackKind::animated:
      break;
  }
  return sampleKeys(bank, layer, word);
}

LocalTransform sampleLocal(const ClipBank& bank, const Layer& layer, std::size_t node,
                           const LocalTransform& rest) {
  return {sampleTrack(bank, layer, 3 * node, false, rest.translation),
          sampleTrack(bank, layer, 3 * node + 1, true, rest.rotation),
          sampleTrack(bank, layer, 3 * node + 2, false, rest.scale)};
}

bool isAdditive(const Layer& layer) {
  return (layer.clip.flags & 2) != 0;
}

/// The weighted mean of the layers that are not additive.
LocalTransform blend(const ClipBank& bank, std::span<const Layer> layers, std::size_t node,
                     const LocalTransform& rest) {
  float sum = 0;
  for (const Layer& layer : layers) {
    if (!isAdditive(layer)) sum = sum + layer.weight * bank.mask(layer.mask, node);
  }
  if (!(sum > 0)) return rest;
  LocalTransform result{};
  Float4 first{};
  bool isFirst = true;
  for (const Layer& layer : layers) {
    if (isAdditive(layer)) continue;
    const float weight = layer.weight * bank.mask(layer.mask, node);
    if (!(weight > 0)) continue;
    const float share = weight / sum;
    const LocalTransform local = sampleLocal(bank, layer, node, rest);
    if (isFirst) first = local.rotation;
    isFirst = false;
    result.translation = mix(result.translation, 1, local.translation, share);
    result.scale = mix(result.scale, 1, local.scale, share);
    result.rotation =
        mix(result.rotation, 1, local.rotation, dot(first, local.rotation) < 0 ? -share : share);
  }
  result.rotation = normalized(result.rotation);
  return result;
}

constexpr LocalTransform noLocalDifference{{0, 0, 0, 0}, {0, 0, 0, 1}, {1, 1, 1, 0}};

void add(LocalTransform& local, const LocalTransform& difference, float weight) {
  Float4 turn = difference.rotation;
  if (turn[3] < 0) turn = mix(turn, -1, {}, 0);
  turn = normalized(mix({0, 0, 0, 1}, 1 - weight, turn, weight));
  const Float4 q = local.rotation;
  local.rotation = normalized({q[3] * turn[0] + q[0] * turn[3] + q[1] * turn[2] - q[2] * turn[1],
                               q[3] * turn[1] - q[0] * turn[2] + q[1] * turn[3] + q[2] * turn[0],
                               q[3] * turn[2] + q[0] * turn[1] - q[1] * turn[0] + q[2] * turn[3],
                               q[3] * turn[3] - q[0] * turn[0] - q[1] * turn[1] - q[2] * turn[2]});
  for (std::size_t i = 0; i < 3; ++i) {
    local.translation[i] = local.translation[i] + weight * difference.translation[i];
    local.scale[i] = local.scale[i] * (1 + weight * (difference.scale[i] - 1));
  }
}

/// The bits of the nearest float16. Ties go to the even one. Infinite above its range.
std::uint16_t toHalf(float value) {
  const auto bits = std::bit_cast<std::uint32_t>(value);
  const std::uint32_t sign = bits >> 16 & 0x8000u, size = bits & 0x7fffffffu;
  std::uint32_t half;
  if (size >= 0x477ff000u) {  // 65520
    half = 0x7c00;
  } else if (size < 0x38800000u) {  // denormal: floats from 0.5 on count 2^-24, too
    half = std::bit_cast<std::uint32_t>(std::bit_cast<float>(size) + 0.5f) - 0x3f000000u;
  } else {  // 13 bits fewer, and an exponent that is less by 112
    half = ((size + 0xfffu + (size >> 13 & 1u)) >> 13) - (112u << 10);
  }
  return static_cast<std::uint16_t>(sign | half);
}

}  // namespace

Result<PackedLayers> packLayers(const PackedClips& clips, std::span<const ClipLayer> layers,
                                const char* subject) {
  const auto refused = [subject](const std::string& what) {
    return Error{ErrorCode::invalidArgument, subject + what};
  };
  if (layers.size() > maxClipLayers) {
    return refused("there are " + std::to_string(layers.size()) + " layers, but at most " +
                   std::to_string(maxClipLayers) + " are allowed");
  }
  const ClipBank bank(clips);
  PackedLayers result;
  std::array<PackedLayer, maxClipLayers> additive;
  std::uint32_t additives = 0;
  for (const ClipLayer& layer : layers) {
    const auto wrong = [&](const std::string& what) {
      return refused("layer " + std::to_string(&layer - layers.data()) + ": " + what);
    };
    if (layer.clip >= bank.header.clipCount) {
      return wrong("there is no clip " + std::to_string(layer.clip) + "; the bank has " +
                   std::to_string(bank.header.clipCount));
    }
    if (layer.mask > bank.header.maskCount) {
      return wrong("there is no mask " + std::to_string(layer.mask) + "; the bank has " +
                   std::to_string(bank.header.maskCount));
    }
    if (!std::isfinite(layer.time)) return wrong("its time is not finite");
    if (!std::isfinite(layer.weight)) return wrong("its weight is not finite");
    const std::uint32_t weight = toHalf(layer.weight);
    if ((weight & 0x7c00) == 0x7c00) return wrong("its weight is too large for float16");
    const BankClip clip = bank.clip(layer.clip);
    const ClipInfo info{clip.duration, (clip.flags & 1) != 0, (clip.flags & 2) != 0};
    if (layer.weight < 0 && weight != 0x8000 && !info.additive)
      return wrong("its weight is negative, and its clip is not additive");
    PackedLayer& place = info.additive ? additive[additives++] : result.layers[result.count++];
    place = {
        clipTime(info, layer.time, layer.hold),
        layer.clip | layer.mask << 10 | (info.additive ? abi::LAYER_ADDITIVE : 0u) | weight << 16};
  }
  std::copy_n(additive.begin(), additives, result.layers.begin() + result.count);
  result.count += additives;
  return result;
}

namespace {

/// `seconds` modulo `duration`. std::fmod takes longer the more often it wraps.
double wrapped(double seconds, double duration) {
  const double turns = std::floor(seconds / duration);
  if (!(std::abs(turns) < 0x1p52)) {
    const double rest = std::fmod(seconds, duration);
    return rest < 0 ? rest + duration : rest;
  }
  // The quotient may have been rounded to the next integer. A time just before 0 is the duration.
  const double rest = std::fma(-turns, duration, seconds);
  return rest < 0 ? rest + duration : rest > duration ? rest - duration : rest;
}

}  // namespace

float clipTime(const ClipInfo& info, double seconds, bool hold) {
  const double duration = double{info.duration};
  if (!(duration > 0)) return 0;
  const double time = info.wraps && !hold ? wrapped(seconds, duration) : seconds;
  return static_cast<float>(std::clamp(time, 0.0, duration));
}

namespace {

using Layers = std::array<Layer, maxClipLayers>;

std::span<const Layer> unpacked(const ClipBank& bank, const PackedLayers& packed, Layers& storage) {
  for (std::uint32_t i = 0; i < packed.count; ++i) {
    const PackedLayer& layer = packed.layers[i];
    storage[i] = {bank.clip(layer.clip()), layer.time, fromHalf(layer.weight()), layer.mask()};
  }
  return std::span(storage).first(packed.count);
}

}  // namespace

void sampleNodes(const PackedClips& clips, const PackedLayers& packed,
                 std::span<Affine<float>> globals) {
  const ClipBank bank(clips);
  Layers storage;
  const std::span<const Layer> layers = unpacked(bank, packed, storage);
  for (std::size_t i = 0; i < globals.size(); ++i) {
    const BankNode node = bank.node(i);
    const LocalTransform rest{
        vectorFrom(node.translation),
        {node.rotation[0], node.rotation[1], node.rotation[2], node.rotation[3]},
        vectorFrom(node.scale)};
    LocalTransform local = blend(bank, layers, i, rest);
    for (const Layer& layer : layers) {
      if (isAdditive(layer)) {
        add(local, sampleLocal(bank, layer, i, noLocalDifference),
            layer.weight * bank.mask(layer.mask, i));
      }
    }
    Affine<float> matrix = composed(local.translation, local.rotation, local.scale);
    if (node.fixed != 0) matrix = multiply(bank.at<Affine<float>>(node.fixed), matrix);
    globals[i] = node.parent == noNode ? matrix : multiply(globals[node.parent], matrix);
  }
}

void poseSkin(const PackedClips& clips, std::uint32_t number,
              std::span<const Affine<float>> globals, std::span<JointMatrix> pose) {
  const ClipBank bank(clips);
  const BankSkin skin = bank.skin(number);
  for (std::size_t joint = 0; joint < pose.size(); ++joint) {
    const auto matrix = bank.at<Affine<float>>(skin.matrices + 12 * joint);
    const std::uint32_t node = bank.words[skin.nodes + joint];
    pose[joint] =
        std::bit_cast<JointMatrix>(node == noNode ? matrix : multiply(globals[node], matrix));
  }
}

std::array<float, 4> sampleVector(const ClipBank& bank, const BankClip& clip, std::size_t track,
                                  float time) {
  return sampleTrack(bank, {clip, time, 1, 0}, track, false, {});
}

void sampleWeights(const PackedClips& clips, const PackedLayers& packed, const BankMorphed& node,
                   std::span<float> weights) {
  const ClipBank bank(clips);
  Layers storage;
  const std::span<const Layer> layers = unpacked(bank, packed, storage);
  std::array<float, maxClipLayers> factors{};
  float sum = 0;
  for (std::size_t i = 0; i < layers.size(); ++i) {
    const std::uint32_t mask = layers[i].mask;
    factors[i] =
        layers[i].weight * (mask == 0 ? 1 : bank.number(node.masks + std::size_t{mask} - 1));
    if (!isAdditive(layers[i])) sum = sum + factors[i];
  }
  for (std::size_t group = 0; group < node.groupCount(); ++group) {
    const std::size_t at = node.rest + 3 * group;
    const std::size_t track = std::size_t{3} * bank.header.nodeCount + node.firstGroup + group;
    const Float4 rest{bank.number(at), bank.number(at + 1), bank.number(at + 2), 0};
    Float4 result = sum > 0 ? Float4{} : rest;
    for (std::size_t i = 0; i < layers.size() && sum > 0; ++i) {
      if (isAdditive(layers[i]) || !(factors[i] > 0)) continue;
      result = mix(result, 1, sampleTrack(bank, layers[i], track, false, rest), factors[i] / sum);
    }
    for (std::size_t i = 0; i < layers.size(); ++i) {
      if (isAdditive(layers[i]))
        result = mix(result, 1, sampleTrack(bank, layers[i], track, false, {}), factors[i]);
    }
    const std::span<float> target = weights.subspan(3 * group);
    std::copy_n(result.begin(), std::min<std::size_t>(target.size(), 3), target.begin());
  }
}

Result<void> sampleWeights(const PackedClips& clips, std::span<const ClipLayer> layers,
                           std::uint32_t node, std::span<float> weights) {
  if (weights.size() != clips.weightCount(node)) {
    return Error{ErrorCode::invalidArgument, "sampleWeights: there are " +
                                                 std::to_string(weights.size()) +
                                                 " weights, but node " + std::to_string(node) +
                                                 " has " + std::to_string(clips.weightCount(node))};
  }
  const Result<PackedLayers> packed = packLayers(clips, layers, "sampleWeights: ");
  if (!packed) return packed.error();
  if (const std::optional<BankMorphed> found = ClipBank(clips).morphedNode(node))
    sampleWeights(clips, *packed, *found, weights);
  return {};
}

Result<void> samplePose(const PackedClips& clips, std::span<const ClipLayer> layers,
                        std::uint32_t skin, std::span<JointMatrix> pose) {
  if (skin >= clips.skinCount()) {
    return Error{ErrorCode::invalidArgument, "samplePose: there is no skin " +
                                                 std::to_string(skin) + "; the bank has " +
                                                 std::to_string(clips.skinCount())};
  }
  if (pose.size() != clips.jointCount(skin)) {
    return Error{ErrorCode::invalidArgument,
                 "samplePose: the pose has " + std::to_string(pose.size()) + " joints, but skin " +
                     std::to_string(skin) + " has " + std::to_string(clips.jointCount(skin))};
  }
  const Result<PackedLayers> packed = packLayers(clips, layers, "samplePose: ");
  if (!packed) return packed.error();
  std::vector<Affine<float>> globals(clips.nodeCount());
  sampleNodes(clips, *packed, globals);
  poseSkin(clips, skin, globals, pose);
  return {};
}

}  // namespace dermis
