// What can be wrong with a mesh, found once, at import.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "dermis/export.h"
#include "dermis/mesh.h"
#include "dermis/result.h"

namespace dermis {

/// Kinds of problem. Those up to `jointOutOfRange` make `pack` refuse the mesh; the rest are dealt
/// with and counted.
enum class MeshProblem : std::uint8_t {
  // The views make no sense: `repair` cannot help.
  emptyMesh,        ///< no vertices, or no positions
  noInfluenceSets,  ///< nothing to skin by
  countMismatch,    ///< an attribute's count is not the vertex count
  strideTooSmall,   ///< an attribute's stride is less than its element
  wrongFormat,      ///< a component type or number that the attribute may not have
  morphVertices,    ///< a morph target's vertices do not rise, or lie outside the mesh
  // Values that `pack` refuses and `repair` mends.
  nonFinitePosition,
  nonFiniteNormal,
  nonFiniteTangent,
  nonFiniteMorph,   ///< a displacement of a morph target
  nonFiniteCenter,  ///< a centre of rotation
  shareOutOfRange,  ///< a dual-quaternion weight or bulge strength not from 0 to 1
  nonFiniteWeight,  ///< NaN or infinite
  negativeWeight,
  jointOutOfRange,  ///< with a weight that is not 0
  // Dealt with by `pack`.
  weightsNotNormalized,  ///< they do not sum to 1: normalised over all sets together
  duplicateJoint,        ///< the same joint twice in one vertex: the weights are added up
  vertexWithoutWeight,   ///< stays in bind pose
};

/// One kind of problem in one mesh.
struct MeshFinding {
  MeshProblem problem = MeshProblem::emptyMesh;
  std::uint64_t count = 0;  ///< Vertices that have it, or morph displacements; 1 for the views.
  std::uint32_t firstVertex = 0;  ///< The first of them.
  std::string message;  ///< A sentence with the first place: "mesh 'Fox', vertex 17: joint 31 is
                        ///< outside …".
};

struct MeshReport {
  std::vector<MeshFinding> findings;  ///< At most one a kind, in the order of `MeshProblem`.

  /// Whether `pack` takes the mesh.
  DERMIS_CORE_API bool packable() const;
  /// Whether the views make sense, so that `repair` can mend what is wrong.
  DERMIS_CORE_API bool repairable() const;
  DERMIS_CORE_API const MeshFinding* find(MeshProblem problem) const;
  /// What `pack` says: fails with `invalidMesh` unless `packable()`. The sentence is that of the
  /// first finding that is refused, and names `repair` if that can mend the mesh.
  DERMIS_CORE_API Result<void> accepted() const;
};

/// True for the kinds that make `pack` refuse the mesh.
DERMIS_CORE_API bool refusedByPack(MeshProblem problem);

/// A short name for a kind, as in reports: "joint out of range".
DERMIS_CORE_API const char* meshProblemName(MeshProblem problem);

/// Looks at every vertex: O(vertices × influences + displacements). `jointCount` is the number of
/// joints of the poses that the mesh will be skinned with, at most `maxPoseJoints`. Sums of
/// weights count as 1 within 2e-7 for each weight that is not 0 (float weights: the tolerance of
/// the official glTF validator), or when the stored integers sum to 255 or 65535 exactly.
DERMIS_CORE_API MeshReport validate(const MeshView& mesh, std::uint32_t jointCount);

/// A copy of a mesh with its bad values mended. Owns its memory; movable, not copyable.
class DERMIS_CORE_API RepairedMesh {
 public:
  RepairedMesh(RepairedMesh&&) = default;
  RepairedMesh& operator=(RepairedMesh&&) = default;
  RepairedMesh(const RepairedMesh&) = delete;
  RepairedMesh& operator=(const RepairedMesh&) = delete;

  /// The mended mesh: float32 attributes without scale or offset, one influence set of uint32
  /// joints and float32 weights. Valid as long as this object lives and is neither moved nor
  /// assigned to.
  MeshView view() const;
  /// What was found before: every finding that `refusedByPack` has been mended.
  const MeshReport& report() const { return report_; }

 private:
  RepairedMesh() = default;
  friend DERMIS_CORE_API Result<RepairedMesh> repair(const MeshView& mesh,
                                                     std::uint32_t jointCount);

  std::string name_;
  std::uint32_t vertexCount_ = 0;
  std::vector<float> positions_, normals_, tangents_, weights_;
  std::vector<std::uint32_t> joints_;
  std::vector<InfluenceSet> sets_;
  struct Morph {
    std::vector<std::uint32_t> vertices;
    std::vector<float> positions, normals, tangents;
  };
  std::vector<Morph> morphs_;
  std::vector<MorphTargetView> morphViews_;
  std::vector<float> dualQuaternionWeights_, bulgeStrengths_, centersOfRotation_;
  float dualQuaternionWeight_ = 0, bulgeStrength_ = 0;
  MeshReport report_;
};

/// Mends what `validate` finds: influences with a weight that is negative or not finite, or a joint
/// outside the pose, are dropped (weights are normalised by `pack`); a position, normal,
/// tangent, displacement or centre of rotation that is not finite becomes 0; dual-quaternion
/// weights and bulge strengths are clamped. Fails with `invalidMesh` where the views make no sense.
DERMIS_CORE_API Result<RepairedMesh> repair(const MeshView& mesh, std::uint32_t jointCount);

}  // namespace dermis
