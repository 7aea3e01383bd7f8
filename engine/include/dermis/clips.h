// Animations: a skeleton and its clips are packed into a bank once, at import. Poses are sampled
// from the bank: of one clip, or blended from several.
//
//     gltf::load -> gltf::skeleton, gltf::clips -> packClips -> PackedClips -> samplePose
//
// A bank is small (a key of a rotation takes at most 8 bytes, and keys are as far apart as the
// permitted error allows), and each of its poses has a stated error.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "dermis/mesh.h"
#include "dermis/result.h"

namespace dermis {

// ---- What is packed.

/// An affine transform as a row-major 3×4 matrix in double precision: `[row][column]`, column 3 is
/// the translation.
using Transform = std::array<std::array<double, 4>, 3>;

/// A node of a skeleton: its local transform at rest, relative to its parent.
struct SkeletonNode {
  std::string_view name = {};      ///< for messages
  std::uint32_t parent = noIndex;  ///< index of a node; that of a root does not exist
  std::array<double, 3> translation{0, 0, 0};
  std::array<double, 4> rotation{0, 0, 0, 1};  ///< x, y, z, w; not all 0
  std::array<double, 3> scale{1, 1, 1};
  /// Replaces the three members above. No clip may animate such a node, except its weights.
  std::optional<Transform> matrix = {};
  /// Morph weights at rest, one for each morph target of the node's mesh. They are finite, and
  /// remain the caller's.
  std::span<const float> weights = {};
};

/// The joints of a skin, as a pose has them.
struct SkeletonSkin {
  std::string_view name = {};                     ///< for messages
  std::span<const std::uint32_t> joints = {};     ///< indices of nodes
  std::span<const JointMatrix> inverseBind = {};  ///< one for each joint
};

/// Nodes in any order, and the skins that hang on them. Names, joints and inverse bind matrices
/// remain the caller's.
struct Skeleton {
  std::vector<SkeletonNode> nodes;
  std::vector<SkeletonSkin> skins;
};

/// How values between keys are computed, as in glTF 2.0.
enum class Interpolation : std::uint8_t { step = 0, linear = 1, cubicSpline = 2 };
/// The property that a channel animates.
enum class ChannelPath : std::uint8_t { translation = 0, rotation = 1, scale = 2, weights = 3 };

/// One animated property of one node, as in glTF 2.0: LINEAR rotations by slerp along the shorter
/// arc, the tangents of CUBICSPLINE scaled by the distance of the keys, rotations normalized after
/// the interpolation, times before the first key and after the last clamped to them.
struct ChannelView {
  std::uint32_t node = 0;
  ChannelPath path = ChannelPath::translation;
  Interpolation interpolation = Interpolation::linear;
  /// Seconds, finite, not descending, at least one. If two are equal, the value jumps there.
  std::span<const float> times = {};
  /// 3 finite values for each key, or 4 for rotations: x, y, z, w, of any length but 0; for weights
  /// as many as the node has. For `cubicSpline` three times as many: in-tangent, value,
  /// out-tangent.
  std::span<const float> values = {};
};

/// A clip.
struct ClipView {
  std::string_view name = {};              ///< for messages
  double duration = 0;                     ///< seconds, finite, at least 0
  std::vector<ChannelView> channels = {};  ///< at most one for a node and a path
  /// Whether its time wraps: after `duration` comes 0. Otherwise it is clamped.
  bool wraps = true;
  /// Whether it is added to what other clips make. What is added are its differences from the pose
  /// of another clip at one time, or from the rest pose. Differences of scales are ratios, and 1
  /// where the divisor is 0.
  bool additive = false;
  std::uint32_t baseClip = noIndex;  ///< of `additive`; if there is none, the rest pose
  double baseTime = 0;               ///< seconds, clamped, of `baseClip`
};

/// Which node carries a figure over the ground, and which direction is up.
///
/// The motion M(t) of a clip is a turn by h(t) about the up axis, followed by a shift p(t) over the
/// ground, both in the space of the skeleton's roots. They follow from the global transform G(t) of
/// the node:
/// - The rotation of G(t) relative to that of G(0) is a tilt about an axis on the ground, followed
///   by a turn about the up axis: by h(t). It is continuous, so it counts whole turns. While the
///   node is tilted by 180 degrees there is no such turn.
/// - p(t) = g(t) − g(0) turned by h(t), with g(t) the origin of the node, projected to the ground.
///
/// So M(0) is the identity. The packed clip has M(t)⁻¹ G(t): the node stays above one place, with
/// its height and tilt. M(t) × the pose of the packed clip is the pose of the source, for the node
/// and what is below it, within `PackClipsOptions::maxError`. Other nodes keep their animation.
struct RootMotionOptions {
  std::uint32_t node = 0;    ///< of the skeleton
  std::uint32_t upAxis = 1;  ///< 0: x, 1: y, 2: z
};

/// How clips are packed.
struct PackClipsOptions {
  /// How far a point that a joint moves may be from where the clips have it, in the units of the
  /// skeleton. The point is as far from the joint as anything that the joint moves. 0: 1/10,000 of
  /// the extent of the skeleton at rest.
  double maxError = 0;
  /// The meshes of each skin, in the order of the skins. They tell how far from its joints a skin
  /// reaches. If empty, a joint reaches as far as its farthest child, or if it has none as far as
  /// its parent is.
  std::span<const JointBounds* const> meshes = {};
  /// Masks, at most 31: a factor from 0 to 1 for each node of the skeleton. One below 2^-60 counts
  /// as 0. Layers name them by their number in this list, from 1 on.
  std::span<const std::span<const float>> masks = {};
  /// How far a morph weight may be from that of the clips. 0: 1/1000.
  double maxWeightError = 0;
  /// If there is one, the motion of this node over the ground is taken out of all clips that are
  /// not additive, and stored beside them (`dermis::rootMotion`). What additive clips add is the
  /// same as without it.
  std::optional<RootMotionOptions> rootMotion = {};
};

/// What `packClips` made.
struct PackClipsReport {
  std::uint64_t byteCount = 0;
  std::uint64_t keyCount = 0;        ///< of all tracks; one track has up to three morph weights
  std::uint32_t animatedTracks = 0;  ///< tracks with keys
  std::uint32_t constantTracks = 0;  ///< tracks with one value
  /// Keys a second of the tracks with keys: the lowest and the highest rate that was chosen.
  double slowestRate = 0, fastestRate = 0;
  double maxError = 0;  ///< that was asked for
  /// The largest error found, of whole poses: at 8 times in each interval of a clip's finest track,
  /// but at most at 32,768 times in a clip, and at 33 near the worst of them. Rounding of
  /// `samplePose` to float32 is not included.
  double worstError = 0;
  std::string worst;  ///< where: "clip 2 'walk', node 5 'hand', at 0.31 s"
};

// ---- The bank.

/// What is known of a packed clip.
struct ClipInfo {
  float duration = 0;  ///< seconds
  bool wraps = false;
  bool additive = false;
};

/// How far the bank's local transform of a node, and its morph weights, may be from those of its
/// clips at any time at which no jump is rounded; for additive clips, their difference. Between
/// keys it is bounded by the curvature of the source, except for splines of rotations, which are
/// measured.
struct ClipError {
  float translation = 0;  ///< distance
  float rotation = 0;     ///< angle in radians
  float scale = 0;        ///< of each factor
  float weight = 0;       ///< of each morph weight
};

/// A bank: a skeleton with its skins and clips, as a blob of little-endian 32-bit words, which it
/// owns. Clips, skins and masks keep their numbers. The blob is relocatable and has a version
/// number, so it can be stored with the assets. A moved-from one may only be destroyed or assigned
/// to.
class DERMIS_CORE_API PackedClips {
 public:
  /// Makes a bank from stored bytes, which it copies. O(bytes): it checks the length, the version,
  /// the checksum, every index and every number, so that no stored blob can make a reader leave it.
  /// Fails with `invalidData` or `unsupportedVersion`.
  static Result<PackedClips> fromBytes(std::span<const std::byte> bytes);

  /// The blob.
  std::span<const std::byte> bytes() const { return std::as_bytes(std::span(words_)); }

  std::uint32_t nodeCount() const;  ///< nodes that clips move; the others are folded into them
  std::uint32_t skinCount() const;  ///< as packed
  std::uint32_t clipCount() const;  ///< as packed
  std::uint32_t maskCount() const;  ///< as packed
  /// The number of joints of a skin, which are those of its pose. 0 if there is no such skin.
  std::uint32_t jointCount(std::uint32_t skin) const;
  /// What is known of a clip. If there is none with this number, a clip of duration 0.
  ClipInfo clip(std::uint32_t clip) const;
  /// The nodes of the skeleton with morph weights, in ascending order.
  std::vector<std::uint32_t> morphedNodes() const;
  /// The number of morph weights of a node of the skeleton, as packed. 0 if there is none.
  std::uint32_t weightCount(std::uint32_t node) const;
  /// The error of a node of the skeleton. 0 where no clip moves it, and if there is none. The
  /// rotation of the node of `rootMotion` is measured in part.
  ClipError error(std::uint32_t node) const;
  bool hasRootMotion() const;  ///< whether the clips were packed with `rootMotion`
  /// The error of the motion of a clip from its beginning: of the node's place on the ground, and
  /// of its heading. Measured in part.
  ClipError rootMotionError() const;

 private:
  friend DERMIS_CORE_API Result<PackedClips> packClips(const Skeleton& skeleton,
                                                       std::span<const ClipView> clips,
                                                       const PackClipsOptions& options,
                                                       PackClipsReport* report);
  friend struct ClipBank;
  PackedClips() = default;
  std::vector<std::uint32_t> words_;
};

inline constexpr std::uint32_t maxClips = 1024;  ///< of a bank
inline constexpr std::uint32_t maxMasks = 31;    ///< of a bank

/// Packs a skeleton and its clips.
///
/// - Keys are at equal distances, which differ from track to track: a rate of the clip, divided by
///   a power of two. Rate and precision are the smallest that keep `maxError`.
/// - Between two keys rotations are interpolated linearly and normalized, the others linearly.
/// - A jump stays one: the interval that has it keeps the value before the jump until then, and the
///   value of the next key from then on. Its time is rounded, by at most 1.5/256 of the interval.
/// - A clip that wraps has no seam that its channels do not have.
/// - Nodes that no clip moves are folded into what hangs on them, in double precision.
///
/// `report` may be null; it is written on success. O(keys × rates): for import, not for loading.
/// Fails with
/// - `invalidArgument` if a number is not finite, an index or a size does not fit, parents form a
///   cycle, a rotation is 0, a node with a matrix is animated, two channels have one node and path,
///   times descend, weights of a node without any are animated, a clip is its own base or its base
///   is additive, an option is out of range, there are no skins, or one has no joints, or clips
///   move a node above that of `rootMotion`, or the global transform at rest of its parent is not
///   made of translation, rotation and uniform scale;
/// - `limitExceeded` if there are more than `maxClips` or `maxMasks`, a skin has more than
///   `maxPoseJoints` joints, a number leaves the range of float32, keys take more memory than 64
///   MiB and 64 times that of the source, or the error cannot be kept: the message names the clip
///   and the node.
DERMIS_CORE_API Result<PackedClips> packClips(const Skeleton& skeleton,
                                              std::span<const ClipView> clips,
                                              const PackClipsOptions& options = {},
                                              PackClipsReport* report = nullptr);

// ---- Sampling.

/// What takes part in a pose.
struct ClipLayer {
  std::uint32_t clip = 0;  ///< number in the bank
  double time = 0;         ///< seconds
  float weight = 1;        ///< finite; not negative, unless the clip is additive
  std::uint32_t mask = 0;  ///< number of a mask of the bank; 0: none
  bool hold = false;       ///< clamps the time at both ends, although the clip wraps
};

inline constexpr std::size_t maxClipLayers = 4;  ///< of a pose

/// The time of a layer inside its clip, as it is sampled: wrapped or clamped in double precision,
/// then rounded to float32.
DERMIS_CORE_API float clipTime(const ClipInfo& clip, double seconds, bool hold = false);

/// Samples the pose of a skin. The same bits on every processor.
///
/// Layers that are not additive are blended: each node gets Σ w m x / Σ w m of their local
/// translations, rotations and scales x, with the weights w rounded to float16 and the factors m of
/// the masks. Rotations are brought into the hemisphere of the first layer with w m > 0, and
/// normalized. Where the sum is 0, and if there are no layers, the node rests. Additive layers
/// follow in their order:
///
///     q <- q · normalize(lerp(1, d, w m)), where d is the difference, negated if its w is negative
///     t <- t + w m · difference
///     s <- s · (1 + w m (ratio − 1))
///
/// O(nodes × layers). Any thread. Fails with `invalidArgument`, and writes nothing, if there are
/// more than `maxClipLayers`, a clip, mask or skin does not exist, a time or weight is not finite,
/// a weight is too large for float16 or negative where it may not be, or `pose` does not have
/// `jointCount(skin)` elements. The message names the layer.
DERMIS_CORE_API Result<void> samplePose(const PackedClips& bank, std::span<const ClipLayer> layers,
                                        std::uint32_t skin, std::span<JointMatrix> pose);

/// Samples the morph weights of a node of the skeleton, blended as `samplePose` blends its
/// translation: the mean Σ w m x / Σ w m, where the sum is 0 the weights at rest, and then
/// x <- x + w m · difference for each additive layer. The same bits on every processor.
///
/// O(weights × layers). Any thread. Fails, and writes nothing, as `samplePose` does, and if
/// `weights` does not have `weightCount(node)` elements.
DERMIS_CORE_API Result<void> sampleWeights(const PackedClips& bank,
                                           std::span<const ClipLayer> layers, std::uint32_t node,
                                           std::span<float> weights);

/// A motion over the ground: of a figure, in its own frame before the motion.
struct RootMotion {
  std::array<double, 3> displacement{};  ///< its component along the up axis is 0
  double turn = 0;                       ///< radians about the up axis
};

/// The motion that was taken out of a clip from one time to another: M(from)⁻¹ M(to), with the M of
/// `RootMotionOptions`. An engine moves and turns its figure by it in each frame; with the global
/// transform F of the figure, F <- F × translation(displacement) × rotation(turn).
///
/// If the clip wraps, times are not wrapped: each loop begins where the one before ended, and times
/// may be negative. Otherwise, and with `hold`, they are clamped. `to` may be before `from`. Zero
/// for additive clips, and for banks without root motion.
///
/// O(log loops). Any thread. In double precision, from keys in float32. Fails with
/// `invalidArgument` if the clip does not exist, or a time is not finite or 2^52 loops away.
DERMIS_CORE_API Result<RootMotion> rootMotion(const PackedClips& bank, std::uint32_t clip,
                                              double fromSeconds, double toSeconds,
                                              bool hold = false);

// ---- Boxes for culling, computed once, for a mesh that clips move. docs/bounds.md has the proof.

/// A box that contains every position that `skinnedBounds` would find for a mesh, in every pose
/// that `samplePose` makes of one clip alone: at any time, without a mask, and with a weight that
/// is above 0 as float16. If the clip is additive, it is added to the rest pose with the weight 1.
///
/// `mesh` is what `jointBounds` returned for a mesh of this skin; method and promise are those of
/// `skinnedBounds`. The box is in the space of the pose. It is infinite if that of `skinnedBounds`
/// is, thus for methods without a proof.
///
/// The time of the clip is split until the box is on no side more than 1/100 of its longest side
/// larger than what `skinnedBounds` finds at single times, or until there are 4 pieces for each of
/// the clip's finest intervals, but at least 256 and at most 4,096.
/// O(pieces × (nodes + keys of a piece + pairs × depth + trios × depth)). Any thread.
///
/// Fails with `invalidArgument` if the clip or the skin does not exist, or if the mesh requires
/// more joints than the skin has.
DERMIS_CORE_API Result<Box> clipBounds(const PackedClips& bank, std::uint32_t clip,
                                       std::uint32_t skin, const JointBounds& mesh, Method method,
                                       JointPromise promise = JointPromise::scaling);

/// A box that contains every position of a mesh in every pose that `samplePose` makes of these
/// clips: of any layers of them, with any times, weights and masks. The rest pose is one of them.
///
/// Each node may have any mean of what the clips and the rest pose give it. If its rotations are
/// more than 90° from their middle, it may have any rotation: the mesh below is in a ball. So the
/// box is larger than that of all clips played alone, and much larger if they turn a node far.
///
/// Arguments, and the infinite box, as for `clipBounds`. O(keys + nodes + pairs × depth). Any
/// thread. Fails with `invalidArgument` as `clipBounds` does, and if a clip is additive.
DERMIS_CORE_API Result<Box> blendBounds(const PackedClips& bank,
                                        std::span<const std::uint32_t> clips, std::uint32_t skin,
                                        const JointBounds& mesh, Method method,
                                        JointPromise promise = JointPromise::scaling);

}  // namespace dermis
