#include "core/affine.h"
#include "dermis/gltf.h"
#include "gltf/reader.h"
#include "strict_floating_point.h"

namespace dermis::gltf {
namespace {

// A node's local transform, with a clip's values applied.
struct LocalTransform {
  std::array<double, 3> translation;
  std::array<double, 4> rotation;
  std::array<double, 3> scale;
};

Transform fromMatrix(const std::array<double, 16>& columns) {
  Transform transform;
  for (std::size_t row = 0; row < 3; ++row) {
    for (std::size_t column = 0; column < 4; ++column) {
      transform[row][column] = columns[column * 4 + row];
    }
  }
  return transform;
}

Transform compose(const LocalTransform& local) {
  return composed(local.translation, local.rotation, local.scale);
}

void applyChannel(const Channel& channel, double time, LocalTransform& local) {
  switch (channel.path) {
    case ChannelPath::translation:
      interpolate(viewOf(channel), time, local.translation);
      break;
    case ChannelPath::rotation:
      interpolate(viewOf(channel), time, local.rotation);
      break;
    case ChannelPath::scale:
      interpolate(viewOf(channel), time, local.scale);
      break;
    case ChannelPath::weights:
      break;  // `morphWeights` samples them.
  }
}

}  // namespace

Transform localTransform(const Node& node) {
  return node.matrix ? fromMatrix(*node.matrix)
                     : compose({node.translation, node.rotation, node.scale});
}

std::vector<Transform> nodeGlobals(const Model& model, std::uint32_t clip, double time) {
  std::vector<LocalTransform> locals;
  locals.reserve(model.nodes.size());
  for (const Node& node : model.nodes) {
    locals.push_back({node.translation, node.rotation, node.scale});
  }
  if (clip < model.clips.size()) {
    for (const Channel& channel : model.clips[clip].channels) {
      applyChannel(channel, time, locals[channel.node]);
    }
  }
  std::vector<Transform> globals(model.nodes.size());
  for (const std::uint32_t index : model.nodeOrder) {
    const Node& node = model.nodes[index];
    const Transform local = node.matrix ? localTransform(node) : compose(locals[index]);
    globals[index] = node.parent == noIndex ? local : multiply(globals[node.parent], local);
  }
  return globals;
}

std::vector<JointMatrix> pose(const Model& model, std::uint32_t skin,
                              std::span<const Transform> globals) {
  if (skin >= model.skins.size() || globals.size() < model.nodes.size()) return {};
  const Skin& from = model.skins[skin];
  std::vector<JointMatrix> matrices(from.joints.size());
  for (std::size_t i = 0; i < from.joints.size(); ++i) {
    const Transform product = multiply(globals[from.joints[i]], from.inverseBindMatrices[i].m);
    for (std::size_t row = 0; row < 3; ++row) {
      for (std::size_t column = 0; column < 4; ++column) {
        matrices[i].m[row][column] = static_cast<float>(product[row][column]);
      }
    }
  }
  return matrices;
}

std::vector<JointMatrix> pose(const Model& model, std::uint32_t skin, std::uint32_t clip,
                              double time) {
  return pose(model, skin, nodeGlobals(model, clip, time));
}

}  // namespace dermis::gltf
