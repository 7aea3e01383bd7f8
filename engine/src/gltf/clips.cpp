// The nodes, skins and clips of a model, as `packClips` takes them.
#include "dermis/gltf.h"
#include "gltf/reader.h"

namespace dermis::gltf {
namespace {

SkeletonNode skeletonNode(const Model& model, const Node& node) {
  SkeletonNode result{node.name, node.parent, node.translation, node.rotation, node.scale};
  if (node.matrix) result.matrix = localTransform(node);
  if (node.mesh != noIndex) {
    result.weights =
        node.morphWeights.empty() ? model.meshes[node.mesh].morphWeights : node.morphWeights;
  }
  return result;
}

ClipView clipView(const Clip& clip) {
  ClipView result;
  result.name = clip.name;
  result.duration = clip.duration;
  for (const Channel& channel : clip.channels) result.channels.push_back(viewOf(channel));
  return result;
}

}  // namespace

ChannelView viewOf(const Channel& channel) {
  return {channel.node, channel.path, channel.interpolation, channel.times, channel.values};
}

Skeleton skeleton(const Model& model) {
  Skeleton result;
  result.nodes.reserve(model.nodes.size());
  for (const Node& node : model.nodes) result.nodes.push_back(skeletonNode(model, node));
  result.skins.reserve(model.skins.size());
  for (const Skin& skin : model.skins)
    result.skins.push_back({skin.name, skin.joints, skin.inverseBindMatrices});
  return result;
}

std::vector<ClipView> clips(const Model& model) {
  std::vector<ClipView> result;
  result.reserve(model.clips.size());
  for (const Clip& clip : model.clips) result.push_back(clipView(clip));
  return result;
}

}  // namespace dermis::gltf
