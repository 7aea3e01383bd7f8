// Rigs: joints and morph weights that follow from the joints of a pose, once a pose, while skinning
// stays as it is. Twist joints, corrective shapes, bending chains, and joints that are linear in
// weights.
//
//     Result<PackedRig> rig = packRig(view);                        // at import
//     RigHandle handle = *scene.addRig(std::move(*rig));            // for any number of poses
//     PoseHandle pose = *scene.addPose(24, {.rig = handle});        // 24 written joints
//
// docs/rigs.md has the formulas.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include "dermis/mesh.h"
#include "dermis/result.h"

namespace dermis {

// ---- Input. A view owns nothing: the caller's memory must stay valid during the call.
//
// A rig has written joints, whose matrices an engine or clips give, then driven joints, whose
// matrices its drivers compute. Meshes have both, numbered in this order. A joint that no driver
// computes is not allowed after the written ones.
//
// It also has weights: first those that are given with a pose, then those that correctives compute.
// Linear drivers read them, and they can be the weights of morph targets
// (`InstanceDescription::drivenTargets`).

/// A joint of a rig.
struct RigJoint {
  /// The joint above it. The matrix of a driven joint is computed relative to that of its parent.
  /// Without one it is relative to the space of the pose.
  std::uint32_t parent = noIndex;
  /// The joint's global transform in bind pose: the inverse of its inverse bind matrix.
  JointMatrix bind = {};
};

/// A joint that takes a share of the twist of another one, for example of the hand along the
/// forearm.
///
/// Of the rotation of `source` relative to its parent and to its bind pose, the twist is the part
/// about `axis`: the rotation is a swing, about an axis perpendicular to it, after the twist. The
/// angle is from -180 to 180 degrees. It is continuous inside this range while the swing stays
/// below 180 degrees.
struct TwistDriver {
  std::uint32_t joint = 0;   ///< driven
  std::uint32_t source = 0;  ///< a joint with or without a parent
  /// In the axes of `source`; of any length but 0. In bind pose the driven joint turns about the
  /// line through its origin with this direction.
  std::array<float, 3> axis{1, 0, 0};
  float share = 0.5f;  ///< from -1 to 1
};

/// How a driven joint is moved from its bind pose, in its own axes: scaled, rotated, translated.
struct JointOffset {
  std::array<float, 3> translation{0, 0, 0};
  std::array<float, 4> rotation{0, 0, 0, 1};  ///< a quaternion x, y, z, w; of any length but 0
  std::array<float, 3> scale{1, 1, 1};
};

/// Pose space deformation (Lewis et al. 2000): weights and joint offsets that are given for example
/// poses of some joints, and interpolated between them by radial basis functions. They are those of
/// an example in its pose.
///
/// The distance of two poses is the root of the sum of squares, over the input joints, of 2 sin
/// (angle / 2), where the angle is that between the rotations. It is about the angle in radians, if
/// that is small.
struct CorrectiveDriver {
  std::span<const std::uint32_t> inputs = {};  ///< joints, at least one
  /// For each example, for each input: the rotation relative to the parent and to the bind pose, a
  /// quaternion x, y, z, w of any length but 0. From 1 to `maxRigExamples` examples.
  std::span<const std::array<float, 4>> examples = {};
  /// Above 0: Gaussian functions exp(-distance² / (2 radius²)), which are 0 far from all examples.
  /// 0: linear functions, the distance itself.
  float radius = 0.5f;
  std::uint32_t firstWeight = 0;  ///< its weights are consecutive
  std::uint32_t weightCount = 0;
  std::span<const float> weights = {};         ///< for each example: `weightCount` of them
  std::span<const std::uint32_t> joints = {};  ///< driven
  std::span<const JointOffset> offsets = {};   ///< for each example: one for each of `joints`
};

/// Joints that follow a curve through a chain of joints, so that what they move bends smoothly
/// (Yang et al. 2006; Forstmann and Ohya 2006). The curve passes through the joints. At the ends of
/// the chain it has the directions and the twists of the joints there; at the others the means of
/// those of the joint and of the one before it. Twist and scale are spread along it.
///
/// The chain is divided into `segments` of equal length in bind pose, measured along the straight
/// lines between its joints. There is a driven joint at each end of a segment but the ends of the
/// chain: `segments` - 1 of them, consecutive.
struct ChainDriver {
  std::span<const std::uint32_t> joints = {};  ///< at least two, from one end to the other
  std::uint32_t firstDriven = 0;
  std::uint32_t segments = 0;  ///< at least 2
};

/// A joint whose matrix is linear in weights: that of its parent × (1 + Σ weight × matrix). In this
/// form compressed skinning plays (Kavan et al. 2024).
struct LinearDriver {
  std::uint32_t joint = 0;                      ///< driven
  std::span<const std::uint32_t> weights = {};  ///< numbers of weights
  std::span<const JointMatrix> matrices = {};   ///< one for each
};

/// A rig. Every driven joint, and every weight after the given ones, has exactly one driver.
struct RigView {
  std::span<const RigJoint> joints = {};
  std::uint32_t writtenJoints = 0;  ///< at least 1; the others are driven
  std::uint32_t givenWeights = 0;   ///< the first weights
  std::uint32_t drivenWeights = 0;  ///< the others
  /// For figures: the node of the skeleton whose morph weights are the given ones.
  std::uint32_t weightsOf = noIndex;
  std::span<const TwistDriver> twists = {};
  std::span<const CorrectiveDriver> correctives = {};
  std::span<const ChainDriver> chains = {};
  std::span<const LinearDriver> linears = {};
};

inline constexpr std::uint32_t maxRigExamples = 64;  ///< of a corrective

// ---- The packed rig.

/// A rig as a blob of little-endian 32-bit words, which it owns. The blob is relocatable and has a
/// version number, so it can be stored with the assets. A moved-from one may only be destroyed or
/// assigned to.
class DERMIS_CORE_API PackedRig {
 public:
  /// Makes a rig from stored bytes, which it copies. O(bytes): it checks the length, the version,
  /// the checksum, every index and every number, so that no stored blob can make a reader leave it.
  /// Fails with `invalidData` or `unsupportedVersion`.
  static Result<PackedRig> fromBytes(std::span<const std::byte> bytes);

  /// The blob.
  std::span<const std::byte> bytes() const { return std::as_bytes(std::span(words_)); }

  std::uint32_t writtenJoints() const;  ///< `RigView::writtenJoints`
  std::uint32_t drivenJoints() const;   ///< the joints after them
  std::uint32_t givenWeights() const;   ///< `RigView::givenWeights`
  std::uint32_t drivenWeights() const;  ///< `RigView::drivenWeights`
  std::uint32_t weightsOf() const;      ///< `RigView::weightsOf`
  /// Whether driven joints are rigid whenever the written ones are: up to rounding they have no
  /// scale and no shear.
  bool isRigid() const;
  /// By how much a corrective misses the values of an example at most: weights, and numbers of
  /// joint offsets.
  float residual() const;

 private:
  friend DERMIS_CORE_API Result<PackedRig> packRig(const RigView& rig);
  friend struct RigBlob;
  PackedRig() = default;
  std::vector<std::uint32_t> words_;
};

/// Packs a rig. Drivers may be in any order: those that read joints or weights of others are
/// computed after them. The functions of correctives are solved by LDLᵀ decomposition in double
/// precision. For import: O(joints + examples³).
///
/// Fails with `invalidArgument`, and names the driver and the joint, if
/// - a number is not finite, a direction or a rotation is 0, an index or a size does not fit;
/// - parents form a cycle, or drivers read each other in a cycle;
/// - a bind matrix that a driver reads has no inverse;
/// - a driven joint or weight has no driver, or two, or a driver drives a written joint;
/// - two examples of a corrective are the same, or so near that its values are missed by more than
///   1e-5 of the largest;
/// - two joints of a chain that follow each other are at one place in bind pose, or the chain turns
///   back by 180 degrees at a joint;
/// and with `limitExceeded` for more than `maxPoseJoints` joints, or `maxRigExamples` examples.
DERMIS_CORE_API Result<PackedRig> packRig(const RigView& rig);

/// Computes what a rig drives: `drivenJoints()` matrices, and all weights, the given ones first.
/// The same bits on every processor. Any thread. Where the matrix of a joint that a driver reads is
/// singular or not finite, the result is unspecified or not finite. Fails with `invalidArgument`,
/// and writes nothing, if a span does not have the size that the rig says.
DERMIS_CORE_API Result<void> evaluateRig(const PackedRig& rig, std::span<const JointMatrix> written,
                                         std::span<const float> givenWeights,
                                         std::span<JointMatrix> driven, std::span<float> weights);

/// A copy of a mesh whose vertices follow a chain: what its joints move is divided between the two
/// ends of the segment to which a vertex is nearest in bind pose, in proportion; a share of less
/// than 1/10,000 goes to the other end. Weights of other joints stay. `joints` are those of the
/// rig. Driven joints are already in the numbering of the mesh, which need not use them.
///
/// O(vertices × joints of the chain). Fails with `invalidMesh` as `repair` does, and with
/// `invalidArgument` as `packRig` does for the chain.
DERMIS_CORE_API Result<RepairedMesh> bendChain(const MeshView& mesh,
                                               std::span<const RigJoint> joints,
                                               const ChainDriver& chain);

}  // namespace dermis
