#include "prepared_mesh.h"

#include <fmt/format.h>

#include <algorithm>
#include <cstddef>
#include <cstring>
#include <map>
#include <span>
#include <utility>

#include "dermis/mesh.h"
#include "kit/memory_left.h"
#include "kit/program.h"
#include "kit/solve_centers.h"
#include "kit/text.h"

namespace dermis::cli {
namespace {

/// Spends the memory of a packed mesh, which a repaired one does not exceed.
bool spendOnMesh(const gltf::Primitive& primitive, std::uint64_t& memoryLeft) {
  constexpr std::uint64_t bytesPerVertex = 4 * 16;  // positions, normals, tangents, centers
  constexpr std::uint64_t bytesPerInfluence = 8;    // a weight and a joint
  const std::uint64_t vertices = primitive.vertexCount;
  // A packed target also takes up to 16 bytes for each 64 vertices.
  const std::uint64_t bytesPerTarget = sizeof(MorphTargetView) + 48 + vertices / 4;
  std::uint64_t displacements = 0;
  for (const gltf::MorphTarget& target : primitive.morphTargets)
    displacements += target.vertices.size() + target.positions.size() + target.normals.size() +
                     target.tangents.size();
  return samples::spend(memoryLeft, vertices, bytesPerVertex) &&
         samples::spend(memoryLeft, vertices * primitive.influencesPerVertex(),
                        bytesPerInfluence) &&
         samples::spend(memoryLeft, primitive.morphTargets.size(), bytesPerTarget) &&
         samples::spend(memoryLeft, displacements, sizeof(float));
}

Error tooLarge(const gltf::Primitive& primitive, std::uint32_t jointCount) {
  return Error{ErrorCode::limitExceeded,
               fmt::format("mesh '{}' for {} joints: it needs more memory than the limit for a "
                           "file of this size",
                           primitive.name, jointCount)};
}

template <typename Joint>
std::uint32_t largestOf(const gltf::SharedArray<std::byte>& joints) {
  Joint largest = 0;
  for (std::size_t at = 0; at + sizeof(Joint) <= joints.size(); at += sizeof(Joint)) {
    Joint joint;
    std::memcpy(&joint, joints.data() + at, sizeof(Joint));
    largest = std::max(largest, joint);
  }
  return largest;
}

}  // namespace

VertexKey vertexKey(const gltf::Primitive& primitive) {
  VertexKey key{primitive.positions.data(), primitive.normals.data(), primitive.tangents.data()};
  for (const gltf::Influences& set : primitive.influences)
    key.insert(key.end(), {set.joints.data(), set.weights.data()});
  for (const gltf::MorphTarget& target : primitive.morphTargets)
    key.insert(key.end(), {target.vertices.data(), target.positions.data(), target.normals.data(),
                           target.tangents.data()});
  return key;
}

std::uint32_t NamedJoints::of(const gltf::Mesh& mesh) {
  std::uint32_t named = 1;
  for (const gltf::Primitive& primitive : mesh.primitives) {
    for (const gltf::Influences& set : primitive.influences) {
      const auto [largest, isNew] = largest_.emplace(set.joints.data(), 0);
      if (isNew) {
        largest->second = set.jointType == ComponentType::uint8
                              ? largestOf<std::uint8_t>(set.joints)
                              : largestOf<std::uint16_t>(set.joints);
      }
      named = std::max(named, 1 + largest->second);
    }
  }
  return named;
}

MeshView PreparedMesh::view() const {
  MeshView mesh = repaired_ ? repaired_->view() : original_;
  if (!centersOfRotation_.empty())
    mesh.centersOfRotation = attributeView(centersOfRotation_.data(), mesh.vertexCount, 3);
  return mesh;
}

Result<std::shared_ptr<const PreparedMesh>> PreparedMesh::prepare(
    const gltf::Primitive& primitive, std::uint32_t jointCount, const MeshPreparation& preparation,
    std::uint64_t& memoryLeft, const CentersOfPrimitive& centers) {
  // The packed mesh grows, so that up to half of it may be unused.
  if (!spendOnMesh(primitive, memoryLeft) || !spendOnMesh(primitive, memoryLeft))
    return tooLarge(primitive, jointCount);
  const std::shared_ptr<PreparedMesh> mesh(new PreparedMesh);
  mesh->original_ = mesh->primitive_.emplace(primitive).mesh();
  mesh->original_.dualQuaternionWeight = preparation.dualQuaternionWeight;
  mesh->original_.bulgeStrength = preparation.bulgeStrength;
  mesh->report_ = validate(mesh->original_, jointCount);
  if (preparation.strict && !mesh->report_.findings.empty())
    return Error{ErrorCode::invalidMesh, mesh->report_.findings.front().message};
  if (!mesh->report_.packable()) {
    if (!spendOnMesh(primitive, memoryLeft)) return tooLarge(primitive, jointCount);
    Result<RepairedMesh> repaired = repair(mesh->original_, jointCount);
    if (!repaired) return repaired.error();
    mesh->repaired_.emplace(std::move(*repaired));
  }
  Result<std::vector<float>> centersOfRotation = centers();
  if (!centersOfRotation) return centersOfRotation.error();
  mesh->centersOfRotation_ = std::move(*centersOfRotation);
  Result<PackedMesh> packed = pack(mesh->view(), jointCount);
  if (!packed) return packed.error();
  mesh->packed_.emplace(std::move(*packed));
  return std::shared_ptr<const PreparedMesh>(mesh);
}

namespace {

/// Maximum influences per vertex; weaker ones are ignored for centers. Otherwise one vertex with
/// many influences would give every vertex that many slots.
constexpr std::uint32_t mostSlots = 32;

/// 20 bytes in the solver, and temporarily the same again.
constexpr std::uint64_t bytesPerPair = 40;
/// Of a vertex and its center, joined and repaired.
constexpr std::uint64_t bytesPerJoinedVertex = 80;
/// Joined, copied for the solver, and repaired.
constexpr std::uint64_t bytesPerJoinedInfluence = 24;

struct JointWeight {
  float weight;
  std::uint32_t joint;
};

/// Concatenates primitives, with as many slots per vertex as the vertex with the most influences
/// needs.
class JoinedMesh {
 public:
  std::uint32_t vertexCount() const { return static_cast<std::uint32_t>(ends_.size()); }

  /// Adds triangles between vertices from `first` on.
  void addTriangles(std::uint32_t first, std::span<const std::uint32_t> indices) {
    for (const std::uint32_t index : indices) triangles_.push_back(first + index);
  }

  /// `mesh` must be repaired, and so tightly packed.
  void addVertices(const MeshView& mesh) {
    const auto* position = static_cast<const float*>(mesh.positions.data);
    positions_.insert(positions_.end(), position, position + std::size_t{mesh.vertexCount} * 3);
    const InfluenceSet& set = mesh.influenceSets.front();
    const auto* joint = static_cast<const std::uint32_t*>(set.joints.data);
    const auto* weight = static_cast<const float*>(set.weights.data);
    std::vector<JointWeight> used;
    for (std::uint32_t vertex = 0; vertex < mesh.vertexCount; ++vertex) {
      used.clear();
      for (std::uint32_t slot = 0; slot < set.joints.components; ++slot, ++joint, ++weight) {
        if (*weight > 0) used.push_back({*weight, *joint});
      }
      std::ranges::sort(used, [](const JointWeight& a, const JointWeight& b) {
        return a.weight != b.weight ? a.weight > b.weight : a.joint < b.joint;
      });
      used.resize(std::min<std::size_t>(used.size(), mostSlots));
      slots_ = std::max(slots_, static_cast<std::uint32_t>(used.size()));
      influences_.insert(influences_.end(), used.begin(), used.end());
      ends_.push_back(influences_.size());
    }
  }

  std::span<const std::uint32_t> triangles() const { return triangles_; }

  /// The number of pairs of joints of all triangles, which the solver stores.
  std::uint64_t pairCount() const {
    std::uint64_t pairs = 0;
    std::vector<std::uint32_t> joints;
    for (std::size_t corner = 0; corner < triangles_.size(); ++corner) {
      const std::uint32_t vertex = triangles_[corner];
      const std::size_t end = ends_[vertex];
      for (std::size_t i = vertex == 0 ? 0 : ends_[vertex - 1]; i < end; ++i)
        joints.push_back(influences_[i].joint);
      if (corner % 3 != 2) continue;
      std::ranges::sort(joints);
      const auto count =
          static_cast<std::uint64_t>(std::unique(joints.begin(), joints.end()) - joints.begin());
      if (count > 1) pairs += count * (count - 1) / 2;
      joints.clear();
    }
    return pairs;
  }

  /// Valid while this object lives and no mesh is added.
  MeshView view(const std::string& name) {
    const auto vertexCount = static_cast<std::uint32_t>(ends_.size());
    joints_.assign(std::size_t{vertexCount} * slots_, 0);
    weights_.assign(joints_.size(), 0);
    std::size_t influence = 0;
    for (std::uint32_t vertex = 0; vertex < vertexCount; ++vertex) {
      for (std::size_t slot = std::size_t{vertex} * slots_; influence < ends_[vertex]; ++slot) {
        joints_[slot] = influences_[influence].joint;
        weights_[slot] = influences_[influence++].weight;
      }
    }
    set_.joints = attributeView(joints_.data(), vertexCount, slots_);
    set_.weights = attributeView(weights_.data(), vertexCount, slots_);
    MeshView mesh;
    mesh.name = name;
    mesh.vertexCount = vertexCount;
    mesh.positions = attributeView(positions_.data(), vertexCount, 3);
    mesh.influenceSets = {&set_, 1};
    return mesh;
  }

 private:
  std::uint32_t slots_ = 1;
  std::vector<float> positions_, weights_;
  std::vector<std::uint32_t> joints_, triangles_;
  std::vector<JointWeight> influences_;
  std::vector<std::size_t> ends_;  ///< of the influences of each vertex
  InfluenceSet set_;
};

std::vector<float> solve(const CenterOfRotationSolver& solver) {
  constexpr std::uint32_t steps = 100;
  samples::Progress bar("centers of rotation", steps);
  std::uint32_t shown = 0;
  return samples::solveCenters(solver, 0, [&](float fraction) {
    for (; shown < static_cast<std::uint32_t>(fraction * steps); ++shown) bar.step();
  });
}

Error tooMuch(const gltf::Mesh& mesh, const std::string& what) {
  return Error{ErrorCode::limitExceeded,
               fmt::format("mesh {}: its centers of rotation {}; they were not computed, so "
                           "center_of_rotation and bulge_controlled are not available",
                           samples::inQuotes(mesh.name), what)};
}

}  // namespace

Result<MeshCenters::Centers> MeshCenters::find(const gltf::Mesh& mesh, std::uint32_t jointCount) {
  JoinedMesh joined;
  std::map<VertexKey, std::uint32_t> firsts;  // the first joined vertex of vertices that are shared
  std::vector<std::uint32_t> firstOf(mesh.primitives.size());
  for (std::size_t index = 0; index < firstOf.size(); ++index) {
    const gltf::Primitive& primitive = mesh.primitives[index];
    if (primitive.influences.empty()) continue;
    const auto [first, isNew] = firsts.emplace(vertexKey(primitive), joined.vertexCount());
    firstOf[index] = first->second;
    if (isNew) {
      const std::uint64_t vertices = primitive.vertexCount;
      if (!samples::spend(memoryLeft_, vertices, bytesPerJoinedVertex) ||
          !samples::spend(memoryLeft_, vertices * primitive.influencesPerVertex(),
                          bytesPerJoinedInfluence))
        return tooMuch(mesh, "need too much memory");
      const gltf::PrimitiveView view(primitive);
      const Result<RepairedMesh> repaired = repair(view.mesh(), jointCount);
      if (!repaired) return repaired.error();
      joined.addVertices(repaired->view());
    }
    if (!samples::spend(memoryLeft_, primitive.triangles.size(), sizeof(std::uint32_t)) ||
        !samples::spend(memoryLeft_, primitive.vertexCount, 3 * sizeof(float)))
      return tooMuch(mesh, "need too much memory");
    joined.addTriangles(firstOf[index], primitive.triangles.values());
  }
  if (!samples::spend(memoryLeft_, joined.pairCount(), bytesPerPair))
    return tooMuch(mesh, "need too much memory");
  const MeshView view = joined.view(mesh.name);
  const Result<CenterOfRotationSolver> solver =
      CenterOfRotationSolver::make(view, jointCount, joined.triangles());
  if (!solver) return solver.error();
  const std::uint64_t terms = solver->termCount();
  if (terms > termsLeft_)
    return tooMuch(
        mesh, fmt::format("need {} terms, but {} remain of the file's limit", terms, termsLeft_));
  termsLeft_ -= terms;
  const std::vector<float> all = solve(*solver);

  Centers centers(mesh.primitives.size());
  for (std::size_t index = 0; index < centers.size(); ++index) {
    const gltf::Primitive& primitive = mesh.primitives[index];
    if (primitive.influences.empty()) continue;
    const float* first = all.data() + std::size_t{firstOf[index]} * 3;
    centers[index].assign(first, first + std::size_t{primitive.vertexCount} * 3);
  }
  return centers;
}

Result<std::vector<float>> MeshCenters::of(const gltf::Model& model,
                                           const gltf::SkinnedPrimitive& source,
                                           std::uint32_t jointCount) {
  const std::pair key(source.mesh, jointCount);
  auto known = found_.find(key);
  if (known == found_.end())
    known = found_.emplace(key, find(model.meshes[source.mesh], jointCount)).first;
  const Result<Centers>& centers = known->second;
  if (!centers) return centers.error();
  return (*centers)[source.primitive];
}

}  // namespace dermis::cli
