// Curves of chains in bind pose, and meshes that are bound to them.
#include "rig/chain.h"

#include <algorithm>
#include <cmath>
#include <string>
#include <vector>

#include "attribute.h"
#include "rig/blob.h"
#include "strict_floating_point.h"

namespace dermis {

using math::Vec3;

HermiteFactors hermiteAt(double t) {
  return {(1 + 2 * t) * (1 - t) * (1 - t), t * t * (3 - 2 * t), t * (1 - t) * (1 - t),
          t * t * (t - 1)};
}
HermiteFactors hermiteSlopeAt(double t) {
  return {6 * t * (t - 1), 6 * t * (1 - t), (1 - t) * (1 - 3 * t), t * (3 * t - 2)};
}

Result<RestCurve> RestCurve::create(std::span<const RigJoint> joints, const ChainDriver& chain,
                                    const std::string& subject) {
  const auto invalid = [&](const std::string& what) {
    return Error{ErrorCode::invalidArgument, subject + what};
  };
  if (chain.joints.size() < 2) return invalid("a chain has at least two joints");
  if (chain.segments < 2 || chain.segments > maxPoseJoints) {
    return invalid("a chain has 2 to " + std::to_string(maxPoseJoints) + " segments, not " +
                   std::to_string(chain.segments));
  }
  RestCurve curve;
  for (const std::uint32_t joint : chain.joints) {
    if (joint >= joints.size())
      return invalid("joint " + std::to_string(joint) + " does not exist");
    const auto& m = joints[joint].bind.m;
    curve.origins_.emplace_back(double{m[0][3]}, double{m[1][3]}, double{m[2][3]});
  }
  const auto titleOf = [&](std::size_t joint) {
    return "joint " + std::to_string(chain.joints[joint]);
  };
  double end = 0;
  std::vector<Vec3> lines;
  for (std::size_t piece = 0; piece + 1 < curve.origins_.size(); ++piece) {
    const Vec3 line = curve.origins_[piece + 1] - curve.origins_[piece];
    const double length = math::length(line);
    if (!(length > 0) || !std::isfinite(length)) {
      return invalid(titleOf(piece) + " and " + titleOf(piece + 1) +
                     " are at one place in bind pose, or at none that is finite");
    }
    lines.push_back(line / length);
    curve.ends_.push_back(end += length);
  }
  for (std::size_t joint = 0; joint < curve.origins_.size(); ++joint) {
    if (joint == 0 || joint == lines.size()) {
      curve.directions_.push_back(joint == 0 ? lines.front() : lines.back());
      continue;
    }
    const Vec3 chord = curve.origins_[joint + 1] - curve.origins_[joint - 1];
    const double length = math::length(chord);
    if (!(length > 1e-6 * (curve.ends_[joint] - curve.beginOf(joint - 1))))
      return invalid("it turns back by 180 degrees at " + titleOf(joint));
    curve.directions_.push_back(chord / length);
  }
  return curve;
}

CurvePlace RestCurve::at(double parameter) const {
  const auto end = std::ranges::upper_bound(ends_, parameter);
  const auto piece = static_cast<std::size_t>(end - ends_.begin());
  if (piece == ends_.size()) return {piece - 1, 1};
  return {piece, std::clamp((parameter - beginOf(piece)) / lengthOf(piece), 0.0, 1.0)};
}

Vec3 RestCurve::combined(const CurvePlace& place, const HermiteFactors& factors) const {
  const std::size_t begin = place.piece, end = begin + 1;
  const double length = lengthOf(begin);
  return factors.first * origins_[begin] + factors.second * origins_[end] +
         factors.firstTangent * length * directions_[begin] +
         factors.secondTangent * length * directions_[end];
}

double RestCurve::squareTo(const Vec3& position, const CurvePlace& place) const {
  const Vec3 line = position - point(place);
  return math::dot(line, line);
}

double RestCurve::nearest(const Vec3& position) const {
  constexpr std::size_t samples = 16;  // of a piece
  CurvePlace best{0, 0};
  double least = squareTo(position, best);
  for (std::size_t piece = 0; piece < ends_.size(); ++piece) {
    for (std::size_t i = 1; i <= samples; ++i) {
      const CurvePlace place{piece, static_cast<double>(i) / samples};
      const double square = squareTo(position, place);
      if (!(square < least)) continue;
      least = square;
      best = place;
    }
  }
  // It is between the neighbors of the best sample, on one side of which another piece may begin.
  const double step = lengthOf(best.piece) / samples;
  double low = parameterOf(best) - step, high = parameterOf(best) + step;
  low = std::max(low, 0.0);
  high = std::min(high, length());
  for (int i = 0; i < 40; ++i) {
    const double first = low + (high - low) / 3, second = high - (high - low) / 3;
    if (squareTo(position, at(first)) <= squareTo(position, at(second))) {
      high = second;
    } else {
      low = first;
    }
  }
  return (low + high) / 2;
}

namespace {

/// The joints at the ends of the segment that has the place, and the share of the second.
struct SegmentShare {
  std::uint32_t first, second;
  double share;
};

SegmentShare segmentAt(const RestCurve& curve, const ChainDriver& chain, double parameter) {
  const double place = parameter / curve.length() * chain.segments;
  const auto segment = std::min(static_cast<std::uint32_t>(place), chain.segments - 1);
  const auto jointAt = [&](std::uint32_t end) {
    if (end == 0) return chain.joints.front();
    return end == chain.segments ? chain.joints.back() : chain.firstDriven + (end - 1);
  };
  // Nobody sees a smaller share, but it takes the time of an influence.
  constexpr double least = 1e-4;
  double share = std::clamp(place - segment, 0.0, 1.0);
  if (share < least) share = 0;
  if (share > 1 - least) share = 1;
  return {jointAt(segment), jointAt(segment + 1), share};
}

}  // namespace

Result<RepairedMesh> bendChain(const MeshView& mesh, std::span<const RigJoint> joints,
                               const ChainDriver& chain) {
  const Result<RestCurve> curve = RestCurve::create(joints, chain, "bendChain: ");
  if (!curve) return curve.error();
  const std::uint64_t end = std::uint64_t{chain.firstDriven} + chain.segments - 1;
  if (end > joints.size()) {
    return Error{ErrorCode::invalidArgument, "bendChain: the chain drives joints up to " +
                                                 std::to_string(end - 1) + ", which do not exist"};
  }
  Result<RepairedMesh> repaired = repair(mesh, static_cast<std::uint32_t>(joints.size()));
  if (!repaired) return repaired;
  // Influences of other joints, then the two of a segment.
  const MeshView& old = repaired->view();
  const InfluenceSet& set = old.influenceSets.front();
  std::vector<std::uint32_t> newJoints;
  std::vector<float> newWeights;
  const std::uint32_t slots = set.weights.components, newSlots = slots + 2;
  for (std::uint32_t vertex = 0; vertex < old.vertexCount; ++vertex) {
    double moved = 0;
    for (std::uint32_t slot = 0; slot < slots; ++slot) {
      const std::uint32_t joint = loadJoint(set.joints, vertex, slot);
      const float weight = loadFloat(set.weights, vertex, slot);
      const bool isOfChain = std::ranges::find(chain.joints, joint) != chain.joints.end();
      if (isOfChain) moved += double{weight};
      newJoints.push_back(isOfChain ? 0 : joint);
      newWeights.push_back(isOfChain ? 0 : weight);
    }
    SegmentShare place{0, 0, 0};
    if (moved > 0) {
      const Vec3 position(double{loadPosition(old, vertex, 0)},
                          double{loadPosition(old, vertex, 1)},
                          double{loadPosition(old, vertex, 2)});
      place = segmentAt(*curve, chain, curve->nearest(position));
    }
    newJoints.insert(newJoints.end(), {place.first, place.second});
    newWeights.push_back(static_cast<float>(moved * (1 - place.share)));
    newWeights.push_back(static_cast<float>(moved * place.share));
  }
  MeshView bent = old;
  const InfluenceSet newSet{
      {newJoints.data(), old.vertexCount, newSlots * 4, ComponentType::uint32, newSlots},
      attributeView(newWeights.data(), old.vertexCount, newSlots)};
  bent.influenceSets = {&newSet, 1};
  return repair(bent, static_cast<std::uint32_t>(joints.size()));
}

}  // namespace dermis
