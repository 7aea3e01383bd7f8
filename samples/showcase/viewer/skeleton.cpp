#include "skeleton.h"

#include <algorithm>
#include <cstring>

#include "dermis/text.h"

namespace dermis::viewer {
namespace {

const std::byte* elementOf(const AttributeView& view, std::uint32_t vertex, std::uint32_t index,
                           std::uint32_t size) {
  return static_cast<const std::byte*>(view.data) + std::size_t{vertex} * view.stride +
         std::size_t{index} * size;
}

template <typename T>
T read(const AttributeView& view, std::uint32_t vertex, std::uint32_t index) {
  T value;
  std::memcpy(&value, elementOf(view, vertex, index, sizeof(T)), sizeof(T));
  return value;
}

std::uint32_t readJoint(const AttributeView& view, std::uint32_t vertex, std::uint32_t index) {
  switch (view.type) {
    case ComponentType::uint8:
      return read<std::uint8_t>(view, vertex, index);
    case ComponentType::uint16:
      return read<std::uint16_t>(view, vertex, index);
    default:
      return read<std::uint32_t>(view, vertex, index);
  }
}

float readWeight(const AttributeView& view, std::uint32_t vertex, std::uint32_t index) {
  switch (view.type) {
    case ComponentType::unorm8:
      return static_cast<float>(read<std::uint8_t>(view, vertex, index)) / 255;
    case ComponentType::unorm16:
      return static_cast<float>(read<std::uint16_t>(view, vertex, index)) / 65535;
    default:
      return read<float>(view, vertex, index);
  }
}

}  // namespace

std::vector<Joint> jointsOf(const cli::Scene& scene) {
  const gltf::Model& model = *scene.model;
  std::vector<bool> isJoint(model.nodes.size());
  for (const cli::ScenePart& part : scene.parts) {
    for (const std::uint32_t node : model.skins[part.source.skin].joints) isJoint[node] = true;
  }
  std::vector<std::vector<std::uint32_t>> children(model.nodes.size());
  std::vector<std::uint32_t> next;  // used as a stack
  for (std::uint32_t node = 0; node < model.nodes.size(); ++node) {
    const std::uint32_t parent = model.nodes[node].parent;
    (parent == gltf::none ? next : children[parent]).push_back(node);
  }
  // Depth first: one limb after the other.
  std::ranges::reverse(next);
  std::vector<std::uint32_t> place(model.nodes.size(), gltf::none);
  std::vector<Joint> joints;
  while (!next.empty()) {
    const std::uint32_t node = next.back();
    next.pop_back();
    next.insert(next.end(), children[node].rbegin(), children[node].rend());
    const std::uint32_t parent = model.nodes[node].parent;
    place[node] = parent == gltf::none ? gltf::none : place[parent];
    if (!isJoint[node]) continue;
    Joint joint;
    joint.node = node;
    joint.parent = place[node];
    joint.name = shortName(model.nodes[node].name);
    if (joint.name.empty()) joint.name = "node " + std::to_string(node);
    place[node] = static_cast<std::uint32_t>(joints.size());
    joints.push_back(std::move(joint));
  }
  return joints;
}

std::vector<glm::vec3> jointPositions(const cli::Scene& scene, const std::vector<Joint>& joints,
                                      std::uint32_t clip, double time) {
  const std::vector<gltf::GlobalTransform> globals = gltf::nodeGlobals(*scene.model, clip, time);
  std::vector<glm::vec3> positions;
  for (const Joint& joint : joints) {
    const gltf::GlobalTransform& global = globals[joint.node];
    positions.emplace_back(global[0][3], global[1][3], global[2][3]);
  }
  return positions;
}

std::vector<float> jointWeights(const cli::Scene& scene, const cli::ScenePart& part,
                                std::uint32_t node) {
  std::vector<float> weights(part.primitive->vertexCount, 0.0f);
  if (part.mesh == nullptr) return weights;
  const MeshView mesh = part.mesh->view();
  const std::vector<std::uint32_t>& joints = scene.model->skins[part.source.skin].joints;
  for (std::uint32_t vertex = 0; vertex < mesh.vertexCount; ++vertex) {
    float own = 0, all = 0;
    for (const InfluenceSet& set : mesh.influenceSets) {
      for (std::uint32_t index = 0; index < set.joints.components; ++index) {
        const float weight = readWeight(set.weights, vertex, index);
        const std::uint32_t joint = readJoint(set.joints, vertex, index);
        all += weight;
        if (joint < joints.size() && joints[joint] == node) own += weight;
      }
    }
    if (all > 0) weights[vertex] = own / all;
  }
  return weights;
}

}  // namespace dermis::viewer
