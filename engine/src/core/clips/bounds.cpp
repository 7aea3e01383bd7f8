// The box around a mesh that clips move: one clip at any time, or any blend of several
// (docs/bounds.md).
#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <cstring>
#include <numbers>
#include <queue>
#include <span>
#include <string>
#include <vector>

#include "bounds/joint_regions.h"
#include "clips/bank.h"
#include "clips/stretch.h"
#include "dermis/clips.h"
#include "linear_algebra.h"
#include "strict_floating_point.h"

namespace dermis {
namespace {

using bounds::AffineMap;
using bounds::Chord;
using bounds::infinity;
using bounds::JointRegion;
using bounds::Range;
using math::Vec3;
using math::Vec4;

constexpr double pi = std::numbers::pi;
constexpr double u = 0x1p-24;

Vec4 unitOf(const Vec4& q) {
  return math::dot(q, q) > 0 ? math::normalize(q) : Vec4{0, 0, 0, 1};
}

Vec4 quaternionProduct(const Vec4& a, const Vec4& b) {
  return {
      a.w * b.x + a.x * b.w + a.y * b.z - a.z * b.y, a.w * b.y - a.x * b.z + a.y * b.w + a.z * b.x,
      a.w * b.z + a.x * b.y - a.y * b.x + a.z * b.w, a.w * b.w - a.x * b.x - a.y * b.y - a.z * b.z};
}

Vec4 mix(const Vec4& a, double share, const Vec4& b, double other) {
  return {share * a.x + other * b.x, share * a.y + other * b.y, share * a.z + other * b.z,
          share * a.w + other * b.w};
}

/// The angle between two quaternions or their opposites.
double arcBetween(const Vec4& a, const Vec4& b) {
  const Vec4 d = mix(a, 1, b, math::dot(a, b) < 0 ? 1 : -1);
  return 2 * std::asin(std::min(1.0, 0.5 * std::sqrt(math::dot(d, d))));
}

AffineMap composition(const AffineMap& a, const AffineMap& b) {
  return {a.linear * b.linear, a.linear * b.offset + a.offset};
}

AffineMap affineAt(const ClipBank& bank, std::size_t offset) {
  const auto rows = bank.at<Affine<float>>(offset);
  AffineMap result;
  for (std::size_t row = 0; row < 3; ++row) {
    for (std::size_t column = 0; column < 3; ++column)
      result.linear[column][row] = double{rows[row][column]};
    result.offset[row] = double{rows[row][3]};
  }
  return result;
}

// ---- The values of a track.

/// Appends values whose hull contains what a clip gives a node from one time to another: what
/// `samplePose` computes, but for its rounding. Rotations are normalized; their hull is a cone.
void gather(const ClipBank& bank, const BankClip& clip, std::size_t node, ChannelPath path,
            float begin, float end, const Vec4& rest, std::vector<Vec4>& values) {
  const bool isRotation = path == ChannelPath::rotation;
  const bool isAdditive = (clip.flags & 2) != 0;
  const auto put = [&](Vec4 v) {
    if (!std::isfinite(math::dot(v, v))) v = {infinity, infinity, infinity, infinity};
    if (isRotation) {
      v = unitOf(v);
      values.push_back(isAdditive ? unitOf(quaternionProduct(rest, v)) : v);
    } else if (isAdditive) {
      values.push_back(path == ChannelPath::scale
                           ? Vec4{rest.x * v.x, rest.y * v.y, rest.z * v.z, 0}
                           : mix(rest, 1, v, 1));
    } else {
      values.push_back(v);
    }
  };
  const std::uint32_t word = bank.words[clip.tracks + 3 * node + static_cast<std::size_t>(path)];
  const auto kind = static_cast<TrackKind>(word >> 30);
  if (kind == TrackKind::rest) {
    values.push_back(isRotation ? unitOf(rest) : rest);
    return;
  }
  if (kind == TrackKind::constant) {
    const std::size_t at = word & 0x3fffffff;
    put({bank.number(at), bank.number(at + 1), bank.number(at + 2),
         isRotation ? bank.number(at + 3) : 0});
    return;
  }
  const std::uint32_t column = word & ((1u << trackColumnBits) - 1);
  const BankClass keys = bank.keyClass(clip, word >> trackColumnBits & 255);
  const KeyFormat format = KeyFormat::of(keys.format);
  std::array<float, 8> range{};
  if (!isRotation) std::memcpy(range.data(), &bank.words[keys.ranges + 8 * column], sizeof(range));
  const auto keyAt = [&](std::size_t row) {
    const KeyBits key = readKey(
        bank.words, 2 * std::size_t{keys.keys} + row * keys.rowHalves + column * format.halves(),
        format);
    const auto [x, y, z, w] = isRotation ? rotationOf(key, format) : vectorOf(key, range);
    return Vec4{x, y, z, w};
  };
  const auto last = static_cast<float>(keys.keyCount - 2);
  const float from = ClipBank::positionOf(begin, clip, keys);
  const float to = ClipBank::positionOf(end, clip, keys);
  const auto firstRow = static_cast<std::size_t>(std::min(std::floor(from), last));
  const auto lastRow = static_cast<std::size_t>(std::min(std::floor(to), last));
  for (std::size_t row = firstRow; row <= lastRow; ++row) {
    const Vec4 a = keyAt(row), b = keyAt(row + 1);
    const double cosine = isRotation ? math::dot(a, b) : 1;
    // Between two fractions a track is linear, or jumps from one of the values to the other.
    for (const float fraction : {row == firstRow ? from - static_cast<float>(row) : 0.0f,
                                 row == lastRow ? to - static_cast<float>(row) : 1.0f}) {
      const double f = double{bank.fractionOf(fraction, keys, row, column)};
      // If the keys are 180° apart, rounding decides the way.
      if (cosine > -1e-5) put(mix(a, 1 - f, b, f));
      if (cosine < 1e-5) put(mix(a, 1 - f, b, -f));
    }
  }
}

// ---- Regions of local transforms.

/// A node's matrix relative to its parent. Its linear part is within `spread` of the center's, and
/// its translation within `shift`.
struct LocalRegion {
  AffineMap center;
  double shift = 0, spread = 0;
  double size = 0;   ///< of the translation: no sum that leads to it is larger
  Stretch stretch;   ///< of the linear part
  Vec4 rotation;     ///< of the center
  double angle = 0;  ///< of the rotation against it; infinite if the part is not a similarity
};

/// How far the rotation of a similarity may be from that of a matrix that is nearly one; infinite
/// if the matrix is none.
double similarityError(const Stretch& stretch) {
  const double ratio = stretch.low > 0 ? stretch.high / stretch.low - 1 : infinity;
  return ratio < 1e-3 ? 16 * ratio : infinity;
}

Vec4 rotationOf(const AffineMap& map, const Stretch& stretch) {
  return similarityError(stretch) < infinity ? math::quaternionOf(map.linear / stretch.high)
                                             : Vec4{0, 0, 0, 1};
}

/// The values that a node's tracks may have.
struct Values {
  std::array<std::vector<Vec4>, 3> tracks;  ///< of `ChannelPath`
  std::array<Vec4, 3> rest;

  const std::vector<Vec4>& of(ChannelPath path) const {
    return tracks[static_cast<std::size_t>(path)];
  }
};

/// Sets the rotation of the center, and the angle.
void boundRotation(const std::vector<Vec4>& values, LocalRegion& region) {
  const auto farthestFrom = [&values](const Vec4& from) {
    return *std::ranges::max_element(
        values, {}, [&from](const Vec4& value) { return arcBetween(from, value); });
  };
  const Vec4 a = farthestFrom(values[0]), b = farthestFrom(a);
  region.rotation = unitOf(mix(a, 1, b, math::dot(a, b) < 0 ? -1 : 1));
  const double arc = arcBetween(region.rotation, farthestFrom(region.rotation));
  // Below 45° all are in one hemisphere, whichever is the first, and so are their means. The
  // rotation turns by twice the arc.
  region.angle = arc < pi / 4 - 1e-4 ? 2 * arc + 64 * u : pi;
}

/// Sets the part of the matrix that the tracks make.
LocalRegion regionOf(const Values& values) {
  LocalRegion region;
  boundRotation(values.of(ChannelPath::rotation), region);

  const auto rangeOf = [&values](ChannelPath path) {
    Range range;
    for (const Vec4& value : values.of(path)) range.add(value.xyz());
    return range;
  };
  const Range places = rangeOf(ChannelPath::translation), scales = rangeOf(ChannelPath::scale);
  region.center.offset = 0.5 * (places.min + places.max);
  for (const Vec4& value : values.of(ChannelPath::translation)) {
    region.shift = std::max(region.shift, math::length(value.xyz() - region.center.offset));
  }
  region.size = bounds::reachOf(places) + math::length(values.rest[0].xyz());
  region.shift += 16 * u * region.size;

  const Vec3 scale = 0.5 * (scales.min + scales.max), half = 0.5 * (scales.max - scales.min);
  const Vec3 sizes = math::max(math::abs(scales.min), math::abs(scales.max));
  const double least = std::min({scales.min.x, scales.min.y, scales.min.z});
  const double most = std::max({sizes.x, sizes.y, sizes.z});
  // The rotation at rest is not normalized: a quaternion of length l turns by 1 + l² (R − 1).
  const double length = 2 * std::abs(1 - math::dot(values.rest[1], values.rest[1]));
  region.stretch = {(1 - 32 * u) * std::max(least * (1 - length), 0.0),
                    (1 + 32 * u) * most * (1 + length)};
  region.center.linear = math::rotationOf(region.rotation);
  for (int axis = 0; axis < 3; ++axis)
    region.center.linear[axis] = scale[axis] * region.center.linear[axis];
  const double turn = region.angle < pi ? 2 * std::sin(region.angle / 2) : 2;
  region.spread = (turn + length) * most + std::max({half.x, half.y, half.z}) +
                  16 * u * (most + math::length(values.rest[2].xyz()));
  double error = 0;
  for (const Vec4& value : values.of(ChannelPath::scale)) {
    const auto [low, high] = std::minmax({value.x, value.y, value.z});
    error = std::max(error, similarityError({low, high}));
  }
  region.angle += error;
  return region;
}

// ---- Along the skeleton.

/// A node's matrix relative to one above it, or to the pose. It is the product of the matrices of
/// the nodes, which moves a point x to at most `shift` + `turn` |x| from where `map` does. Products
/// of float32 add `noiseShift` + `noiseTurn` |x|.
struct Chain {
  AffineMap map;
  double shift = 0, turn = 0, noiseShift = 0, noiseTurn = 0;
  Stretch stretch;
  Vec4 rotation{0, 0, 0, 1};
  double angle = 0;
};

/// (G + E) (M + F) − G M = E M + (G + E) F, and |G + E| is at most `stretch`.
Chain below(const Chain& above, const LocalRegion& local) {
  Chain chain;
  const double high = above.stretch.high, distance = math::length(local.center.offset);
  chain.map = composition(above.map, local.center);
  chain.stretch = above.stretch * local.stretch;
  chain.shift = above.shift + above.turn * distance + high * local.shift;
  chain.turn = above.turn * local.stretch.high + high * local.spread;
  chain.noiseShift =
      above.noiseShift + above.noiseTurn * (distance + local.shift) +
      32 * u * (math::length(above.map.offset) + above.shift + high * (local.size + local.shift));
  chain.noiseTurn = above.noiseTurn * local.stretch.high + 32 * u * chain.stretch.high;
  chain.rotation = quaternionProduct(above.rotation, local.rotation);
  chain.angle = above.angle + local.angle;
  // Any matrix of this size.
  if (chain.turn >= chain.stretch.high) {
    chain.map.linear = 0.0 * math::Mat3{};
    chain.turn = chain.stretch.high;
  }
  return chain;
}

/// What clips do to the joints of a skin.
class ClipRegions final : public bounds::JointRegions {
 public:
  ClipRegions(const ClipBank& bank, std::uint32_t skin)
      : bank_(bank),
        skin_(bank.skin(skin)),
        isNeeded_(bank.header.nodeCount),
        locals_(bank.header.nodeCount),
        chains_(bank.header.nodeCount) {
    for (std::size_t joint = 0; joint < skin_.jointCount; ++joint) {
      const std::size_t matrix = skin_.matrices + 12 * joint;
      binds_.push_back(affineAt(bank, matrix));
      stretches_.push_back(stretchOf(bank.at<Affine<float>>(matrix)));
      for (std::uint32_t node = nodeOf(joint); node != noNode; node = bank.node(node).parent)
        isNeeded_[node] = true;
    }
    joints.resize(skin_.jointCount);
  }

  /// All poses of one clip from one time to another.
  void setTimes(const BankClip& clip, float begin, float end) {
    set([&](std::size_t node, ChannelPath path, const Vec4& rest, std::vector<Vec4>& values) {
      gather(bank_, clip, node, path, begin, end, rest, values);
    });
  }

  /// All means of the rest pose and of poses of clips.
  void setBlends(std::span<const std::uint32_t> clips) {
    set([&](std::size_t node, ChannelPath path, const Vec4& rest, std::vector<Vec4>& values) {
      values.push_back(path == ChannelPath::rotation ? unitOf(rest) : rest);
      for (const std::uint32_t number : clips) {
        const BankClip clip = bank_.clip(number);
        gather(bank_, clip, node, path, 0, clip.duration, rest, values);
      }
    });
  }

  Chord chord(std::uint32_t first, std::uint32_t second, const Extent& extent) const override {
    const std::uint32_t common = commonNode(nodeOf(first), nodeOf(second));
    const Chain top = common == noNode ? Chain{} : chains_[common];
    double error = 0, noise = 0;
    const auto place = [&](std::uint32_t joint) {
      const Chain chain = chainBetween(common, nodeOf(joint));
      const double reach = bounds::reachOf(bounds::imageOf(binds_[joint], extent));
      const Chain& whole = nodeOf(joint) == noNode ? top : chains_[nodeOf(joint)];
      error += chain.shift + chain.turn * reach;
      noise += whole.noiseShift + whole.noiseTurn * reach + bindNoise(whole, joint) +
               joints[joint].slack * bounds::reachOf(bounds::rangeOf(extent));
      return composition(chain.map, binds_[joint]);
    };
    const AffineMap between = place(first) - place(second);
    const double distance = bounds::reachOf(bounds::imageOf(between, extent));
    // The centers of whole chains may be others.
    const AffineMap expected{top.map.linear * between.linear, top.map.linear * between.offset};
    const AffineMap other = joints[first].map - joints[second].map - expected;
    return {top.stretch.high * (distance + error) + noise,
            top.turn * distance + top.stretch.high * error + noise +
                bounds::reachOf(bounds::imageOf(other, extent))};
  }

  double angle(std::uint32_t first, std::uint32_t second) const override {
    std::uint32_t a = nodeOf(first), b = nodeOf(second);
    const std::uint32_t common = commonNode(a, b);
    if (common != noNode && chains_[common].angle == infinity) return infinity;
    double sum = similarityError(stretches_[first]) + similarityError(stretches_[second]);
    for (; a != common; a = bank_.node(a).parent) sum += locals_[a].angle;
    for (; b != common; b = bank_.node(b).parent) sum += locals_[b].angle;
    return sum;
  }

 private:
  std::uint32_t nodeOf(std::size_t joint) const { return bank_.words[skin_.nodes + joint]; }

  /// The lowest node above two. Parents come before their children.
  std::uint32_t commonNode(std::uint32_t a, std::uint32_t b) const {
    while (a != b) {
      if (a == noNode || b == noNode) return noNode;
      std::uint32_t& lower = a > b ? a : b;
      lower = bank_.node(lower).parent;
    }
    return a;
  }

  Chain chainBetween(std::uint32_t above, std::uint32_t node) const {
    std::vector<std::uint32_t> nodes;
    for (; node != above; node = bank_.node(node).parent) nodes.push_back(node);
    Chain chain;
    for (std::size_t i = nodes.size(); i-- > 0;) chain = below(chain, locals_[nodes[i]]);
    return chain;
  }

  /// What the product with the last matrix of a joint adds at its origin.
  double bindNoise(const Chain& chain, std::size_t joint) const {
    return 32 * u *
           (math::length(chain.map.offset) + chain.shift +
            chain.stretch.high * math::length(binds_[joint].offset));
  }

  template <typename Gather>
  void set(const Gather& gatherTrack) {
    Values values;
    for (std::size_t i = 0; i < locals_.size(); ++i) {
      if (!isNeeded_[i]) continue;
      const BankNode node = bank_.node(i);
      const auto& [tx, ty, tz] = node.translation;
      const auto& [sx, sy, sz] = node.scale;
      const auto& [x, y, z, w] = node.rotation;
      values.rest = {Vec4{tx, ty, tz, 0}, Vec4{x, y, z, w}, Vec4{sx, sy, sz, 0}};
      for (std::size_t path = 0; path < 3; ++path) {
        values.tracks[path].clear();
        gatherTrack(i, static_cast<ChannelPath>(path), values.rest[path], values.tracks[path]);
      }
      locals_[i] = regionOf(values);
      if (node.fixed != 0) putBelowFixed(node.fixed, locals_[i]);
      chains_[i] = below(node.parent == noNode ? Chain{} : chains_[node.parent], locals_[i]);
    }
    for (std::size_t joint = 0; joint < joints.size(); ++joint) setJoint(joint);
  }

  void putBelowFixed(std::size_t matrix, LocalRegion& local) const {
    const AffineMap fixed = affineAt(bank_, matrix);
    const Stretch stretch = stretchOf(bank_.at<Affine<float>>(matrix));
    local.center = composition(fixed, local.center);
    local.shift *= stretch.high;
    local.spread *= stretch.high;
    local.size = local.size * stretch.high + math::length(fixed.offset);
    local.stretch = stretch * local.stretch;
    local.rotation = quaternionProduct(rotationOf(fixed, stretch), local.rotation);
    local.angle += similarityError(stretch);
  }

  void setJoint(std::size_t joint) {
    const AffineMap& bind = binds_[joint];
    const Stretch& stretch = stretches_[joint];
    JointRegion& region = joints[joint];
    region.bind = bind;
    region.rotation = rotationOf(bind, stretch);
    region.angle = similarityError(stretch);
    region.map = bind;
    region.least = stretch.low;
    region.most = stretch.high;
    if (nodeOf(joint) == noNode) return;
    const Chain& chain = chains_[nodeOf(joint)];
    region.map = composition(chain.map, bind);
    region.shift = chain.shift + chain.noiseShift + bindNoise(chain, joint);
    region.turn = chain.turn + chain.noiseTurn;
    region.slack = 32 * u * chain.stretch.high * stretch.high;
    region.spread = region.turn * stretch.high + region.slack;
    const Stretch all = chain.stretch * stretch;
    region.most = all.high + chain.noiseTurn * stretch.high + region.slack;
    region.least = std::max(0.0, all.low - (region.most - all.high));
    region.rotation = quaternionProduct(chain.rotation, region.rotation);
    region.angle += chain.angle;
  }

  const ClipBank bank_;
  const BankSkin skin_;
  std::vector<bool> isNeeded_;  ///< whether a joint hangs on a node
  std::vector<LocalRegion> locals_;
  std::vector<Chain> chains_;
  std::vector<AffineMap> binds_;
  std::vector<Stretch> stretches_;  ///< of `binds_`
};

// ---- What is asked.

Error refused(const char* subject, const std::string& what) {
  return {ErrorCode::invalidArgument, subject + what};
}

Result<void> check(const char* subject, const PackedClips& bank,
                   std::span<const std::uint32_t> clips, std::uint32_t skin,
                   const JointBounds& mesh) {
  if (skin >= bank.skinCount()) {
    return refused(subject, "there is no skin " + std::to_string(skin) + "; the bank has " +
                                std::to_string(bank.skinCount()));
  }
  for (const std::uint32_t clip : clips) {
    if (clip >= bank.clipCount()) {
      return refused(subject, "there is no clip " + std::to_string(clip) + "; the bank has " +
                                  std::to_string(bank.clipCount()));
    }
  }
  const std::uint32_t required = JointBoundsData::of(mesh).requiredJoints;
  if (required > bank.jointCount(skin)) {
    return refused(subject, "the mesh requires " + std::to_string(required) + " joints, but skin " +
                                std::to_string(skin) + " has " +
                                std::to_string(bank.jointCount(skin)));
  }
  return {};
}

/// A part of the time of a clip.
struct Piece {
  float begin, end;
  Range box;      ///< around the mesh at all of these times
  double excess;  ///< how far it was outside what is known to be reached

  bool operator<(const Piece& other) const { return excess < other.excess; }
};

/// How far a box is outside another.
double excessOf(const Range& box, const Range& inner) {
  double most = 0;
  for (int axis = 0; axis < 3; ++axis) {
    most = std::max({most, inner.min[axis] - box.min[axis], box.max[axis] - inner.max[axis]});
  }
  return most;
}

double longestSide(const Range& box) {
  const Vec3 sides = box.max - box.min;
  return std::max({sides.x, sides.y, sides.z});
}

}  // namespace

Result<Box> clipBounds(const PackedClips& bank, std::uint32_t clip, std::uint32_t skin,
                       const JointBounds& mesh, Method method, JointPromise promise) {
  if (Result<void> good = check("clipBounds: ", bank, {&clip, 1}, skin, mesh); !good)
    return good.error();
  const ClipBank words(bank);
  const BankClip played = words.clip(clip);
  ClipRegions regions(words, skin);
  std::vector<JointMatrix> pose(bank.jointCount(skin));
  Range inner, outer;  // what is reached, and the box of the pieces that are not split
  std::priority_queue<Piece> pieces;
  const auto addPiece = [&](float begin, float end) {
    const ClipLayer layer{.clip = clip, .time = 0.5 * (double{begin} + double{end}), .hold = true};
    if (samplePose(bank, {&layer, 1}, skin, pose))
      inner.add(bounds::rangeOf(skinnedBounds(mesh, pose, method, promise)));
    regions.setTimes(played, begin, end);
    const Range box = bounds::rangeOf(bounds::skinnedBounds(mesh, regions, method, promise));
    pieces.push({begin, end, box, excessOf(box, inner)});
  };
  addPiece(0, played.duration);
  // Splits the piece that is farthest outside, as long as that matters.
  const float intervals = played.duration * played.rate;
  for (int splits = static_cast<int>(std::clamp(4 * intervals, 256.0f, 4096.0f));
       !pieces.empty();) {
    Piece piece = pieces.top();
    pieces.pop();
    const double excess = excessOf(piece.box, inner);
    if (!pieces.empty() && excess < pieces.top().excess && excess < piece.excess) {
      piece.excess = excess;
      pieces.push(piece);
      continue;
    }
    const float middle = piece.begin + (piece.end - piece.begin) / 2;
    if (piece.begin == piece.end || splits <= 0 ||
        !(excess > std::max(0.0, 0.01 * longestSide(inner)))) {
      outer.add(piece.box);
    } else if (middle > piece.begin && middle < piece.end) {
      addPiece(piece.begin, middle);
      addPiece(middle, piece.end);
      --splits;
    } else {  // There is no time between these two.
      addPiece(piece.begin, piece.begin);
      addPiece(piece.end, piece.end);
    }
  }
  return bounds::boxOf(outer);
}

Result<Box> blendBounds(const PackedClips& bank, std::span<const std::uint32_t> clips,
                        std::uint32_t skin, const JointBounds& mesh, Method method,
                        JointPromise promise) {
  if (Result<void> good = check("blendBounds: ", bank, clips, skin, mesh); !good)
    return good.error();
  for (const std::uint32_t clip : clips) {
    if (!bank.clip(clip).additive) continue;
    return refused("blendBounds: ", "clip " + std::to_string(clip) +
                                        " is additive, and its weight may be any number: there is "
                                        "no box for all of its blends");
  }
  ClipRegions regions(ClipBank(bank), skin);
  regions.setBlends(clips);
  return bounds::skinnedBounds(mesh, regions, method, promise);
}

}  // namespace dermis
