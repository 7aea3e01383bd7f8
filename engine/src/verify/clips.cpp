#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <numbers>
#include <optional>
#include <span>
#include <string>
#include <utility>
#include <vector>

#include <glm/ext/quaternion_common.hpp>
#include <glm/ext/quaternion_double.hpp>
#include <glm/ext/quaternion_geometric.hpp>
#include <glm/geometric.hpp>
#include <glm/gtc/quaternion.hpp>
#include <glm/mat3x3.hpp>
#include <glm/mat4x4.hpp>
#include <glm/matrix.hpp>
#include <glm/vec3.hpp>
#include <glm/vec4.hpp>

#include "core/clips/errors.h"
#include "dermis/clips.h"
#include "dermis/verify.h"
#include "strict_floating_point.h"
#include "verify/joint.h"
#include "verify/pose_skeleton.h"

namespace dermis::reference {
namespace {

using diagnosis::noJoint;
using glm::dmat3;
using glm::dmat4;
using glm::dquat;
using glm::dvec3;
using glm::dvec4;

constexpr double u = 0x1p-24;          // half the distance from 1 to the next number of float32
constexpr double denormal = 0x1p-126;  ///< a GPU may flush smaller numbers to 0
constexpr double mostSize = 0x1p126;   ///< larger numbers may overflow
/// Of a vector or a matrix that is computed from a few others: 64 numbers are flushed.
constexpr double flushedMatrix = 64 * denormal;
/// Of a vector between keys: its three steps, which are multiplied by less than 2^21, and others.
constexpr double flushedVector = 0x1p22 * denormal;

// ---- The local transforms of nodes as clips have them.

/// A clip with its channels by node.
class Clip {
 public:
  explicit Clip(const ClipView& view) : view_(&view) {
    for (const ChannelView& channel : view.channels) channels_.push_back(&channel);
    std::ranges::stable_sort(channels_, {}, &ChannelView::node);
  }

  const ClipView* operator->() const { return view_; }
  std::span<const ChannelView* const> channelsOf(std::uint32_t node) const {
    return {std::ranges::lower_bound(channels_, node, {}, &ChannelView::node),
            std::ranges::upper_bound(channels_, node, {}, &ChannelView::node)};
  }

 private:
  const ClipView* view_;
  std::vector<const ChannelView*> channels_;
};

/// The local transform of a node. The rotation is a unit quaternion.
struct Local {
  dvec3 translation{0};
  dquat rotation{1, 0, 0, 0};  // w first
  dvec3 scale{1};
};

dquat toRotation(const dvec4& value) {
  return glm::normalize(dquat(value.w, value.x, value.y, value.z));
}

enum class Part : std::size_t { inTangent = 0, value = 1, outTangent = 2 };

/// The number of a key that is `place` numbers behind the first.
double numberOf(const ChannelView& channel, std::size_t width, std::size_t key, Part part,
                std::size_t place) {
  if (channel.interpolation == Interpolation::cubicSpline)
    key = 3 * key + static_cast<std::size_t>(part);
  return double{channel.values[key * width + place]};
}

/// glTF 2.0, appendix C. `keyOf` gets a key and its part, `linear` two values and a fraction.
template <typename KeyOf, typename Linear>
auto interpolated(const ChannelView& channel, double time, KeyOf keyOf, Linear linear) {
  // The first key after the time. If a time has several keys, the last of them counts from then on.
  const auto after = std::upper_bound(channel.times.begin(), channel.times.end(), time,
                                      [](double at, float key) { return at < double{key}; });
  const auto next = static_cast<std::size_t>(after - channel.times.begin());
  if (next == 0) return keyOf(0, Part::value);
  const auto from = keyOf(next - 1, Part::value);
  if (next == channel.times.size() || channel.interpolation == Interpolation::step) return from;

  const auto to = keyOf(next, Part::value);
  const double start = double{channel.times[next - 1]};
  const double distance = double{channel.times[next]} - start;
  const double s = (time - start) / distance;
  if (channel.interpolation == Interpolation::cubicSpline) {
    const double s2 = s * s, s3 = s2 * s;
    return (2 * s3 - 3 * s2 + 1) * from + (3 * s2 - 2 * s3) * to +
           distance * (s3 - 2 * s2 + s) * keyOf(next - 1, Part::outTangent) +
           distance * (s3 - s2) * keyOf(next, Part::inTangent);
  }
  return linear(from, to, s);
}

dvec4 valueAt(const ChannelView& channel, double time) {
  const bool isRotation = channel.path == ChannelPath::rotation;
  const auto keyOf = [&](std::size_t key, Part part) {
    dvec4 result(0.0);
    for (std::size_t i = 0; i < (isRotation ? 4u : 3u); ++i)
      result[static_cast<glm::length_t>(i)] = numberOf(channel, isRotation ? 4 : 3, key, part, i);
    return result;
  };
  return interpolated(channel, time, keyOf, [&](const dvec4& from, const dvec4& to, double s) {
    if (!isRotation) return (1 - s) * from + s * to;
    const dquat q = glm::slerp(toRotation(from), toRotation(to), s);  // along the shorter arc
    return dvec4(q.x, q.y, q.z, q.w);
  });
}

/// The morph weight `number` of a node in a clip.
double weightAt(const Skeleton& skeleton, std::uint32_t node, std::size_t number, const Clip& clip,
                double time) {
  const std::span<const float> rest = skeleton.nodes[node].weights;
  for (const ChannelView* const channel : clip.channelsOf(node)) {
    if (channel->path != ChannelPath::weights) continue;
    return interpolated(
        *channel, time,
        [&](std::size_t key, Part part) {
          return numberOf(*channel, rest.size(), key, part, number);
        },
        [](double from, double to, double s) { return (1 - s) * from + s * to; });
  }
  return double{rest[number]};
}

Local restOf(const SkeletonNode& node) {
  const auto& [x, y, z, w] = node.rotation;
  return {{node.translation[0], node.translation[1], node.translation[2]},
          toRotation({x, y, z, w}),
          {node.scale[0], node.scale[1], node.scale[2]}};
}

/// The local transform that a clip gives a node of the skeleton.
Local localAt(const Skeleton& skeleton, std::uint32_t node, const Clip& clip, double time) {
  Local local = restOf(skeleton.nodes[node]);
  for (const ChannelView* const channel : clip.channelsOf(node)) {
    if (channel->path == ChannelPath::weights) continue;
    const dvec4 found = valueAt(*channel, time);
    if (channel->path == ChannelPath::translation) local.translation = dvec3(found);
    if (channel->path == ChannelPath::rotation) local.rotation = toRotation(found);
    if (channel->path == ChannelPath::scale) local.scale = dvec3(found);
  }
  return local;
}

/// What an additive clip adds to `base` to get `local`: base⁻¹ · rotation with w ≥ 0, translation −
/// base, scale ÷ base. A scale of 0 in the base gives the ratio 1.
Local differenceOf(const Local& local, const Local& base) {
  Local result{local.translation - base.translation, glm::conjugate(base.rotation) * local.rotation,
               dvec3(1.0)};
  if (result.rotation.w < 0) result.rotation = -result.rotation;
  for (glm::length_t i = 0; i < 3; ++i)
    if (base.scale[i] != 0) result.scale[i] = local.scale[i] / base.scale[i];
  return result;
}

// ---- Root motion.

template <typename Rows>  // of a Transform or a JointMatrix
dmat4 toMatrix(const Rows& rows) {
  dmat4 result(1.0);
  for (glm::length_t row = 0; row < 3; ++row)
    for (glm::length_t column = 0; column < 4; ++column)
      result[column][row] =
          double{rows[static_cast<std::size_t>(row)][static_cast<std::size_t>(column)]};
  return result;
}

/// The node whose motion is taken out. Its parent stays at rest.
struct Carrier {
  const Skeleton& skeleton;
  std::uint32_t node;
  glm::length_t up;
  dmat4 above{1.0};          ///< the global transform of the parent
  dquat turned{1, 0, 0, 0};  ///< its rotation

  Carrier(const Skeleton& of, const RootMotionOptions& options)
      : skeleton(of), node(options.node), up(static_cast<glm::length_t>(options.upAxis)) {
    std::uint32_t next = skeleton.nodes[node].parent;
    for (; next < skeleton.nodes.size(); next = skeleton.nodes[next].parent)
      above = restMatrix(skeleton.nodes[next]) * above;
    turned =
        glm::normalize(glm::quat_cast(dmat3(above) / std::cbrt(glm::determinant(dmat3(above)))));
  }

  static dmat4 restMatrix(const SkeletonNode& node) {
    if (node.matrix) return toMatrix(*node.matrix);
    const Local rest = restOf(node);
    dmat4 matrix(glm::mat3_cast(rest.rotation));
    for (glm::length_t i = 0; i < 3; ++i) matrix[i] *= rest.scale[i];
    matrix[3] = {rest.translation, 1};
    return matrix;
  }

  /// From −2π to 2π: the turn about the up axis of the rotation since the beginning.
  double heading(const Clip& clip, double time) const {
    const dquat start = localAt(skeleton, node, clip, 0).rotation;
    const dquat now = localAt(skeleton, node, clip, time).rotation;
    const dquat since = turned * now * glm::conjugate(start) * glm::conjugate(turned);
    const std::array<double, 3> axis{since.x, since.y, since.z};
    return 2 * std::atan2(axis[static_cast<std::size_t>(up)], since.w);
  }
  /// The same, with whole turns: followed from the beginning.
  double wholeHeading(const Clip& clip, double time) const {
    std::vector<double> times{0, time};
    for (const ChannelView* const channel : clip.channelsOf(node)) {
      if (channel->path != ChannelPath::rotation) continue;
      for (const float key : channel->times)
        if (double{key} > 0 && double{key} < time) times.push_back(double{key});
    }
    std::sort(times.begin(), times.end());
    double whole = 0;
    constexpr int steps = 24;
    for (std::size_t i = 0; i + 1 < times.size(); ++i) {
      for (int step = 1; step <= steps; ++step) {
        const double at = times[i] + (times[i + 1] - times[i]) * step / steps;
        const double next = heading(clip, at), turn = 2 * std::numbers::pi;
        whole = next + turn * std::round((whole - next) / turn);
      }
    }
    return whole;
  }
  dvec3 ground(const Clip& clip, double time) const {
    dvec3 place(above * dvec4(localAt(skeleton, node, clip, time).translation, 1));
    place[up] = 0;
    return place;
  }
  dmat4 motion(const Clip& clip, double time) const {
    dvec3 axis(0.0);
    axis[up] = 1;
    dmat4 result(glm::mat3_cast(glm::angleAxis(heading(clip, time), axis)));
    result[3] = {ground(clip, time) - dmat3(result) * ground(clip, 0), 1};
    return result;
  }
  /// What remains.
  Local inPlace(const Clip& clip, double time) const {
    Local local = localAt(skeleton, node, clip, time);
    const dmat4 taken = motion(clip, time);
    local.translation =
        dvec3(glm::inverse(above) * glm::inverse(taken) * above * dvec4(local.translation, 1));
    local.rotation =
        glm::normalize(glm::conjugate(turned) * glm::conjugate(glm::quat_cast(dmat3(taken))) *
                       turned * local.rotation);
    return local;
  }
};

/// The time inside a clip, as `clipTime` has it.
double timeInClip(const ClipView& clip, double seconds, bool hold) {
  const double duration = double{static_cast<float>(clip.duration)};
  double time = std::min(std::max(seconds, 0.0), duration);
  if (clip.wraps && !hold && duration > 0) {
    time = std::fmod(seconds, duration);
    if (time < 0) time += duration;
  }
  return std::min(double{static_cast<float>(time)}, duration);
}

/// The nearest number of float16, the even one of two. At least 65536 in size if there is none.
double roundToHalf(double value) {
  int exponent = 0;
  std::frexp(value, &exponent);  // |value| < 2^exponent
  const int lastPlace = std::max(exponent - 11, -24);
  return std::ldexp(std::nearbyint(std::ldexp(value, -lastPlace)), lastPlace);
}

// ---- What is refused.

Error refused(std::string message) {
  return {ErrorCode::invalidArgument, std::move(message)};
}

Result<void> checkClips(const Skeleton& skeleton, std::span<const ClipView> clips) {
  for (const ClipView& clip : clips) {
    for (const ChannelView& channel : clip.channels) {
      const bool isNode = channel.node < skeleton.nodes.size();
      std::size_t width = channel.path == ChannelPath::rotation ? 4 : 3;
      if (isNode && channel.path == ChannelPath::weights)
        width = skeleton.nodes[channel.node].weights.size();
      const std::size_t parts = channel.interpolation == Interpolation::cubicSpline ? 3 : 1;
      if (!isNode || width == 0 || channel.times.empty() ||
          channel.values.size() != std::uint64_t{channel.times.size()} * width * parts) {
        return refused("clip " + std::to_string(&clip - clips.data()) + ": channel " +
                       std::to_string(&channel - clip.channels.data()) +
                       " has no keys, values of another number, or a node that does not exist");
      }
    }
  }
  return {};
}

Result<void> checkSkin(const Skeleton& skeleton, std::uint32_t skin) {
  if (skin >= skeleton.skins.size())
    return refused("skin " + std::to_string(skin) + " does not exist");
  const SkeletonSkin& checked = skeleton.skins[skin];
  if (checked.inverseBind.size() != checked.joints.size())
    return refused("a skin needs one inverse bind matrix for each joint");
  for (const std::uint32_t joint : checked.joints) {
    if (joint >= skeleton.nodes.size())
      return refused("joint " + std::to_string(joint) + " is not a node");
  }
  return {};
}

/// A layer, ready to be sampled.
struct Layer {
  Clip clip;
  std::optional<Clip> base = {};  ///< none: the rest pose
  double time = 0, baseTime = 0;  ///< inside the clips
  double weight = 0;              ///< of float16
  const float* mask = nullptr;

  double factor(std::uint32_t node) const {
    if (mask == nullptr) return weight;
    return mask[node] < 0x1p-60f ? 0 : weight * double{mask[node]};  // `PackClipsOptions::masks`
  }
};

Result<Layer> toLayer(const ClipLayer& from, std::span<const ClipView> clips,
                      std::span<const std::span<const float>> masks) {
  if (from.clip >= clips.size())
    return refused("clip " + std::to_string(from.clip) + " does not exist");
  if (from.mask > masks.size())
    return refused("mask " + std::to_string(from.mask) + " does not exist");
  if (!std::isfinite(from.time)) return refused("the time is not finite");
  if (!std::isfinite(from.weight)) return refused("the weight is not finite");
  const ClipView& clip = clips[from.clip];
  if (from.weight < 0 && !clip.additive)
    return refused("the weight is negative, but the clip is not additive");

  Layer layer{.clip = Clip(clip), .time = timeInClip(clip, from.time, from.hold)};
  layer.weight = roundToHalf(double{from.weight});
  if (std::abs(layer.weight) > 65504) return refused("the weight is too large for float16");
  if (from.mask > 0) layer.mask = masks[from.mask - 1].data();
  if (clip.additive && clip.baseClip < clips.size()) {
    layer.base.emplace(clips[clip.baseClip]);
    layer.baseTime = timeInClip(clips[clip.baseClip], clip.baseTime, true);
  }
  return layer;
}

// ---- Blending, and how far the bank's local transform may be from it.
//
// The sampled parts of the bank are off by the `ClipError` e of the node. A unit quaternion whose
// rotation is off by the angle a is off by at most a / 2. So Σ w q is off by Σ w a / 2, which turns
// it by an arc whose sine is at most that, divided by |Σ w q|; its rotation turns by twice the arc.
// lerp(1, difference, w) is such a sum in which the first part is exact. If errors decide about the
// hemisphere, the rotation may be any.
//
// float32: a weighted mean has at most 11 roundings of each part. 16 u of its parts cover them,
// also for quaternions, at 2 × 5 roundings. A product of two quaternions and the interpolation
// before it turn by at most 32 u. So do the conversion of a quaternion to a matrix, whose 9 entries
// are off by 4 u each, and the length of the quaternion, which is off by 4 u.

struct LocalError {
  double translation = 0, rotation = 0, scale = 0;
  double rounding = 0;  ///< of the 3×3 matrix of the rotation: how far it is from any rotation
};

double largestOf(const dvec3& v) {
  return std::max({std::abs(v.x), std::abs(v.y), std::abs(v.z)});
}

/// The numbers of `local` may overflow: then no error is too large.
void checkRange(const Local& local, LocalError& error) {
  if (!(glm::length(local.translation) + error.translation <= mostSize))
    error.translation = unbounded;
  if (!(largestOf(local.scale) + error.scale <= mostSize)) error.scale = unbounded;
}

/// The angle by which a sum of quaternions turns if its parts are off by `angle` together.
double turnOf(double angle, const dquat& sum, bool eitherHemisphere) {
  if (eitherHemisphere) return std::numbers::pi;
  return 2 * std::asin(std::min(1.0, angle / 2 / glm::length(sum)));
}

Local blend(const Skeleton& skeleton, std::uint32_t node, std::span<const Layer> layers,
            const ClipError& clipError, const Carrier* carrier, LocalError& error) {
  const double angle = double{clipError.rotation} + 16 * u;
  Local sum{dvec3(0.0), dquat(0, 0, 0, 0), dvec3(0.0)};
  dquat first(1, 0, 0, 0);
  double total = 0, translations = 0, scales = 0;
  bool eitherHemisphere = false;
  for (const Layer& layer : layers) {
    const double factor = layer.factor(node);
    if (layer.clip->additive || factor == 0) continue;
    const bool isCarrier = carrier != nullptr && carrier->node == node;
    const Local local = isCarrier ? carrier->inPlace(layer.clip, layer.time)
                                  : localAt(skeleton, node, layer.clip, layer.time);
    if (total == 0) first = local.rotation;
    const double cosine = glm::dot(first, local.rotation);
    eitherHemisphere |= std::abs(cosine) <= angle;
    total += factor;
    sum.translation += factor * local.translation;
    sum.rotation = sum.rotation + local.rotation * (cosine < 0 ? -factor : factor);
    sum.scale += factor * local.scale;
    translations += factor * glm::length(local.translation);
    scales += factor * largestOf(local.scale);
  }
  if (total == 0) {
    const Local rest = restOf(skeleton.nodes[node]);
    error = {16 * u * glm::length(rest.translation) + flushedMatrix, 32 * u,
             16 * u * largestOf(rest.scale) + flushedMatrix, 32 * u};
    checkRange(rest, error);
    return rest;
  }
  error.translation = double{clipError.translation} + 16 * u * translations / total + flushedVector;
  error.rotation = turnOf(total * angle, sum.rotation, eitherHemisphere) + 32 * u;
  error.scale = double{clipError.scale} + 16 * u * scales / total + flushedVector;
  error.rounding = 32 * u;
  const Local mean{sum.translation / total, glm::normalize(sum.rotation), sum.scale / total};
  checkRange(mean, error);
  return mean;
}

void add(const Skeleton& skeleton, std::uint32_t node, const Layer& layer,
         const ClipError& clipError, Local& local, LocalError& error) {
  const double factor = layer.factor(node), size = std::abs(factor);
  if (!layer.clip->additive || factor == 0) return;
  const Local base = layer.base ? localAt(skeleton, node, *layer.base, layer.baseTime)
                                : restOf(skeleton.nodes[node]);
  const Local difference = differenceOf(localAt(skeleton, node, layer.clip, layer.time), base);

  const double angle = double{clipError.rotation} + 16 * u;
  const dquat turn = dquat(1 - factor, 0, 0, 0) + difference.rotation * factor;
  error.rotation += turnOf(size * angle, turn, std::abs(difference.rotation.w) <= angle) + 32 * u;
  error.rounding += 32 * u;
  local.rotation = glm::normalize(local.rotation * glm::normalize(turn));

  local.translation += factor * difference.translation;
  error.translation +=
      size * (double{clipError.translation} + flushedVector) +
      4 * u * (glm::length(local.translation) + size * glm::length(difference.translation)) +
      denormal * glm::length(difference.translation) + flushedMatrix;

  const dvec3 growth = 1.0 + factor * (difference.scale - 1.0);
  const double growthError = size * (double{clipError.scale} + flushedVector) +
                             4 * u * (1 + size * largestOf(difference.scale - 1.0)) +
                             denormal * largestOf(difference.scale - 1.0) + flushedMatrix;
  error.scale = error.scale * largestOf(growth) +
                (largestOf(local.scale) + error.scale) * growthError + flushedMatrix;
  if (!(largestOf(growth) <= mostSize)) error.scale = unbounded;
  local.scale *= growth;
  checkRange(local, error);
}

// ---- The skeleton.
//
// M_i is the exact local transform of node i, G_i the product of those from the root to i, and ~
// marks those of the bank. x is a point in the frame of the joint n, y_i = M_i+1 … M_n x. Then
//
//     G~_n x − G_n x = Σ G~_i-1 (M~_i − M_i) y_i   without rounding, and
//     |(M~ − M) y| ≤ translation error + (rotation error · largest scale + scale error) |y|.
//
// Nothing is left out: ‖G~_i-1‖ ≤ ‖G_i-1‖ + `drift`, which is the same sum for matrices instead of
// points. |y_i| ≤ |y_i for x = 0| + ‖M_i+1 … M_n‖ |x|. All norms are spectral.
//
// float32: A B y, with 3×4 matrices, is off by 4 u (‖A‖_F ‖B‖_F |y| + ‖A‖_F |B's translation| +
// |A's translation|), and ‖·‖_F ≤ √3 ‖·‖. With P_i the product of the norms ‖M~‖ from the root to
// i, and T_i = Σ P_i-1 |translation of M~_i|, this is at most 12 u (P_i |y| + T_i). 16 u of them,
// once for each node and once for the inverse bind matrix, cover the rounding of factors as well,
// whichever nodes the bank folds into others.
//
// Denormals: each number of a matrix that is stored, read or computed on the way to node i may be
// off by 2^-126 for each of its products and sums. What is left of that matrix is a G of a node
// above i; what is right of it is y_i. If a product of sizes is too large for float32, there is no
// bound.
//
// Shape: how far the 3×3 part of G~ is from Q G, with Q the rotation that suits best. For the
// parent of i, `warp` is such a bound, F the error and G = m O + K, with O orthogonal and m between
// the singular values, so that 2 ‖K‖ = σ1 − σ3 = `spread`. Node i has M = R S and M~ = E R (S + D),
// with E a rotation by the angle a, and D the error of the scale. With P = O E Oᵀ
//
//     (Q G + F) M~ = Q P G M + Q (K (E − 1) − (P − 1) K) R S + Q G E R D + F M~,
//
// so warp ≤ spread · a · largest scale + ‖G‖ · scale error + parent's warp · ‖M~‖, and what float32
// adds. A rotation error changes no shape unless a node above is stretched.

struct PosedNode {
  dmat4 local{1.0}, global{1.0};
  double shift = 0, turn = 0;  ///< |(M~ − M) y| ≤ shift + turn |y|
  double drift = 0;            ///< ‖G~ − G‖ at most
  double warp = 0, spread = 0;
  double stretch = 1;  ///< ‖G~‖ at most
  double product = 1;  ///< P
  double span = 0;     ///< T
  double above = 1;    ///< 1, and ‖G~‖ of all nodes above at most
  bool mayOverflow = false;
};

double sumOfSizes(const dmat4& matrix) {
  double sum = 0;
  for (glm::length_t column = 0; column < 4; ++column)
    for (glm::length_t row = 0; row < 3; ++row) sum += std::abs(matrix[column][row]);
  return sum;
}

double normOf(const dmat4& matrix) {
  return singularValues(dmat3(matrix)).values[0];
}

PosedNode poseNode(const Skeleton& skeleton, std::uint32_t node, std::span<const Layer> layers,
                   const PosedNode& above, const ClipError* clipError, const Carrier* carrier) {
  PosedNode posed;
  if (skeleton.nodes[node].matrix) {
    posed.local = toMatrix(*skeleton.nodes[node].matrix);
  } else {
    const ClipError bankError = clipError != nullptr ? *clipError : ClipError{};
    LocalError error;
    Local local = blend(skeleton, node, layers, bankError, carrier, error);
    for (const Layer& layer : layers) add(skeleton, node, layer, bankError, local, error);
    posed.local = dmat4(glm::mat3_cast(local.rotation));
    for (glm::length_t i = 0; i < 3; ++i) posed.local[i] *= local.scale[i];
    posed.local[3] = {local.translation, 1};
    posed.shift = error.translation;
    const double largest = largestOf(local.scale);
    const double scale = error.scale * (1 + error.rounding);  // M~'s rotation is not exactly one
    posed.turn = error.rotation * largest + scale;
    posed.warp = (above.spread * error.rotation + above.stretch * error.rounding) * largest +
                 above.stretch * scale;
  }
  posed.global = above.global * posed.local;
  if (clipError == nullptr) return posed;
  posed.mayOverflow =
      above.mayOverflow || !(sumOfSizes(posed.local) + posed.shift + posed.turn <= mostSize);
  if (posed.mayOverflow) return posed;
  const dvec3 values = singularValues(dmat3(posed.global)).values;
  posed.spread = values[0] - values[2];
  const double norm = normOf(posed.local);
  posed.product = above.product * (norm + posed.turn);
  posed.span = above.span + above.product * (glm::length(dvec3(posed.local[3])) + posed.shift);
  posed.above = std::max(above.above, above.stretch);
  posed.drift = above.drift * norm + above.stretch * posed.turn + 16 * u * posed.product +
                flushedMatrix * posed.above;
  posed.warp +=
      above.warp * (norm + posed.turn) + 16 * u * posed.product + flushedMatrix * posed.above;
  posed.mayOverflow = !(posed.product <= mostSize) || !(posed.span <= mostSize);
  if (!posed.mayOverflow) posed.stretch = values[0] + posed.drift;
  return posed;
}

std::array<double, 3> boundOf(std::span<const PosedNode> nodes,
                              std::span<const std::uint32_t> parents, std::uint32_t joint,
                              const dmat4& inverseBind) {
  // p = L⁻¹ (x − t), with L the linear part of the inverse bind matrix and t its translation.
  const dvec3 values = singularValues(dmat3(inverseBind)).values;
  const dvec3 t(inverseBind[3]);
  const PosedNode& last = nodes[joint];
  const double size = last.product * (values[0] + glm::length(t)) + last.span;
  if (last.mayOverflow || !(size <= mostSize)) return {unbounded, unbounded, unbounded};
  if (values[2] == 0) return {mostSize, unbounded, unbounded};
  const double bind = glm::length(glm::inverse(dmat3(inverseBind)) * t);
  const double flushedJoint = flushedMatrix * std::max(last.above, last.stretch);
  double atJoint = 16 * u * (last.product * (values[0] * bind + glm::length(t)) + last.span) +
                   flushedJoint * (1 + bind);
  double perDistance = (16 * u * last.product * values[0] + flushedJoint) / values[2];

  dmat4 below(1.0);  // from the frame of the joint
  for (std::uint32_t node = joint; node != noJoint; node = parents[node]) {
    const PosedNode& posed = nodes[node];
    const double stretch = parents[node] != noJoint ? nodes[parents[node]].stretch : 1;
    const double flushedNode = flushedMatrix * posed.above;
    const double turn = stretch * posed.turn + 16 * u * posed.product + flushedNode;
    atJoint += stretch * posed.shift + 16 * u * posed.span + flushedNode +
               turn * glm::length(dvec3(below[3]));
    perDistance += turn * normOf(below);
    below = posed.local * below;
  }
  const double shape = (last.warp + 16 * u * last.product) * values[0] + flushedJoint;
  return {atJoint, perDistance, std::min(shape, perDistance * values[0])};
}

/// Checks clips, masks and layers.
Result<std::vector<Layer>> toLayers(const Skeleton& skeleton, std::span<const ClipView> clips,
                                    std::span<const std::span<const float>> masks,
                                    std::span<const ClipLayer> layers) {
  if (const Result<void> checked = checkClips(skeleton, clips); !checked) return checked.error();
  for (const std::span<const float> mask : masks)
    if (mask.size() != skeleton.nodes.size()) return refused("a mask needs one factor per node");
  if (layers.size() > maxClipLayers)
    return refused("there are " + std::to_string(layers.size()) + " layers, but at most " +
                   std::to_string(maxClipLayers) + " may be");
  std::vector<Layer> resolved;
  for (std::size_t index = 0; index < layers.size(); ++index) {
    const Result<Layer> layer = toLayer(layers[index], clips, masks);
    if (!layer) return refused("layer " + std::to_string(index) + ": " + layer.error().message);
    resolved.push_back(*layer);
  }
  return resolved;
}

std::vector<std::uint32_t> parentsOf(const Skeleton& skeleton) {
  std::vector<std::uint32_t> parents;
  for (const SkeletonNode& node : skeleton.nodes)
    parents.push_back(node.parent < skeleton.nodes.size() ? node.parent : noJoint);
  return parents;
}

}  // namespace

Result<SampledPose> samplePose(const Skeleton& skeleton, std::span<const ClipView> clips,
                               std::span<const std::span<const float>> masks,
                               std::span<const ClipLayer> layers, std::uint32_t skin,
                               const PackedClips* bank, const RootMotionOptions* rootMotion) {
  if (const Result<void> checked = checkSkin(skeleton, skin); !checked) return checked.error();
  const Result<std::vector<Layer>> resolved = toLayers(skeleton, clips, masks, layers);
  if (!resolved) return resolved.error();
  const std::vector<std::uint32_t> parents = parentsOf(skeleton);
  const std::vector<std::uint32_t> order = diagnosis::orderOf(parents);
  if (order.size() != parents.size()) return refused("the parents of nodes form a cycle");

  if (rootMotion != nullptr && (rootMotion->node >= parents.size() || rootMotion->upAxis > 2))
    return refused("root motion names a node or an axis that does not exist");
  std::optional<Carrier> carrier;
  if (rootMotion != nullptr) carrier.emplace(skeleton, *rootMotion);
  std::vector<ClipError> errors;
  if (bank != nullptr) errors = errorsOf(*bank, parents.size());
  std::vector<PosedNode> nodes(parents.size());
  for (const std::uint32_t node : order) {
    const PosedNode above = parents[node] != noJoint ? nodes[parents[node]] : PosedNode();
    nodes[node] =
        poseNode(skeleton, node, *resolved, above, bank != nullptr ? &errors[node] : nullptr,
                 carrier ? &*carrier : nullptr);
  }
  SampledPose pose;
  const SkeletonSkin& posedSkin = skeleton.skins[skin];
  for (std::size_t index = 0; index < posedSkin.joints.size(); ++index) {
    const std::uint32_t joint = posedSkin.joints[index];
    const dmat4 inverseBind = toMatrix(posedSkin.inverseBind[index].m);
    const dmat4 matrix = nodes[joint].global * inverseBind;
    Transform& result = pose.joints.emplace_back();
    for (std::size_t row = 0; row < 3; ++row)
      for (std::size_t column = 0; column < 4; ++column)
        result[row][column] =
            matrix[static_cast<glm::length_t>(column)][static_cast<glm::length_t>(row)];
    if (bank == nullptr) continue;
    pose.bounds.push_back(boundOf(nodes, parents, joint, inverseBind));
    pose.inverseBind.push_back(posedSkin.inverseBind[index]);
  }
  return pose;
}

// The bank has M(t) as a place on the ground and a heading, which are off by the distance e and the
// angle a of `rootMotionError`. So the shift of M is off by e + a |g(0)|, and a product of n such
// motions by n times that, and n + 1 times a for the shift of each.
Result<SampledMotion> rootMotion(const Skeleton& skeleton, std::span<const ClipView> clips,
                                 const RootMotionOptions& options, std::uint32_t clip,
                                 double fromSeconds, double toSeconds, bool hold,
                                 const PackedClips* bank) {
  if (const Result<void> checked = checkClips(skeleton, clips); !checked) return checked.error();
  if (options.node >= skeleton.nodes.size() || options.upAxis > 2)
    return refused("root motion names a node or an axis that does not exist");
  if (diagnosis::orderOf(parentsOf(skeleton)).size() != skeleton.nodes.size())
    return refused("the parents of nodes form a cycle");
  if (clip >= clips.size()) return refused("clip " + std::to_string(clip) + " does not exist");
  if (!std::isfinite(fromSeconds) || !std::isfinite(toSeconds))
    return refused("a time is not finite");
  SampledMotion result;
  const Clip played(clips[clip]);
  if (played->additive) return result;
  const Carrier carrier(skeleton, options);
  const double duration = double{static_cast<float>(played->duration)};
  const bool wraps = played->wraps && !hold && duration > 0;
  const auto loopOf = [&](double seconds) { return wraps ? std::floor(seconds / duration) : 0; };
  const auto timeOf = [&](double seconds) {
    return std::clamp(seconds - loopOf(seconds) * duration, 0.0, duration);
  };
  const double loops = loopOf(toSeconds) - loopOf(fromSeconds);
  if (!(std::abs(loops) <= 1e6)) return refused("the times are too far apart");

  const double from = timeOf(fromSeconds), to = timeOf(toSeconds);
  dmat4 all = glm::inverse(carrier.motion(played, from));
  const dmat4 loop = carrier.motion(played, duration);
  for (double i = 0; i < std::abs(loops); ++i) all = all * (loops > 0 ? loop : glm::inverse(loop));
  all = all * carrier.motion(played, to);
  for (glm::length_t i = 0; i < 3; ++i)
    result.motion.displacement[static_cast<std::size_t>(i)] = i == carrier.up ? 0 : all[3][i];
  result.motion.turn = carrier.wholeHeading(played, to) - carrier.wholeHeading(played, from) +
                       loops * carrier.wholeHeading(played, duration);
  if (bank == nullptr) return result;
  const ClipError error = bank->rootMotionError();
  const double count = std::abs(loops) + 2, angle = double{error.rotation};
  double shifts = 0;
  for (const double time : {from, to})
    shifts += glm::length(dvec3(carrier.motion(played, time)[3]));
  shifts += std::abs(loops) * glm::length(dvec3(loop[3]));
  result.turnBound = count * angle + 1e-12;
  result.displacementBound =
      count * (double{error.translation} + angle * glm::length(carrier.ground(played, 0))) +
      (count + 1) * angle * shifts + 1e-12;
  return result;
}

// The bank's weights are off by the `ClipError` e of the node, so their mean is, too. float32 and
// denormals: as for translations above.
Result<SampledWeights> sampleWeights(const Skeleton& skeleton, std::span<const ClipView> clips,
                                     std::span<const std::span<const float>> masks,
                                     std::span<const ClipLayer> layers, std::uint32_t node,
                                     const PackedClips* bank) {
  const Result<std::vector<Layer>> resolved = toLayers(skeleton, clips, masks, layers);
  if (!resolved) return resolved.error();
  SampledWeights result;
  if (node >= skeleton.nodes.size()) return result;
  const double clipError = bank != nullptr ? double{bank->error(node).weight} : 0;
  for (std::size_t number = 0; number < skeleton.nodes[node].weights.size(); ++number) {
    const auto at = [&](const Clip& clip, double time) {
      return weightAt(skeleton, node, number, clip, time);
    };
    const double rest = double{skeleton.nodes[node].weights[number]};
    double total = 0, sum = 0, sizes = 0;
    for (const Layer& layer : *resolved) {
      if (layer.clip->additive) continue;
      const double factor = layer.factor(node), value = at(layer.clip, layer.time);
      total += factor;
      sum += factor * value;
      sizes += factor * std::abs(value);
    }
    double weight = total > 0 ? sum / total : rest, bound = denormal;
    if (total > 0) bound = clipError + 16 * u * sizes / total + flushedVector;
    for (const Layer& layer : *resolved) {
      if (!layer.clip->additive) continue;
      const double base = layer.base ? at(*layer.base, layer.baseTime) : rest;
      const double factor = layer.factor(node), size = std::abs(factor);
      const double difference = at(layer.clip, layer.time) - base;
      if (!(std::abs(weight) + bound <= mostSize)) bound = unbounded;
      weight += factor * difference;
      bound += size * (clipError + flushedVector) +
               4 * u * (std::abs(weight) + size * std::abs(difference)) +
               denormal * std::abs(difference) + flushedMatrix;
    }
    if (!(std::abs(weight) + bound <= mostSize)) bound = unbounded;
    result.weights.push_back(weight);
    if (bank != nullptr) result.bounds.push_back(bound);
  }
  return result;
}

}  // namespace dermis::reference
