// Packs a skeleton and its clips: which nodes move, how exact each must be, the keys of each, and
// the words.
#include <algorithm>
#include <bit>
#include <cmath>
#include <map>
#include <numeric>
#include <optional>
#include <string>
#include <tuple>
#include <vector>

#include "bounds/joint_bounds_data.h"
#include "clips/bank.h"
#include "clips/check.h"
#include "clips/curve.h"
#include "clips/track.h"
#include "dermis/clips.h"
#include "pack/check.h"
#include "strict_floating_point.h"

namespace dermis {
namespace {

using Point = std::array<double, 3>;

constexpr Transform identity{{{1, 0, 0, 0}, {0, 1, 0, 0}, {0, 0, 1, 0}}};

Transform product(const Transform& a, const Transform& b) {
  Transform result{};
  for (std::size_t row = 0; row < 3; ++row) {
    for (std::size_t column = 0; column < 4; ++column) {
      result[row][column] = a[row][0] * b[0][column] + a[row][1] * b[1][column] +
                            a[row][2] * b[2][column] + (column == 3 ? a[row][3] : 0);
    }
  }
  return result;
}

Point transformed(const Transform& a, const Point& p) {
  Point result{};
  for (std::size_t row = 0; row < 3; ++row)
    result[row] = a[row][0] * p[0] + a[row][1] * p[1] + a[row][2] * p[2] + a[row][3];
  return result;
}

Point originOf(const Transform& a) {
  return {a[0][3], a[1][3], a[2][3]};
}

double apart(const Point& a, const Point& b) {
  return std::hypot(a[0] - b[0], a[1] - b[1], a[2] - b[2]);
}

/// How much longer a transform makes things, about.
double scaleOf(const Transform& a) {
  double sum = 0;
  for (const auto& row : a) sum += row[0] * row[0] + row[1] * row[1] + row[2] * row[2];
  return std::sqrt(sum / 3);
}

Transform inDouble(const JointMatrix& matrix) {
  Transform result;
  for (std::size_t row = 0; row < 3; ++row) std::ranges::copy(matrix.m[row], result[row].begin());
  return result;
}

/// Translation, rotation, scale.
using Local = std::array<Value, 3>;
constexpr ChannelPath paths[] = {ChannelPath::translation, ChannelPath::rotation,
                                 ChannelPath::scale};
constexpr Local noDifference{{{0, 0, 0, 0}, {0, 0, 0, 1}, {1, 1, 1, 0}}};

Transform matrixOf(const Local& local) {
  const auto& [t, q, s] = local;
  const auto [x, y, z, w] = q;
  return {{{(1 - 2 * (y * y + z * z)) * s[0], 2 * (x * y - w * z) * s[1],
            2 * (x * z + w * y) * s[2], t[0]},
           {2 * (x * y + w * z) * s[0], (1 - 2 * (x * x + z * z)) * s[1],
            2 * (y * z - w * x) * s[2], t[1]},
           {2 * (x * z - w * y) * s[0], 2 * (y * z + w * x) * s[1],
            (1 - 2 * (x * x + y * y)) * s[2], t[2]}}};
}

Local added(const Local& local, const Local& difference) {
  Local result{local[0], dermis::product(local[1], difference[1]), local[2]};
  for (std::size_t i = 0; i < 3; ++i) {
    result[0][i] += difference[0][i];
    result[2][i] *= difference[2][i];
  }
  return result;
}

Local restOf(const SkeletonNode& node) {
  const auto &t = node.translation, &s = node.scale;
  return {{{t[0], t[1], t[2], 0}, normalized(node.rotation), {s[0], s[1], s[2], 0}}};
}

/// A node that a clip moves.
struct MovedNode {
  std::uint32_t source;
  std::uint32_t parent;        ///< in the list of these, or `noNode`
  Transform fixed = identity;  ///< between the parent and this
  Local rest;
  Transform global;  ///< at rest
  std::size_t depth = 0;
  double reach = 0;       ///< of what it moves itself, in the units of the skeleton
  double wholeReach = 0;  ///< of all that hangs on it
  ClipError error{};
};

/// Where something that no clip moves hangs.
struct Hanging {
  std::uint32_t node = noNode;  ///< of the bank
  Transform fixed = identity;
};

struct PackedClip {
  double rate = 1;
  std::vector<std::array<Track, 3>> tracks;  ///< of each node
};

class Packer {
 public:
  Packer(const Skeleton& skeleton, std::span<const ClipView> clips, const PackClipsOptions& options)
      : skeleton_(skeleton), clips_(clips), options_(options) {}

  Result<std::vector<std::uint32_t>> pack(PackClipsReport& report) {
    findChannels();
    findMovedNodes();
    measureReach();
    report.maxError = maxError_;
    for (std::size_t i = 0; i < clips_.size(); ++i) {
      Result<PackedClip> packed = packClip(i, report);
      if (!packed) return packed.error();
      packed_.push_back(*std::move(packed));
    }
    return write(report);
  }

 private:
  void findChannels() {
    channels_.resize(clips_.size());
    for (std::size_t i = 0; i < clips_.size(); ++i) {
      for (const ChannelView& channel : clips_[i].channels) {
        if (channel.path != ChannelPath::weights)
          channels_[i][{channel.node, channel.path}] = &channel;
      }
    }
  }

  const ChannelView* channelOf(std::size_t clip, std::uint32_t node, ChannelPath path) const {
    const auto found = channels_[clip].find({node, path});
    return found == channels_[clip].end() ? nullptr : found->second;
  }

  /// A channel that holds the value at rest moves nothing.
  bool moves(const ChannelView& channel) const {
    const Local rest = restOf(skeleton_.nodes[channel.node]);
    const bool isRotation = channel.path == ChannelPath::rotation;
    const Curve curve(&channel, channel.path, {}, {});
    const Value& still = rest[static_cast<std::size_t>(channel.path)];
    if (channel.interpolation == Interpolation::cubicSpline) return true;
    return std::ranges::any_of(channel.times, [&](float time) {
      return distance(curve.at(double{time}), still, isRotation) > 0 ||
             distance(curve.at(double{time}, Side::before), still, isRotation) > 0;
    });
  }

  void findMovedNodes() {
    const auto& nodes = skeleton_.nodes;
    std::vector<bool> isMoved(nodes.size());
    for (const ClipView& clip : clips_) {
      for (const ChannelView& channel : clip.channels) {
        if (channel.path != ChannelPath::weights && moves(channel)) isMoved[channel.node] = true;
      }
    }
    // Parents first, by depth.
    std::vector<std::size_t> depth(nodes.size(), 0);
    for (std::size_t i = 0; i < nodes.size(); ++i) {
      for (std::uint32_t above = nodes[i].parent; above < nodes.size(); above = nodes[above].parent)
        ++depth[i];
    }
    std::vector<std::uint32_t> order(nodes.size());
    std::iota(order.begin(), order.end(), 0u);
    std::ranges::stable_sort(order, {}, [&](std::uint32_t i) { return depth[i]; });
    hanging_.resize(nodes.size());
    restGlobals_.resize(nodes.size());
    for (const std::uint32_t i : order) {
      const SkeletonNode& node = nodes[i];
      const bool isRoot = node.parent >= nodes.size();
      const Hanging above = isRoot ? Hanging{} : hanging_[node.parent];
      const Transform local = node.matrix ? *node.matrix : matrixOf(restOf(node));
      restGlobals_[i] = isRoot ? local : product(restGlobals_[node.parent], local);
      if (!isMoved[i]) {
        hanging_[i] = {above.node, product(above.fixed, local)};
        continue;
      }
      hanging_[i] = {static_cast<std::uint32_t>(moved_.size()), identity};
      moved_.push_back({i, above.node, above.fixed, restOf(node), restGlobals_[i],
                        above.node == noNode ? 0 : moved_[above.node].depth + 1});
    }
    // By their own depth, which counts moved nodes only.
    std::vector<std::uint32_t> byDepth(moved_.size()), place(moved_.size());
    std::iota(byDepth.begin(), byDepth.end(), 0u);
    std::ranges::stable_sort(byDepth, {}, [&](std::uint32_t i) { return moved_[i].depth; });
    std::vector<MovedNode> sorted;
    for (const std::uint32_t i : byDepth) {
      place[i] = static_cast<std::uint32_t>(sorted.size());
      sorted.push_back(moved_[i]);
    }
    moved_ = std::move(sorted);
    for (MovedNode& node : moved_) {
      if (node.parent != noNode) node.parent = place[node.parent];
    }
    for (Hanging& hanging : hanging_) {
      if (hanging.node != noNode) hanging.node = place[hanging.node];
    }
  }

  /// Lets a moved node, and those above it, reach a point of the rest pose.
  void reach(std::uint32_t node, const Point& point) {
    if (node == noNode) return;
    const auto far = [&](const MovedNode& of) { return apart(originOf(of.global), point); };
    moved_[node].reach = std::max(moved_[node].reach, far(moved_[node]));
    for (; node != noNode; node = moved_[node].parent)
      moved_[node].wholeReach = std::max(moved_[node].wholeReach, far(moved_[node]));
  }

  void reachMeshes() {
    for (std::size_t i = 0; i < options_.meshes.size(); ++i) {
      const JointBoundsData& bounds = JointBoundsData::of(*options_.meshes[i]);
      const SkeletonSkin& skin = skeleton_.skins[i];
      const auto reachBox = [&](std::uint32_t joint, const Extent& extent) {
        if (joint >= skin.joints.size() || extent.empty()) return;
        const std::uint32_t source = skin.joints[joint];
        const Transform bind = product(restGlobals_[source], inDouble(skin.inverseBind[joint]));
        for (unsigned corner = 0; corner < 8; ++corner) {
          Point point{};
          for (std::size_t axis = 0; axis < 3; ++axis) {
            point[axis] = (corner >> axis & 1) != 0 ? double{extent.reach[2 * axis]}
                                                    : -double{extent.reach[2 * axis + 1]};
          }
          reach(hanging_[source].node, transformed(bind, point));
        }
      };
      for (const JointBoundsData::Joint& joint : bounds.joints) reachBox(joint.joint, joint.alone);
      for (const JointBoundsData::Pair& pair : bounds.pairs) {
        reachBox(bounds.joints[pair.first].joint, pair.extent);
        reachBox(bounds.joints[pair.second].joint, pair.extent);
      }
    }
  }

  void measureReach() {
    Point low{}, high{};
    bool isFirst = true;
    for (const SkeletonSkin& skin : skeleton_.skins) {
      for (const std::uint32_t joint : skin.joints) {
        const Point point = originOf(restGlobals_[joint]);
        for (std::size_t axis = 0; axis < 3; ++axis) {
          low[axis] = isFirst ? point[axis] : std::min(low[axis], point[axis]);
          high[axis] = isFirst ? point[axis] : std::max(high[axis], point[axis]);
        }
        isFirst = false;
        reach(hanging_[joint].node, point);
      }
    }
    reachMeshes();
    // What moves nothing else reaches as far as its parent is.
    for (MovedNode& node : moved_) {
      if (node.reach > 0) continue;
      for (const MovedNode& child : moved_) {
        if (child.parent != noNode && &moved_[child.parent] == &node)
          node.reach = std::max(node.reach, apart(originOf(node.global), originOf(child.global)));
      }
      if (node.reach == 0 && node.parent != noNode)
        node.reach = apart(originOf(node.global), originOf(moved_[node.parent].global));
      node.wholeReach = std::max(node.wholeReach, node.reach);
    }
    double extent = std::max({high[0] - low[0], high[1] - low[1], high[2] - low[2]});
    for (const MovedNode& node : moved_) {
      if (extent == 0) extent = std::max(extent, node.wholeReach);
    }
    if (extent == 0) extent = 1;
    for (MovedNode& node : moved_) {  // a joint alone
      if (node.reach == 0) node.reach = extent;
      node.wholeReach = std::max(node.wholeReach, node.reach);
    }
    maxError_ = options_.maxError > 0 ? options_.maxError : extent / 10000;
  }

  /// The rate at which all keys of a clip are, or else one that suits them.
  double rateOf(const ClipView& clip) const {
    double closest = 1.0 / 30;
    for (const double rate : {24.0, 25.0, 30.0, 48.0, 50.0, 60.0, 100.0, 120.0}) {
      const bool fits = std::ranges::all_of(clip.channels, [&](const ChannelView& channel) {
        return std::ranges::all_of(channel.times, [&](float time) {
          const double frames = double{time} * rate;
          return std::abs(frames - std::round(frames)) < 1e-3;
        });
      });
      if (fits) return rate;
    }
    for (const ChannelView& channel : clip.channels) {
      for (std::size_t i = 1; i < channel.times.size(); ++i) {
        const double step = double{channel.times[i]} - double{channel.times[i - 1]};
        if (step > 0) closest = std::min(closest, step);
      }
    }
    return std::min(1 / closest, 120.0);
  }

  std::vector<std::array<Curve, 3>> curvesOf(std::size_t number) const {
    const ClipView& clip = clips_[number];
    std::vector<std::array<Curve, 3>> curves(moved_.size());
    for (std::size_t i = 0; i < moved_.size(); ++i) {
      for (std::size_t p = 0; p < 3; ++p) {
        const Value& rest = moved_[i].rest[p];
        std::optional<Value> base;
        if (clip.additive) {
          base = rest;
          if (clip.baseClip < clips_.size()) {
            const ClipInfo info{static_cast<float>(clips_[clip.baseClip].duration)};
            const double time = double{clipTime(info, clip.baseTime, true)};
            base = Curve(channelOf(clip.baseClip, moved_[i].source, paths[p]), paths[p], rest, {})
                       .at(time);
          }
        }
        curves[i][p] = Curve(channelOf(number, moved_[i].source, paths[p]), paths[p], rest, base);
      }
    }
    return curves;
  }

  const Local& stillOf(std::size_t clip, std::size_t node) const {
    return clips_[clip].additive ? noDifference : moved_[node].rest;
  }

  std::string where(std::size_t clip, std::size_t node) const {
    const std::uint32_t source = moved_[node].source;
    return titled("clip", clip, clips_[clip].name) + ", " +
           titled("node", source, skeleton_.nodes[source].name);
  }

  Result<PackedClip> packClip(std::size_t number, PackClipsReport& report) {
    PackedClip packed;
    const double duration = double{static_cast<float>(clips_[number].duration)};
    packed.rate = double{static_cast<float>(rateOf(clips_[number]))};
    const std::vector<std::array<Curve, 3>> curves = curvesOf(number);
    const std::vector<Needs> needs = needsOf(number, curves, duration);
    // Errors of joints add up along a chain. The share of each is made smaller until the sum fits.
    double share = 1, worst = 0;
    std::size_t worstNode = 0;
    double worstTime = 0;
    for (int attempt = 0; attempt < 16; ++attempt, share *= 0.6) {
      packed.tracks.assign(moved_.size(), {});
      for (std::size_t i = 0; i < moved_.size(); ++i) {
        const Needs& need = needs[i];
        const double error = maxError_ * share;
        const double tolerances[] = {error / need.above, error / need.reach,
                                     error / (need.above * need.localReach)};
        for (std::size_t p = 0; p < 3; ++p) {
          std::optional<Track> track =
              fitTrack(curves[i][p], stillOf(number, i)[p], duration, packed.rate, tolerances[p]);
          if (!track) return unkept(number, i, packed.rate);
          packed.tracks[i][p] = *std::move(track);
        }
      }
      worst = errorOf(number, packed, curves, duration, worstNode, worstTime);
      if (worst <= maxError_) break;
    }
    if (!(worst <= maxError_)) return unkept(number, worstNode, packed.rate);
    for (std::size_t i = 0; i < moved_.size(); ++i) {
      float* const errors[] = {&moved_[i].error.translation, &moved_[i].error.rotation,
                               &moved_[i].error.scale};
      for (std::size_t p = 0; p < 3; ++p) {
        const double error = packed.tracks[i][p].error * (1 + 0x1p-23);
        *errors[p] = std::max(*errors[p], static_cast<float>(error));
      }
    }
    if (worst > report.worstError) {
      report.worstError = worst;
      report.worst = where(number, worstNode) + ", at " + std::to_string(worstTime) + " s";
    }
    return packed;
  }

  Error unkept(std::size_t clip, std::size_t node, double rate) const {
    return {ErrorCode::limitExceeded,
            "packClips: " + where(clip, node) + ": maxError " + std::to_string(maxError_) +
                " cannot be kept with at most " +
                std::to_string(std::lround(std::ldexp(rate, -finestLevel))) + " keys a second"};
  }

  /// The global transforms of a pose; of an additive clip, added to the rest pose. `valueOf` gets a
  /// node and a property.
  template <typename ValueOf>
  std::vector<Transform> globalsOf(std::size_t number, ValueOf valueOf) const {
    std::vector<Transform> globals(moved_.size());
    for (std::size_t i = 0; i < moved_.size(); ++i) {
      const MovedNode& node = moved_[i];
      Local local{valueOf(i, 0), valueOf(i, 1), valueOf(i, 2)};
      if (clips_[number].additive) local = added(node.rest, local);
      globals[i] = product(node.fixed, matrixOf(local));
      if (node.parent != noNode) globals[i] = product(globals[node.parent], globals[i]);
    }
    return globals;
  }

  /// What decides how exact a node must be in a clip, at most at any time.
  struct Needs {
    double above = 1e-30;       ///< the scale of what is above it
    double reach = 1e-30;       ///< the distance of what hangs on it
    double localReach = 1e-30;  ///< the same in its own units
  };

  std::vector<Needs> needsOf(std::size_t number, const std::vector<std::array<Curve, 3>>& curves,
                             double duration) const {
    std::vector<Needs> needs(moved_.size());
    constexpr int steps = 32;
    for (int step = 0; step <= steps; ++step) {
      const double time = step * duration / steps;
      const std::vector<Transform> globals =
          globalsOf(number, [&](std::size_t i, std::size_t p) { return curves[i][p].at(time); });
      for (std::size_t i = 0; i < moved_.size(); ++i) {
        const MovedNode& node = moved_[i];
        const double above =
            scaleOf(node.parent == noNode ? node.fixed : product(globals[node.parent], node.fixed));
        needs[i].above = std::max(needs[i].above, above);
        const double grown = scaleOf(globals[i]) / std::max(scaleOf(node.global), 1e-30);
        for (auto up = static_cast<std::uint32_t>(i); up != noNode; up = moved_[up].parent) {
          const double reach =
              apart(originOf(globals[up]), originOf(globals[i])) + node.reach * grown;
          needs[up].reach = std::max(needs[up].reach, reach);
          needs[up].localReach =
              std::max(needs[up].localReach, reach / std::max(scaleOf(globals[up]), 1e-30));
        }
      }
    }
    return needs;
  }

  /// The largest distance between a point that a joint moves and where the clip has it.
  double errorOf(std::size_t number, const PackedClip& packed,
                 const std::vector<std::array<Curve, 3>>& curves, double duration,
                 std::size_t& worstNode, double& worstTime) const {
    std::vector<std::pair<double, double>> jumps;  // time, clearance
    for (std::size_t i = 0; i < moved_.size(); ++i) {
      for (std::size_t p = 0; p < 3; ++p) {
        const Track& track = packed.tracks[i][p];
        const double clearance = jumpClearance * std::ldexp(1, track.level) / packed.rate;
        for (const double time : curves[i][p].jumps(duration, 0))
          jumps.emplace_back(time, track.jumps.empty() ? 0.01 / packed.rate : clearance);
      }
    }
    const double steps = std::clamp(std::ceil(duration * packed.rate * 4), 1.0, 8000.0);
    double worst = 0;
    for (double step = 0; step <= steps; ++step) {
      const double time = step / steps * duration;
      if (std::ranges::any_of(
              jumps, [&](const auto& jump) { return std::abs(jump.first - time) <= jump.second; }))
        continue;
      const std::vector<Transform> exact =
          globalsOf(number, [&](std::size_t i, std::size_t p) { return curves[i][p].at(time); });
      const std::vector<Transform> stored = globalsOf(number, [&](std::size_t i, std::size_t p) {
        return packed.tracks[i][p].at(time, packed.rate, stillOf(number, i)[p], p == 1);
      });
      for (std::size_t i = 0; i < moved_.size(); ++i) {
        const MovedNode& node = moved_[i];
        const double distance = node.reach / std::max(scaleOf(node.global), 1e-30);
        for (std::size_t axis = 0; axis < 6; ++axis) {
          Point point{};
          point[axis / 2] = axis % 2 == 0 ? distance : -distance;
          const double error = apart(transformed(exact[i], point), transformed(stored[i], point));
          if (error <= worst) continue;
          worst = error;
          worstNode = i;
          worstTime = time;
        }
      }
    }
    return worst;
  }

  // -- The words.

  template <typename Record>
  void put(std::size_t offset, const Record& record) {
    std::memcpy(&words_[offset], &record, sizeof(record));
  }
  std::uint32_t reserve(std::size_t count) {
    const auto offset = static_cast<std::uint32_t>(words_.size());
    words_.resize(words_.size() + count);
    return offset;
  }
  std::uint32_t append(const Transform& transform) {
    const std::uint32_t offset = reserve(12);
    for (std::size_t i = 0; i < 12; ++i)
      words_[offset + i] =
          std::bit_cast<std::uint32_t>(static_cast<float>(transform[i / 4][i % 4]));
    return offset;
  }

  Result<std::vector<std::uint32_t>> write(PackClipsReport& report) {
    BankHeader header{};
    header.magic = clipsMagic;
    header.version = clipsVersion;
    header.nodeCount = static_cast<std::uint32_t>(moved_.size());
    header.skinCount = static_cast<std::uint32_t>(skeleton_.skins.size());
    header.clipCount = static_cast<std::uint32_t>(clips_.size());
    header.maskCount = static_cast<std::uint32_t>(options_.masks.size());
    header.sourceNodeCount = static_cast<std::uint32_t>(skeleton_.nodes.size());
    reserve(sizeof(header) / 4);
    header.nodes = reserve(moved_.size() * sizeof(BankNode) / 4);
    header.skins = reserve(skeleton_.skins.size() * sizeof(BankSkin) / 4);
    header.clips = reserve(clips_.size() * sizeof(BankClip) / 4);
    header.masks = reserve(options_.masks.size() * moved_.size());
    for (std::size_t mask = 0; mask < options_.masks.size(); ++mask) {
      for (std::size_t i = 0; i < moved_.size(); ++i) {
        words_[header.masks + mask * moved_.size() + i] =
            std::bit_cast<std::uint32_t>(options_.masks[mask][moved_[i].source]);
      }
    }
    for (std::size_t i = 0; i < moved_.size(); ++i) writeNode(header.nodes + 16 * i, moved_[i]);
    for (std::size_t i = 0; i < skeleton_.skins.size(); ++i)
      writeSkin(header.skins + 4 * i, skeleton_.skins[i]);
    for (std::size_t i = 0; i < clips_.size(); ++i) {
      writeClip(header.clips + 8 * i, i, report);
      if (words_.size() > 0x3fffffff)
        return Error{ErrorCode::limitExceeded, "packClips: the clips need more than 4 GiB"};
    }
    header.wordCount = static_cast<std::uint32_t>(words_.size());
    put(0, header);
    header.checksum = checksumOfBlob(words_);
    put(0, header);
    report.byteCount = words_.size() * 4;
    return std::move(words_);
  }

  void writeNode(std::size_t offset, const MovedNode& node) {
    BankNode record{};
    record.parent = node.parent;
    record.source = node.source;
    if (node.fixed != identity) record.fixed = append(node.fixed);
    for (std::size_t i = 0; i < 4; ++i) {
      if (i < 3) record.translation[i] = static_cast<float>(node.rest[0][i]);
      record.rotation[i] = static_cast<float>(node.rest[1][i]);
      if (i < 3) record.scale[i] = static_cast<float>(node.rest[2][i]);
    }
    record.error = node.error;
    put(offset, record);
  }

  void writeSkin(std::size_t offset, const SkeletonSkin& skin) {
    BankSkin record{};
    record.jointCount = static_cast<std::uint32_t>(skin.joints.size());
    record.nodes = reserve(skin.joints.size());
    for (std::size_t i = 0; i < skin.joints.size(); ++i)
      words_[record.nodes + i] = hanging_[skin.joints[i]].node;
    record.matrices = static_cast<std::uint32_t>(words_.size());
    for (std::size_t i = 0; i < skin.joints.size(); ++i)
      append(product(hanging_[skin.joints[i]].fixed, inDouble(skin.inverseBind[i])));
    put(offset, record);
  }

  void writeClip(std::size_t offset, std::size_t number, PackClipsReport& report) {
    const PackedClip& clip = packed_[number];
    int finest = 20;
    for (const auto& tracks : clip.tracks) {
      for (const Track& track : tracks) {
        if (track.kind == TrackKind::animated) finest = std::min(finest, track.level);
      }
    }
    BankClip record{};
    record.duration = static_cast<float>(clips_[number].duration);
    record.rate = static_cast<float>(clip.rate / std::ldexp(1, finest));
    record.flags = (clips_[number].wraps ? 1u : 0u) | (clips_[number].additive ? 2u : 0u);
    record.tracks = reserve(3 * clip.tracks.size());

    using Columns = std::vector<std::pair<std::size_t, const Track*>>;  // word of `tracks`
    std::map<std::tuple<int, std::uint32_t, bool>, Columns> classes;
    for (std::size_t i = 0; i < 3 * clip.tracks.size(); ++i) {
      const Track& track = clip.tracks[i / 3][i % 3];
      if (track.kind == TrackKind::constant) {
        const std::uint32_t value = reserve(i % 3 == 1 ? 4 : 3);
        for (std::size_t c = 0; c < (i % 3 == 1 ? 4u : 3u); ++c)
          words_[value + c] = std::bit_cast<std::uint32_t>(track.constant[c]);
        words_[record.tracks + i] = trackWord(TrackKind::constant, value);
        ++report.constantTracks;
      } else if (track.kind == TrackKind::animated) {
        classes[{track.level, track.format.word(), !track.jumps.empty()}].emplace_back(
            record.tracks + i, &track);
        ++report.animatedTracks;
        report.keyCount += track.keys.size();
      }
    }
    record.classCount = static_cast<std::uint32_t>(classes.size());
    record.classes = reserve(classes.size() * sizeof(BankClass) / 4);
    std::uint32_t classNumber = 0;
    for (const auto& [kind, columns] : classes) {
      writeClass(record.classes + 8 * std::size_t{classNumber}, std::get<int>(kind) - finest,
                 columns);
      for (std::size_t c = 0; c < columns.size(); ++c) {
        words_[columns[c].first] = trackWord(
            TrackKind::animated, classNumber << trackColumnBits | static_cast<std::uint32_t>(c));
      }
      ++classNumber;
    }
    put(offset, record);
  }

  void writeClass(std::size_t offset, int level,
                  const std::vector<std::pair<std::size_t, const Track*>>& columns) {
    const Track& first = *columns[0].second;
    BankClass record{};
    record.format = first.format.word();
    record.level = static_cast<std::uint32_t>(level);
    record.keyCount = static_cast<std::uint32_t>(first.keys.size());
    record.columnCount = static_cast<std::uint32_t>(columns.size());
    record.rowHalves = (record.columnCount * first.format.halves() + 1) / 2 * 2;
    record.keys = reserve(std::size_t{record.keyCount} * record.rowHalves / 2);
    if (!first.format.isRotation) record.ranges = reserve(6 * columns.size());
    const std::size_t jumpWords = (columns.size() + 3) / 4;
    if (!first.jumps.empty()) record.jumps = reserve(first.jumps.size() * jumpWords);
    for (std::size_t c = 0; c < columns.size(); ++c) {
      const Track& track = *columns[c].second;
      for (std::size_t row = 0; row < track.keys.size(); ++row) {
        writeKey(words_,
                 2 * std::size_t{record.keys} + row * record.rowHalves + c * track.format.halves(),
                 track.format, track.keys[row]);
      }
      if (!track.format.isRotation) put(record.ranges + 6 * c, track.range);
      for (std::size_t k = 0; k < track.jumps.size(); ++k)
        words_[record.jumps + k * jumpWords + c / 4] |= std::uint32_t{track.jumps[k]} << c % 4 * 8;
    }
    put(offset, record);
  }

  const Skeleton& skeleton_;
  std::span<const ClipView> clips_;
  const PackClipsOptions& options_;
  std::vector<std::map<std::pair<std::uint32_t, ChannelPath>, const ChannelView*>> channels_;
  std::vector<MovedNode> moved_;
  std::vector<Hanging> hanging_;        ///< of each node of the skeleton
  std::vector<Transform> restGlobals_;  ///< of each node of the skeleton
  double maxError_ = 0;
  std::vector<PackedClip> packed_;
  std::vector<std::uint32_t> words_;
};

}  // namespace

Result<PackedClips> packClips(const Skeleton& skeleton, std::span<const ClipView> clips,
                              const PackClipsOptions& options, PackClipsReport* report) {
  if (Result<void> good = checkClipInput(skeleton, clips, options); !good) return good.error();
  PackClipsReport found;
  Result<std::vector<std::uint32_t>> words = Packer(skeleton, clips, options).pack(found);
  if (!words) return words.error();
  if (!std::isfinite(found.maxError) || !checkClips(*words)) {
    return Error{ErrorCode::limitExceeded,
                 "packClips: the skeleton or its clips have numbers beyond the range of float32"};
  }
  PackedClips packed;
  packed.words_ = *std::move(words);
  if (report != nullptr) *report = found;
  return packed;
}

}  // namespace dermis
