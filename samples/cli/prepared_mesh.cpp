#include "prepared_mesh.h"

#include <fmt/format.h>

#include <algorithm>
#include <cstddef>
#include <cstring>
#include <span>
#include <utility>

#include "dermis/centers_of_rotation.h"
#include "dermis/text.h"
#include "dermis/validate.h"
#include "kit/program.h"
#include "kit/solve_centers.h"

namespace dermis::cli {
namespace {

/// In the packed mesh and in the repaired one: positions, normals, tangents, centers.
constexpr std::uint64_t bytesPerVertex = 2 * 4 * 16;
/// Weight and joint: packed, repaired, and temporarily during the conversion.
constexpr std::uint64_t bytesPerInfluence = 3 * 8;
/// Packed, and as views of the repaired mesh.
constexpr std::uint64_t bytesPerTarget = sizeof(MorphTargetView) + 48;

template <typename Joint>
std::uint32_t largestOf(std::span<const std::byte> joints) {
  Joint largest = 0;
  for (std::size_t at = 0; at + sizeof(Joint) <= joints.size(); at += sizeof(Joint)) {
    Joint joint;
    std::memcpy(&joint, joints.data() + at, sizeof(Joint));
    largest = std::max(largest, joint);
  }
  return largest;
}

}  // namespace

std::uint32_t namedJoints(const gltf::Mesh& mesh) {
  std::uint32_t named = 1;
  for (const gltf::Primitive& primitive : mesh.primitives) {
    for (const gltf::Influences& set : primitive.influences) {
      named = std::max(named, 1 + (set.jointType == ComponentType::uint8
                                       ? largestOf<std::uint8_t>(set.joints)
                                       : largestOf<std::uint16_t>(set.joints)));
    }
  }
  return named;
}

bool PreparedMesh::spend(const gltf::Primitive& primitive, gltf::MemoryBudget& budget) {
  const std::uint64_t influences =
      std::uint64_t{primitive.vertexCount} * primitive.influencesPerVertex();
  std::uint64_t displacements = 0;
  for (const gltf::MorphTarget& target : primitive.morphTargets)
    displacements += target.positions.size() + target.normals.size() + target.tangents.size();
  return budget.spend(primitive.vertexCount, bytesPerVertex) &&
         budget.spend(influences, bytesPerInfluence) &&
         budget.spend(primitive.morphTargets.size(), bytesPerTarget) &&
         budget.spend(displacements, 3 * sizeof(float));
}

MeshView PreparedMesh::view() const {
  MeshView mesh = repaired_ ? repaired_->view() : original_;
  if (!centersOfRotation_.empty())
    mesh.centersOfRotation = floatAttribute(centersOfRotation_.data(), mesh.vertexCount, 3);
  return mesh;
}

Result<std::shared_ptr<const PreparedMesh>> PreparedMesh::prepare(
    const gltf::Primitive& primitive, std::uint32_t jointCount, const MeshPreparation& preparation,
    const CentersOfPrimitive& centers) {
  const std::shared_ptr<PreparedMesh> mesh(new PreparedMesh);
  mesh->original_ = mesh->primitive_.emplace(primitive).mesh();
  mesh->original_.dualQuaternionWeight = preparation.dualQuaternionWeight;
  mesh->original_.bulgeStrength = preparation.bulgeStrength;
  mesh->report_ = validate(mesh->original_, jointCount);
  if (!mesh->report_.packable()) {
    if (preparation.strict)
      return Error{ErrorCode::invalidMesh, mesh->report_.findings.front().message};
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

struct JointWeight {
  float weight;
  std::uint32_t joint;
};

/// Concatenates primitives, with as many slots per vertex as the vertex with the most influences
/// needs.
class JoinedMesh {
 public:
  /// `mesh` must be repaired, and so tightly packed.
  void add(const MeshView& mesh, std::span<const std::uint32_t> indices) {
    const auto first = static_cast<std::uint32_t>(positions_.size() / 3);
    const auto* position = static_cast<const float*>(mesh.positions.data);
    positions_.insert(positions_.end(), position, position + std::size_t{mesh.vertexCount} * 3);
    for (const std::uint32_t index : indices) triangles_.push_back(first + index);

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
    set_.joints = {joints_.data(), vertexCount, slots_ * 4, ComponentType::uint32, slots_};
    set_.weights = floatAttribute(weights_.data(), vertexCount, slots_);
    MeshView mesh;
    mesh.name = name;
    mesh.vertexCount = vertexCount;
    mesh.positions = floatAttribute(positions_.data(), vertexCount, 3);
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
                           inQuotes(mesh.name), what)};
}

}  // namespace

Result<MeshCenters::Centers> MeshCenters::find(const gltf::Mesh& mesh, std::uint32_t jointCount) {
  JoinedMesh joined;
  for (const gltf::Primitive& primitive : mesh.primitives) {
    if (primitive.influences.empty()) continue;
    const gltf::PrimitiveView view(primitive);
    const Result<RepairedMesh> repaired = repair(view.mesh(), jointCount);
    if (!repaired) return repaired.error();
    joined.add(repaired->view(), primitive.triangles);
  }
  if (!budget_.spend(joined.pairCount(), bytesPerPair))
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
  const float* next = all.data();
  for (std::size_t index = 0; index < centers.size(); ++index) {
    const gltf::Primitive& primitive = mesh.primitives[index];
    if (primitive.influences.empty()) continue;
    const float* end = next + std::size_t{primitive.vertexCount} * 3;
    centers[index].assign(next, end);
    next = end;
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
