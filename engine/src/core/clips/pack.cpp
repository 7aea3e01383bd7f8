// Packs a skeleton and its clips: which nodes move, how exact each must be, and the keys of each.
#include <algorithm>
#include <cmath>
#include <deque>
#include <limits>
#include <map>
#include <memory>
#include <numbers>
#include <optional>
#include <string>
#include <vector>

#include "affine.h"
#include "bounds/joint_bounds_data.h"
#include "clips/bank.h"
#include "clips/bank_writer.h"
#include "clips/check.h"
#include "clips/curve.h"
#include "clips/root_motion.h"
#include "clips/track.h"
#include "dermis/clips.h"
#include "strict_floating_point.h"
#include "text.h"

namespace dermis {
namespace {

using Point = std::array<double, 3>;

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

constexpr ChannelPath paths[] = {ChannelPath::translation, ChannelPath::rotation,
                                 ChannelPath::scale};
constexpr Local noDifference{{{0, 0, 0, 0}, {0, 0, 0, 1}, {1, 1, 1, 0}}};

Transform matrixOf(const Local& local) {
  return composed(local[0], local[1], local[2]);
}

Local added(const Local& local, const Local& difference) {
  Local result{local[0], product(local[1], difference[1]), local[2]};
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

/// Where a point that a joint moves is farthest from where the clip has it.
struct PoseError {
  double distance = 0;
  std::size_t node = 0;  ///< a moved one: the joint
  double time = 0;
};

/// What decides how exact a node must be in a clip, at most at any time.
struct Needs {
  double above = 1e-30;       ///< the scale of what is above it
  double reach = 1e-30;       ///< the distance of what hangs on it
  double localReach = 1e-30;  ///< the same in its own units
};

class Packer {
 public:
  Packer(const Skeleton& skeleton, std::span<const ClipView> clips, const PackClipsOptions& options)
      : skeleton_(skeleton), clips_(clips), options_(options) {
    for (const ClipView& clip : clips) {
      for (const ChannelView& channel : clip.channels)
        memoryLeft_ +=
            64 * (std::uint64_t{channel.times.size_bytes()} + channel.values.size_bytes());
    }
  }

  Result<std::vector<std::uint32_t>> pack(PackClipsReport& report) {
    findChannels();
    findMovedNodes();
    findMorphedNodes();
    if (Result<void> good = findRootMotion(); !good) return good.error();
    measureReach();
    report.maxError = maxError_;
    if (!spend(std::uint64_t{clips_.size()} * moved_.size() * sizeof(FittedClip::tracks[0])))
      return Error{ErrorCode::limitExceeded,
                   "packClips: " + std::to_string(clips_.size()) + " clips of " +
                       std::to_string(moved_.size()) +
                       " nodes take more memory than 64 MiB and 64 times that of their keys"};
    for (std::size_t i = 0; i < clips_.size(); ++i) {
      Result<FittedClip> packed = packClip(i, report);
      if (!packed) return packed.error();
      packed_.push_back(*std::move(packed));
    }
    return writeBank(
        {skeleton_, clips_, options_.masks, moved_, morphed_, hanging_, packed_, motion_}, report);
  }

 private:
  /// Takes memory for what is packed. Returns false if there is not enough left.
  bool spend(std::uint64_t bytes) {
    if (bytes > memoryLeft_) return false;
    memoryLeft_ -= bytes;
    return true;
  }
  bool spend(const Track& track) {
    return spend(sizeof(Track) + std::uint64_t{track.keys.size()} * (2 * sizeof(KeyBits)) +
                 std::uint64_t{track.jumps.size()} * 2);
  }
  Error tooLarge(std::size_t clip) const {
    return {ErrorCode::limitExceeded, "packClips: " + titled("clip", clip, clips_[clip].name) +
                                          ": with its keys, clips take more memory than 64 MiB "
                                          "and 64 times that of the source; allow a larger error"};
  }

  /// By node and path. Keys of rotations get unit length, which they need between keys.
  void findChannels() {
    channels_.resize(clips_.size());
    for (std::size_t i = 0; i < clips_.size(); ++i) {
      for (ChannelView channel : clips_[i].channels) {
        if (channel.path == ChannelPath::rotation &&
            channel.interpolation != Interpolation::cubicSpline) {
          std::vector<float>& values = changedKeys_.emplace_back();
          for (std::size_t key = 0; key < channel.values.size(); key += 4) {
            Value rotation;
            std::ranges::copy(channel.values.subspan(key, 4), rotation.begin());
            for (const double x : normalized(rotation)) values.push_back(static_cast<float>(x));
          }
          channel.values = values;
        }
        channels_[i][{channel.node, channel.path}] = channel;
      }
    }
  }

  const ChannelView* channelOf(std::size_t clip, std::uint32_t node, ChannelPath path) const {
    const auto found = channels_[clip].find({node, path});
    return found == channels_[clip].end() ? nullptr : &found->second;
  }

  /// A channel that holds the value at rest moves nothing.
  bool moves(const ChannelView& channel) const {
    if (channel.interpolation == Interpolation::cubicSpline) return true;
    const Local rest = restOf(skeleton_.nodes[channel.node]);
    const Value& still = rest[static_cast<std::size_t>(channel.path)];
    const Curve curve(&channel, channel.path, still, {});
    return std::ranges::any_of(channel.times, [&](float time) {
      return distance(curve.at(double{time}), still, curve.isRotation()) > 0 ||
             distance(curve.at(double{time}, Side::before), still, curve.isRotation()) > 0;
    });
  }

  void findMovedNodes() {
    const auto& nodes = skeleton_.nodes;
    std::vector<bool> isMoved(nodes.size());
    for (const auto& channels : channels_) {
      for (const auto& [property, channel] : channels) {
        if (channel.path != ChannelPath::weights && moves(channel)) isMoved[channel.node] = true;
      }
    }
    hanging_.resize(nodes.size());
    restGlobals_.resize(nodes.size());
    for (const std::uint32_t i : parentsFirst(nodes)) {
      const SkeletonNode& node = nodes[i];
      const bool isRoot = node.parent >= nodes.size();
      const Hanging above = isRoot ? Hanging{} : hanging_[node.parent];
      const Transform local = node.matrix ? *node.matrix : matrixOf(restOf(node));
      restGlobals_[i] = isRoot ? local : multiply(restGlobals_[node.parent], local);
      if (isMoved[i]) {
        hanging_[i] = {static_cast<std::uint32_t>(moved_.size()), identity};
        moved_.push_back({i, above.node, above.fixed, restOf(node), restGlobals_[i]});
      } else {
        hanging_[i] = {above.node, multiply(above.fixed, local)};
      }
    }
  }

  /// Their weights are packed in groups of three, like translations.
  void findMorphedNodes() {
    std::uint32_t groups = 0;
    for (std::uint32_t i = 0; i < skeleton_.nodes.size(); ++i) {
      const std::span<const float> weights = skeleton_.nodes[i].weights;
      if (weights.empty()) continue;
      MorphedNode& node = morphed_.emplace_back(MorphedNode{i, groups, {}});
      node.rest.resize((weights.size() + 2) / 3);
      for (std::size_t k = 0; k < weights.size(); ++k) node.rest[k / 3][k % 3] = double{weights[k]};
      groups += static_cast<std::uint32_t>(node.rest.size());
    }
  }

  /// What splits the motion of the node, and which nodes it carries.
  Result<void> findRootMotion() {
    if (!options_.rootMotion) return {};
    const std::uint32_t node = options_.rootMotion->node;
    const std::uint32_t parent = skeleton_.nodes[node].parent;
    const bool isRoot = parent >= skeleton_.nodes.size();
    const auto refused = [&](const std::string& what) {
      return Error{
          ErrorCode::invalidArgument,
          "packClips: rootMotion: " + titled("node", node, skeleton_.nodes[node].name) + what};
    };
    if (!isRoot && hanging_[parent].node != noNode) {
      const std::uint32_t above = moved_[hanging_[parent].node].source;
      return refused(" is below " + titled("node", above, skeleton_.nodes[above].name) +
                     ", which clips move");
    }
    frame_ = MotionFrame::of(isRoot ? identity : restGlobals_[parent], options_.rootMotion->upAxis);
    if (!frame_) {
      return refused(
          " has a parent whose global transform is not made of translation, rotation and uniform "
          "scale");
    }
    motion_ = BankMotion{options_.rootMotion->upAxis, 1, 0, 0};
    const std::uint32_t carrier = hanging_[node].node;
    isCarried_.resize(moved_.size());
    for (std::size_t i = 0; i < moved_.size(); ++i) {
      const MovedNode& moved = moved_[i];
      isCarried_[i] = moved.source == node || (moved.parent != noNode && isCarried_[moved.parent]);
    }
    if (carrier != noNode && moved_[carrier].source == node) carrier_ = carrier;
    return {};
  }

  /// Lets a moved node reach a point of the rest pose.
  void reach(std::uint32_t node, const Point& point) {
    if (node != noNode)
      moved_[node].reach =
          std::max(moved_[node].reach, apart(originOf(moved_[node].global), point));
  }

  void reachMeshes() {
    for (std::size_t i = 0; i < options_.meshes.size(); ++i) {
      const JointBoundsData& bounds = JointBoundsData::of(*options_.meshes[i]);
      const SkeletonSkin& skin = skeleton_.skins[i];
      const auto reachBox = [&](std::uint32_t joint, const Extent& extent) {
        if (joint >= skin.joints.size() || extent.empty()) return;
        const std::uint32_t source = skin.joints[joint];
        const Transform bind = multiply(restGlobals_[source], skin.inverseBind[joint].m);
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
    // What moves no joint or vertex itself reaches as far as its children, or else as its parent.
    std::vector<double> childReach(moved_.size());
    for (const MovedNode& node : moved_) {
      if (node.parent == noNode) continue;
      double& farthest = childReach[node.parent];
      farthest =
          std::max(farthest, apart(originOf(node.global), originOf(moved_[node.parent].global)));
    }
    double extent = std::max({high[0] - low[0], high[1] - low[1], high[2] - low[2]}), farthest = 0;
    for (std::size_t i = 0; i < moved_.size(); ++i) {
      MovedNode& node = moved_[i];
      if (node.reach == 0) node.reach = childReach[i];
      if (node.reach == 0 && node.parent != noNode)
        node.reach = apart(originOf(node.global), originOf(moved_[node.parent].global));
      farthest = std::max(farthest, node.reach);
    }
    if (extent == 0) extent = farthest > 0 ? farthest : 1;  // a joint alone
    for (MovedNode& node : moved_) {
      if (node.reach == 0) node.reach = extent;
    }
    maxError_ = options_.maxError > 0 ? options_.maxError : extent / 10000;
    if (carrier_ != noNode) motion_->length = static_cast<float>(moved_[carrier_].reach + extent);
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

  /// The time in the base of an additive clip.
  double baseTimeOf(const ClipView& clip) const {
    const ClipInfo info{static_cast<float>(clips_[clip.baseClip].duration)};
    return double{clipTime(info, clip.baseTime, true)};
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
            base = Curve(channelOf(clip.baseClip, moved_[i].source, paths[p]), paths[p], rest, {})
                       .at(baseTimeOf(clip));
          }
        }
        curves[i][p] = Curve(channelOf(number, moved_[i].source, paths[p]), paths[p], rest, base);
      }
    }
    return curves;
  }

  /// The channel of the weights of a node in a clip for three of them, as if of a translation. It
  /// points to `values`.
  std::optional<ChannelView> groupChannel(std::size_t clip, const MorphedNode& node,
                                          std::size_t group, std::vector<float>& values) const {
    const ChannelView* const all = channelOf(clip, node.source, ChannelPath::weights);
    if (all == nullptr) return std::nullopt;
    const std::size_t count = skeleton_.nodes[node.source].weights.size();
    values.clear();
    for (std::size_t first = 0; first < all->values.size(); first += count) {
      for (std::size_t k = 3 * group; k < 3 * group + 3; ++k)
        values.push_back(k < count ? all->values[first + k] : 0);
    }
    ChannelView channel = *all;
    channel.path = ChannelPath::translation;
    channel.values = values;
    return channel;
  }

  /// The weights, in groups, from which an additive clip is a difference.
  std::vector<Value> baseWeights(const ClipView& clip, const MorphedNode& node) const {
    std::vector<Value> base = node.rest;
    if (clip.baseClip >= clips_.size()) return base;
    const ChannelView* const all = channelOf(clip.baseClip, node.source, ChannelPath::weights);
    if (all == nullptr) return base;
    std::vector<double> weights(skeleton_.nodes[node.source].weights.size());
    interpolate(*all, baseTimeOf(clip), weights);
    for (std::size_t k = 0; k < weights.size(); ++k) base[k / 3][k % 3] = weights[k];
    return base;
  }

  /// Straight lines between keys of what is split get little of the error. Empty if it takes more
  /// memory than is left.
  std::optional<SplitMotion> splitMotionOf(std::size_t number, double duration,
                                           const Needs& needs) const {
    const MovedNode& node = moved_[carrier_];
    return splitMotion(*frame_, channelOf(number, node.source, ChannelPath::translation),
                       channelOf(number, node.source, ChannelPath::rotation), node.rest[0],
                       node.rest[1], duration, double{motion_->length}, maxError_ / 64,
                       maxError_ / (64 * needs.reach), memoryLeft_);
  }

  /// Packs morph weights and the root motion.
  Result<void> packVectors(std::size_t number, double duration, const SplitMotion* split,
                           std::span<const Needs> needs, FittedClip& packed) {
    if (Result<void> good = packWeights(number, duration, packed); !good) return good;
    if (!motion_) return {};
    packed.vectorTracks.emplace_back();
    if (split == nullptr) return {};
    const Curve curve(&split->motion, ChannelPath::translation, {}, {});
    const double tolerance =
        maxError_ / (8 * std::max(1.0, needs[carrier_].reach / double{motion_->length}));
    std::optional<Track> track = fitTrack(curve, Value{}, duration, packed.rate, tolerance);
    if (Result<void> good = checkFit(track, number, options_.rootMotion->node, packed.rate); !good)
      return good;
    // Both the place and the heading are relative to those at the beginning.
    const double error = 2 * (track->error + split->motionError) * (1 + 0x1p-23);
    motion_->translationError = std::max(motion_->translationError, static_cast<float>(error));
    motion_->rotationError =
        std::max(motion_->rotationError,
                 static_cast<float>(error / double{motion_->length} * (1 + 0x1p-23)));
    if (!spend(*track)) return tooLarge(number);
    packed.vectorTracks.back() = *std::move(track);
    return {};
  }

  Result<void> packWeights(std::size_t number, double duration, FittedClip& packed) {
    const ClipView& clip = clips_[number];
    const double tolerance = options_.maxWeightError > 0 ? options_.maxWeightError : 1e-3;
    std::vector<float> values;
    for (MorphedNode& node : morphed_) {
      std::vector<Value> bases;
      if (clip.additive) bases = baseWeights(clip, node);
      for (std::size_t group = 0; group < node.rest.size(); ++group) {
        const Value& rest = node.rest[group];
        const std::optional<Value> base =
            clip.additive ? std::optional(bases[group]) : std::nullopt;
        const auto channel = groupChannel(number, node, group, values);
        const Curve curve(channel ? &*channel : nullptr, ChannelPath::translation, rest, base);
        std::optional<Track> track =
            fitTrack(curve, clip.additive ? Value{} : rest, duration, packed.rate, tolerance);
        if (Result<void> good = checkFit(track, number, node.source, packed.rate, tolerance); !good)
          return good;
        if (!spend(*track)) return tooLarge(number);
        node.error = std::max(node.error, static_cast<float>(track->error * (1 + 0x1p-23)));
        packed.vectorTracks.push_back(*std::move(track));
      }
    }
    return {};
  }

  const Local& stillOf(std::size_t clip, std::size_t node) const {
    return clips_[clip].additive ? noDifference : moved_[node].rest;
  }

  std::string where(std::size_t clip, std::uint32_t source) const {
    return titled("clip", clip, clips_[clip].name) + ", " +
           titled("node", source, skeleton_.nodes[source].name);
  }

  Result<FittedClip> packClip(std::size_t number, PackClipsReport& report) {
    FittedClip packed;
    const double duration = double{static_cast<float>(clips_[number].duration)};
    packed.rate = double{static_cast<float>(rateOf(clips_[number]))};
    const std::vector<std::array<Curve, 3>> source = curvesOf(number);
    const std::vector<Needs> needs = needsOf(number, source, duration);
    std::vector<std::array<Curve, 3>> curves = source;
    std::optional<SplitMotion> split;
    if (carrier_ != noNode && !clips_[number].additive) {
      split = splitMotionOf(number, duration, needs[carrier_]);
      if (!split || !spend(split->bytes)) return tooLarge(number);
      if (split->place)
        curves[carrier_][0] = Curve(&*split->place, ChannelPath::translation, {}, {});
      if (split->turn) curves[carrier_][1] = Curve(&*split->turn, ChannelPath::rotation, {}, {});
    }
    if (Result<void> good = packVectors(number, duration, split ? &*split : nullptr, needs, packed);
        !good)
      return good.error();
    // Errors of joints add up along a chain. The share of each is made smaller until the sum fits.
    double share = 1;
    PoseError worst;
    const std::uint64_t memoryLeft = memoryLeft_;
    for (int attempt = 0; attempt < 16; ++attempt, share *= 0.6) {
      memoryLeft_ = memoryLeft;
      packed.tracks.assign(moved_.size(), {});
      for (std::size_t i = 0; i < moved_.size(); ++i) {
        const Needs& need = needs[i];
        const double error = maxError_ * share;
        const double tolerances[] = {error / need.above, error / need.reach,
                                     error / (need.above * need.localReach)};
        for (std::size_t p = 0; p < 3; ++p) {
          std::optional<Track> track =
              fitTrack(curves[i][p], stillOf(number, i)[p], duration, packed.rate, tolerances[p]);
          if (Result<void> good = checkFit(track, number, moved_[i].source, packed.rate); !good)
            return good.error();
          const bool isAtRest = track->kind == TrackKind::rest && track->error == 0;
          if (!isAtRest && !spend(*track)) return tooLarge(number);
          packed.tracks[i][p] =
              isAtRest ? atRest_ : std::make_shared<const Track>(*std::move(track));
        }
      }
      worst = errorOf(number, packed, source, duration, split.has_value());
      if (worst.distance <= maxError_) break;
    }
    if (!(worst.distance <= maxError_))
      return unkept(where(number, moved_[worst.node].source), "maxError", maxError_, packed.rate);
    for (std::size_t i = 0; i < moved_.size(); ++i) {
      float* const errors[] = {&moved_[i].error.translation, &moved_[i].error.rotation,
                               &moved_[i].error.scale};
      for (std::size_t p = 0; p < 3; ++p) {
        double error = packed.tracks[i][p]->error * (1 + 0x1p-23);
        if (split && i == carrier_ && p == 1) error += split->turnError;
        *errors[p] = std::max(*errors[p], static_cast<float>(error));
      }
    }
    if (worst.distance > report.worstError) {
      report.worstError = worst.distance;
      report.worst =
          where(number, moved_[worst.node].source) + ", at " + decimal(worst.time) + " s";
    }
    if (split) memoryLeft_ += split->bytes;
    return packed;
  }

  /// `weightError`: the one of morph weights that was to be kept.
  Result<void> checkFit(const std::optional<Track>& track, std::size_t clip, std::uint32_t node,
                        double rate, std::optional<double> weightError = {}) const {
    if (!track) {
      return unkept(where(clip, node), weightError ? "maxWeightError" : "maxError",
                    weightError.value_or(maxError_), rate);
    }
    if (std::isfinite(track->error)) return {};
    return Error{ErrorCode::limitExceeded,
                 "packClips: " + where(clip, node) + ": its keys are beyond the range of float32"};
  }

  static Error unkept(const std::string& where, const char* option, double error, double rate) {
    return {ErrorCode::limitExceeded, "packClips: " + where + ": " + option + " " + decimal(error) +
                                          " cannot be kept with at most " +
                                          decimal(std::ldexp(rate, -finestLevel)) +
                                          " keys a second"};
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
      globals[i] = multiply(node.fixed, matrixOf(local));
      if (node.parent != noNode) globals[i] = multiply(globals[node.parent], globals[i]);
    }
    return globals;
  }

  std::vector<Needs> needsOf(std::size_t number, const std::vector<std::array<Curve, 3>>& curves,
                             double duration) const {
    std::vector<Needs> needs(moved_.size());
    std::vector<double> own(moved_.size()), all(moved_.size()), farthest(moved_.size());
    constexpr int steps = 32;
    for (int step = 0; step <= steps; ++step) {
      const double time = step * duration / steps;
      const std::vector<Transform> globals =
          globalsOf(number, [&](std::size_t i, std::size_t p) { return curves[i][p].at(time); });
      for (std::size_t i = 0; i < moved_.size(); ++i) {
        const MovedNode& node = moved_[i];
        const double above = scaleOf(
            node.parent == noNode ? node.fixed : multiply(globals[node.parent], node.fixed));
        needs[i].above = std::max(needs[i].above, above);
        const double grown = scaleOf(globals[i]) / std::max(scaleOf(node.global), 1e-30);
        own[i] = all[i] = node.reach * grown;
      }
      std::ranges::fill(farthest, 0.0);
      for (std::size_t i = moved_.size(); i-- > 0;)
        reachFrom(static_cast<std::uint32_t>(i), globals, own[i], all, farthest);
      for (std::size_t i = 0; i < moved_.size(); ++i) {
        needs[i].reach = std::max(needs[i].reach, farthest[i]);
        needs[i].localReach =
            std::max(needs[i].localReach, farthest[i] / std::max(scaleOf(globals[i]), 1e-30));
      }
    }
    return needs;
  }

  /// Lets a node and those above it reach what hangs on the node: at the distance `own` from it,
  /// and, together with all nodes below it, at most at `all`. So that long chains take linear time,
  /// nodes far above reach as far as that bound.
  void reachFrom(std::uint32_t node, const std::vector<Transform>& globals, double own,
                 std::vector<double>& all, std::vector<double>& farthest) const {
    const auto extend = [&](double& reach, std::uint32_t from, double beyond) {
      reach = std::max(reach, apart(originOf(globals[from]), originOf(globals[node])) + beyond);
    };
    constexpr int exactAncestors = 64;
    std::uint32_t up = node;
    for (int i = 0; i < exactAncestors && up != noNode; ++i, up = moved_[up].parent)
      extend(farthest[up], up, own);
    if (up != noNode) extend(farthest[up], up, all[node]);
    if (const std::uint32_t parent = moved_[node].parent; parent != noNode)
      extend(all[parent], parent, all[node]);
  }

  std::size_t morphGroups() const {
    std::size_t groups = 0;
    for (const MorphedNode& node : morphed_) groups += node.rest.size();
    return groups;
  }

  /// From when to when a jump may be rounded, ascending and apart from each other.
  std::vector<std::pair<double, double>> nearJumps(const FittedClip& packed,
                                                   const std::vector<std::array<Curve, 3>>& curves,
                                                   double duration) const {
    std::vector<std::pair<double, double>> all, merged;
    for (std::size_t i = 0; i < moved_.size(); ++i) {
      for (std::size_t p = 0; p < 3; ++p) {
        const Track& track = *packed.tracks[i][p];
        const double clearance = track.jumps.empty()  // the jump is too small to count
                                     ? 0.01 / packed.rate
                                     : jumpClearance * std::ldexp(1, track.level) / packed.rate;
        for (const double time : curves[i][p].jumps(duration, 0))
          all.emplace_back(time - clearance, time + clearance);
      }
    }
    for (std::size_t i = morphGroups(); i < packed.vectorTracks.size(); ++i) {
      const Track& track = packed.vectorTracks[i];
      const double interval = std::ldexp(1, track.level) / packed.rate;
      for (std::size_t k = 0; k < track.jumps.size(); ++k) {
        if (track.jumps[k] == 0) continue;
        const double time = (static_cast<double>(k) + (track.jumps[k] + 1) / 256.0) * interval;
        all.emplace_back(time - jumpClearance * interval, time + jumpClearance * interval);
      }
    }
    std::ranges::sort(all);
    for (const auto& [from, to] : all) {
      if (merged.empty() || from > merged.back().second) merged.emplace_back(from, to);
      merged.back().second = std::max(merged.back().second, to);
    }
    return merged;
  }

  /// The motion of a packed clip from its beginning to a time.
  Transform motionAt(const FittedClip& packed, double time) const {
    const auto at = [&](double seconds) {
      return packed.vectorTracks.back().at(seconds, packed.rate, {}, false);
    };
    return motionMatrix(motionBetween(at(0), at(time), double{motion_->length}), motion_->upAxis);
  }

  /// Measures the pose at a time. `isSplit`: the motion was taken out.
  void measure(std::size_t number, const FittedClip& packed,
               const std::vector<std::array<Curve, 3>>& curves, bool isSplit, double time,
               PoseError& worst) const {
    const std::vector<Transform> exact =
        globalsOf(number, [&](std::size_t i, std::size_t p) { return curves[i][p].at(time); });
    std::vector<Transform> stored = globalsOf(number, [&](std::size_t i, std::size_t p) {
      return packed.tracks[i][p]->at(time, packed.rate, stillOf(number, i)[p], p == 1);
    });
    if (isSplit) {
      const Transform motion = motionAt(packed, time);
      for (std::size_t i = 0; i < moved_.size(); ++i) {
        if (isCarried_[i]) stored[i] = multiply(motion, stored[i]);
      }
    }
    for (std::size_t i = 0; i < moved_.size(); ++i) {
      const MovedNode& node = moved_[i];
      const double reach = node.reach / std::max(scaleOf(node.global), 1e-30);
      for (std::size_t axis = 0; axis < 6; ++axis) {
        Point point{};
        point[axis / 2] = axis % 2 == 0 ? reach : -reach;
        double error = apart(transformed(exact[i], point), transformed(stored[i], point));
        if (std::isnan(error)) error = std::numeric_limits<double>::infinity();
        if (error > worst.distance) worst = {error, i, time};
      }
    }
  }

  /// At how many steps `errorOf` measures a clip: 8 for each of its finest intervals, but at most
  /// 32,768, so that the import of long clips takes seconds.
  double measuredSteps(const FittedClip& packed, double duration) const {
    int finest = 0;
    for (const auto& tracks : packed.tracks) {
      for (const auto& track : tracks) finest = std::min(finest, track->level);
    }
    if (motion_) finest = std::min(finest, packed.vectorTracks.back().level);
    return std::clamp(8 * std::ceil(duration * packed.rate / std::ldexp(1, finest)), 1.0, 32768.0);
  }

  /// The largest error of whole poses. Stops at the first above `maxError_`.
  PoseError errorOf(std::size_t number, const FittedClip& packed,
                    const std::vector<std::array<Curve, 3>>& curves, double duration,
                    bool isSplit) const {
    const std::vector<std::pair<double, double>> skipped = nearJumps(packed, curves, duration);
    PoseError worst;
    const auto measureAt = [&](double time) {
      time = std::clamp(time, 0.0, duration);
      const auto next =
          std::ranges::lower_bound(skipped, time, {}, &std::pair<double, double>::second);
      if (next != skipped.end() && next->first <= time) return;
      measure(number, packed, curves, isSplit, time, worst);
    };
    // Halfway between two keys, normalized interpolation is exact: errors that add up along a chain
    // are not seen there. Multiples of the golden ratio spread the times over all fractions.
    const double steps = measuredSteps(packed, duration), step = duration / steps;
    for (double i = 0; i <= steps && worst.distance <= maxError_; ++i) {
      const double turns = i * std::numbers::phi;
      measureAt((i + turns - std::floor(turns)) * step);
    }
    // The largest error is likely near the largest found.
    const double found = worst.time;
    for (int i = -16; i <= 16 && worst.distance <= maxError_; ++i) measureAt(found + i * step / 8);
    return worst;
  }

  const Skeleton& skeleton_;
  std::span<const ClipView> clips_;
  const PackClipsOptions& options_;
  std::uint64_t memoryLeft_ = std::uint64_t{64} << 20;  ///< bytes
  const std::shared_ptr<const Track> atRest_ = std::make_shared<const Track>();
  std::vector<std::map<std::pair<std::uint32_t, ChannelPath>, ChannelView>> channels_;
  std::deque<std::vector<float>> changedKeys_;  ///< which channels point to
  std::vector<MovedNode> moved_;
  std::vector<MorphedNode> morphed_;
  std::optional<MotionFrame> frame_;
  std::optional<BankMotion> motion_;
  std::uint32_t carrier_ = noNode;      ///< the node with root motion in `moved_`
  std::vector<bool> isCarried_;         ///< of each moved node, whether it is that or below it
  std::vector<Hanging> hanging_;        ///< of each node of the skeleton
  std::vector<Transform> restGlobals_;  ///< of each node of the skeleton
  double maxError_ = 0;
  std::vector<FittedClip> packed_;
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
