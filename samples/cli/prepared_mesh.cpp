#include "prepared_mesh.h"

#include <algorithm>
#include <cstring>
#include <span>
#include <utility>

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

}  // namespace dermis::cli
