// Rigs with any number of drivers of each kind, and poses for them, all random. The same seed gives
// the same rig.
#pragma once

#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <list>
#include <random>
#include <span>
#include <utility>
#include <vector>

#include "dermis/rig.h"
#include "random_number.h"

namespace dermis::test {

struct RigSize {
  std::uint32_t writtenJoints = 60;
  std::uint32_t givenWeights = 0;
  std::uint32_t twists = 8;
  std::uint32_t correctives = 6, inputs = 1, examples = 8;
  std::uint32_t weights = 4, offsetJoints = 1;  ///< of each corrective
  std::uint32_t chains = 2, chainJoints = 4, segments = 8;
  std::uint32_t linears = 0, terms = 3;
  /// Otherwise all parents are written joints, and all functions of correctives Gaussian.
  bool isVaried = false;
};

/// Owns what the view refers to.
class MadeRig {
 public:
  MadeRig(std::uint32_t seed, const RigSize& size) : random_(seed), size_(size) {
    addWritten();
    for (std::uint32_t i = 0; i < size.twists; ++i) addTwist();
    for (std::uint32_t i = 0; i < size.correctives; ++i) addCorrective();
    for (std::uint32_t i = 0; i < size.chains; ++i) addChain();
    for (std::uint32_t i = 0; i < size.linears; ++i) addLinear();
  }
  MadeRig(const MadeRig&) = delete;
  MadeRig& operator=(const MadeRig&) = delete;

  RigView view() const {
    RigView view;
    view.joints = joints_;
    view.writtenJoints = size_.writtenJoints;
    view.givenWeights = size_.givenWeights;
    view.drivenWeights = drivenWeights_;
    view.twists = twists_;
    view.correctives = correctives_;
    view.chains = chains_;
    view.linears = linears_;
    return view;
  }

  /// Matrices of the written joints, each turned about its place in bind pose by up to `most`
  /// radians relative to its parent, and scaled by up to `growth` more or less.
  std::vector<JointMatrix> pose(std::uint32_t seed, double most = 1.5, double growth = 0) const {
    std::mt19937 random(seed);
    std::vector<JointMatrix> pose;
    for (std::uint32_t joint = 0; joint < size_.writtenJoints; ++joint) {
      const double half = between(random, 0, most) / 2, sine = std::sin(half);
      const std::array<float, 3> axis = directionFrom(random);
      const auto part = [&](std::size_t i) { return static_cast<float>(sine * double{axis[i]}); };
      JointMatrix own = rotation({part(0), part(1), part(2), static_cast<float>(std::cos(half))});
      for (std::size_t row = 0; row < 3; ++row) {
        const auto factor = static_cast<float>(1 + between(random, -growth, growth));
        for (std::size_t column = 0; column < 3; ++column) own.m[column][row] *= factor;
      }
      const auto& bind = joints_[joint].bind.m;
      for (auto& row : own.m)
        row[3] = -(row[0] * bind[0][3] + row[1] * bind[1][3] + row[2] * bind[2][3]);
      for (std::size_t row = 0; row < 3; ++row) own.m[row][3] += bind[row][3];
      pose.push_back(joint == 0 ? own : product(pose[joints_[joint].parent], own));
    }
    return pose;
  }

 private:
  static std::array<float, 3> directionFrom(std::mt19937& random) {
    std::array<double, 3> v;
    double square = 0;
    while (square < 0.01 || square > 1) {
      square = 0;
      for (double& number : v) {
        number = between(random, -1, 1);
        square += number * number;
      }
    }
    const auto unit = [&](double number) { return static_cast<float>(number / std::sqrt(square)); };
    return {unit(v[0]), unit(v[1]), unit(v[2])};
  }
  std::array<float, 4> turn() {
    const std::array<float, 3> axis = directionFrom(random_);
    const double half = between(random_, 0, 1.5);
    const auto part = [&](std::size_t i) { return static_cast<float>(std::sin(half)) * axis[i]; };
    return {part(0), part(1), part(2), static_cast<float>(std::cos(half))};
  }
  static JointMatrix rotation(const std::array<float, 4>& q) {
    const auto [x, y, z, w] = q;
    return {{{1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y), 0},
             {2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x), 0},
             {2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y), 0}}};
  }
  static JointMatrix product(const JointMatrix& a, const JointMatrix& b) {
    JointMatrix c;
    for (std::size_t row = 0; row < 3; ++row) {
      for (std::size_t column = 0; column < 4; ++column) {
        float sum = column == 3 ? a.m[row][3] : 0;
        for (std::size_t i = 0; i < 3; ++i) sum += a.m[row][i] * b.m[i][column];
        c.m[row][column] = sum;
      }
    }
    return c;
  }

  float number(double least, double most) {
    return static_cast<float>(between(random_, least, most));
  }
  template <typename T>
  std::span<const T> keep(std::list<std::vector<T>>& lists, std::vector<T> list) {
    return lists.emplace_back(std::move(list));
  }

  /// Limbs of six joints, each of which begins at a joint before it. The joints of the rig are
  /// along a line, so that chains of any of them do not turn back.
  void addWritten() {
    for (std::uint32_t i = 0; i < size_.writtenJoints; ++i) {
      RigJoint& joint = joints_.emplace_back();
      if (i != 0) joint.parent = i % 6 == 1 ? below(random_, i) : i - 1;
      joint.bind = rotation(turn());
      joint.bind.m[0][3] = 0.4f * static_cast<float>(i) + number(-0.1, 0.1);
      joint.bind.m[1][3] = number(-0.2, 0.2);
      joint.bind.m[2][3] = number(-0.2, 0.2);
    }
  }
  std::uint32_t written() { return 1 + below(random_, size_.writtenJoints - 1); }
  /// A joint that drivers may read.
  std::uint32_t readable() { return size_.isVaried ? below(random_, joints_.size()) : written(); }
  /// `above`: its parent.
  std::uint32_t addDriven(std::uint32_t above) {
    RigJoint joint = joints_[written()];
    joint.parent = size_.isVaried && chance(random_, 20) ? RigJoint().parent : above;
    joints_.push_back(joint);
    return static_cast<std::uint32_t>(joints_.size()) - 1;
  }

  void addTwist() {
    TwistDriver twist;
    twist.source = readable();
    twist.axis = directionFrom(random_);
    twist.share = number(-1, 1);
    twist.joint = addDriven(readable());
    twists_.push_back(twist);
  }

  void addCorrective() {
    CorrectiveDriver corrective;
    std::vector<std::uint32_t> inputs, joints;
    std::vector<std::array<float, 4>> examples;
    std::vector<float> weights;
    std::vector<JointOffset> offsets;
    for (std::uint32_t i = 0; i < size_.inputs; ++i) inputs.push_back(readable());
    // None is below another one that the same driver drives.
    for (std::uint32_t i = 0; i < size_.offsetJoints; ++i) joints.push_back(readable());
    for (std::uint32_t& joint : joints) joint = addDriven(joint);
    for (std::uint32_t i = 0; i < size_.examples; ++i) {
      for (std::uint32_t input = 0; input < size_.inputs; ++input) examples.push_back(turn());
      for (std::uint32_t weight = 0; weight < size_.weights; ++weight)
        weights.push_back(number(0, 1));
      for (std::uint32_t joint = 0; joint < size_.offsetJoints; ++joint) {
        offsets.push_back({{number(-0.2, 0.2), number(-0.2, 0.2), number(-0.2, 0.2)},
                           turn(),
                           {number(0.8, 1.2), number(0.8, 1.2), number(0.8, 1.2)}});
      }
    }
    corrective.radius = size_.isVaried && chance(random_, 50) ? 0 : 0.5f;
    corrective.firstWeight = size_.givenWeights + drivenWeights_;
    corrective.weightCount = size_.weights;
    drivenWeights_ += size_.weights;
    corrective.inputs = keep(numbers_, inputs);
    corrective.examples = keep(rotations_, examples);
    corrective.weights = keep(floats_, weights);
    corrective.joints = keep(numbers_, joints);
    corrective.offsets = keep(offsets_, offsets);
    correctives_.push_back(corrective);
  }

  void addChain() {
    ChainDriver chain;
    std::vector<std::uint32_t> joints{below(random_, size_.writtenJoints - size_.chainJoints + 1)};
    while (joints.size() < size_.chainJoints) joints.push_back(joints.back() + 1);
    chain.joints = keep(numbers_, joints);
    chain.segments = size_.segments;
    chain.firstDriven = static_cast<std::uint32_t>(joints_.size());
    for (std::uint32_t i = 1; i < size_.segments; ++i) addDriven(joints[0]);
    chains_.push_back(chain);
  }

  void addLinear() {
    LinearDriver linear;
    std::vector<std::uint32_t> weights;
    std::vector<JointMatrix> matrices;
    for (std::uint32_t i = 0; i < size_.terms; ++i) {
      weights.push_back(below(random_, size_.givenWeights + drivenWeights_));
      JointMatrix& matrix = matrices.emplace_back();
      for (auto& row : matrix.m) {
        for (float& one : row) one = number(-0.2, 0.2);
      }
    }
    linear.joint = addDriven(readable());
    linear.weights = keep(numbers_, weights);
    linear.matrices = keep(matrices_, matrices);
    linears_.push_back(linear);
  }

  std::mt19937 random_;
  RigSize size_;
  std::uint32_t drivenWeights_ = 0;
  std::vector<RigJoint> joints_;
  std::vector<TwistDriver> twists_;
  std::vector<CorrectiveDriver> correctives_;
  std::vector<ChainDriver> chains_;
  std::vector<LinearDriver> linears_;
  std::list<std::vector<std::uint32_t>> numbers_;
  std::list<std::vector<float>> floats_;
  std::list<std::vector<std::array<float, 4>>> rotations_;
  std::list<std::vector<JointOffset>> offsets_;
  std::list<std::vector<JointMatrix>> matrices_;
};

}  // namespace dermis::test
