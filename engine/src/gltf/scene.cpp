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
    if (parent != noIndex && reachable[parent]) reachable[node] = true;
  }
  return reachable;
}

// The nodes of a scene. If the scene lists a node that is not a root, the node's parents must be in
// the scene too: otherwise it is not clear whether their transforms apply.
std::vector<bool> nodesOfScene(const Source& source, const Model& model, std::size_t scene) {
  std::vector<std::uint32_t> roots, others;
  for (const int node : source.content().scenes[scene].nodes)
    (model.nodes[indexOf(node)].parent == noIndex ? roots : others).push_back(indexOf(node));
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

// Reads the meshes that hang on a skeleton.
class RigidMeshes {
 public:
  RigidMeshes(Source& source, const std::vector<bool>& faultyMeshes, PrimitiveReader& reader,
              Model& model)
      : source_(source), reader_(reader), model_(model), mayRead_(model.meshes.size()) {
    std::vector<bool> isDrawn(model.skins.size());
    for (const SkinnedPrimitive& skinned : model.skinnedPrimitives) isDrawn[skinned.skin] = true;
    std::vector<std::uint32_t> joints;
    for (std::size_t i = 0; i < model.skins.size(); ++i)
      if (isDrawn[i])
        joints.insert(joints.end(), model.skins[i].joints.begin(), model.skins[i].joints.end());
    isCarried_ = nodesBelow(model, joints);
    for (std::size_t i = 0; i < mayRead_.size(); ++i)
      mayRead_[i] = !faultyMeshes[i] && model.meshes[i].primitives.empty();
  }

  // Makes a skin of a node whose mesh has none. Returns whether the mesh can be drawn.
  bool add(std::uint32_t index) {
    const Node& node = model_.nodes[index];
    if (!isCarried_[index] || !mayRead_[node.mesh] || !read(node.mesh)) return false;
    const std::vector<Primitive>& primitives = model_.meshes[node.mesh].primitives;
    const std::string where = join("node ", index, " and its rigid mesh");
    source_.spend(1, 2 * sizeof(Skin) + sizeof(JointMatrix) + node.name.size(), where);
    source_.spend(primitives.size(), 2 * sizeof(SkinnedPrimitive), where);
    const auto skin = static_cast<std::uint32_t>(model_.skins.size());
    model_.skins.push_back({node.name, {index}, {JointMatrix{}}});
    for (std::uint32_t i = 0; i < primitives.size(); ++i) {
      if (primitives[i].vertexCount > 0)
        model_.skinnedPrimitives.push_back({index, node.mesh, i, skin});
    }
    return true;
  }

 private:
  bool read(std::uint32_t index) {
    Mesh& mesh = model_.meshes[index];
    if (!mesh.primitives.empty()) return true;
    mayRead_[index] = source_.notes().tolerate(NoteKind::rigid, "; it is left out", [&] {
      readMesh(reader_, source_.content().meshes[index].primitives.size(), model_, index);
    });
    if (!mayRead_[index]) mesh.primitives.clear();
    for (Primitive& primitive : mesh.primitives)
      primitive.influences = {reader_.rigidInfluences(primitive.vertexCount)};
    return !mesh.primitives.empty();
  }

  Source& source_;
  PrimitiveReader& reader_;
  Model& model_;
  std::vector<bool> isCarried_;  ///< by node
  std::vector<bool> mayRead_;    ///< by mesh
};

/// Adds zeros for the morph targets without a weight.
void fillUp(Source& source, const char* kind, std::size_t number, std::uint32_t targets,
            std::vector<float>& weights) {
  if (weights.size() >= targets) return;
  source.spend(targets - weights.size(), sizeof(float), join(kind, " ", number, ": weights"));
  weights.resize(targets);
}

void addNote(Model& model, std::size_t count, const char* what, const char* rest) {
  if (count > 0) model.notes.push_back(join(counted(count, what), rest));
}

}  // namespace

void readScene(Source& source, const std::vector<bool>& faultyMeshes, const LoadOptions& options,
               Model& model) {
  const tinygltf::Model& content = source.content();
  for (const tinygltf::Mesh& from : content.meshes) {
    Mesh& mesh = model.meshes.emplace_back();
    mesh.name = from.name;
    mesh.morphTargetNames = source.takeTargetNames(model.meshes.size() - 1);
    mesh.morphTargetCount = morphTargetCount(from);
    for (const double weight : from.weights) {
      mesh.morphWeights.push_back(static_cast<float>(weight));
    }
    fillUp(source, "mesh", model.meshes.size() - 1, mesh.morphTargetCount, mesh.morphWeights);
  }
  for (std::size_t i = 0; i < model.nodes.size(); ++i) {
    Node& node = model.nodes[i];
    if (node.mesh != noIndex && !node.morphWeights.empty())
      fillUp(source, "node", i, model.meshes[node.mesh].morphTargetCount, node.morphWeights);
  }

  const std::vector<bool> reachable = findReachable(source, model);
  PrimitiveReader reader(source, options.missingNormals);
  const std::vector<bool> jointsReachable = skinsWithin(model, reachable);
  std::size_t outside = 0, inBindPose = 0;
  std::vector<std::uint32_t> notSkinned;
  for (std::uint32_t i = 0; i < model.nodes.size(); ++i) {
    const Node& node = model.nodes[i];
    if (node.mesh == noIndex) continue;
    if (!reachable[i]) ++outside;
    if (reachable[i] && node.skin == noIndex) notSkinned.push_back(i);
    if (!reachable[i] || node.skin == noIndex) continue;
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
  if (options.rigidMeshes) {
    RigidMeshes rigid(source, faultyMeshes, reader, model);
    std::erase_if(notSkinned, [&](std::uint32_t node) { return rigid.add(node); });
  }
  addNote(model, outside, "node", " left out: outside the default scene");
  addNote(model, notSkinned.size(), "node", " left out: a mesh but no skin");
  addNote(model, inBindPose, "primitive", " left in bind pose: a skinned node, but no joints");
}

}  // namespace dermis::gltf
