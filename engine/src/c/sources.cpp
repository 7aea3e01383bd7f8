#include "sources.h"

#include <algorithm>

namespace dermis::c {
namespace {

bool isZero(std::span<const double> numbers) {
  return std::ranges::all_of(numbers, [](double number) { return number == 0; });
}

SkeletonNode nodeOf(const dermis_node& node) {
  SkeletonNode result;
  result.name = text(node.name);
  if (node.parent != 0) result.parent = node.parent - 1;
  std::copy_n(node.translation, 3, result.translation.begin());
  if (!isZero(node.rotation)) std::copy_n(node.rotation, 4, result.rotation.begin());
  if (!isZero(node.scale)) std::copy_n(node.scale, 3, result.scale.begin());
  result.weights = array(node.weights, node.weight_count, "a node's weights");
  if (node.matrix == nullptr) return result;
  Transform& matrix = result.matrix.emplace();
  for (std::size_t i = 0; i < 12; ++i) matrix[i / 4][i % 4] = node.matrix[i];
  return result;
}

ChannelView channelOf(const dermis_channel& channel) {
  ChannelView result;
  result.node = channel.node;
  result.path = static_cast<ChannelPath>(
      enumerator(channel.path, DERMIS_CHANNEL_WEIGHTS, "a channel's path"));
  result.interpolation = static_cast<Interpolation>(enumerator(
      channel.interpolation, DERMIS_INTERPOLATION_CUBIC_SPLINE, "a channel's interpolation"));
  result.times = array(channel.times, channel.key_count, "a channel's times");
  result.values = array(channel.values, channel.value_count, "a channel's values");
  return result;
}

ClipView clipOf(const dermis_clip_view& clip) {
  ClipView result;
  result.name = text(clip.name);
  result.duration = clip.duration;
  for (const dermis_channel& channel : inArray(clip.channels, clip.channel_count, "channels"))
    result.channels.push_back(channelOf(channel));
  result.wraps = clip.is_clamped == 0;
  result.additive = clip.is_additive != 0;
  if (clip.base_clip != 0) result.baseClip = clip.base_clip - 1;
  result.baseTime = clip.base_time;
  return result;
}

/// Both have the same bytes.
std::span<const std::array<float, 4>> quaternionsOf(const float* numbers, std::size_t count) {
  static_assert(sizeof(std::array<float, 4>) == 4 * sizeof(float));
  array(numbers, count, "a corrective's rotations");
  return {reinterpret_cast<const std::array<float, 4>*>(numbers), count};
}

JointOffset offsetOf(const dermis_joint_offset& offset) {
  const auto isSet = [](float number) { return number != 0; };
  JointOffset result;
  std::ranges::copy(offset.translation, result.translation.begin());
  if (std::ranges::any_of(offset.rotation, isSet))
    std::ranges::copy(offset.rotation, result.rotation.begin());
  if (std::ranges::any_of(offset.scale, isSet))
    std::ranges::copy(offset.scale, result.scale.begin());
  return result;
}

}  // namespace

ClipsOfCaller::ClipsOfCaller(const dermis_clips_source& source) {
  for (const dermis_node& node : inArray(source.nodes, source.node_count, "nodes"))
    skeleton.nodes.push_back(nodeOf(node));
  for (const dermis_skin& skin : inArray(source.skins, source.skin_count, "skins")) {
    skeleton.skins.push_back(
        {text(skin.name), array(skin.joints, skin.joint_count, "a skin's joints"),
         jointsOf(skin.inverse_bind, skin.joint_count, "a skin's inverse_bind")});
  }
  for (const dermis_clip_view& clip : inArray(source.clips, source.clip_count, "clips"))
    clips.push_back(clipOf(clip));
  const std::size_t nodes = source.node_count;
  if (source.mask_count > maxMasks)
    fail("there are " + std::to_string(source.mask_count) + " masks, but at most " +
             std::to_string(maxMasks) + " are allowed",
         DERMIS_LIMIT_EXCEEDED);
  const std::span<const float> all = array(source.masks, source.mask_count * nodes, "masks");
  for (std::size_t mask = 0; mask < source.mask_count; ++mask)
    masks.push_back(all.subspan(mask * nodes, nodes));
  if (source.root_motion_node == 0) return;
  rootMotion = {.node = source.root_motion_node - 1,
                .upAxis = source.up_axis == 0 ? 1 : source.up_axis - 1};
}

void appendLayers(std::span<const dermis_clip_layer> layers, std::vector<ClipLayer>& to) {
  for (const dermis_clip_layer& layer : layers)
    to.push_back({layer.clip, layer.time, layer.weight, layer.mask, layer.hold != 0});
}

ClipsForCaller::ClipsForCaller(const Skeleton& skeleton, std::span<const ClipView> views) {
  for (const SkeletonNode& node : skeleton.nodes) {
    dermis_node& result = nodes_.emplace_back();
    result.size = sizeof(result);
    if (node.parent < skeleton.nodes.size()) result.parent = node.parent + 1;
    result.name = names_.emplace_back(node.name).c_str();
    std::ranges::copy(node.translation, result.translation);
    std::ranges::copy(node.rotation, result.rotation);
    std::ranges::copy(node.scale, result.scale);
    if (isZero(result.scale)) result.scale[0] = 1e-300;  // 0 in float32, and not the default
    result.weights = node.weights.data();
    result.weight_count = static_cast<std::uint32_t>(node.weights.size());
    if (!node.matrix) continue;
    std::array<double, 12>& matrix = matrices_.emplace_back();
    for (std::size_t i = 0; i < 12; ++i) matrix[i] = (*node.matrix)[i / 4][i % 4];
    result.matrix = matrix.data();
  }
  for (const SkeletonSkin& skin : skeleton.skins) {
    skins_.push_back({sizeof(dermis_skin), static_cast<std::uint32_t>(skin.joints.size()),
                      names_.emplace_back(skin.name).c_str(), skin.joints.data(),
                      reinterpret_cast<const dermis_joint*>(skin.inverseBind.data())});
  }
  for (const ClipView& clip : views) {
    std::vector<dermis_channel>& channels = channels_.emplace_back();
    for (const ChannelView& channel : clip.channels) {
      channels.push_back(
          {sizeof(dermis_channel), channel.node, static_cast<dermis_channel_path>(channel.path),
           static_cast<dermis_interpolation>(channel.interpolation), channel.times.data(),
           channel.values.data(), static_cast<std::uint32_t>(channel.times.size()),
           static_cast<std::uint32_t>(channel.values.size())});
    }
    dermis_clip_view& result = clips_.emplace_back();
    result.size = sizeof(result);
    result.channel_count = static_cast<std::uint32_t>(channels.size());
    result.name = names_.emplace_back(clip.name).c_str();
    result.duration = clip.duration;
    result.channels = channels.data();
  }
  source.size = sizeof(source);
  source.node_count = static_cast<std::uint32_t>(nodes_.size());
  source.skin_count = static_cast<std::uint32_t>(skins_.size());
  source.clip_count = static_cast<std::uint32_t>(clips_.size());
  source.nodes = nodes_.data();
  source.skins = skins_.data();
  source.clips = clips_.data();
}

std::vector<RigJoint> rigJointsOf(const dermis_rig_joint* joints, std::uint32_t count) {
  std::vector<RigJoint> result;
  for (const dermis_rig_joint& joint : array(joints, count, "joints")) {
    RigJoint& made = result.emplace_back();
    if (joint.parent != 0) made.parent = joint.parent - 1;
    made.bind = jointsOf(&joint.bind, 1, "bind").front();
  }
  return result;
}

ChainDriver chainOf(const dermis_chain& chain) {
  return {array(chain.joints, chain.joint_count, "a chain's joints"), chain.first_driven,
          chain.segments};
}

RigOfCaller::RigOfCaller(const dermis_rig_source* callers) {
  const dermis_rig_source source = in(callers, "source");
  joints_ = rigJointsOf(source.joints, source.joint_count);
  for (const dermis_twist& twist : inArray(source.twists, source.twist_count, "twists")) {
    TwistDriver& made = twists_.emplace_back();
    made.joint = twist.joint;
    made.source = twist.source;
    std::ranges::copy(twist.axis, made.axis.begin());
    made.share = twist.share;
  }
  for (const dermis_corrective& corrective :
       inArray(source.correctives, source.corrective_count, "correctives"))
    correctives_.push_back(correctiveOf(corrective));
  for (const dermis_chain& chain : inArray(source.chains, source.chain_count, "chains"))
    chains_.push_back(chainOf(chain));
  for (const dermis_linear& linear : inArray(source.linears, source.linear_count, "linears")) {
    linears_.push_back({linear.joint,
                        array(linear.weights, linear.count, "a linear driver's weights"),
                        jointsOf(linear.matrices, linear.count, "a linear driver's matrices")});
  }
  view = {.joints = joints_,
          .writtenJoints = source.written_joints,
          .givenWeights = source.given_weights,
          .drivenWeights = source.driven_weights,
          .twists = twists_,
          .correctives = correctives_,
          .chains = chains_,
          .linears = linears_};
  if (source.given_weights != 0) view.weightsOf = source.weights_of;
}

CorrectiveDriver RigOfCaller::correctiveOf(const dermis_corrective& corrective) {
  const std::size_t examples = corrective.example_count;
  CorrectiveDriver made;
  made.inputs = array(corrective.inputs, corrective.input_count, "a corrective's inputs");
  made.examples = quaternionsOf(corrective.rotations, examples * corrective.input_count);
  made.radius = corrective.radius;
  made.firstWeight = corrective.first_weight;
  made.weightCount = corrective.weight_count;
  made.weights =
      array(corrective.weights, examples * corrective.weight_count, "a corrective's weights");
  made.joints = array(corrective.joints, corrective.joint_count, "a corrective's joints");
  std::vector<JointOffset>& moved = offsets_.emplace_back();
  for (const dermis_joint_offset& offset :
       array(corrective.offsets, examples * corrective.joint_count, "a corrective's offsets"))
    moved.push_back(offsetOf(offset));
  made.offsets = moved;
  return made;
}

}  // namespace dermis::c
