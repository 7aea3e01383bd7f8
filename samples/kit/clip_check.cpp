#include "kit/clip_check.h"

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <iterator>
#include <vector>

#include <glm/glm.hpp>

namespace dermis::samples {
namespace {

template <typename Matrix>
glm::dmat4 matrixOf(const Matrix& rows) {
  glm::dmat4 matrix(1.0);
  for (int row = 0; row < 3; ++row) {
    for (int column = 0; column < 4; ++column)
      matrix[column][row] =
          double{rows[static_cast<std::size_t>(row)][static_cast<std::size_t>(column)]};
  }
  return matrix;
}

bool isFinite(const JointMatrix& joint) {
  return std::ranges::all_of(joint.m, [](const auto& row) {
    return std::ranges::all_of(row, [](float value) { return std::isfinite(value); });
  });
}

/// When a component jumps by more than this share of the largest.
std::vector<double> jumpsOf(const ChannelView& channel, double share) {
  std::vector<double> jumps;
  if (channel.interpolation == Interpolation::cubicSpline) return jumps;
  float largest = 0;
  for (const float value : channel.values) largest = std::max(largest, std::abs(value));
  const std::size_t width = channel.values.size() / channel.times.size();
  for (std::size_t key = 1; key < channel.times.size(); ++key) {
    if (channel.interpolation != Interpolation::step &&
        channel.times[key] != channel.times[key - 1])
      continue;
    float jump = 0;
    for (std::size_t i = key * width; i < (key + 1) * width; ++i)
      jump = std::max(jump, std::abs(channel.values[i] - channel.values[i - width]));
    if (double{jump} > share * double{largest}) jumps.push_back(double{channel.times[key]});
  }
  return jumps;
}

/// Adds something that is `off` from where it should be.
void compare(Comparison& comparison, std::size_t number, double off, double bound) {
  const double ratio = off <= 0 ? 0 : off / bound;
  const double error = std::isnan(ratio) ? HUGE_VAL : ratio;
  ++comparison.compared;
  if (error > comparison.worstPosition) {
    comparison.worstPosition = error;
    comparison.worstPositionVertex = static_cast<std::uint32_t>(number);
  }
  comparison.largestPositionError = std::max(comparison.largestPositionError, off);
  if (error > 1 && comparison.failures++ == 0)
    comparison.firstFailure = static_cast<std::uint32_t>(number);
}

}  // namespace

bool isNearJump(const ClipView& clip, double time) {
  for (const ChannelView& channel : clip.channels) {
    const std::vector<double> all = jumpsOf(channel, 0);
    std::vector<double> large = jumpsOf(channel, 0.05);
    large.insert(large.begin(), 0);
    large.push_back(clip.duration);
    for (const double jump : all) {
      // The interval of a jump has no other that counts. The time is rounded to 1/256 of it.
      const auto after = std::ranges::upper_bound(large, jump);
      const auto before = std::ranges::lower_bound(large, jump);
      const double interval = (after == large.end() ? clip.duration : *after) -
                              (before == large.begin() ? 0 : *std::prev(before));
      if (std::abs(time - jump) <= interval / 256 + 1e-6 * clip.duration) return true;
    }
  }
  return false;
}

Comparison comparePose(std::span<const JointMatrix> pose, const reference::SampledPose& expected,
                       const SkeletonSkin& skin) {
  Comparison comparison;
  for (std::size_t joint = 0; joint < pose.size(); ++joint) {
    const auto [atJoint, perDistance, shape] = expected.bounds[joint];
    if (!std::isfinite(perDistance)) {
      if (!std::isfinite(atJoint)) {
        ++comparison.exempt.outOfRange;
      } else if (isFinite(pose[joint])) {
        ++comparison.exempt.onlyFinite;
      } else {
        compare(comparison, joint, HUGE_VAL, 1);
      }
      continue;
    }
    const glm::dmat4 error = (matrixOf(pose[joint].m) - matrixOf(expected.joints[joint])) *
                             glm::inverse(matrixOf(skin.inverseBind[joint].m));
    for (int column = 0; column < 4; ++column)
      compare(comparison, joint, glm::length(glm::dvec3(error[column])),
              column < 3 ? perDistance : atJoint);
  }
  comparison.expectedExempt = comparison.exempt;
  return comparison;
}

Comparison compareWeights(std::span<const float> weights,
                          const reference::SampledWeights& expected) {
  Comparison comparison;
  for (std::size_t i = 0; i < weights.size(); ++i)
    compare(comparison, i, std::abs(double{weights[i]} - expected.weights[i]), expected.bounds[i]);
  return comparison;
}

}  // namespace dermis::samples
