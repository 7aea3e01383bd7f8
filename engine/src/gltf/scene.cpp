#include <algorithm>

#include "gltf/failure.h"
#include "gltf/reader.h"
#include "strict_floating_point.h"

namespace dermis::gltf {
namespace {

std::vector<bool> nodesBelow(const Model& model, const std::vector<std::uint32_t>& roots) {
  std::vector<bool> reachable(model.nodes.size(), false);
  for (const std::uint32_t root : roots) reachable[root] = true;
  for (const std::uint32_t node : model.nodeOrder) {
    const std::uint32_t parent = model.nodes[node].parent;
    if (parent != none && reachable[parent]) reachable[node] = true;
  }
  return reachable;
}

// The nodes of a scene. If the scene lists a node that is not a root, the node's parents must be in
// the scene too: otherwise it is not clear whether their transforms apply.
std::vector<bool> nodesOfScene(const Source& source, const Model& model, std::size_t scene) {
  std::vector<std::uint32_t> roots, others;
  for (const int node : source.content().scenes[scene].nodes)
    (model.nodes[indexOf(node)].parent == none ? roots : others).push_back(indexOf(node));
  std::vector<bool> reachable = nodesBelow(model, roots);
  for (const std::uint32_t node : others) {
    const std::string sentence = join("scene ", scene, ": node ", node, " is not a root but a ",
                                      "child of node ", model.nodes[node].parent);
    if (!reachable[node]) failInvalid(sentence);
    source.notes().broken(NoteKind::sceneNode, sentence);
  }
  return reachable;
}

// The nodes of the default scene: of `scene`, or of scene 0 if the file does not say (as in
// three.js), or all nodes if there are no scenes.
std::vector<bool> findReachable(const Source& source, Model& model) {
  const tinygltf::Model& content = source.content();
  if (!content.scenes.empty())
    return nodesOfScene(source, model, static_cast<std::size_t>(std::max(content.defaultScene, 0)));
  if (!model.nodes.empty()) model.notes.push_back("the file has no scene: all its nodes are used");
  return std::vector<bool>(model.nodes.size(), true);
}

void readMesh(PrimitiveReader& reader, std::size_t count, Model& model, std::uint32_t index) {
  Mesh& mesh = model.meshes[index];
  if (!mesh.primitives.empty()) return;
  for (std::uint32_t i = 0; i < count; ++i) mesh.primitives.push_back(reader.read(index, i));
}

// By skin: whether all its joints are among these nodes.
std::vector<bool> skinsWithin(const Model& model, const std::vector<bool>& nodes) {
  std::vector<bool> within;
  for (const Skin& skin : model.skins)
    within.push_back(std::ranges::all_of(skin.joints, [&](auto joint) { return nodes[joint]; }));
  return within;
}

bool hasNoJoints(const tinygltf::Mesh& mesh) {
  return std::ranges::none_of(mesh.primitives, [](const tinygltf::Primitive& primitive) {
    return primitive.attributes.contains("JOINTS_0");
  });
}

void addNote(Model& model, std::size_t count, const char* what, const char* rest) {
  if (count > 0) model.notes.push_back(join(counted(count, what), rest));
}

}  // namespace

void readScene(Source& source, Model& model) {
  const tinygltf::Model& content = source.content();
  for (const tinygltf::Mesh& from : content.meshes) {
    Mesh& mesh = model.meshes.emplace_back();
    mesh.name = from.name;
    mesh.morphTargetCount = morphTargetCount(from);
    for (const double weight : from.weights) {
      mesh.morphWeights.push_back(static_cast<float>(weight));
    }
  }

  const std::vector<bool> reachable = findReachable(source, model);
  PrimitiveReader reader(source);
  const std::vector<bool> jointsReachable = skinsWithin(model, reachable);
  std::size_t outside = 0, notSkinned = 0, inBindPose = 0;
  for (std::uint32_t i = 0; i < model.nodes.size(); ++i) {
    const Node& node = model.nodes[i];
    if (node.mesh == none) continue;
    if (!reachable[i]) ++outside;
    if (reachable[i] && node.skin == none) ++notSkinned;
    if (!reachable[i] || node.skin == none) continue;
    if (!jointsReachable[node.skin]) {
      source.notes().broken(NoteKind::jointOutside, "node ", i, ": its skin, ", node.skin,
                            ", has joints outside the scene");
    }
    const bool withoutJoints = hasNoJoints(content.meshes[node.mesh]);
    if (withoutJoints) {
      source.notes().broken(NoteKind::withoutJoints, "node ", i, ": it has a skin, but mesh ",
                            node.mesh, " has no joints and stays in bind pose");
    }
    readMesh(reader, content.meshes[node.mesh].primitives.size(), model, node.mesh);
    const std::vector<Primitive>& primitives = model.meshes[node.mesh].primitives;
    // A few nodes and a few primitives can make many pairs.
    source.spend(primitives.size(), 2 * sizeof(SkinnedPrimitive),
                 join("node ", i, " and the primitives of mesh ", node.mesh));
    for (std::uint32_t j = 0; j < primitives.size(); ++j) {
      if (primitives[j].vertexCount == 0) continue;
      if (primitives[j].influences.empty() && !withoutJoints) ++inBindPose;
      model.skinnedPrimitives.push_back({i, node.mesh, j, node.skin});
    }
  }
  addNote(model, outside, "node", " left out: outside the default scene");
  addNote(model, notSkinned, "node", " left out: a mesh but no skin");
  addNote(model, inBindPose, "primitive", " left in bind pose: a skinned node, but no joints");
}

}  // namespace dermis::gltf
