#include <algorithm>
#include <utility>

#include "dermis/gltf.h"
#include "gltf/properties.h"
#include "gltf/reader.h"
#include "strict_floating_point.h"

namespace dermis::gltf {
namespace {

const Channel* findWeights(const Model& model, std::uint32_t node, std::uint32_t clip) {
  if (clip >= model.clips.size()) return nullptr;
  const std::vector<Channel>& channels = model.clips[clip].channels;
  const std::pair wanted(node, ChannelPath::weights);
  const auto placeOf = [](const Channel& channel) { return std::pair(channel.node, channel.path); };
  const auto found = std::ranges::lower_bound(channels, wanted, {}, placeOf);
  return found == channels.end() || placeOf(*found) != wanted ? nullptr : &*found;
}

}  // namespace

std::vector<float> morphWeights(const Model& model, std::uint32_t node, std::uint32_t clip,
                                double time) {
  if (node >= model.nodes.size() || model.nodes[node].mesh == noIndex) return {};
  const Node& from = model.nodes[node];
  const Mesh& mesh = model.meshes[from.mesh];
  std::vector<float> weights(mesh.morphTargetCount, 0.0f);
  if (const Channel* channel = findWeights(model, node, clip)) {
    std::vector<double> sampled(channel->components);
    interpolate(viewOf(*channel), time, sampled);
    std::transform(sampled.begin(), sampled.end(), weights.begin(), toFloat);
  } else if (!from.morphWeights.empty()) {
    std::copy(from.morphWeights.begin(), from.morphWeights.end(), weights.begin());
  } else if (!mesh.morphWeights.empty()) {
    std::copy(mesh.morphWeights.begin(), mesh.morphWeights.end(), weights.begin());
  }
  return weights;
}

}  // namespace dermis::gltf
