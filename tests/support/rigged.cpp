#include "rigged.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <random>

#include "scene_meshes.h"

namespace dermis::test {

std::unique_ptr<const RigSource> riggedSource(std::uint32_t seed, std::uint32_t given,
                                              std::uint32_t weightsOf) {
  auto made = std::make_unique<RigSource>();
  RigSource& rig = *made;
  std::mt19937 random(seed);
  std::uniform_real_distribution<float> between(-1, 1);
  const auto quaternion = [&] {
    return std::array<float, 4>{between(random), between(random), between(random), 1.5f};
  };
  // Joints in a row, with driven ones between them.
  rig.joints.resize(riggedJoints + drivenJoints);
  for (std::uint32_t joint = 0; joint < rig.joints.size(); ++joint) {
    RigJoint& own = rig.joints[joint];
    if (joint != 0) own.parent = joint < riggedJoints ? joint - 1 : joint - riggedJoints;
    own.bind.m[0][3] = 0.3f * static_cast<float>(joint % riggedJoints);
    own.bind.m[1][3] = 0.1f * between(random);
  }
  const std::uint32_t first = riggedJoints;
  rig.twists = {
      TwistDriver{.joint = first, .source = 3, .axis = {1, 0.2f, 0}, .share = 0.5f},
      TwistDriver{.joint = first + 1, .source = first, .axis = {1, 0, 0}, .share = -0.75f}};
  // Two correctives: of two joints for a joint and two weights, and of one for three weights.
  rig.inputs = {2, 5};
  rig.offsetJoints = {first + 2};
  for (int example = 0; example < 5; ++example) {
    rig.examples.insert(rig.examples.end(), {quaternion(), quaternion()});
    rig.otherExamples.push_back(quaternion());
    rig.weights.insert(rig.weights.end(), {between(random), between(random)});
    rig.otherWeights.insert(rig.otherWeights.end(),
                            {between(random), between(random), between(random)});
    rig.offsets.push_back(
        {{between(random), between(random), 0.1f}, quaternion(), {1, 1.5f, 0.75f}});
  }
  rig.correctives = {CorrectiveDriver{.inputs = rig.inputs,
                                      .examples = rig.examples,
                                      .radius = 0.75f,
                                      .firstWeight = given,
                                      .weightCount = 2,
                                      .weights = rig.weights,
                                      .joints = rig.offsetJoints,
                                      .offsets = rig.offsets},
                     CorrectiveDriver{.inputs = std::span(rig.inputs).first(1),
                                      .examples = rig.otherExamples,
                                      .radius = 0,
                                      .firstWeight = given + 2,
                                      .weightCount = 3,
                                      .weights = rig.otherWeights}};
  rig.chainJoints = {0, 1, 2};
  rig.chains = {ChainDriver{.joints = rig.chainJoints, .firstDriven = first + 3, .segments = 4}};
  rig.terms = {0, 3, 1};
  rig.matrices.resize(rig.terms.size());
  for (JointMatrix& matrix : rig.matrices) {
    for (auto& row : matrix.m) {
      for (float& number : row) number = 0.2f * between(random);
    }
  }
  rig.linears = {LinearDriver{.joint = first + 6, .weights = rig.terms, .matrices = rig.matrices}};
  rig.view = {.joints = rig.joints,
              .writtenJoints = riggedJoints,
              .givenWeights = given,
              .drivenWeights = drivenWeights,
              .weightsOf = weightsOf,
              .twists = rig.twists,
              .correctives = rig.correctives,
              .chains = rig.chains,
              .linears = rig.linears};
  return made;
}

PackedRig riggedPose(std::uint32_t seed, std::uint32_t given, std::uint32_t weightsOf) {
  return must(packRig(riggedSource(seed, given, weightsOf)->view));
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
