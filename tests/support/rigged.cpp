#include "rigged.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <random>

#include "scene_meshes.h"

namespace dermis::test {

PackedRig riggedPose(std::uint32_t seed, std::uint32_t given, std::uint32_t weightsOf) {
  std::mt19937 random(seed);
  std::uniform_real_distribution<float> between(-1, 1);
  const auto quaternion = [&] {
    return std::array<float, 4>{between(random), between(random), between(random), 1.5f};
  };
  // Joints in a row, with driven ones between them.
  std::vector<RigJoint> joints(riggedJoints + drivenJoints);
  for (std::uint32_t joint = 0; joint < joints.size(); ++joint) {
    RigJoint& made = joints[joint];
    if (joint != 0) made.parent = joint < riggedJoints ? joint - 1 : joint - riggedJoints;
    made.bind.m[0][3] = 0.3f * static_cast<float>(joint % riggedJoints);
    made.bind.m[1][3] = 0.1f * between(random);
  }
  const std::uint32_t first = riggedJoints;
  const std::array twists{
      TwistDriver{.joint = first, .source = 3, .axis = {1, 0.2f, 0}, .share = 0.5f},
      TwistDriver{.joint = first + 1, .source = first, .axis = {1, 0, 0}, .share = -0.75f}};
  // Two correctives: of two joints for a joint and two weights, and of one for three weights.
  const std::array<std::uint32_t, 2> inputs{2, 5};
  const std::array<std::uint32_t, 1> offsetJoints{first + 2};
  std::vector<std::array<float, 4>> examples, others;
  std::vector<float> weights, otherWeights;
  std::vector<JointOffset> offsets;
  for (int example = 0; example < 5; ++example) {
    examples.insert(examples.end(), {quaternion(), quaternion()});
    others.push_back(quaternion());
    weights.insert(weights.end(), {between(random), between(random)});
    otherWeights.insert(otherWeights.end(), {between(random), between(random), between(random)});
    offsets.push_back({{between(random), between(random), 0.1f}, quaternion(), {1, 1.5f, 0.75f}});
  }
  const std::array correctives{CorrectiveDriver{.inputs = inputs,
                                                .examples = examples,
                                                .radius = 0.75f,
                                                .firstWeight = given,
                                                .weightCount = 2,
                                                .weights = weights,
                                                .joints = offsetJoints,
                                                .offsets = offsets},
                               CorrectiveDriver{.inputs = std::span(inputs).first(1),
                                                .examples = others,
                                                .radius = 0,
                                                .firstWeight = given + 2,
                                                .weightCount = 3,
                                                .weights = otherWeights}};
  const std::array<std::uint32_t, 3> chainJoints{0, 1, 2};
  const std::array chains{
      ChainDriver{.joints = chainJoints, .firstDriven = first + 3, .segments = 4}};
  const std::array<std::uint32_t, 3> terms{0, 3, 1};
  std::array<JointMatrix, 3> matrices{};
  for (JointMatrix& matrix : matrices) {
    for (auto& row : matrix.m) {
      for (float& number : row) number = 0.2f * between(random);
    }
  }
  const std::array linears{
      LinearDriver{.joint = first + 6, .weights = terms, .matrices = matrices}};
  return must(packRig({.joints = joints,
                       .writtenJoints = riggedJoints,
                       .givenWeights = given,
                       .drivenWeights = drivenWeights,
                       .weightsOf = weightsOf,
                       .twists = twists,
                       .correctives = correctives,
                       .chains = chains,
                       .linears = linears}));
}

PackedRig smallRig() {
  std::vector<RigJoint> joints(smallWritten + 3);
  for (std::uint32_t joint = 0; joint < joints.size(); ++joint) {
    if (joint != 0) joints[joint].parent = joint < smallWritten ? joint - 1 : joint - smallWritten;
    joints[joint].bind.m[0][3] = 0.4f * static_cast<float>(joint % smallWritten);
  }
  const std::array twists{TwistDriver{.joint = smallWritten, .source = 2}};
  const std::array<std::uint32_t, 3> chainJoints{0, 1, 2};
  const std::array chains{
      ChainDriver{.joints = chainJoints, .firstDriven = smallWritten + 1, .segments = 3}};
  return must(packRig(
      {.joints = joints, .writtenJoints = smallWritten, .twists = twists, .chains = chains}));
}

PackedRig longRig(std::uint32_t terms) {
  const std::array<RigJoint, 2> joints;
  const std::vector<std::uint32_t> weights(terms);
  const std::vector<JointMatrix> matrices(terms);
  const std::array linears{LinearDriver{.joint = 1, .weights = weights, .matrices = matrices}};
  return must(
      packRig({.joints = joints, .writtenJoints = 1, .givenWeights = 1, .linears = linears}));
}

Driven evaluated(const PackedRig& rig, std::span<const JointMatrix> written,
                 std::span<const float> given) {
  Driven driven{std::vector<JointMatrix>(rig.drivenJoints()),
                std::vector<float>(rig.givenWeights() + rig.drivenWeights())};
  must(evaluateRig(rig, written, given, driven.joints, driven.weights));
  return driven;
}

float largestDifference(const Driven& a, const Driven& b) {
  float largest = 0;
  for (std::size_t joint = 0; joint < a.joints.size(); ++joint) {
    for (std::size_t row = 0; row < 3; ++row) {
      for (std::size_t column = 0; column < 4; ++column) {
        largest = std::max(
            largest, std::abs(a.joints[joint].m[row][column] - b.joints.at(joint).m[row][column]));
      }
    }
  }
  for (std::size_t weight = 0; weight < a.weights.size(); ++weight)
    largest = std::max(largest, std::abs(a.weights[weight] - b.weights.at(weight)));
  return largest;
}

}  // namespace dermis::test
