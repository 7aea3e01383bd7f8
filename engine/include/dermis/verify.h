// The reference in double precision, how far from it a vertex may be, and what makes a pose wrong.
#pragma once

#include <array>
#include <cstdint>
#include <span>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "dermis/clips.h"
#include "dermis/layout.h"
#include "dermis/mesh.h"
#include "dermis/result.h"
#include "dermis/rig.h"

// ---- The CPU reference: it defines the right answer, in double precision. It starts from the same
// mesh views and float32 joint matrices as the GPU, and shares no code with packing or the kernels.
// It is written to be correct and readable, not fast.

namespace dermis::reference {

using Double3 = std::array<double, 3>;  ///< x, y, z
using Double4 = std::array<double, 4>;  ///< x, y, z, w

/// How near a float32 result must be to the reference at one vertex: the accuracy contract of
/// docs/accuracy.md, for the method, the pose and this vertex. Formats add their own bounds
/// (`positionFormatBound` and others below).
struct VertexBounds {
  double position = 0;  ///< maximum distance between positions, in the units of the pose
  /// Maximum distance between unit normals. If negative, the normal must only have unit length.
  double normal = 0;
  double tangent = 0;  ///< the same for tangents
  /// The largest length in the computation, in the units of the pose: max |t_j| + max σ_j |p| over
  /// the influences. t_j is the translation and σ_j the largest singular value of joint j, p is the
  /// position in bind pose.
  double scale = 0;
  /// Rounding or flushed denormals decide the answer: rotations are antipodal, or a joint's 3×3
  /// matrix has rank 1, is nearly a singular mirror, or is below the range of the contract. The
  /// result must be finite, nothing more.
  bool onlyFinite = false;
  bool undefined = false;         ///< a joint is not finite: there is no answer
  bool outOfRange = false;        ///< numbers exceed the range of the contract: any result is right
  bool normalMayVanish = false;   ///< morph targets cancel the normal: zero is right, too
  bool tangentMayVanish = false;  ///< the same for the tangent
  bool eitherHandedness = false;  ///< the blended matrix is singular: both handednesses are right
};

/// What `skin` returns: one element for each vertex.
struct SkinnedMesh {
  std::vector<Double3> positions;
  std::vector<Double3> normals;   ///< empty if the mesh has none
  std::vector<Double4> tangents;  ///< w is the handedness; empty if the mesh has none
  std::vector<VertexBounds> bounds;
};

/// Skins a mesh. Positions, normals and tangents are in the space of the pose.
///
/// - First the active morph targets are added to the bind pose.
/// - Influences are normalized over all sets together. A vertex without weight stays in bind pose,
///   with its morph targets.
/// - docs/methods.md has the formulas and sources: Kavan et al. 2007, section 4, for dual
///   quaternions; Kavan et al. 2008 for iterative blending; Alexa 2002 and Cordier and
///   Magnenat-Thalmann 2005 for logarithms; Kavan and Žára 2005 for spherical blending; Hejl 2004
///   for quaternions and translations; Le and Hodgins 2016 for centers of rotation.
/// - All methods except `linear` apply scale and shear in two phases, by polar decomposition. The
///   reference decomposes every joint; the kernels take nearly rigid joints for rigid. For a pose
///   with `JointPromise::scaleIgnored`, pass joints without scale.
/// - Normals are transformed by the cofactor matrix of the blended 3×3 matrix, tangents by the
///   blended 3×3 matrix. Both are normalized. Tangents are not made orthogonal to normals. The
///   handedness is multiplied by the sign of the determinant.
///
/// Fails with `invalidMesh` if `pack` refuses the mesh for `pose.size()` joints, and with
/// `invalidArgument` if the method is not valid, or if the mesh lacks a morph target or the centers
/// of rotation that the method needs.
DERMIS_VERIFY_API Result<SkinnedMesh> skin(const MeshView& mesh, std::span<const JointMatrix> pose,
                                           Method method, std::span<const MorphWeight> morphs = {});

/// What `samplePose` returns.
struct SampledPose {
  std::vector<Transform> joints;  ///< joint global transforms × inverse bind matrices
  /// How near a pose of the bank must be: {A, B, C} for each joint, or empty if there was no bank.
  /// Its joint matrix moves a point p of bind space to at most A + B d from where `joints` moves
  /// it. d is the length of inverse bind matrix × p: how far p is from the joint, in the joint's
  /// frame. Except for a rotation, its 3×3 part is at most C from that of `joints` (spectral norm).
  /// B and C are infinite if the inverse bind matrix is singular: the joint matrix must only be
  /// finite. All are if numbers leave the range of float32: then it may be anything.
  std::vector<std::array<double, 3>> bounds;
  std::vector<JointMatrix> inverseBind;  ///< one for each of the bounds
};

/// Samples the pose of a skin from the clips that a bank is made of, as `dermis::samplePose` does
/// from the bank, but with exact keys and in double precision. Only the weights are rounded to
/// float16, and the times to float32. A clip has the pose at rest where it has no channel; so has
/// the base of an additive clip.
///
/// `masks` are those of `PackClipsOptions`, and so is `rootMotion`, if there is one. The bounds
/// follow from `bank->error`.
///
/// Fails with `invalidArgument` as `dermis::samplePose` does, and if an index or a size does not
/// fit, or parents form a cycle.
DERMIS_VERIFY_API Result<SampledPose> samplePose(const Skeleton& skeleton,
                                                 std::span<const ClipView> clips,
                                                 std::span<const std::span<const float>> masks,
                                                 std::span<const ClipLayer> layers,
                                                 std::uint32_t skin,
                                                 const PackedClips* bank = nullptr,
                                                 const RootMotionOptions* rootMotion = nullptr);

/// Skins a mesh in a pose that was sampled with a bank. The bounds are those for vertices that a
/// device skins in the bank's pose. They consist of what `SampledPose::bounds` makes of the vertex,
/// and of the bounds of the other `skin` for the worst pose of the bank. Morph weights are exact:
/// pass those of the device.
///
/// Fails with `invalidArgument` as well if the pose has no bounds, and for methods that are
/// `isForComparison`.
DERMIS_VERIFY_API Result<SkinnedMesh> skin(const MeshView& mesh, const SampledPose& pose,
                                           Method method, std::span<const MorphWeight> morphs = {});

/// What `rootMotion` returns.
struct SampledMotion {
  RootMotion motion;
  /// How far the motion of the bank may be from it; 0 if there was no bank.
  double displacementBound = 0, turnBound = 0;
};

/// The motion that `packClips` takes out of a clip, for `dermis::rootMotion`. O(loops × keys).
///
/// Fails with `invalidArgument` as `dermis::rootMotion` and `packClips` do, and if the times are
/// more than a million loops apart.
DERMIS_VERIFY_API Result<SampledMotion> rootMotion(const Skeleton& skeleton,
                                                   std::span<const ClipView> clips,
                                                   const RootMotionOptions& options,
                                                   std::uint32_t clip, double fromSeconds,
                                                   double toSeconds, bool hold = false,
                                                   const PackedClips* bank = nullptr);

/// What `sampleWeights` returns.
struct SampledWeights {
  std::vector<double> weights;
  /// How far each weight of the bank may be from it, or empty if there was no bank.
  std::vector<double> bounds;
};

/// Samples the morph weights of a node in the same way, for `dermis::sampleWeights`. Empty if there
/// is no such node.
DERMIS_VERIFY_API Result<SampledWeights> sampleWeights(
    const Skeleton& skeleton, std::span<const ClipView> clips,
    std::span<const std::span<const float>> masks, std::span<const ClipLayer> layers,
    std::uint32_t node, const PackedClips* bank = nullptr);

/// What `evaluateRig` returns.
struct EvaluatedRig {
  std::vector<Transform> joints;  ///< driven joint matrices
  std::vector<double> weights;    ///< all, the given ones first
  /// How far each number in float32 may be from it. Infinite if rounding decides the result: a
  /// matrix is singular, a twist is near 180 degrees or a swing is; between two joints of a chain
  /// the rotation is near 180 degrees, or the curve runs against it; or numbers leave the range of
  /// float32.
  std::vector<Transform> jointBounds;
  std::vector<double> weightBounds;  ///< the same; 0 for the given ones
};

/// Computes what a rig drives from its source, as `dermis::evaluateRig` and the kernels do from the
/// packed rig. The bounds are derived: docs/accuracy.md.
///
/// Fails with `invalidArgument` if a span does not have the size that the rig says, and if
/// `packRig` refuses the rig.
DERMIS_VERIFY_API Result<EvaluatedRig> evaluateRig(const RigView& rig,
                                                   std::span<const JointMatrix> written,
                                                   std::span<const float> givenWeights = {});

}  // namespace dermis::reference

// ---- The accuracy contract: how near a result must be to the reference, and whether it is.

namespace dermis {

/// The unit u of rounding of float32: half the distance from 1 to the next number, 2^-24.
inline constexpr double floatRounding = 5.9604644775390625e-8;

/// Maximum distance between a position in float32 and the same position stored in `format`.
/// - float32: 0.
/// - float16: half a unit in the last place of each component x. This is at most 2^-11 |x|, or
///   2^-25 below the smallest normal number.
/// - snorm16: along each axis half a step, h / 32767 / 2, plus the rounding errors of (p − c) / h
///   in float32, 4 u |c| + 8 u h. c is the center of `box` and h half of its size. This holds for
///   positions inside the box.
DERMIS_VERIFY_API double positionFormatBound(VertexFormat format,
                                             const reference::Double3& position, const Box& box);

/// The same for unit normals. L = 127 or 32767 is the maximum integer of the format.
/// - float16: 2^-11, plus √3 · 2^-25 for components below the smallest normal number.
/// - snorm: √3 times half a step and a rounding, ½ / L + u.
/// - octahedral: √18 δ, with δ = ½ / L + 12 u. An error of δ in both components moves the point on
///   the octahedron by (δ, δ, 2δ), which has length √6 δ. The projection onto the sphere divides it
///   by the distance from the origin, which is at least 1 / √3.
DERMIS_VERIFY_API double normalFormatBound(VertexFormat format);

/// The same for unit tangents. If they are octahedral, the second component has half as many steps:
/// the bound is √3 times the length of (δ, η, δ + η), with η = 1 / (L − 1) + 12 u.
DERMIS_VERIFY_API double tangentFormatBound(VertexFormat format);

/// How many vertices have no bound. The caller of `compareWithReference` states these numbers; the
/// comparison fails if they are different.
struct Exemptions {
  std::uint64_t onlyFinite = 0;  ///< `VertexBounds::onlyFinite`: must be finite, nothing more
  std::uint64_t skipped = 0;     ///< `VertexBounds::undefined`: not checked
  std::uint64_t outOfRange = 0;  ///< `VertexBounds::outOfRange`, if not `undefined`: not checked

  friend bool operator==(const Exemptions&, const Exemptions&) = default;
};

/// The exemptions that the reference reports. Use it for poses that come from files. A test that
/// makes its own pose should state the numbers instead.
DERMIS_VERIFY_API Exemptions exemptionsOf(const reference::SkinnedMesh& expected);

/// The result of a comparison. Errors are divided by the bound of their vertex, so that 1 is the
/// largest permitted.
struct Comparison {
  double worstPosition = 0;               ///< maximum of error ÷ bound
  double worstNormal = 0;                 ///< the same for normals
  double worstTangent = 0;                ///< the same; a wrong handedness counts as an error of 2
  double largestPositionError = 0;        ///< not divided; in the units of the pose
  std::uint32_t worstPositionVertex = 0;  ///< the vertex of `worstPosition`
  std::uint32_t worstNormalVertex = 0;    ///< the vertex of `worstNormal`
  std::uint32_t worstTangentVertex = 0;   ///< the vertex of `worstTangent`
  std::uint64_t compared = 0;             ///< vertices that were compared with their bound
  Exemptions exempt;                      ///< vertices that were not
  Exemptions expectedExempt;              ///< what the caller stated
  /// Vertices, among those compared, whose normal only had to have unit length.
  std::uint64_t onlyUnitNormals = 0;
  std::uint64_t onlyUnitTangents = 0;  ///< the same for tangents
  std::uint64_t clamped = 0;           ///< vertices that the reference has outside the snorm16 box
  std::uint64_t failures = 0;          ///< vertices outside their bound, or not finite
  std::uint32_t firstFailure = 0;      ///< the first such vertex

  /// Whether no vertex failed, and the exemptions are those that the caller stated.
  bool passed() const { return failures == 0 && exempt == expectedExempt; }
};

/// One attribute of skinned vertices, in an output buffer. Needs no alignment.
struct SkinnedAttribute {
  const void* data = nullptr;  ///< of vertex 0; null if the attribute is absent
  std::uint32_t count = 0;     ///< number of vertices
  std::uint32_t stride = 0;    ///< bytes
  VertexFormat format = VertexFormat::none;
};

/// The vertices that are compared with the reference.
struct SkinnedView {
  SkinnedAttribute positions = {};
  SkinnedAttribute normals = {};   ///< may be absent
  SkinnedAttribute tangents = {};  ///< may be absent
  Box box = {};                    ///< of positions in snorm16
};

/// Compares skinned vertices with those of the reference. Each error must be at most the bound of
/// the vertex plus the bound of the format. Normals and tangents are compared if both have them.
/// `exemptions` states how many vertices have no bound. `Comparison::passed` is the verdict.
///
/// - A vertex that is not finite in the reference fails, unless `VertexBounds::undefined` is set.
///   So does one whose bound is not finite, unless `undefined` or `onlyFinite` is set.
/// - The handedness must be equal to that of the reference. If `VertexBounds::eitherHandedness` is
///   set, it must be 1 or -1.
/// - The fourth component of a position must be 1, that of a normal 0.
/// - If a direction is zero in the reference, it must be zero; if octahedral, (0, 0, 1).
/// - A position outside the snorm16 box is compared with the nearest point of the box.
/// - A float16 component may be infinite, with the right sign, if the value of the reference plus
///   its bound reaches 65520, which is half a step above the largest finite number.
///
/// Fails with `invalidArgument` if the counts differ, if a format is not allowed for its attribute,
/// if a stride is smaller than an element, or if the snorm16 box is not finite or has min > max.
DERMIS_VERIFY_API Result<Comparison> compareWithReference(const reference::SkinnedMesh& expected,
                                                          const SkinnedView& actual,
                                                          const Exemptions& exemptions = {});

// ---- Finds out whether a pose is plausible for a mesh, and which mistake makes it wrong. For
// debug builds: an engine calls it once, with the first pose of an instance.

/// Well-known mistakes of engines that compute joint matrices. J is the right joint matrix, G the
/// joint's global transform, B its inverse bind matrix: J = G · B.
enum class PoseMistake : std::uint8_t {
  none = 0,
  unknown = 1,      ///< the pose is wrong, but none of the tested mistakes explains it
  transposed = 2,   ///< 4×4 matrices are read in the wrong order, so that the translation is lost
  columnMajor = 3,  ///< 12 floats in column-major order are read as row-major
  inverseBindMissing = 4,    ///< G instead of G · B
  inverseBindTwice = 5,      ///< G · B · B
  inverseBindWrongSide = 6,  ///< B · G
  jointsInNodeOrder = 7,     ///< the order of nodes instead of that of the skin
  jointsSortedByName = 8,    ///< sorted by name instead of in the order of the skin
  jointsOffByOne = 9,        ///< the matrix of the joint before or after
  rootMissing = 10,          ///< without the transform of the nodes above the skeleton, or the root
  rootTwice = 11,            ///< with it twice
  units = 12,            ///< lengths of the skeleton are 100 times or 0.01 times those of the mesh
  axes = 13,             ///< the skeleton has another handedness or up axis than the mesh
  quaternionOrder = 14,  ///< w, x, y, z read as x, y, z, w, or the other way around
  weightSet = 15,        ///< weights of one influence set are read for another
};

/// A pose, and what is known of its skeleton. Only `jointMatrices` is required. What is not known
/// is left empty; mistakes that need it are then not tested. "Joint" is an index into
/// `jointMatrices`.
struct PoseInput {
  std::span<const JointMatrix> jointMatrices = {};  ///< those that the mesh is skinned with
  /// 3 vertex indices per triangle. Without them, vertices that are near each other count as
  /// connected.
  std::span<const std::uint32_t> triangles = {};
  std::span<const JointMatrix> inverseBindMatrices = {};  ///< one for each joint
  std::span<const std::string_view> jointNames = {};      ///< one for each joint
  /// The node of each joint: an index into `parents` and `localTransforms`. If empty, joint j is
  /// node j, and there may be further nodes.
  std::span<const std::uint32_t> jointNodes = {};
  /// The parent of each node. A root has one that does not exist, such as 0xffffffff. Pass the
  /// nodes above the skeleton, too: they have the root transform.
  std::span<const std::uint32_t> parents = {};
  /// The transform of each node relative to its parent, from which the engine computed
  /// `jointMatrices`. Most mistakes are certain only with them.
  std::span<const JointMatrix> localTransforms = {};
};

/// What `diagnose` found.
struct Diagnosis {
  PoseMistake mistake = PoseMistake::none;
  /// Names the mistake, and the line of code that mends it. Empty if the pose is plausible.
  std::string message;
  /// How far the pose is from a plausible one: the mean of |log(length ÷ length in bind pose)| of
  /// edges between joints, without the scale of the whole model.
  double stretch = 0;
  /// The same after the mistake is mended.
  double mendedStretch = 0;
  /// Mistakes that were not tested, and what to pass: "joints off by one: pass PoseInput::parents
  /// and inverseBindMatrices".
  std::vector<std::pair<PoseMistake, std::string>> notTested;

  /// Whether nothing was found.
  bool plausible() const { return mistake == PoseMistake::none; }
};

/// A short name of the mistake, for reports: "inverse bind matrix missing".
DERMIS_VERIFY_API const char* poseMistakeName(PoseMistake mistake);

/// Finds out whether a pose is plausible for a mesh, and if not, which mistake explains it.
///
/// - If the skeleton is known with its local transforms, the right joint matrices are computed from
///   it. If those of the input differ, the mistake that makes them equal is named.
/// - Otherwise, and if the local transforms may be wrong themselves, each mistake is undone, and
///   then the result is measured: how edges are stretched, how far joints are from where their
///   parents take them, and how far the pose is from the bind pose.
/// - Mistakes that move the whole model (root transform, its scale) are found only by the first.
/// - Morph targets and the method have no effect. A sample of the edges is measured: it takes some
///   milliseconds for each mesh.
///
/// Fails with `invalidMesh` if `pack` refuses the mesh for this number of joints, and with
/// `invalidArgument` if there are no joint matrices, if a span does not have the size that is
/// stated above, if a triangle names a vertex or a joint a node that does not exist, or if the
/// parents form a cycle.
DERMIS_VERIFY_API Result<Diagnosis> diagnose(const MeshView& mesh, const PoseInput& input);

}  // namespace dermis
