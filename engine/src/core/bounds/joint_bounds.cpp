#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <limits>
#include <string>
#include <unordered_map>
#include <unordered_set>
#include <vector>

#include "attribute.h"
#include "bounds/extent.h"
#include "check_mesh.h"
#include "dermis/mesh.h"
#include "pack/influences.h"
#include "strict_floating_point.h"
#include "text.h"

namespace dermis {
namespace {

using bounds::Range;
using bounds::Reach;

using Influence = PackedInfluence;

/// A component of a position or a displacement as it is stored.
double loadStored(const AttributeView& view, std::uint32_t element, std::uint32_t component) {
  return static_cast<double>(loadFloat(view, element, component));
}

math::Vec3 loadPosition(const MeshView& mesh, std::uint32_t vertex) {
  math::Vec3 position;
  for (std::uint32_t i = 0; i < 3; ++i) {
    position[i] =
        loadStored(mesh.positions, vertex, i) * static_cast<double>(mesh.positionScale[i]) +
        static_cast<double>(mesh.positionOffset[i]);
  }
  return position;
}

Error invalid(const MeshView& mesh, const std::string& what) {
  return {ErrorCode::invalidArgument, "mesh " + inQuotes(mesh.name) + what};
}

/// The minimum and the maximum of a morph weight.
using MorphRange = std::array<float, 2>;

/// Where each vertex may be, relative to its bind position; empty if nothing displaces it.
class Displacements {
 public:
  Displacements(const MeshView& mesh, std::span<const MorphRange> ranges) {
    for (std::size_t target = 0; target < mesh.morphTargets.size(); ++target)
      add(mesh, mesh.morphTargets[target], ranges.empty() ? MorphRange{0, 1} : ranges[target]);
  }

  Range around(std::uint32_t vertex, const math::Vec3& position) const {
    const Range point{position, position};
    return ranges_.empty() ? point : point + ranges_[vertex];
  }

 private:
  void add(const MeshView& mesh, const MorphTargetView& target, const MorphRange& range) {
    if (!target.positions) return;
    ranges_.resize(mesh.vertexCount, Range{math::Vec3(0.0), math::Vec3(0.0)});
    for (std::uint32_t element = 0; element < target.positions.count; ++element) {
      const std::uint32_t vertex = target.vertices.empty() ? element : target.vertices[element];
      math::Vec3 whole;
      for (std::uint32_t i = 0; i < 3; ++i) {
        whole[static_cast<int>(i)] =
            loadStored(target.positions, element, i) * static_cast<double>(target.positionScale[i]);
      }
      const math::Vec3 low = static_cast<double>(range[0]) * whole;
      const math::Vec3 high = static_cast<double>(range[1]) * whole;
      ranges_[vertex] = ranges_[vertex] + Range{math::min(low, high), math::max(low, high)};
    }
  }

  std::vector<Range> ranges_;
};

struct PairRange {
  std::uint32_t influences = 2;
  Reach reach;
  double firstOverSecond[2] = {bounds::infinity, 0};
  double secondOverFirst[2] = {bounds::infinity, 0};
  double minSum = bounds::infinity;
};

/// Stored ratios may err by a few roundings, so they are rounded outward.
float below(double ratio) {
  return bounds::roundDown(ratio * (1 - 1e-7));
}
float above(double ratio) {
  return std::min(bounds::roundUp(ratio * (1 + 1e-7)), std::numeric_limits<float>::max());
}

class Collector {
 public:
  explicit Collector(std::uint32_t jointCount) : alone_(jointCount), used_(jointCount, false) {}

  void add(const std::vector<Influence>& influences, const Range& place) {
    for (const Influence& influence : influences) used_[influence.joint] = true;
    if (influences.empty()) {
      unweighted_.add(place);
      return;
    }
    const Reach reach(place);
    if (influences.size() == 1) alone_[influences[0].joint].add(reach);
    for (std::size_t second = 1; second < influences.size(); ++second) {
      for (std::size_t first = 0; first < second; ++first) {
        addPair(influences[first], influences[second], influences.size(), reach);
      }
    }
    if (influences.size() <= JointBoundsData::maxTrioInfluences) addTrios(influences);
  }

  JointBoundsData take() const {
    JointBoundsData result;
    std::vector<std::uint32_t> compact(alone_.size(), 0);
    for (std::uint32_t joint = 0; joint < alone_.size(); ++joint) {
      if (!used_[joint]) continue;
      compact[joint] = static_cast<std::uint32_t>(result.joints.size());
      result.joints.push_back({joint, alone_[joint].extent()});
      result.requiredJoints = joint + 1;
    }
    result.unweighted = bounds::boxOf(unweighted_);
    // The order of a hash table differs between standard libraries; the stored data must not.
    for (const auto& [key, pair] : pairs_) {
      result.pairs.push_back(finish(compact[key >> 16], compact[key & 0xffffu], pair));
    }
    std::sort(result.pairs.begin(), result.pairs.end(),
              [](const JointBoundsData::Pair& a, const JointBoundsData::Pair& b) {
                return a.first != b.first ? a.first < b.first : a.second < b.second;
              });
    for (const std::uint64_t key : trios_) {
      const auto joint = [&](int shift) {
        return compact[static_cast<std::size_t>(key >> shift & 0xffffu)];
      };
      result.trios.push_back({joint(32), joint(16), joint(0)});
    }
    std::sort(result.trios.begin(), result.trios.end());
    return result;
  }

 private:
  void addPair(const Influence& first, const Influence& second, std::size_t influences,
               const Reach& reach) {
    PairRange& pair = pairs_[first.joint << 16 | second.joint];
    const auto others = static_cast<double>(influences - 1);
    const double a = first.weight / (second.weight * others);
    const double b = second.weight / (first.weight * others);
    pair.influences = std::max(pair.influences, static_cast<std::uint32_t>(influences));
    pair.reach.add(reach);
    pair.firstOverSecond[0] = std::min(pair.firstOverSecond[0], a);
    pair.firstOverSecond[1] = std::max(pair.firstOverSecond[1], a);
    pair.secondOverFirst[0] = std::min(pair.secondOverFirst[0], b);
    pair.secondOverFirst[1] = std::max(pair.secondOverFirst[1], b);
    pair.minSum = std::min(pair.minSum, a + b);
  }

  void addTrios(const std::vector<Influence>& influences) {
    for (std::size_t c = 2; c < influences.size(); ++c) {
      for (std::size_t b = 1; b < c; ++b) {
        for (std::size_t a = 0; a < b; ++a) {
          trios_.insert(std::uint64_t{influences[a].joint} << 32 |
                        std::uint64_t{influences[b].joint} << 16 | influences[c].joint);
        }
      }
    }
  }

  static JointBoundsData::Pair finish(std::uint32_t first, std::uint32_t second,
                                      const PairRange& pair) {
    return {first,
            second,
            pair.influences,
            pair.reach.extent(),
            {below(pair.firstOverSecond[0]), above(pair.firstOverSecond[1])},
            {below(pair.secondOverFirst[0]), above(pair.secondOverFirst[1])},
            below(pair.minSum)};
  }

  static_assert(maxPoseJoints <= 65536, "the keys below have 16 bits a joint");
  std::vector<Reach> alone_;
  std::vector<bool> used_;
  std::unordered_map<std::uint32_t, PairRange> pairs_;
  std::unordered_set<std::uint64_t> trios_;
  Range unweighted_;
};

Result<void> checkRanges(const MeshView& mesh, std::span<const MorphRange> morphRanges) {
  if (!morphRanges.empty() && morphRanges.size() != mesh.morphTargets.size()) {
    return invalid(mesh, ": there are " + std::to_string(morphRanges.size()) + " ranges for " +
                             std::to_string(mesh.morphTargets.size()) + " morph targets");
  }
  for (const MorphRange& range : morphRanges) {
    if (!std::isfinite(range[0]) || !std::isfinite(range[1]) || range[0] > range[1]) {
      return invalid(mesh, ": a range of morph weights is not finite, or its min is above its max");
    }
  }
  return {};
}

}  // namespace

Result<JointBounds> jointBounds(const MeshView& mesh, std::uint32_t jointCount,
                                std::span<const MorphRange> morphRanges) {
  if (const Result<void> good = checkRanges(mesh, morphRanges); !good) return good.error();
  if (const Result<void> good = checkPackable(mesh, jointCount); !good) return good.error();
  const Displacements displacements(mesh, morphRanges);
  Collector collector(jointCount);
  std::vector<Influence> influences;
  for (std::uint32_t vertex = 0; vertex < mesh.vertexCount; ++vertex) {
    gatherInfluences(mesh, vertex, influences);
    mergeJoints(influences);
    collector.add(influences, displacements.around(vertex, loadPosition(mesh, vertex)));
  }
  return JointBoundsData::joined(collector.take());
}

}  // namespace dermis
