#include "clips/check.h"

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <set>

#include "strict_floating_point.h"
#include "text.h"

namespace dermis {
namespace {

Error invalid(const std::string& what) {
  return {ErrorCode::invalidArgument, "packClips: " + what};
}

Error exceeded(const std::string& what) {
  return {ErrorCode::limitExceeded, "packClips: " + what};
}

template <typename Numbers>
bool areFinite(const Numbers& numbers) {
  return std::ranges::all_of(numbers, [](auto number) { return std::isfinite(number); });
}

Result<void> checkNodes(const std::vector<SkeletonNode>& nodes) {
  for (std::size_t i = 0; i < nodes.size(); ++i) {
    const SkeletonNode& node = nodes[i];
    const std::string title = titled("node", i, node.name);
    bool isFinite =
        areFinite(node.translation) && areFinite(node.rotation) && areFinite(node.scale);
    if (node.matrix)
      isFinite = isFinite && std::ranges::all_of(*node.matrix, areFinite<std::array<double, 4>>);
    isFinite = isFinite && areFinite(node.weights);
    if (!isFinite) return invalid(title + " has a number that is not finite");
    if (std::ranges::all_of(node.rotation, [](double number) { return number == 0; }))
      return invalid(title + " has the rotation 0");
  }
  std::vector<bool> isReached(nodes.size());
  for (const std::uint32_t node : parentsFirst(nodes)) isReached[node] = true;
  if (const auto lost = std::ranges::find(isReached, false); lost != isReached.end()) {
    const auto i = static_cast<std::size_t>(lost - isReached.begin());
    return invalid(titled("node", i, nodes[i].name) + " is part of, or below, a cycle of parents");
  }
  return {};
}

Result<void> checkSkins(const Skeleton& skeleton) {
  if (skeleton.skins.empty()) return invalid("there are no skins");
  for (std::size_t i = 0; i < skeleton.skins.size(); ++i) {
    const SkeletonSkin& skin = skeleton.skins[i];
    const std::string title = titled("skin", i, skin.name);
    if (skin.joints.empty()) return invalid(title + " has no joints");
    if (skin.joints.size() > maxPoseJoints)
      return exceeded(title + " has " + std::to_string(skin.joints.size()) + " joints");
    if (skin.joints.size() != skin.inverseBind.size()) {
      return invalid(title + " has " + std::to_string(skin.joints.size()) + " joints, but " +
                     std::to_string(skin.inverseBind.size()) + " inverse bind matrices");
    }
    for (std::size_t joint = 0; joint < skin.joints.size(); ++joint) {
      if (skin.joints[joint] >= skeleton.nodes.size()) {
        return invalid(title + ": joint " + std::to_string(joint) + " is node " +
                       std::to_string(skin.joints[joint]) + ", which does not exist");
      }
      for (const auto& row : skin.inverseBind[joint].m) {
        if (!areFinite(row)) {
          return invalid(title + ": the inverse bind matrix of joint " + std::to_string(joint) +
                         " has a number that is not finite");
        }
      }
    }
  }
  return {};
}

/// Numbers of a value.
std::size_t widthOf(ChannelPath path, const SkeletonNode& node) {
  if (path == ChannelPath::weights) return node.weights.size();
  return path == ChannelPath::rotation ? 4 : 3;
}

Result<void> checkChannel(const Skeleton& skeleton, const ChannelView& channel,
                          const std::string& clip) {
  if (channel.node >= skeleton.nodes.size()) {
    return invalid(clip + " animates node " + std::to_string(channel.node) +
                   ", which does not exist");
  }
  const SkeletonNode& node = skeleton.nodes[channel.node];
  const std::string title = clip + ": " + titled("node", channel.node, node.name);
  if (channel.path > ChannelPath::weights || channel.interpolation > Interpolation::cubicSpline)
    return invalid(title + ": the path or the interpolation is no value of its type");
  const bool isWeights = channel.path == ChannelPath::weights;
  if (isWeights && node.weights.empty())
    return invalid(title + " has no weights, so they cannot be animated");
  if (node.matrix && !isWeights) return invalid(title + " has a matrix, so it cannot be animated");
  const std::size_t width =
      widthOf(channel.path, node) * (channel.interpolation == Interpolation::cubicSpline ? 3u : 1u);
  if (channel.times.empty() ||
      channel.values.size() != std::uint64_t{channel.times.size()} * width) {
    return invalid(title + " has " + std::to_string(channel.times.size()) + " key times and " +
                   std::to_string(channel.values.size()) + " numbers: " + std::to_string(width) +
                   " are needed for each of at least one key");
  }
  if (!areFinite(channel.times) || !areFinite(channel.values))
    return invalid(title + " has a key that is not finite");
  for (std::size_t key = 0;
       channel.path == ChannelPath::rotation &&
       channel.interpolation != Interpolation::cubicSpline && key < channel.values.size();
       key += 4) {
    if (std::ranges::count(channel.values.subspan(key, 4), 0.0f) == 4)
      return invalid(title + ": key " + std::to_string(key / 4) + " is the rotation 0");
  }
  if (!std::ranges::is_sorted(channel.times)) return invalid(title + ": its key times descend");
  return {};
}

Result<void> checkClips(const Skeleton& skeleton, std::span<const ClipView> clips) {
  if (clips.size() > maxClips) {
    return exceeded("there are " + std::to_string(clips.size()) + " clips, but at most " +
                    std::to_string(maxClips) + " are allowed");
  }
  for (std::size_t i = 0; i < clips.size(); ++i) {
    const ClipView& clip = clips[i];
    const std::string title = titled("clip", i, clip.name);
    if (!std::isfinite(clip.duration) || clip.duration < 0 ||
        !std::isfinite(static_cast<float>(clip.duration)))
      return invalid(title + ": its duration is not finite, or negative");
    std::set<std::uint64_t> seen;  // nodes and paths
    for (const ChannelView& channel : clip.channels) {
      if (Result<void> good = checkChannel(skeleton, channel, title); !good) return good;
      const auto property = std::uint64_t{channel.node} << 2 | static_cast<unsigned>(channel.path);
      if (!seen.insert(property).second)
        return invalid(title + " has two channels for one property of " +
                       titled("node", channel.node, skeleton.nodes[channel.node].name));
    }
    if (!clip.additive || clip.baseClip >= clips.size()) continue;
    if (clip.baseClip == i || clips[clip.baseClip].additive)
      return invalid(title + ": its base is itself, or additive");
    if (!std::isfinite(clip.baseTime)) return invalid(title + ": its base time is not finite");
  }
  return {};
}

}  // namespace

std::vector<std::uint32_t> parentsFirst(const std::vector<SkeletonNode>& nodes) {
  std::vector<std::vector<std::uint32_t>> children(nodes.size());
  std::vector<std::uint32_t> order;
  for (std::uint32_t i = 0; i < nodes.size(); ++i) {
    if (nodes[i].parent < nodes.size())
      children[nodes[i].parent].push_back(i);
    else
      order.push_back(i);
  }
  for (std::size_t next = 0; next < order.size(); ++next) {
    const std::vector<std::uint32_t>& below = children[order[next]];
    order.insert(order.end(), below.begin(), below.end());
  }
  return order;
}

std::string titled(const char* kind, std::size_t number, std::string_view name) {
  std::string title = kind;
  title.append(" ").append(std::to_string(number));
  return name.empty() ? title : title.append(" ").append(inQuotes(name));
}

Result<void> checkClipInput(const Skeleton& skeleton, std::span<const ClipView> clips,
                            const PackClipsOptions& options) {
  if (!std::isfinite(options.maxError) || options.maxError < 0)
    return invalid("maxError is not finite, or negative");
  if (!std::isfinite(options.maxWeightError) || options.maxWeightError < 0)
    return invalid("maxWeightError is not finite, or negative");
  if (options.rootMotion &&
      (options.rootMotion->node >= skeleton.nodes.size() || options.rootMotion->upAxis > 2))
    return invalid("rootMotion names a node or an axis that does not exist");
  if (Result<void> good = checkNodes(skeleton.nodes); !good) return good;
  if (Result<void> good = checkSkins(skeleton); !good) return good;
  if (!options.meshes.empty() && options.meshes.size() != skeleton.skins.size()) {
    return invalid("there are " + std::to_string(options.meshes.size()) + " meshes, but " +
                   std::to_string(skeleton.skins.size()) + " skins");
  }
  if (std::ranges::count(options.meshes, nullptr) > 0) return invalid("a mesh is null");
  if (options.masks.size() > maxMasks) {
    return exceeded("there are " + std::to_string(options.masks.size()) + " masks, but at most " +
                    std::to_string(maxMasks) + " are allowed");
  }
  for (std::size_t i = 0; i < options.masks.size(); ++i) {
    if (options.masks[i].size() != skeleton.nodes.size() ||
        !std::ranges::all_of(options.masks[i], [](float x) { return x >= 0 && x <= 1; })) {
      return invalid("mask " + std::to_string(i + 1) +
                     " does not have a factor from 0 to 1 for each node");
    }
  }
  return checkClips(skeleton, clips);
}

}  // namespace dermis
