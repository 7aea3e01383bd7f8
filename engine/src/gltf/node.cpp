#include <algorithm>
#include <cmath>

#include "gltf/failure.h"
#include "gltf/reader.h"
#include "strict_floating_point.h"

namespace dermis::gltf {
namespace {

// The largest sum of the magnitudes in a column.
double norm(const Transform& transform) {
  double largest = 0;
  for (std::size_t column = 0; column < 4; ++column) {
    double sum = column == 3 ? 1 : 0;
    for (const std::array<double, 4>& row : transform) sum += std::abs(row[column]);
    largest = std::max(largest, sum);
  }
  return largest;
}

// A node's matrix must be translation × rotation × scale. Like other programs, Dermis uses it as it
// is. The official validator compares one norm of the matrix and of that product. Shear does not
// change the norm if another column has the largest sum: then it is not an error, even if strict.
void checkDecomposition(const Node& node, std::size_t index, Notes& notes) {
  constexpr double tolerance = 1e-4;
  Node parts;
  parts.matrix = node.matrix;
  decompose(parts);
  const Transform transform = localTransform(node), product = localTransform(parts);
  double difference = 0, largest = 0;
  for (std::size_t row = 0; row < 3; ++row) {
    for (std::size_t column = 0; column < 3; ++column) {
      difference = std::max(difference, std::abs(transform[row][column] - product[row][column]));
      largest = std::max(largest, std::abs(transform[row][column]));
    }
  }
  const bool isSingular = std::ranges::find(parts.scale, 0.0) != parts.scale.end();
  const char* sentence = ": its matrix is not a translation times a rotation times a scale";
  if (isSingular || std::abs(norm(transform) - norm(product)) > tolerance) {
    notes.broken(NoteKind::decomposition, "node ", index, sentence);
  } else if (difference > tolerance * largest) {
    notes.remark(NoteKind::decomposition, "node ", index, sentence);
  }
}

// Like other programs, Dermis does not use the fourth row.
void checkMatrix(const Node& node, std::size_t index, Notes& notes) {
  for (std::size_t column = 0; column < 4; ++column) {
    const auto value = static_cast<float>((*node.matrix)[4 * column + 3]);
    if (value == (column == 3 ? 1.0f : 0.0f)) continue;
    notes.broken(NoteKind::matrix, "node ", index, ": the fourth row of its matrix is not 0 0 0 1");
    return;
  }
  checkDecomposition(node, index, notes);
}

void readTransform(const tinygltf::Node& source, std::size_t index, Node& node, Notes& notes) {
  if (!source.matrix.empty()) {
    std::copy(source.matrix.begin(), source.matrix.end(), node.matrix.emplace().begin());
    checkMatrix(node, index, notes);
    return;
  }
  std::copy(source.translation.begin(), source.translation.end(), node.translation.begin());
  std::copy(source.rotation.begin(), source.rotation.end(), node.rotation.begin());
  std::copy(source.scale.begin(), source.scale.end(), node.scale.begin());
  for (const double component : node.rotation) {
    if (std::abs(component) <= 1) continue;
    notes.broken(NoteKind::rotation, "node ", index, ": its rotation has the component ", component,
                 ", which is not from -1 to 1");
  }
  const double length = normalizeQuaternion(node.rotation);
  if (isUnitLength(length)) return;
  notes.broken(NoteKind::rotation, "node ", index, ": its rotation has a length of ", length,
               ", not 1");
}

void readParents(const tinygltf::Model& content, Model& model) {
  for (std::size_t parent = 0; parent < content.nodes.size(); ++parent) {
    for (const int childIndex : content.nodes[parent].children) {
      Node& child = model.nodes[static_cast<std::size_t>(childIndex)];
      if (child.parent != noIndex) {
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
    used[i] = model.nodes[i].mesh != noIndex && model.nodes[i].skin != noIndex;
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
    if (model.nodes[i].parent == noIndex) model.nodeOrder.push_back(i);
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
    model.nodes[i].parent = noIndex;
    model.nodeOrder.push_back(i);
  }
}

}  // namespace

void readNodes(const Source& source, Model& model) {
  const tinygltf::Model& content = source.content();
  model.nodes.resize(content.nodes.size());
  for (std::size_t i = 0; i < content.nodes.size(); ++i) {
    const tinygltf::Node& from = content.nodes[i];
    Node& node = model.nodes[i];
    node.name = from.name;
    node.mesh = indexOf(from.mesh);
    node.skin = indexOf(from.skin);
    node.morphWeights.assign(from.weights.size(), 0);
    std::transform(from.weights.begin(), from.weights.end(), node.morphWeights.begin(),
                   [](double weight) { return static_cast<float>(weight); });
    readTransform(from, i, node, source.notes());
  }
  readParents(content, model);
  orderNodes(source, model);
}

}  // namespace dermis::gltf
