#include <algorithm>
#include <cmath>

#include "gltf/failure.h"
#include "gltf/reader.h"
#include "strict_floating_point.h"

namespace dermis::gltf {
namespace {

// Decimal numbers in a JSON text are not exact. Only a length that differs from 1 by more than this
// gets a note.
constexpr double unitLengthTolerance = 1e-5;

// Like other programs, Dermis does not use the fourth row.
void checkMatrix(const std::array<double, 16>& matrix, std::size_t index, Notes& notes) {
  constexpr double tolerance = 1e-5;
  const bool affine = std::abs(matrix[3]) <= tolerance && std::abs(matrix[7]) <= tolerance &&
                      std::abs(matrix[11]) <= tolerance && std::abs(matrix[15] - 1) <= tolerance;
  if (affine) return;
  notes.broken(NoteKind::matrix, "node ", index, ": the fourth row of its matrix is not 0 0 0 1");
}

// Returns whether the rotation had to be normalized.
bool readTransform(const tinygltf::Node& source, std::size_t index, Node& node, Notes& notes) {
  if (!source.matrix.empty()) {
    std::copy(source.matrix.begin(), source.matrix.end(), node.matrix.emplace().begin());
    checkMatrix(*node.matrix, index, notes);
    return false;
  }
  std::copy(source.translation.begin(), source.translation.end(), node.translation.begin());
  std::copy(source.rotation.begin(), source.rotation.end(), node.rotation.begin());
  std::copy(source.scale.begin(), source.scale.end(), node.scale.begin());
  return normalizeQuaternion(node.rotation) > unitLengthTolerance;
}

void readParents(const tinygltf::Model& content, Model& model) {
  for (std::size_t parent = 0; parent < content.nodes.size(); ++parent) {
    for (const int childIndex : content.nodes[parent].children) {
      Node& child = model.nodes[static_cast<std::size_t>(childIndex)];
      if (child.parent != none) {
        failInvalid("node ", childIndex, ": it is a child of both node ", child.parent,
                    " and node ", parent);
      }
      child.parent = static_cast<std::uint32_t>(parent);
    }
  }
}

// The nodes whose transforms decide where something skinned is: skinned nodes, joints, and what the
// default scene lists.
std::vector<bool> findUsed(const Source& source, const Model& model) {
  const tinygltf::Model& content = source.content();
  std::vector<bool> used(model.nodes.size(), false);
  for (std::size_t i = 0; i < used.size(); ++i)
    used[i] = model.nodes[i].mesh != none && model.nodes[i].skin != none;
  const auto use = [&](const std::vector<int>& nodes) {
    for (const int node : nodes) used[static_cast<std::size_t>(node)] = true;
  };
  for (std::size_t i = 0; i < content.skins.size(); ++i)
    if (source.usage().skins[i]) use(content.skins[i].joints);
  if (!content.scenes.empty())
    use(content.scenes[static_cast<std::size_t>(std::max(content.defaultScene, 0))].nodes);
  return used;
}

// Roots first, then their children, and so on. The nodes that remain are in a cycle, because no
// node has two parents. If none of them is used, they become roots.
void orderNodes(const Source& source, Model& model) {
  const tinygltf::Model& content = source.content();
  model.nodeOrder.reserve(model.nodes.size());
  for (std::uint32_t i = 0; i < model.nodes.size(); ++i) {
    if (model.nodes[i].parent == none) model.nodeOrder.push_back(i);
  }
  for (std::size_t i = 0; i < model.nodeOrder.size(); ++i) {
    for (const int child : content.nodes[model.nodeOrder[i]].children) {
      model.nodeOrder.push_back(static_cast<std::uint32_t>(child));
    }
  }
  if (model.nodeOrder.size() == model.nodes.size()) return;
  std::vector<bool> reached(model.nodes.size(), false);
  for (const std::uint32_t node : model.nodeOrder) reached[node] = true;
  const std::vector<bool> used = findUsed(source, model);
  for (std::uint32_t i = 0; i < model.nodes.size(); ++i) {
    if (reached[i]) continue;
    source.notes().tolerateUnlessUsed(
        used[i], [&] { failInvalid("node ", i, ": it is part of, or below, a cycle of nodes"); });
    model.nodes[i].parent = none;
    model.nodeOrder.push_back(i);
  }
}

}  // namespace

double normalizeQuaternion(std::array<double, 4>& quaternion) {
  double square = 0;
  for (const double component : quaternion) square += component * component;
  const double length = std::sqrt(square);
  if (!(length > 0) || !std::isfinite(length)) {
    quaternion = {0, 0, 0, 1};
    return 1;
  }
  for (double& component : quaternion) component /= length;
  return std::abs(length - 1);
}

void readNodes(const Source& source, Model& model) {
  const tinygltf::Model& content = source.content();
  model.nodes.resize(content.nodes.size());
  std::size_t normalized = 0;
  for (std::size_t i = 0; i < content.nodes.size(); ++i) {
    const tinygltf::Node& from = content.nodes[i];
    Node& node = model.nodes[i];
    node.name = from.name;
    node.mesh = indexOf(from.mesh);
    node.skin = indexOf(from.skin);
    node.morphWeights.assign(from.weights.size(), 0);
    std::transform(from.weights.begin(), from.weights.end(), node.morphWeights.begin(),
                   [](double weight) { return static_cast<float>(weight); });
    if (readTransform(from, i, node, source.notes())) ++normalized;
  }
  readParents(content, model);
  orderNodes(source, model);
  if (normalized > 0) {
    model.notes.push_back(
        join(counted(normalized, "node rotation"), " normalized: not of unit length"));
  }
}

}  // namespace dermis::gltf
