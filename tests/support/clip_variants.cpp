#include "clip_variants.h"

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <random>
#include <span>
#include <utility>
#include <vector>

#include <glm/geometric.hpp>
#include <glm/gtc/quaternion.hpp>
#include <glm/vec3.hpp>
#include <glm/vec4.hpp>

#include "random_number.h"

namespace dermis::test {
namespace {

using glm::dquat;
using glm::dvec3;
using glm::dvec4;
using gltf::Channel;

constexpr float lateKeysDelay = 0.37f;  // seconds

dvec4 valueAt(const Channel& channel, std::size_t key) {
  dvec4 value(0);
  for (std::size_t i = 0; i < channel.components; ++i)
    value[static_cast<int>(i)] = double{channel.values[key * channel.components + i]};
  return value;
}

void setValue(Channel& channel, std::size_t key, const dvec4& value) {
  for (std::size_t i = 0; i < channel.components; ++i)
    channel.values[key * channel.components + i] = static_cast<float>(value[static_cast<int>(i)]);
}

void addKey(Channel& channel, double time, const dvec4& value) {
  channel.times.push_back(static_cast<float>(time));
  channel.values.resize(channel.values.size() + channel.components);
  setValue(channel, channel.times.size() - 1, value);
}

dquat quaternionOf(const dvec4& value) {
  return {value.w, value.x, value.y, value.z};
}
dvec4 valueOf(const dquat& q) {
  return {q.x, q.y, q.z, q.w};
}

Channel withoutKeys(const Channel& channel) {
  Channel result = channel;
  result.times.clear();
  result.values.clear();
  return result;
}

/// LINEAR, and rotations in the hemisphere of the key before.
void makeLinear(Channel& channel) {
  if (channel.interpolation == Interpolation::cubicSpline) {
    const std::size_t width = channel.components;
    std::vector<float> values;
    for (std::size_t key = 0; key < channel.times.size(); ++key) {
      const auto value =
          channel.values.begin() + static_cast<std::ptrdiff_t>((3 * key + 1) * width);
      values.insert(values.end(), value, value + static_cast<std::ptrdiff_t>(width));
    }
    channel.values = std::move(values);
  }
  channel.interpolation = Interpolation::linear;
  if (channel.path != ChannelPath::rotation) return;
  for (std::size_t key = 1; key < channel.times.size(); ++key) {
    const dvec4 value = valueAt(channel, key);
    if (glm::dot(value, valueAt(channel, key - 1)) < 0) setValue(channel, key, -value);
  }
}

void makeSpline(Channel& channel, std::mt19937& random) {
  const std::size_t count = channel.times.size();
  // A longer tangent would turn a rotation around between two keys.
  const double longest = channel.path == ChannelPath::rotation ? 1.5 : 4;
  Channel spline = channel;
  spline.interpolation = Interpolation::cubicSpline;
  spline.values.clear();
  for (std::size_t key = 0; key < count; ++key) {
    const std::size_t before = key == 0 ? 0 : key - 1, after = std::min(key + 1, count - 1);
    const double time = double{channel.times[after]} - double{channel.times[before]};
    dvec4 tangent(0);
    if (time > 0) tangent = (valueAt(channel, after) - valueAt(channel, before)) / time;
    const dvec4 in = tangent * (key % 3 == 0 ? between(random, 0, longest) : 1.0);
    const dvec4 out = tangent * (key % 4 == 0 ? between(random, 0, longest) : 1.0);
    for (const dvec4& part : {in, valueAt(channel, key), out})
      for (std::size_t i = 0; i < channel.components; ++i)
        spline.values.push_back(static_cast<float>(part[static_cast<int>(i)]));
  }
  channel = std::move(spline);
}

void makeIrregular(Channel& channel, std::mt19937& random) {
  Channel result = withoutKeys(channel);
  const std::size_t last = channel.times.size() - 1;
  for (std::size_t key = 0; key <= last; ++key) {
    const bool isInner = key != 0 && key != last;
    if (isInner && chance(random, 40)) continue;
    const double time = double{channel.times[key]};
    const double move = between(random, -0.4, 0.4);
    double distance = 0;  // to the key before or after
    if (isInner) {
      distance =
          move < 0 ? time - double{channel.times[key - 1]} : double{channel.times[key + 1]} - time;
    }
    addKey(result, time + move * distance, valueAt(channel, key));
  }
  channel = std::move(result);
}

/// The value after so many jumps. Scales multiply along a chain, so theirs are small.
dvec4 jumped(const Channel& channel, dvec4 value, int count) {
  const dvec4 step = dvec4(0.1, -0.2, 0.05, 0) * (glm::length(valueAt(channel, 0)) + 0.1);
  for (int i = 0; i < count; ++i) {
    if (channel.path == ChannelPath::rotation) {
      value = valueOf(quaternionOf(value) * dquat(0.8, 0.36, 0, 0.48));
    } else {
      value = channel.path == ChannelPath::scale ? 1.03 * value : value + step;
    }
  }
  return value;
}

/// Some keys stay for a while, in which the value jumps. The keys after them jump as well. A bank
/// needs that while: around a jump it has no slope.
void addJumps(Channel& channel, std::mt19937& random) {
  Channel result = withoutKeys(channel);
  const double last = double{channel.times.back()};
  double next = double{channel.times.front()};  // keys before are left out
  int count = 0;
  for (std::size_t key = 0; key < channel.times.size(); ++key) {
    const double time = double{channel.times[key]};
    if (time < next) continue;
    const dvec4 value = jumped(channel, valueAt(channel, key), count);
    addKey(result, time, value);
    constexpr double hold = 0.2;
    if (count == 3 || last - time < 1.5 * hold || chance(random, 50)) continue;
    const double at = time + hold * between(random, 0.3, 0.7);
    const dvec4 after = jumped(channel, valueAt(channel, key), ++count);
    addKey(result, at, value);
    addKey(result, at, after);
    addKey(result, time + hold, after);
    next = time + 1.4 * hold;
  }
  channel = std::move(result);
}

void makeSpin(Channel& channel, std::mt19937& random) {
  const std::size_t count = channel.times.size();
  if (channel.path != ChannelPath::rotation || count < 3) return;
  dvec3 axis(0, 0, 1);
  for (int i = 0; i < 3; ++i) axis[i] += between(random, -0.5, 0.5);
  axis = glm::normalize(axis);
  const double whole = glm::radians(std::min(400.0, 100.0 * static_cast<double>(count - 1)));
  for (std::size_t key = 0; key < count; ++key) {
    const double angle = whole * static_cast<double>(key) / static_cast<double>(count - 1);
    setValue(channel, key,
             valueOf(quaternionOf(valueAt(channel, key)) * glm::angleAxis(angle, axis)));
  }
}

/// Scales for every third node that has keys of its rotation.
void addScales(gltf::Clip& clip) {
  static const std::array<dvec3, 5> scales{dvec3(1, 1, 1), dvec3(0.01, 1, 1.5), dvec3(1, -0.5, 1),
                                           dvec3(1e-4, 1e-4, 1e-4), dvec3(-1, 1, -0.25)};
  std::vector<Channel> added;
  std::size_t number = 0;
  for (const Channel& channel : clip.channels) {
    if (channel.path != ChannelPath::rotation || number++ % 3 != 0) continue;
    Channel& scale = added.emplace_back(channel);
    scale.path = ChannelPath::scale;
    scale.components = 3;
    scale.values.resize(3 * scale.times.size());
    for (std::size_t key = 0; key < scale.times.size(); ++key)
      setValue(scale, key, dvec4(scales[key % scales.size()], 0));
  }
  for (Channel& scale : added) {
    std::erase_if(clip.channels, [&](const Channel& other) {
      return other.node == scale.node && other.path == ChannelPath::scale;
    });
    clip.channels.push_back(std::move(scale));
  }
  std::ranges::sort(clip.channels, {},
                    [](const Channel& channel) { return std::pair(channel.node, channel.path); });
}

void change(Channel& channel, double duration, ClipVariant variant, std::mt19937& random) {
  switch (variant) {
    case ClipVariant::step:
      channel.interpolation = Interpolation::step;
      break;
    case ClipVariant::cubicSpline:
      makeSpline(channel, random);
      break;
    case ClipVariant::irregularKeys:
      makeIrregular(channel, random);
      break;
    case ClipVariant::jumps:
      addJumps(channel, random);
      break;
    case ClipVariant::lateKeys:
      for (float& time : channel.times) time += lateKeysDelay;
      break;
    case ClipVariant::oneKey: {
      const dvec4 value = valueAt(channel, below(random, channel.times.size()));
      channel = withoutKeys(channel);
      addKey(channel, 0.4 * duration, value);
      break;
    }
    case ClipVariant::spin:
      makeSpin(channel, random);
      break;
    case ClipVariant::smallScales:
      break;  // `addScales` does it.
  }
}

}  // namespace

const char* clipVariantName(ClipVariant variant) {
  switch (variant) {
    case ClipVariant::step:
      return "step";
    case ClipVariant::cubicSpline:
      return "cubicSpline";
    case ClipVariant::irregularKeys:
      return "irregularKeys";
    case ClipVariant::jumps:
      return "jumps";
    case ClipVariant::lateKeys:
      return "lateKeys";
    case ClipVariant::oneKey:
      return "oneKey";
    case ClipVariant::spin:
      return "spin";
    case ClipVariant::smallScales:
      return "smallScales";
  }
  return "";
}

gltf::Model withVariant(gltf::Model model, ClipVariant variant, std::uint32_t seed) {
  std::mt19937 random(seed);
  for (gltf::Clip& clip : model.clips) {
    std::erase_if(clip.channels,
                  [](const Channel& channel) { return channel.path == ChannelPath::weights; });
    for (Channel& channel : clip.channels) {
      makeLinear(channel);
      change(channel, clip.duration, variant, random);
    }
    if (variant == ClipVariant::lateKeys) clip.duration += double{lateKeysDelay};
    if (variant == ClipVariant::smallScales) addScales(clip);
  }
  return model;
}

}  // namespace dermis::test
