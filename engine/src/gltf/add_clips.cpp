// Adds the clips of one model to another. Channels find their nodes by name.
#include <algorithm>
#include <cmath>
#include <compare>
#include <iterator>
#include <optional>
#include <utility>

#include "gltf/failure.h"
#include "gltf/notes.h"
#include "gltf/properties.h"
#include "gltf/reader.h"
#include "strict_floating_point.h"

namespace dermis::gltf {
namespace {

// In a sorted list, the node that a name selects comes first.
struct NamedNode {
  std::string_view name;
  bool isNoJoint = false;
  std::uint32_t node = noIndex;

  friend auto operator<=>(const NamedNode&, const NamedNode&) = default;
};

std::vector<bool> findJoints(const Model& model) {
  std::vector<bool> isJoint(model.nodes.size());
  for (const Skin& skin : model.skins)
    for (const std::uint32_t joint : skin.joints) isJoint[joint] = true;
  return isJoint;
}

std::uint32_t targetsOf(const Model& model, std::uint32_t node) {
  const std::uint32_t mesh = model.nodes[node].mesh;
  return mesh == noIndex ? 0 : model.meshes[mesh].morphTargetCount;
}

// The distance of a node from its parent.
double distanceOf(const Node& node) {
  const Transform local = localTransform(node);
  return std::hypot(local[0][3], local[1][3], local[2][3]);
}

// A node for messages: "node 3 'hip'".
std::string place(const Model& model, std::uint32_t node) {
  return join("node ", node, " ", inQuotes(model.nodes[node].name));
}

std::pair<std::uint32_t, ChannelPath> targetOf(const Channel& channel) {
  return {channel.node, channel.path};
}

class ClipMatcher {
 public:
  // Memory per node of the model and of the other one.
  static constexpr std::uint64_t bytesPerNode = 3 * sizeof(NamedNode) + 1;
  static constexpr std::uint64_t bytesPerSource =
      2 * sizeof(std::optional<std::uint32_t>) + 2 * sizeof(double) + 1;

  ClipMatcher(Model& model, const Model& from, Notes& notes)
      : model_(model),
        from_(from),
        notes_(notes),
        fromJoints_(findJoints(from)),
        transformed_(from.nodes.size()),
        morphed_(from.nodes.size()) {
    const std::vector<bool> isJoint = findJoints(model);
    nodes_.reserve(model.nodes.size());
    for (std::uint32_t node = 0; node < model.nodes.size(); ++node) {
      const NamedNode named{model.nodes[node].name, !isJoint[node], node};
      if (named.name.empty()) continue;
      nodes_.push_back(named);
      if (targetsOf(model, node) > 0) nodesWithTargets_.push_back(named);
    }
    std::ranges::sort(nodes_);
    std::ranges::sort(nodesWithTargets_);
    findScale();
  }

  // Replaces the nodes of the clip's channels by those of the model, and removes channels without
  // one.
  void match(Clip& clip) {
    std::vector<Channel>& channels = clip.channels;
    // A joint wins if another node with its name is animated, too.
    std::stable_partition(channels.begin(), channels.end(), [&](const Channel& channel) -> bool {
      return fromJoints_[channel.node];
    });
    for (Channel& channel : channels) {
      const auto node = channel.path == ChannelPath::weights ? nodeForWeights(channel)
                                                             : nodeForTransform(channel.node);
      if (node != noIndex && channel.path == ChannelPath::translation) scale(channel);
      channel.node = node;
    }
    std::erase_if(channels, [](const Channel& channel) { return channel.node == noIndex; });
    std::ranges::stable_sort(channels, {}, targetOf);
    const auto isRepeated = [](const Channel& a, const Channel& b) {
      return targetOf(a) == targetOf(b);
    };
    for (std::size_t i = 1; i < channels.size(); ++i) {
      if (!isRepeated(channels[i - 1], channels[i])) continue;
      notes_.remark(NoteKind::ambiguousName, "several animated nodes are named ",
                    inQuotes(model_.nodes[channels[i].node].name), ": only one of them is used");
    }
    channels.erase(std::unique(channels.begin(), channels.end(), isRepeated), channels.end());
    for (const Channel& channel : channels) decomposeTarget(channel);
  }

 private:
  using Names = std::vector<NamedNode>;

  static Names::const_iterator find(const Names& names, const std::string& name) {
    const auto found =
        std::ranges::lower_bound(names, std::string_view(name), {}, &NamedNode::name);
    return found != names.end() && found->name == name ? found : names.end();
  }

  // The node for a channel of this node. Each node is looked up, and noted, once.
  std::uint32_t nodeForTransform(std::uint32_t node) {
    std::optional<std::uint32_t>& known = transformed_[node];
    if (!known) known = findNode(node, nodes_, "no node of the model has this name");
    return *known;
  }

  std::uint32_t nodeForWeights(const Channel& channel) {
    std::optional<std::uint32_t>& known = morphed_[channel.node];
    if (known) return *known;
    known = findNode(channel.node, nodesWithTargets_,
                     "no node of the model with this name has morph targets");
    if (*known == noIndex || targetsOf(model_, *known) == channel.components) return *known;
    notes_.remark(NoteKind::otherTargets, place(from_, channel.node), ": its mesh has ",
                  channel.components, " morph targets, that of the model has ",
                  targetsOf(model_, *known), "; its weights are left out");
    return *(known = noIndex);
  }

  std::uint32_t findNode(std::uint32_t node, const Names& names, const char* complaint) const {
    const std::string& name = from_.nodes[node].name;
    if (name.empty()) {
      notes_.remark(NoteKind::unmatched, "node ", node, " is animated, but has no name");
      return noIndex;
    }
    const auto found = find(names, name);
    if (found == names.end()) {
      notes_.remark(NoteKind::unmatched, place(from_, node), " is animated, but ", complaint);
      return noIndex;
    }
    const auto next = std::next(found);
    if (next != names.end() && next->name == name && next->isNoJoint == found->isNoJoint) {
      notes_.remark(NoteKind::ambiguousName, "several nodes of the model are named ",
                    inQuotes(name), ": node ", found->node, " is animated");
    }
    return found->node;
  }

  // The clips may be in another unit of length. Figures of different size differ by less.
  void findScale() {
    constexpr double sameUnit = 3;
    std::vector<double> ratios;
    for (const Node& node : from_.nodes) {
      const auto found = node.name.empty() ? nodes_.end() : find(nodes_, node.name);
      if (found == nodes_.end()) continue;
      const double ratio = distanceOf(model_.nodes[found->node]) / distanceOf(node);
      if (std::isfinite(ratio) && ratio > 0) ratios.push_back(ratio);
    }
    if (ratios.empty()) return;
    const auto middle = ratios.begin() + static_cast<std::ptrdiff_t>(ratios.size() / 2);
    std::ranges::nth_element(ratios, middle);
    if (*middle <= sameUnit && *middle >= 1 / sameUnit) return;
    scale_ = *middle;
  }

  void scale(Channel& channel) {
    if (scale_ == 1) return;
    if (!std::exchange(isScaleNoted_, true)) {
      notes_.remark(NoteKind::unit, "in the model, nodes are ", scale_,
                    " times as far from their parents: translations are multiplied by this number");
    }
    for (float& value : channel.values) value = toFloat(double{value} * scale_);
  }

  void decomposeTarget(const Channel& channel) {
    Node& node = model_.nodes[channel.node];
    if (!node.matrix || channel.path == ChannelPath::weights) return;
    decompose(node);
    notes_.remark(NoteKind::animatedMatrix, place(model_, channel.node),
                  " of the model has a matrix, which has been decomposed for the animation");
  }

  Model& model_;
  const Model& from_;
  Notes& notes_;
  std::vector<bool> fromJoints_;
  Names nodes_, nodesWithTargets_;
  /// By node of the other model: the node for transforms and for weights, or `none`.
  std::vector<std::optional<std::uint32_t>> transformed_, morphed_;
  double scale_ = 1;
  bool isScaleNoted_ = false;
};

}  // namespace

Result<std::vector<std::string>> addClips(Model& model, Model from) {
  if (from.clips.empty()) return Error{ErrorCode::invalidData, "it has no animations"};
  MemoryBudget budget(from.memoryLeft);
  if (!budget.spend(model.nodes.size(), ClipMatcher::bytesPerNode) ||
      !budget.spend(from.nodes.size(), ClipMatcher::bytesPerSource)) {
    return Error{ErrorCode::limitExceeded,
                 "matching its nodes with those of the model needs more memory than the limit for "
                 "a file of this size"};
  }
  Notes notes(false);
  ClipMatcher matcher(model, from, notes);
  for (Clip& clip : from.clips) matcher.match(clip);
  std::vector<std::string> sentences;
  notes.appendTo(sentences);
  const auto isEmpty = [](const Clip& clip) { return clip.channels.empty(); };
  if (std::ranges::all_of(from.clips, isEmpty)) {
    std::string message = "its animations move no node of the model";
    if (!sentences.empty()) message += ": " + sentences.front();
    return Error{ErrorCode::invalidData, std::move(message)};
  }
  std::ranges::move(from.clips, std::back_inserter(model.clips));
  std::ranges::move(from.sideFiles, std::back_inserter(model.sideFiles));
  return sentences;
}

}  // namespace dermis::gltf
