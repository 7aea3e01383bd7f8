// Finds what is wrong with a mesh, and repairs it. Both are done once, at import.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "dermis/export.h"
#include "dermis/mesh.h"
#include "dermis/result.h"

namespace dermis {

/// Kinds of problems. `pack` refuses a mesh with any problem up to `jointOutOfRange`, and accepts
/// the others.
enum class MeshProblem : std::uint8_t {
  // The views are not valid. `repair` cannot help.
  emptyMesh = 0,        ///< no vertices, or no positions
  noInfluenceSets = 1,  ///< no influences, or a set without joints or weights
  countMismatch = 2,    ///< the count of an attribute is not what `AttributeView::count` must be
  strideTooSmall = 3,   ///< the stride of an attribute is less than the size of an element
  wrongFormat = 4,      ///< an attribute has a component type or count that is not allowed
  morphVertices = 5,    ///< vertices of a morph target are not ascending, or are outside the mesh
  // Values that `pack` refuses and `repair` fixes.
  nonFinitePosition = 6,
  nonFiniteNormal = 7,
  nonFiniteTangent = 8,
  nonFiniteMorph = 9,    ///< a displacement of a morph target
  nonFiniteCenter = 10,  ///< a center of rotation
  /// A dual-quaternion weight or bulge strength that is not from 0 to 1.
  methodWeightOutOfRange = 11,
  nonFiniteWeight = 12,  ///< NaN or infinite
  negativeWeight = 13,
  /// A joint that the pose does not have, or a float that is not a whole number, with a weight that
  /// is not 0.
  jointOutOfRange = 14,
  // Values that `pack` fixes or ignores, and lengths that do not matter to skinning.
  weightsNotNormalized = 15,  ///< the weights of a vertex do not sum to 1: they are normalized
  duplicateJoint = 16,        ///< a joint occurs twice in a vertex: its weights are added
  vertexWithoutWeight = 17,   ///< all weights are 0: the vertex stays in bind pose
  /// As `jointOutOfRange`, but with weight 0: the joint is ignored.
  unusedJointOutOfRange = 18,
  normalLength = 19,   ///< a normal is not of unit length
  tangentLength = 20,  ///< a tangent is not of unit length
  tangentSign = 21,    ///< the handedness of a tangent is neither 1 nor -1
};

/// One kind of problem in one mesh.
struct MeshFinding {
  MeshProblem problem = MeshProblem::emptyMesh;
  std::uint64_t count = 0;  ///< number of vertices, morph displacements or views that have it
  /// The first such vertex. 0 if the problem is one of a view or of the whole mesh.
  std::uint32_t firstVertex = 0;
  /// A sentence about the first place, for example "mesh 'Fox', vertex 17: joint 31 is outside the
  /// pose of 24 joints".
  std::string message;
};

/// All problems of one mesh.
struct MeshReport {
  std::vector<MeshFinding> findings;  ///< at most one for each kind, in the order of `MeshProblem`

  /// Whether `pack` accepts the mesh.
  DERMIS_CORE_API bool packable() const;
  /// Whether all views are valid, so that `repair` can fix the mesh.
  DERMIS_CORE_API bool repairable() const;
  /// The finding of this kind; null if there is none.
  DERMIS_CORE_API const MeshFinding* find(MeshProblem problem) const;
  /// Fails with `invalidMesh`, as `pack` does, unless the mesh is `packable`. The message is that
  /// of the first finding that is `refusedByPack`. It mentions `repair` if the mesh is
  /// `repairable`.
  DERMIS_CORE_API Result<void> accepted() const;
};

/// Whether `pack` refuses a mesh with this problem.
DERMIS_CORE_API bool refusedByPack(MeshProblem problem);

/// A short name of the problem, for reports: "joint out of range".
DERMIS_CORE_API const char* meshProblemName(MeshProblem problem);

/// Finds all problems of a mesh. O(vertices × influences + displacements). `jointCount` is the
/// number of joints of the skeleton; numbers above `maxPoseJoints` count as that. If there are
/// float weights, a sum counts as 1 within 2e-7 for each weight other than 0. Integer weights must
/// sum to exactly 1. A direction is of unit length within 0.00674. Both are the tolerances of the
/// official glTF validator.
DERMIS_CORE_API MeshReport validate(const MeshView& mesh, std::uint32_t jointCount);

/// A repaired copy of a mesh. Owns its memory. Movable, not copyable.
class DERMIS_CORE_API RepairedMesh {
 public:
  RepairedMesh(RepairedMesh&&) = default;
  RepairedMesh& operator=(RepairedMesh&&) = default;
  RepairedMesh(const RepairedMesh&) = delete;
  RepairedMesh& operator=(const RepairedMesh&) = delete;

  /// The repaired mesh: float32 attributes without scale or offset, and one influence set of uint32
  /// joints and float32 weights. The view is valid until this object is destroyed, moved or
  /// assigned to.
  MeshView view() const;
  /// What `validate` found before the repair. Problems that are `refusedByPack` are fixed now.
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

/// Fixes the problems that `validate` finds and `pack` refuses:
/// - An influence is dropped if its weight is negative or not finite, or if the pose does not have
///   its joint. `pack` normalizes the remaining weights.
/// - A position, normal, tangent, displacement or center of rotation that is not finite becomes 0.
/// - Dual-quaternion weights and bulge strengths are clamped to the range from 0 to 1.
///
/// Fails with `invalidMesh` if the views are not valid (`MeshReport::repairable`).
DERMIS_CORE_API Result<RepairedMesh> repair(const MeshView& mesh, std::uint32_t jointCount);

}  // namespace dermis
