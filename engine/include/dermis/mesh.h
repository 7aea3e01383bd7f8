// Meshes: what skinning reads, checked, repaired, packed; and what is computed from them at import:
// normals, boxes, centers of rotation.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <limits>
#include <memory>
#include <span>
#include <string>
#include <string_view>
#include <type_traits>
#include <vector>

#include "dermis/layout.h"
#include "dermis/result.h"

// ---- Plain data of the interface.

namespace dermis {

/// A joint matrix: joint global transform × inverse bind matrix. An affine transform as a row-major
/// 3×4 matrix: `m[row][column]`, column 3 is the translation. It transforms a point p to m * (p,
/// 1): from bind space, the space of the mesh, to the space of the pose, the space of the joint
/// global transforms. Skinned vertices are in that space. 48 bytes; the GPU reads an array of
/// these.
struct JointMatrix {
  float m[3][4] = {{1, 0, 0, 0}, {0, 1, 0, 0}, {0, 0, 1, 0}};
};
static_assert(sizeof(JointMatrix) == 48);

/// What a pose promises of its joints. The less can happen, the less time pipelines take to be
/// created, and joints to be converted. Rigid joints give the same vertices with each.
enum class JointPromise : std::uint8_t {
  /// Nothing: joints may scale, shear and mirror. Many exporters leave a scale in joints.
  scaling = 0,
  /// Scale and shear are ignored: of a joint only the rotation of its polar decomposition and its
  /// translation count.
  scaleIgnored = 1,
  /// Joints only rotate and translate. One that does more rotates by an unspecified rotation.
  rigid = 2,
};

/// Converts a column-major 4×4 matrix, as GLM stores it. A row-major matrix for row vectors, as of
/// DirectXMath, has the same bytes. The last row (column), which should be 0 0 0 1, is not read.
inline JointMatrix toJointMatrix(std::span<const float, 16> columnMajor) {
  JointMatrix result;
  for (std::size_t row = 0; row < 3; ++row) {
    for (std::size_t column = 0; column < 4; ++column)
      result.m[row][column] = columnMajor[column * 4 + row];
  }
  return result;
}

/// The same for an array of matrices, 16 floats each. `result` may be what `writePose` returned: it
/// is not read. Fails with `invalidArgument` if there are not 16 floats for each joint matrix.
inline Result<void> toJointMatrices(std::span<const float> columnMajor,
                                    std::span<JointMatrix> result) {
  if (columnMajor.size() != result.size() * 16) {
    return Error{ErrorCode::invalidArgument, std::to_string(columnMajor.size()) +
                                                 " floats are not 4x4 matrices for " +
                                                 std::to_string(result.size()) + " joints"};
  }
  for (std::size_t joint = 0; joint < result.size(); ++joint)
    result[joint] = toJointMatrix(columnMajor.subspan(joint * 16).first<16>());
  return {};
}

/// Converts a glm::mat4. Its last row, which should be 0 0 0 1, is not read.
template <typename Matrix, typename Length = typename Matrix::length_type>
JointMatrix toJointMatrix(const Matrix& columns) {
  JointMatrix result;
  for (Length row = 0; row < 3; ++row) {
    for (Length column = 0; column < 4; ++column) result.m[row][column] = columns[column][row];
  }
  return result;
}

/// Converts to a glm::mat4x3 or glm::mat4.
template <typename Matrix, typename Length = typename Matrix::length_type>
Matrix toColumns(const JointMatrix& matrix) {
  Matrix result(1);
  for (Length row = 0; row < 3; ++row) {
    for (Length column = 0; column < 4; ++column) result[column][row] = matrix.m[row][column];
  }
  return result;
}

/// Maximum joints of a pose.
inline constexpr std::uint32_t maxPoseJoints = 65536;

// ---- Views of a mesh in the caller's memory: vertices in bind pose and their influences. A view
// copies nothing and owns nothing. The memory must stay valid and unchanged during the call that
// takes the view.

/// How one component of an attribute is stored. As in Vulkan and glTF, the value of a `unorm` type
/// is the integer divided by its maximum, and the value of a `snorm` type is the same, but at least
/// -1. float16 is IEEE 754 binary16.
enum class ComponentType : std::uint8_t {
  float32 = 0,
  float16 = 1,
  snorm8 = 2,
  snorm16 = 3,
  unorm8 = 4,
  unorm16 = 5,
  uint8 = 6,
  uint16 = 7,
  uint32 = 8,
};

/// Bytes of one component.
constexpr std::uint32_t componentSize(ComponentType type) {
  constexpr std::uint32_t sizes[] = {4, 2, 1, 2, 1, 2, 1, 2, 4};
  const auto index = static_cast<std::size_t>(type);
  return index < std::size(sizes) ? sizes[index] : 0;
}

/// One attribute: `count` elements of `components` components each, `stride` bytes apart. So it can
/// be part of interleaved vertices. Needs no alignment.
struct AttributeView {
  const void* data = nullptr;  ///< the first element; null if the mesh does not have the attribute
  /// Number of elements: `MeshView::vertexCount`, or the size of `MorphTargetView::vertices` if
  /// that is not empty.
  std::uint32_t count = 0;
  /// Bytes from one element to the next; at least the size of an element.
  std::uint32_t stride = 0;
  ComponentType type = ComponentType::float32;
  std::uint32_t components = 0;  ///< per element

  /// Whether the mesh has the attribute.
  explicit operator bool() const { return data != nullptr; }
};

/// Joints and weights of every vertex. `components` is the number of influences per vertex: 4 in a
/// set of glTF, any number here, the same for joints and weights. An influence of weight 0 is
/// ignored, whatever its joint is.
struct InfluenceSet {
  AttributeView joints;   ///< uint8, uint16, uint32, or float32 with whole numbers
  AttributeView weights;  ///< float32, unorm8 or unorm16
};

/// One morph target (blend shape): displacements that are multiplied by a weight and added to the
/// attributes in bind pose, before skinning. If an attribute is absent here, it is not displaced.
/// If the mesh does not have the attribute, its displacements are ignored. `pack` stores only
/// vertices with a displacement other than zero.
struct MorphTargetView {
  /// The vertices that the elements below belong to, strictly ascending. If empty, there is an
  /// element for each vertex of the mesh.
  std::span<const std::uint32_t> vertices;
  /// float32, float16 or snorm16, 3 components (a fourth is ignored), multiplied by
  /// `positionScale`.
  AttributeView positions;
  AttributeView normals;   ///< float32, float16, snorm8 or snorm16, 3 components or 4
  AttributeView tangents;  ///< the same; the handedness is not displaced
  std::array<float, 3> positionScale{1, 1, 1};
};

/// A morph target that is active on an instance, and its weight.
struct MorphWeight {
  std::uint32_t target = 0;  ///< index into `MeshView::morphTargets`
  float weight = 0;          ///< any finite number; a target with weight 0 is not active
};

/// A mesh in bind pose. The influences of a vertex are those of all sets together, in any order and
/// any number. Weights need not sum to 1: they are normalized. If a joint occurs twice in a vertex,
/// its weights are added.
struct MeshView {
  std::string_view name;  ///< for messages only
  std::uint32_t vertexCount = 0;
  /// Required. float32, float16, snorm16 or unorm16, 3 components (a fourth is ignored). Each
  /// component is multiplied by `positionScale`; then `positionOffset` is added.
  AttributeView positions;
  std::array<float, 3> positionScale{1, 1, 1};
  std::array<float, 3> positionOffset{0, 0, 0};
  /// Optional. float32, float16, snorm8 or snorm16, 3 components (a fourth is ignored). A zero
  /// normal stays zero.
  AttributeView normals;
  /// Optional. The same types, 4 components. The fourth is the handedness: -1 if it is negative,
  /// otherwise 1.
  AttributeView tangents;
  std::span<const InfluenceSet> influenceSets;    ///< at least one
  std::span<const MorphTargetView> morphTargets;  ///< may be empty

  // -- Inputs of some methods. Morph targets do not change them.

  /// For `Method::blended`: from 0 (linear) to 1 (dual quaternions). Optional; float32, unorm8 or
  /// unorm16, 1 component.
  AttributeView dualQuaternionWeights;
  float dualQuaternionWeight = 0.5f;  ///< of every vertex, if `dualQuaternionWeights` is absent
  /// For `Method::bulgeControlled`: from 0 (bulges like dual quaternions) to 1 (bulges as little as
  /// `Method::centerOfRotation`). Optional; the same types.
  AttributeView bulgeStrengths;
  float bulgeStrength = 1;  ///< of every vertex, if `bulgeStrengths` is absent
  /// For methods that `needsCentersOfRotation`: points in bind space, float32, 3 components.
  /// `CenterOfRotationSolver` computes them.
  AttributeView centersOfRotation;
};

/// A view of float32 values or of joint indices. `stride` is in bytes; 0 if elements are tightly
/// packed.
template <typename T>
AttributeView attributeView(const T* data, std::uint32_t count, std::uint32_t components,
                            std::uint32_t stride = 0) {
  static_assert(std::is_same_v<T, float> || (std::is_unsigned_v<T> && sizeof(T) <= 4));
  constexpr ComponentType type = std::is_same_v<T, float> ? ComponentType::float32
                                 : sizeof(T) == 1         ? ComponentType::uint8
                                 : sizeof(T) == 2         ? ComponentType::uint16
                                                          : ComponentType::uint32;
  constexpr std::uint32_t size = sizeof(T);
  return {data, count, stride != 0 ? stride : components * size, type, components};
}

// ---- Computes normals for a mesh that has none. This is done once, at import, before `pack`.

/// Smooth normals: that of a vertex is the mean of the normals of its triangles, weighted by their
/// areas. `triangles` has 3 vertex indices per triangle, counterclockwise as seen from outside. Of
/// `mesh`, only the positions are read; it need not have influences. Returns 3 floats per vertex,
/// of unit length. A vertex without triangles, or for which the mean has no direction, gets 0 0 1.
/// Vertices at the same place have normals of their own. O(vertices + indices).
///
/// Fails with `invalidMesh` if `validate` would refuse the view of the positions, and with
/// `invalidArgument` if the number of indices is not a multiple of 3, or a vertex does not exist.
DERMIS_CORE_API Result<std::vector<float>> smoothNormals(const MeshView& mesh,
                                                         std::span<const std::uint32_t> triangles);

/// Flat normals: those of the triangles, as glTF 2.0 demands for meshes without normals. Vertices
/// have to be repeated for them: vertex i of the new mesh is vertex `triangles[i]` of this one.
/// Returns 3 floats per vertex of the new mesh; a triangle without area gets 0 0 1. Otherwise as
/// `smoothNormals`.
DERMIS_CORE_API Result<std::vector<float>> flatNormals(const MeshView& mesh,
                                                       std::span<const std::uint32_t> triangles);

// ---- Finds what is wrong with a mesh, and repairs it. Both are done once, at import.

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

/// All problems of one mesh.
struct MeshReport {
  /// One kind of problem in one mesh.
  struct Finding {
    MeshProblem problem = MeshProblem::emptyMesh;
    std::uint64_t count = 0;  ///< number of vertices, morph displacements or views that have it
    /// The first such vertex. 0 if the problem is one of a view or of the whole mesh.
    std::uint32_t firstVertex = 0;
    /// A sentence about the first place, for example "mesh 'Fox', vertex 17: joint 31 is outside
    /// the pose of 24 joints".
    std::string message;
  };
  std::vector<Finding> findings;  ///< at most one for each kind, in the order of `MeshProblem`

  /// Whether `pack` accepts the mesh.
  DERMIS_CORE_API bool packable() const;
  /// Whether all views are valid, so that `repair` can fix the mesh.
  DERMIS_CORE_API bool repairable() const;
  /// The finding of this kind; null if there is none.
  DERMIS_CORE_API const Finding* find(MeshProblem problem) const;
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

/// A repaired copy of a mesh. Owns its memory. A moved-from one may only be destroyed or assigned
/// to.
class DERMIS_CORE_API RepairedMesh {
 public:
  ~RepairedMesh();
  RepairedMesh(RepairedMesh&&) noexcept;
  RepairedMesh& operator=(RepairedMesh&&) noexcept;

  /// The repaired mesh: float32 attributes without scale or offset, and one influence set of uint32
  /// joints and float32 weights. The view is valid until this object is destroyed or assigned to.
  const MeshView& view() const;
  /// What `validate` found before the repair. Problems that are `refusedByPack` are fixed now.
  const MeshReport& report() const;

 private:
  RepairedMesh();
  friend DERMIS_CORE_API Result<RepairedMesh> repair(const MeshView& mesh,
                                                     std::uint32_t jointCount);
  struct State;
  std::unique_ptr<State> state_;
};

/// Fixes the problems that `validate` finds and `pack` refuses:
/// - An influence is dropped if its weight is negative or not finite, or if the pose does not have
///   its joint. `pack` normalizes the remaining weights.
/// - A position, normal, tangent, displacement or center of rotation that is not finite becomes 0.
/// - Dual-quaternion weights and bulge strengths are clamped to the range from 0 to 1.
///
/// Fails with `invalidMesh` if the views are not valid (`MeshReport::repairable`).
DERMIS_CORE_API Result<RepairedMesh> repair(const MeshView& mesh, std::uint32_t jointCount);

// ---- Converts a mesh into the blob that the kernels read. This is done once, at import.

/// Alignment of a packed mesh in the mesh buffer, in bytes.
inline constexpr std::uint32_t packedMeshAlignment = 16;

/// What `makePlan` needs to know about a packed mesh. The engine keeps it, and may free the packed
/// mesh once its bytes are on the GPU.
struct MeshInfo {
  std::uint64_t byteSize = 0;  ///< of the blob
  std::uint32_t vertexCount = 0;
  std::uint32_t requiredJoints = 0;  ///< minimum joints of a pose: the largest joint index + 1
  std::uint32_t maxInfluences = 0;   ///< maximum influences of a vertex
  std::uint32_t minInfluences = 0;   ///< minimum influences of a vertex
  std::uint32_t morphTargetCount = 0;
  bool hasNormals = false;
  bool hasTangents = false;
  bool hasCentersOfRotation = false;  ///< required by methods that `needsCentersOfRotation`
};

/// A packed mesh: a blob of little-endian 32-bit words, which it owns. The vertices are in the
/// order of the mesh. The blob is relocatable (offsets count from its beginning) and has a version
/// number, so it can be stored with the assets.
///
/// The engine copies the same bytes to the mesh buffer on the GPU, at a multiple of
/// `packedMeshAlignment`.
class DERMIS_CORE_API PackedMesh {
 public:
  /// Makes a packed mesh from stored bytes, which it copies. O(bytes): it checks the length, the
  /// version, the checksum and every index, so that no stored blob can make a kernel read outside
  /// its mesh or pose. Fails with `invalidData` or `unsupportedVersion`.
  static Result<PackedMesh> fromBytes(std::span<const std::byte> bytes);

  /// The blob. Its size is a multiple of `packedMeshAlignment`.
  std::span<const std::byte> bytes() const { return std::as_bytes(std::span(words_)); }

  /// What `makePlan` needs to know about it.
  MeshInfo info() const;
  /// `info().vertexCount`.
  std::uint32_t vertexCount() const { return info().vertexCount; }

 private:
  friend DERMIS_CORE_API Result<PackedMesh> pack(const MeshView& mesh, std::uint32_t jointCount);
  PackedMesh() = default;
  std::vector<std::uint32_t> words_;
};

/// Packs a mesh. `jointCount` is the number of joints of its skeleton, 1 to `maxPoseJoints`: all
/// joint indices must be less. A pose may have fewer joints, but at least
/// `MeshInfo::requiredJoints`. O(vertices × influences + displacements).
///
/// - Attributes are converted to float32.
/// - The weights of a joint that occurs twice in a vertex are added. Zero weights are dropped.
/// - Weights are normalized in double precision, and rounded to float32 so that they sum to exactly
///   1. A weight below 2^-49 is dropped. Rounding the sum to 1 may drop one below 2^-24.
/// - The influences of a vertex are sorted by descending weight, and by ascending joint index if
///   weights are equal. The first is the pivot: the quaternions of the others are brought into its
///   hemisphere before they are blended (docs/methods.md).
/// - An influence takes 8 bytes.
/// - Of morph targets, only displaced vertices are stored.
///
/// Fails with `invalidArgument` if `jointCount` is out of range, with `limitExceeded` if the blob
/// might be larger than 2^32 words, and with `invalidMesh` if `validate` finds a problem that is
/// `refusedByPack`; the message is that of the first such finding.
DERMIS_CORE_API Result<PackedMesh> pack(const MeshView& mesh, std::uint32_t jointCount);

// ---- Computes a box around a skinned mesh from its pose, without skinning it. Engines need such a
// box for culling, and for snorm16 positions, which are relative to a box. `jointBounds` collects
// what is needed about the vertices, once, at import. `skinnedBounds` then takes a few microseconds
// for a pose. docs/bounds.md has the proof.

struct JointBoundsData;

/// The extents of the vertices in bind pose, grouped by the joints that move them. `jointBounds`
/// makes it once, at import. It does not depend on pose and method, and may be stored with the
/// mesh. A default-constructed one has no vertices; a moved-from one may only be destroyed or
/// assigned to.
class DERMIS_CORE_API JointBounds {
 public:
  JointBounds();
  ~JointBounds();
  JointBounds(JointBounds&&) noexcept;
  JointBounds& operator=(JointBounds&&) noexcept;

  /// The data as little-endian words with a version and a checksum, to store it.
  std::vector<std::byte> bytes() const;
  /// Reads what `bytes` returned. It is checked, so that `skinnedBounds` never reads out of range.
  /// Fails with `invalidData` if it is damaged, or with `unsupportedVersion`.
  static Result<JointBounds> fromBytes(std::span<const std::byte> bytes);

 private:
  friend struct JointBoundsData;
  std::unique_ptr<JointBoundsData> data_;
};

/// Collects what `skinnedBounds` needs to know about a mesh, for poses of `jointCount` joints.
/// O(vertices × influences²).
///
/// The boxes hold for all combinations of morph weights within `morphRanges`: the minimum and the
/// maximum of the weight of each morph target. If it is empty, all ranges are 0 to 1. For a mesh
/// that is drawn without its morph targets, pass a view without them: the box is tighter.
///
/// Fails with `invalidMesh` if `pack` refuses the mesh or a morph target does not fit it. Fails
/// with `invalidArgument` if `jointCount` is 0 or above `maxPoseJoints`, if a range is not finite
/// or its minimum is above its maximum, or if the number of ranges is wrong.
DERMIS_CORE_API Result<JointBounds> jointBounds(
    const MeshView& mesh, std::uint32_t jointCount,
    std::span<const std::array<float, 2>> morphRanges = {});

/// A box that contains every position that the kernels or the reference compute for the mesh in
/// this pose, including rounding errors. It is in the space of the pose. In ordinary poses it is a
/// few percent larger than necessary; docs/bounds.md has the formulas, the proof and numbers.
///
/// `promise` is that of the pose. If it is not `scaling`, the box is that of the joints without
/// their scale, except for `linear`, which always scales. If it is broken, the box proves nothing.
///
/// There is a proof for `linear`, `dualQuaternion` and `blended`. For all other methods the box is
/// infinite.
///
/// The box is infinite (from -inf to inf), too, if a joint that moves vertices is not finite or is
/// outside the pose, or if the mesh reaches beyond 1e38. A side may be infinite if numbers leave
/// the range of float32. So check the box with `std::isfinite` before you use it for snorm16. It
/// never contains a NaN. Joints that move no vertices have no effect. For a default-constructed
/// `JointBounds` and a method with a proof the box has min > max.
///
/// O(joints + pairs + trios). Any thread. Needs 32 KiB of stack, and allocates only if more than
/// 128 joints move vertices.
DERMIS_CORE_API Box skinnedBounds(const JointBounds& bounds, std::span<const JointMatrix> pose,
                                  Method method, JointPromise promise = JointPromise::scaling);

// ---- Computes centers of rotation: for each vertex, the point about which the blended rotation of
// its joints rotates it. They are computed once, at import, from the bind pose. Source: Le and
// Hodgins 2016, "Real-time skeletal skinning with optimized centers of rotation".
//
// The similarity of two weight vectors i and t is large if they share joints with the same ratio of
// weights (σ = 0.1):
//
//     s(i, t) = Σ_{j≠k} w_ij w_ik w_tj w_tk exp(−(w_ij w_tk − w_ik w_tj)² / σ²)
//
// The center of vertex i is the mean of the centroids of all triangles t of the mesh, weighted by
// s(i, t) and by their areas. The weights of a triangle are the mean of the weights of its
// vertices.

/// Computes the centers of rotation of a mesh, 3 floats per vertex, in bind space. `make` sorts the
/// triangles once. `solve` then computes the centers of any range of vertices, on any thread, so
/// that an engine's job system can share the work. The solver starts no threads.
///
/// Weights are those that `pack` stores: normalized, those of one joint added, and those below
/// 2^-49 dropped. A vertex without weight adds nothing to the weights of its triangles. A triangle
/// without area adds nothing to a center. If a vertex has fewer than two influences, or no triangle
/// has two of its joints, its center is its own position in bind pose; with one joint the center
/// makes no difference. Every other center lies in the convex hull of the triangles' centroids.
/// Centers are finite.
///
/// Sums are computed in double precision. The result differs from the exact center only by the
/// rounding of weights and centers to float32.
///
/// There is one term for each vertex, triangle, and pair of joints that the two share; triangles
/// with equal weights count as one. `solve` takes about 4 ns per term (x86-64, one core), so its
/// time is O(vertices × triangles) for each pair of joints. A body of 10,000 vertices, 20,000
/// triangles and 26 joints takes 0.5 s. The worst case is a mesh with the same four joints in all
/// vertices: 10,000 vertices take 5 s, and ten times as many take a hundred times as long.
///
/// The solver owns its data: the memory of mesh and triangles may be released after `make`.
/// Movable, not copyable. A moved-from solver may only be destroyed or assigned to.
class DERMIS_CORE_API CenterOfRotationSolver {
 public:
  /// Sorts the triangles by the pairs of joints that move them. O(triangles × joints²), where
  /// joints is the number of joints of one triangle. Takes 20 bytes for each pair of each triangle,
  /// and temporarily the same amount again. A triangle has 6 to 15 pairs if vertices have four
  /// influences.
  ///
  /// `triangles` has three vertex indices for each triangle. Pass the whole surface, as one mesh,
  /// even if it is split, for example by material: the centers depend on all of it.
  ///
  /// `MeshView::centersOfRotation` is ignored. Fails with `invalidMesh` if `pack` refuses the rest
  /// of the mesh, with the same message; with
  /// `invalidArgument` if `jointCount` is 0 or above `maxPoseJoints`, if the number of indices is
  /// not a multiple of 3, or if an index is outside the mesh; with `limitExceeded` above 2^32 − 1
  /// triangles. Any thread.
  static Result<CenterOfRotationSolver> make(const MeshView& mesh, std::uint32_t jointCount,
                                             std::span<const std::uint32_t> triangles);
  ~CenterOfRotationSolver();
  CenterOfRotationSolver(CenterOfRotationSolver&&) noexcept;
  CenterOfRotationSolver& operator=(CenterOfRotationSolver&&) noexcept;

  /// Number of vertices of the mesh.
  std::uint32_t vertexCount() const;

  /// Number of terms in the sums of all vertices; see above for the time that a term takes. Check
  /// it before you solve a mesh of unknown origin. O(vertices × influences²).
  std::uint64_t termCount() const;

  /// Computes the centers of `centers.size()` / 3 vertices, beginning with `firstVertex`. Any
  /// number of threads may call it at the same time. Results are the same to the bit however the
  /// vertices are divided among calls; 64 vertices are enough for a job. Allocates nothing unless
  /// it fails. Fails with `invalidArgument`, and writes nothing, if the size of `centers` is not a
  /// multiple of 3 or a vertex is not in the mesh.
  Result<void> solve(std::uint32_t firstVertex, std::span<float> centers) const;

 private:
  struct State;
  explicit CenterOfRotationSolver(std::unique_ptr<const State> state);
  std::unique_ptr<const State> state_;
};

}  // namespace dermis
