// Applies rigs to models.
#include <algorithm>
#include <cstring>
#include <iterator>
#include <map>
#include <set>
#include <unordered_map>
#include <utility>

#include "core/attribute.h"
#include "gltf/failure.h"
#include "gltf/rig.h"
#include "strict_floating_point.h"

namespace dermis::gltf {
namespace {

struct Influence {
  std::uint32_t joint;
  float weight;
};
using VertexInfluences = std::vector<std::vector<Influence>>;
using VerticesByJoint = std::unordered_map<std::uint32_t, std::vector<std::uint32_t>>;

template <typename T>
SharedArray<std::byte> bytesOf(const std::vector<T>& values) {
  const auto bytes = std::as_bytes(std::span(values));
  return {std::vector<std::byte>(bytes.begin(), bytes.end())};
}

void appendTo(VertexInfluences& vertices, const InfluenceSet& set, std::uint32_t vertexCount) {
  for (std::uint32_t vertex = 0; vertex < vertexCount; ++vertex) {
    for (std::uint32_t slot = 0; slot < set.weights.components; ++slot) {
      const float weight = loadFloat(set.weights, vertex, slot);
      if (weight != 0) vertices[vertex].push_back({loadJoint(set.joints, vertex, slot), weight});
    }
  }
}

/// The new meshes, nodes, channels and skin, before any of them is put into the model.
class RigApplier {
 public:
  RigApplier(Model& model, std::uint32_t skin, const OwnedRig& rig, MemoryBudget& budget)
      : model_(model), skin_(skin), rig_(rig), budget_(budget) {}

  void run() {
    std::map<std::uint32_t, bool> isShared;  // by mesh of the skin: with nodes of other skins
    for (const Node& node : model_.nodes)
      if (node.mesh != noIndex && node.skin == skin_) isShared[node.mesh] = false;
    for (const Node& node : model_.nodes) {
      const auto found = node.mesh == noIndex ? isShared.end() : isShared.find(node.mesh);
      if (found != isShared.end() && node.skin != skin_) found->second = true;
    }
    std::vector<Mesh> meshes;
    std::map<std::uint32_t, Targets> given;  // by mesh that has driven targets: the others
    for (const auto& [index, shared] : isShared) {
      Targets others;
      meshes.push_back(newMesh(index, others));
      if (meshes.back().morphTargetCount != model_.meshes[index].morphTargetCount)
        given.emplace(index, std::move(others));
    }
    Skin skin = newSkin();
    model_.meshes.reserve(model_.meshes.size() + meshes.size());

    // From here on nothing fails.
    std::map<std::uint32_t, std::uint32_t> moved;
    auto next = static_cast<std::uint32_t>(model_.meshes.size());
    for (const auto& [index, shared] : isShared) moved[index] = shared ? next++ : index;
    for (Clip& clip : model_.clips) {
      for (Channel& channel : clip.channels) {
        const Node& node = model_.nodes[channel.node];
        if (channel.path != ChannelPath::weights || node.skin != skin_) continue;
        if (const auto targets = given.find(node.mesh); targets != given.end()) {
          select(channel.values, channel.components, targets->second);
          channel.components = static_cast<std::uint32_t>(targets->second.size());
        }
      }
      std::erase_if(clip.channels, [](const Channel& channel) { return channel.components == 0; });
    }
    for (Node& node : model_.nodes) {
      if (node.mesh == noIndex || node.skin != skin_) continue;
      if (const auto targets = given.find(node.mesh); targets != given.end())
        select(node.morphWeights, model_.meshes[node.mesh].morphTargetCount, targets->second);
      node.mesh = moved[node.mesh];
    }
    for (SkinnedPrimitive& skinned : model_.skinnedPrimitives)
      if (skinned.skin == skin_) skinned.mesh = moved[skinned.mesh];
    auto mesh = meshes.begin();
    for (const auto& [index, shared] : isShared) {
      if (shared) {
        model_.meshes.push_back(std::move(*mesh++));
      } else {
        model_.meshes[index] = std::move(*mesh++);
      }
    }
    model_.skins[skin_] = std::move(skin);
  }

 private:
  using Targets = std::vector<std::uint32_t>;

  /// Keeps some values of each row; the places ascend.
  static void select(std::vector<float>& rows, std::size_t columns, const Targets& places) {
    std::size_t kept = 0;
    for (std::size_t row = 0; row + columns <= rows.size(); row += columns)
      for (const std::uint32_t place : places) rows[kept++] = rows[row + place];
    rows.resize(kept);
  }

  Skin newSkin() const {
    Skin skin = model_.skins[skin_];
    std::size_t written = 0;
    for (std::size_t joint = 0; joint < rig_.places.size(); ++joint) {
      if (rig_.places[joint] >= rig_.view.writtenJoints) continue;
      skin.joints[written] = skin.joints[joint];
      skin.inverseBindMatrices[written++] = skin.inverseBindMatrices[joint];
    }
    skin.joints.resize(written);
    skin.inverseBindMatrices.resize(written);
    return skin;
  }

  /// `given` become the targets that the rig does not drive, if it drives any.
  Mesh newMesh(std::uint32_t index, Targets& given) {
    const Mesh& from = model_.meshes[index];
    for (const Primitive& primitive : from.primitives)
      spend(budget_, primitive.morphTargets.size() + 2, sizeof(Primitive), "the meshes of a rig");
    Mesh mesh = from;
    if (const auto found = rig_.targets.find(index); found != rig_.targets.end()) {
      const Targets& driven = found->second;
      spend(budget_, from.morphTargetCount + driven.size(), 96, "the morph targets of a rig");
      const std::set<std::uint32_t> known(driven.begin(), driven.end());
      for (std::uint32_t target = 0; target < from.morphTargetCount; ++target)
        if (!known.contains(target)) given.push_back(target);
      Targets order = given;
      order.insert(order.end(), driven.begin(), driven.end());
      mesh.morphTargetCount = static_cast<std::uint32_t>(given.size());
      select(mesh.morphWeights, from.morphTargetCount, given);
      if (!from.morphTargetNames.empty())
        mesh.morphTargetNames = inOrder(from.morphTargetNames, order);
      for (std::size_t i = 0; i < mesh.primitives.size(); ++i) {
        spend(budget_, order.size(), sizeof(MorphTarget), "the morph targets of a rig");
        mesh.primitives[i].morphTargets = inOrder(from.primitives[i].morphTargets, order);
      }
    }
    for (Primitive& primitive : mesh.primitives) {
      if (primitive.influences.empty()) continue;
      checkJoints(index, primitive);
      if (rig_.joints.size() != rig_.view.writtenJoints)
        for (Influences& set : primitive.influences) renumber(set);
      bind(primitive);
    }
    return mesh;
  }

  /// Joints beyond those of the skin are mostly the driven ones of a rig that was applied before.
  void checkJoints(std::uint32_t mesh, const Primitive& primitive) {
    const std::size_t count = rig_.places.size();
    const PrimitiveView view(primitive);
    for (const InfluenceSet& set : view.mesh().influenceSets) {
      if (!checked_.emplace(set.joints.data, set.weights.data).second) continue;
      for (std::uint32_t vertex = 0; vertex < primitive.vertexCount; ++vertex) {
        for (std::uint32_t slot = 0; slot < set.weights.components; ++slot) {
          const std::uint32_t joint = loadJoint(set.joints, vertex, slot);
          if (joint < count || loadFloat(set.weights, vertex, slot) == 0) continue;
          failInvalid("skin ", skin_, " has ", counted(count, "joint"), ", but vertex ", vertex,
                      " of mesh ", mesh, " follows joint ", joint,
                      ": the file is wrong, or a rig was applied to the skin before");
        }
      }
    }
  }

  /// An element that does not exist is empty.
  template <typename T>
  static std::vector<T> inOrder(const std::vector<T>& from,
                                const std::vector<std::uint32_t>& order) {
    std::vector<T> result;
    for (const std::uint32_t place : order)
      result.push_back(place < from.size() ? from[place] : T());
    return result;
  }

  void renumber(Influences& set) {
    const auto [known, isNew] = renumbered_.emplace(set.joints.data(), set.joints);
    if (isNew) {
      const std::size_t count = set.joints.size() / componentSize(set.jointType);
      spend(budget_, count, 4 * sizeof(std::uint16_t), "the joints of a rig");
      const AttributeView view{set.joints.data(), static_cast<std::uint32_t>(count),
                               componentSize(set.jointType), set.jointType, 1};
      std::vector<std::uint16_t> joints(count);
      for (std::uint32_t i = 0; i < count; ++i) {
        const std::uint32_t joint = loadJoint(view, i, 0);
        const std::uint32_t place = joint < rig_.places.size() ? rig_.places[joint] : 0xffff;
        joints[i] = static_cast<std::uint16_t>(place);
      }
      kept_.push_back(set.joints);  // so that no other array gets its address
      known->second = bytesOf(joints);
    }
    set.joints = known->second;
    set.jointType = ComponentType::uint16;
  }

  /// Binds the vertices to all chains.
  void bind(Primitive& primitive) {
    if (rig_.chains.empty() || primitive.vertexCount == 0) return;
    std::vector<const void*> key{primitive.positions.data()};
    for (const Influences& set : primitive.influences)
      key.insert(key.end(), {set.joints.data(), set.weights.data()});
    const auto [known, isNew] = bound_.emplace(key, std::vector<Influences>());
    if (isNew) known->second = boundInfluences(primitive);
    primitive.influences = known->second;
  }

  std::vector<Influences> boundInfluences(const Primitive& primitive) {
    const std::uint32_t count = primitive.vertexCount;
    const std::uint32_t slots = primitive.influencesPerVertex();
    spend(budget_, count, 64 + 32 * std::uint64_t{slots}, "the vertices of a chain");
    VertexInfluences vertices(count);
    const PrimitiveView view(primitive);
    for (const InfluenceSet& set : view.mesh().influenceSets) appendTo(vertices, set, count);
    VerticesByJoint ofJoints;
    for (std::uint32_t vertex = 0; vertex < count; ++vertex) {
      for (const Influence& influence : vertices[vertex]) {
        std::vector<std::uint32_t>& list = ofJoints[influence.joint];
        if (list.empty() || list.back() != vertex) list.push_back(vertex);
      }
    }
    bool isBound = false;
    for (const ChainDriver& chain : rig_.chains)
      isBound = bindTo(chain, primitive, vertices, ofJoints) || isBound;
    if (!isBound) return primitive.influences;

    std::size_t most = 1;
    for (const std::vector<Influence>& vertex : vertices) most = std::max(most, vertex.size());
    const std::size_t sets = (most + 3) / 4;
    spend(budget_, sets * count, 4 * (sizeof(std::uint16_t) + sizeof(float)) * 2,
          "the vertices of a chain");
    std::vector<Influences> result;
    for (std::size_t set = 0; set < sets; ++set) {
      std::vector<std::uint16_t> joints(std::size_t{count} * 4);
      std::vector<float> weights(std::size_t{count} * 4);
      for (std::size_t vertex = 0; vertex < count; ++vertex) {
        const std::vector<Influence>& from = vertices[vertex];
        for (std::size_t i = 0; i < 4 && set * 4 + i < from.size(); ++i) {
          joints[vertex * 4 + i] = static_cast<std::uint16_t>(from[set * 4 + i].joint);
          weights[vertex * 4 + i] = from[set * 4 + i].weight;
        }
      }
      result.push_back(
          {ComponentType::uint16, ComponentType::float32, bytesOf(joints), bytesOf(weights)});
    }
    return result;
  }

  /// Binds the vertices that joints of the chain move. Returns whether there are any.
  bool bindTo(const ChainDriver& chain, const Primitive& primitive, VertexInfluences& vertices,
              VerticesByJoint& ofJoints) {
    // Looking joints up takes more time than memory.
    spend(budget_, chain.joints.size(), 16, "the vertices of a chain");
    std::vector<std::uint32_t> moved;
    std::size_t most = 0;
    for (const std::uint32_t joint : chain.joints) {
      const auto found = ofJoints.find(joint);
      if (found == ofJoints.end()) continue;
      for (const std::uint32_t vertex : found->second) {
        // Binding to another chain may have removed a bad influence.
        const std::vector<Influence>& from = vertices[vertex];
        if (std::ranges::find(from, joint, &Influence::joint) == from.end()) continue;
        moved.push_back(vertex);
        most = std::max(most, from.size());
      }
      ofJoints.erase(found);
    }
    std::ranges::sort(moved);
    moved.erase(std::unique(moved.begin(), moved.end()), moved.end());
    if (moved.empty()) return false;
    const auto count = static_cast<std::uint32_t>(moved.size());
    const auto slots = static_cast<std::uint32_t>(most);
    // Each vertex is compared with places on all pieces of the curve, and each of its influences
    // with all joints, which takes time.
    const std::uint64_t comparisons = chain.joints.size() * std::uint64_t{slots};
    spend(budget_, count,
          48 + 24 * std::uint64_t{slots + 2} + 8 * chain.joints.size() + comparisons / 4,
          "the vertices of a chain");
    std::vector<float> positions, weights;
    std::vector<std::uint32_t> ofSlots;
    for (const std::uint32_t vertex : moved) {
      for (std::size_t i = 0; i < 3; ++i)
        positions.push_back(primitive.positions[std::size_t{vertex} * 3 + i]);
      std::vector<Influence>& from = vertices[vertex];
      from.resize(slots, {0, 0});
      for (const Influence& influence : from) {
        ofSlots.push_back(influence.joint);
        weights.push_back(influence.weight);
      }
      from.clear();
    }
    MeshView mesh;
    mesh.name = primitive.name;
    mesh.vertexCount = count;
    mesh.positions = attributeView(positions.data(), count, 3);
    const InfluenceSet set{{ofSlots.data(), count, slots * 4, ComponentType::uint32, slots},
                           attributeView(weights.data(), count, slots)};
    mesh.influenceSets = {&set, 1};
    const Result<RepairedMesh> bent = bendChain(mesh, rig_.joints, chain);
    if (!bent) throw Failure{bent.error()};
    VertexInfluences bound(count);
    appendTo(bound, bent->view().influenceSets.front(), count);
    for (std::size_t i = 0; i < moved.size(); ++i) {
      for (const Influence& influence : bound[i])
        if (influence.joint == chain.joints.front() || influence.joint == chain.joints.back())
          ofJoints[influence.joint].push_back(moved[i]);
      vertices[moved[i]] = std::move(bound[i]);
    }
    return true;
  }

  Model& model_;
  std::uint32_t skin_;
  const OwnedRig& rig_;
  MemoryBudget& budget_;
  std::set<std::pair<const void*, const void*>> checked_;     ///< arrays of joints and weights
  std::map<const void*, SharedArray<std::byte>> renumbered_;  ///< by array of joints
  std::vector<SharedArray<std::byte>> kept_;
  std::map<std::vector<const void*>, std::vector<Influences>> bound_;
};

}  // namespace

Result<std::shared_ptr<const RigView>> applyRig(Model& model, std::uint32_t skin,
                                                std::string_view text) {
  if (skin >= model.skins.size() || model.skins[skin].joints.empty())
    return Error{ErrorCode::invalidArgument, join("applyRig: there is no skin ", skin)};
  return guarded<std::shared_ptr<const RigView>>([&] {
    MemoryBudget budget(model.memoryLeft);
    budget.addFile(text.size());
    const auto rig = std::make_shared<OwnedRig>();
    readRig(model, skin, text, budget, *rig);
    RigApplier(model, skin, *rig, budget).run();
    std::ranges::move(rig->notes, std::back_inserter(model.notes));
    model.memoryLeft = budget.left();
    return std::shared_ptr<const RigView>(rig, &rig->view);
  });
}

}  // namespace dermis::gltf
