// A rig with every kind of driver, for poses of eight joints.
#pragma once

#include <array>
#include <cstdint>
#include <memory>
#include <span>
#include <vector>

#include "dermis/rig.h"
#include "kit/batch_runner.h"

namespace dermis::test {

inline constexpr std::uint32_t riggedJoints = 8;  ///< written
inline constexpr std::uint32_t drivenJoints = 7;  ///< two twists, an offset, a chain, a linear one
inline constexpr std::uint32_t givenWeights = 2;
inline constexpr std::uint32_t drivenWeights = 5;

/// Owns what the view refers to.
struct RigSource {
  std::vector<RigJoint> joints;
  std::vector<TwistDriver> twists;
  std::vector<std::uint32_t> inputs, offsetJoints, chainJoints, terms;
  std::vector<std::array<float, 4>> examples, otherExamples;
  std::vector<float> weights, otherWeights;
  std::vector<JointOffset> offsets;
  std::vector<JointMatrix> matrices;
  std::vector<CorrectiveDriver> correctives;
  std::vector<ChainDriver> chains;
  std::vector<LinearDriver> linears;
  RigView view;

  RigSource() = default;
  RigSource(const RigSource&) = delete;
  RigSource& operator=(const RigSource&) = delete;
};

/// `seed` changes what drivers have for numbers. `weightsOf`: the node of its given weights.
std::unique_ptr<const RigSource> riggedSource(std::uint32_t seed = 1,
                                              std::uint32_t given = givenWeights,
                                              std::uint32_t weightsOf = 0xffffffffu);
PackedRig riggedPose(std::uint32_t seed = 1, std::uint32_t given = givenWeights,
                     std::uint32_t weightsOf = 0xffffffffu);

/// A rig of five written joints and three driven ones, without weights.
PackedRig smallRig();
inline constexpr std::uint32_t smallWritten = 5;

/// One whose linear driver has so many terms, of 64 bytes.
PackedRig longRig(std::uint32_t terms);

using Driven = samples::DrivenPose;
Driven evaluated(const PackedRig& rig, std::span<const JointMatrix> written,
                 std::span<const float> given);

/// The largest difference of two numbers.
float largestDifference(const Driven& a, const Driven& b);

}  // namespace dermis::test
