// The C interface against that of C++: rigs. What both do must be the same to the bit.
#include <array>
#include <limits>
#include <string>
#include <vector>

#include "c_helpers.h"
#include "dermis/rig.h"
#include "dermis/verify.h"

namespace dermis::test {
namespace {

constexpr std::uint32_t written = 4, driven = 6;

/// The same rig twice, with a driver of each kind.
class CRigsTest : public ::testing::Test {
 protected:
  CRigsTest() {
    for (std::uint32_t i = 0; i < written + driven; ++i) {
      const std::uint32_t parent = i < written ? i : i - written + 1;  // 1 + its index
      RigJoint& joint = joints.emplace_back();
      if (parent != 0) joint.parent = parent - 1;
      joint.bind.m[0][3] = 0.5f * static_cast<float>(i % written);
      joint.bind.m[1][3] = i % 2 == 0 ? 0.0f : 0.125f;
      dermis_rig_joint& same = cJoints.emplace_back();
      same.parent = parent;
      std::memcpy(&same.bind, &joint.bind, sizeof(same.bind));
    }
    twist.joint = 4;
    twist.source = 2;
    twist.axis[0] = 1;
    twist.axis[1] = 0.25f;
    twist.share = -0.75f;
    corrective.inputs = inputs.data();
    corrective.input_count = 2;
    corrective.example_count = 2;
    corrective.rotations = rotations.data();
    corrective.first_weight = 1;
    corrective.weight_count = 2;
    corrective.weights = weights.data();
    corrective.joints = &offsetJoint;
    corrective.joint_count = 1;
    corrective.offsets = offsets.data();
    corrective.radius = 0.75f;
    chain.joints = chainJoints.data();
    chain.joint_count = 3;
    chain.first_driven = 6;
    chain.segments = 4;
    linear.joint = 9;
    linear.weights = terms.data();
    linear.matrices = matrices.data();
    linear.count = 2;
    for (std::size_t i = 0; i < matrices.size(); ++i) {
      for (std::size_t row = 0; row < 3; ++row) {
        for (std::size_t column = 0; column < 4; ++column) {
          const auto number = static_cast<float>((3 * i + 5 * row + 7 * column) % 4);
          sameMatrices[i].m[row][column] = matrices[i].m[row][column] = 0.125f * number;
        }
      }
    }
    source.joint_count = written + driven;
    source.written_joints = written;
    source.given_weights = 1;
    source.driven_weights = 2;
    source.weights_of = 5;
    source.joints = cJoints.data();
    source.twists = &twist;
    source.correctives = &corrective;
    source.chains = &chain;
    source.linears = &linear;
    source.twist_count = source.corrective_count = source.chain_count = source.linear_count = 1;
  }
  /// Calls a function with that of C++.
  template <typename Function>
  auto withSame(const Function& use) const {
    const TwistDriver sameTwist{.joint = 4, .source = 2, .axis = {1, 0.25f, 0}, .share = -0.75f};
    std::array<std::array<float, 4>, 4> examples{};
    std::memcpy(examples.data(), rotations.data(), sizeof(rotations));
    const std::array<JointOffset, 2> sameOffsets{
        JointOffset{.translation = {0, 0.25f, 0}},
        JointOffset{.rotation = {0, 0.5f, 0, 2}, .scale = {1, 0, 0.5f}}};
    const CorrectiveDriver sameCorrective{.inputs = inputs,
                                          .examples = examples,
                                          .radius = 0.75f,
                                          .firstWeight = 1,
                                          .weightCount = 2,
                                          .weights = weights,
                                          .joints = {&offsetJoint, 1},
                                          .offsets = sameOffsets};
    const LinearDriver sameLinear{.joint = 9, .weights = terms, .matrices = sameMatrices};
    return must(use(RigView{.joints = joints,
                            .writtenJoints = written,
                            .givenWeights = 1,
                            .drivenWeights = 2,
                            .weightsOf = 5,
                            .twists = {&sameTwist, 1},
                            .correctives = {&sameCorrective, 1},
                            .chains = {&sameChain, 1},
                            .linears = {&sameLinear, 1}}));
  }
  dermis_packed_rig_info pack(Owned<dermis_packed_rig>& rig) {
    expectOk(dermis_pack_rig(&source, &rig, &error));
    dermis_packed_rig_info info = sized<dermis_packed_rig_info>();
    expectOk(dermis_packed_rig_contents(rig, &info, &error));
    return info;
  }
  void expectRefused(const std::string& part, dermis_code code = DERMIS_INVALID_ARGUMENT) {
    Owned<dermis_packed_rig> none;
    expectError(dermis_pack_rig(&source, &none, &error), part, code);
    EXPECT_EQ(none.object, nullptr);
  }

  std::vector<RigJoint> joints;
  std::vector<dermis_rig_joint> cJoints;
  dermis_twist twist = sized<dermis_twist>();
  const std::array<std::uint32_t, 2> inputs{1, 2};
  const std::array<float, 16> rotations{0, 0, 0, 1, 0, 0, 0, 1, 0.5f, 0, 0.25f, 1, 0, 2, 0, 3};
  const std::array<float, 4> weights{0, 1, 0.5f, -1};
  const std::uint32_t offsetJoint = 5;
  // Zeros are no rotation and no scale, but not beside other numbers.
  const std::array<dermis_joint_offset, 2> offsets{
      dermis_joint_offset{{0, 0.25f, 0}, {}, {}},
      dermis_joint_offset{{}, {0, 0.5f, 0, 2}, {1, 0, 0.5f}}};
  dermis_corrective corrective = sized<dermis_corrective>();
  const std::array<std::uint32_t, 3> chainJoints{0, 1, 2};
  const ChainDriver sameChain{.joints = chainJoints, .firstDriven = 6, .segments = 4};
  dermis_chain chain = sized<dermis_chain>();
  const std::array<std::uint32_t, 2> terms{0, 2};
  std::array<dermis_joint, 2> matrices{};
  std::array<JointMatrix, 2> sameMatrices{};
  dermis_linear linear = sized<dermis_linear>();
  dermis_rig_source source = sized<dermis_rig_source>();
};

TEST_F(CRigsTest, ARigIsThatOfCpp) {
  const PackedRig same = withSame([](const RigView& view) { return packRig(view); });
  Owned<dermis_packed_rig> rig, loaded;
  const dermis_packed_rig_info info = pack(rig);
  ASSERT_EQ(info.byte_count, same.bytes().size());
  EXPECT_TRUE(isSame(info.bytes, same.bytes().data(), same.bytes().size()));
  EXPECT_EQ(info.written_joints, written);
  EXPECT_EQ(info.driven_joints, driven);
  EXPECT_EQ(info.given_weights, 1u);
  EXPECT_EQ(info.driven_weights, 2u);
  EXPECT_EQ(info.weights_of, 5u);
  EXPECT_EQ(info.is_rigid, 0u);
  EXPECT_EQ(info.residual, same.residual());
  expectOk(dermis_packed_rig_load(info.bytes, info.byte_count, &loaded, &error));
  dermis_packed_rig_info again = sized<dermis_packed_rig_info>();
  expectOk(dermis_packed_rig_contents(loaded, &again, &error));
  ASSERT_EQ(again.byte_count, info.byte_count);
  EXPECT_TRUE(isSame(again.bytes, info.bytes, info.byte_count));

  std::array<JointMatrix, written> pose{};
  for (std::uint32_t i = 0; i < written; ++i) pose[i].m[1][2] = 0.25f * static_cast<float>(i);
  const float given = 0.375f;
  std::array<JointMatrix, driven> expected{}, found{};
  std::array<float, 3> expectedWeights{}, foundWeights{};
  must(evaluateRig(same, pose, {&given, 1}, expected, expectedWeights));
  auto* const cPose = reinterpret_cast<dermis_joint*>(pose.data());
  auto* const cFound = reinterpret_cast<dermis_joint*>(found.data());
  expectOk(dermis_evaluate_rig(loaded, cPose, written, &given, 1, cFound, driven,
                               foundWeights.data(), 3, &error));
  EXPECT_TRUE(isSame(found.data(), expected.data(), sizeof(found)));
  EXPECT_EQ(foundWeights, expectedWeights);
  EXPECT_NE(foundWeights[2], 0);

  // Refused calls write nothing.
  foundWeights = {7, 7, 7};
  const auto refused = [&](const std::string& part, const dermis_joint* from, std::uint32_t count,
                           const float* first, dermis_joint* to, float* toWeights,
                           std::uint32_t weightCount) {
    expectError(
        dermis_evaluate_rig(rig, from, count, first, 1, to, driven, toWeights, weightCount, &error),
        part);
  };
  float* const all = foundWeights.data();
  refused("dermis_evaluate_rig: there are 3 written joints", cPose, 3, &given, cFound, all, 3);
  refused("there are 2 weights in all", cPose, written, &given, cFound, all, 2);
  refused("written is null", nullptr, written, &given, cFound, all, 3);
  refused("given_weights is null", cPose, written, nullptr, cFound, all, 3);
  refused("driven is null", cPose, written, &given, nullptr, all, 3);
  refused("weights is null", cPose, written, &given, cFound, nullptr, 3);
  expectError(
      dermis_evaluate_rig(nullptr, cPose, written, &given, 1, cFound, driven, all, 3, &error),
      "rig is null");
  EXPECT_EQ(foundWeights, (std::array<float, 3>{7, 7, 7}));

  expectError(dermis_packed_rig_contents(nullptr, &again, &error), "rig is null");
  again.size = 8;
  expectError(dermis_packed_rig_contents(rig, &again, &error), "info: its size is 8");
  expectError(dermis_packed_rig_load(nullptr, 4, &loaded, &error), "bytes is null");
  expectError(dermis_packed_rig_load(info.bytes, info.byte_count, nullptr, &error), "rig is null");
  Owned<dermis_packed_rig> none;
  expectError(dermis_packed_rig_load(info.bytes, info.byte_count - 4, &none, &error), "",
              DERMIS_INVALID_DATA);
  EXPECT_EQ(none.object, nullptr);
}

TEST_F(CRigsTest, TheReferenceIsThatOfCpp) {
  std::array<JointMatrix, written> pose{};
  for (std::uint32_t i = 0; i < written; ++i) pose[i].m[1][2] = 0.25f * static_cast<float>(i);
  const float given = 0.375f;
  const auto same = withSame([&](const RigView& view) {
    return reference::evaluateRig(view, pose, {&given, 1});
  });
  constexpr std::size_t numbers = 12 * driven;
  std::vector<double> exact(numbers, 7), bounds(numbers, 7), allWeights(3, 7), weightBounds(3, 7);
  const auto evaluate = [&](std::uint32_t count, std::size_t jointNumbers,
                            std::size_t weightCount) {
    return dermis_reference_rig(&source, reinterpret_cast<const dermis_joint*>(pose.data()), count,
                                &given, 1, exact.data(), bounds.data(), jointNumbers,
                                allWeights.data(), weightBounds.data(), weightCount, &error);
  };
  // Refused calls write nothing.
  expectError(evaluate(3, numbers, 3), "there are 3 joints and 1 weights, but the rig has 4 and 1");
  expectError(evaluate(written, numbers - 1, 3), "joints have 72 numbers, not 71");
  expectError(evaluate(written, numbers, 2), "weights have 3 numbers, not 2");
  expectError(dermis_reference_rig(nullptr, nullptr, 0, nullptr, 0, nullptr, nullptr, 0, nullptr,
                                   nullptr, 0, &error),
              "source is null");
  expectError(dermis_reference_rig(&source, nullptr, written, &given, 1, nullptr, nullptr, 0,
                                   nullptr, nullptr, 0, &error),
              "written is null");
  expectError(
      dermis_reference_rig(&source, reinterpret_cast<const dermis_joint*>(pose.data()), written,
                           nullptr, 1, nullptr, nullptr, 0, nullptr, nullptr, 0, &error),
      "given_weights is null");
  twist.size = 4;
  expectError(evaluate(written, numbers, 3), "twists[0]: its size is 4");
  twist.size = sizeof(twist);
  EXPECT_EQ(exact, std::vector<double>(numbers, 7));
  EXPECT_EQ(weightBounds, std::vector<double>(3, 7));

  expectOk(evaluate(written, numbers, 3));
  EXPECT_TRUE(isSame(exact.data(), same.joints.data(), 8 * numbers));
  EXPECT_TRUE(isSame(bounds.data(), same.jointBounds.data(), 8 * numbers));
  EXPECT_EQ(allWeights, same.weights);
  EXPECT_EQ(weightBounds, same.weightBounds);
  expectOk(dermis_reference_rig(&source, reinterpret_cast<const dermis_joint*>(pose.data()),
                                written, &given, 1, nullptr, nullptr, 0, nullptr, nullptr, 0,
                                &error));
}

TEST_F(CRigsTest, WithoutGivenWeightsNoNodeHasThem) {
  source = sized<dermis_rig_source>();
  source.joint_count = source.written_joints = 1;
  source.joints = cJoints.data();
  Owned<dermis_packed_rig> rig;
  const dermis_packed_rig_info info = pack(rig);
  EXPECT_EQ(info.weights_of, 0xffffffffu);
  EXPECT_EQ(info.driven_joints, 0u);
  EXPECT_EQ(info.is_rigid, 1u);
}

TEST_F(CRigsTest, WhatIsWrongWithARigIsSaid) {
  expectError(dermis_pack_rig(nullptr, nullptr, &error), "source is null");
  expectError(dermis_pack_rig(&source, nullptr, &error), "rig is null");
  const dermis_rig_source right = source;
  const auto wrongSource = [&](const std::string& part, const dermis_rig_source& wrong,
                               dermis_code code = DERMIS_INVALID_ARGUMENT) {
    source = wrong;
    expectRefused(part, code);
    source = right;
  };
  dermis_rig_source wrong = right;
  wrong.size = 8;
  wrongSource("source: its size is 8", wrong);
  const auto without = [&](auto member, const std::string& part) {
    dermis_rig_source changed = right;
    changed.*member = nullptr;
    wrongSource(part, changed);
  };
  without(&dermis_rig_source::joints, "joints is null");
  without(&dermis_rig_source::twists, "twists is null");
  without(&dermis_rig_source::correctives, "correctives is null");
  without(&dermis_rig_source::chains, "chains is null");
  without(&dermis_rig_source::linears, "linears is null");
  wrong = right;
  wrong.written_joints = 0;
  wrongSource("dermis_pack_rig: of 10 joints 0 are written", wrong);
  const std::vector<dermis_rig_joint> many(65537);
  wrong = sized<dermis_rig_source>();
  wrong.joints = many.data();
  wrong.joint_count = wrong.written_joints = 65537;
  wrongSource("there are 65537 joints", wrong, DERMIS_LIMIT_EXCEEDED);

  // What a driver has.
  const auto wrongDriver = [&](auto& driver, auto member, auto value, const std::string& part,
                               dermis_code code = DERMIS_INVALID_ARGUMENT) {
    const auto saved = driver;
    driver.*member = value;
    expectRefused(part, code);
    driver = saved;
  };
  wrongDriver(twist, &dermis_twist::size, 4u, "twists[0]: its size is 4");
  wrongDriver(twist, &dermis_twist::share, std::numeric_limits<float>::quiet_NaN(), "twist 0");
  wrongDriver(twist, &dermis_twist::joint, 3u, "twist 0 drives joint 3, which is written");
  wrongDriver(corrective, &dermis_corrective::size, 8u, "correctives[0]: its size is 8");
  wrongDriver(corrective, &dermis_corrective::inputs, nullptr, "a corrective's inputs is null");
  wrongDriver(corrective, &dermis_corrective::rotations, nullptr,
              "a corrective's rotations is null");
  wrongDriver(corrective, &dermis_corrective::weights, nullptr, "a corrective's weights is null");
  wrongDriver(corrective, &dermis_corrective::joints, nullptr, "a corrective's joints is null");
  wrongDriver(corrective, &dermis_corrective::offsets, nullptr, "a corrective's offsets is null");
  wrongDriver(corrective, &dermis_corrective::input_count, 0u, "corrective 0");
  wrongDriver(corrective, &dermis_corrective::example_count, 0u, "corrective 0");
  wrongDriver(corrective, &dermis_corrective::first_weight, 2u, "corrective 0 drives weights 2");
  wrongDriver(chain, &dermis_chain::size, 8u, "chains[0]: its size is 8");
  wrongDriver(chain, &dermis_chain::joints, nullptr, "a chain's joints is null");
  wrongDriver(chain, &dermis_chain::segments, 1u, "a chain has 2 to 65536 segments");
  wrongDriver(linear, &dermis_linear::size, 8u, "linears[0]: its size is 8");
  wrongDriver(linear, &dermis_linear::weights, nullptr, "a linear driver's weights is null");
  wrongDriver(linear, &dermis_linear::matrices, nullptr, "a linear driver's matrices is null");
  wrongDriver(linear, &dermis_linear::joint, 10u, "joint 10 does not exist");
  std::array<float, 65 * 8> rotationsOfMany{};
  std::array<float, 65 * 2> weightsOfMany{};
  const std::array<dermis_joint_offset, 65> offsetsOfMany{};
  corrective.example_count = 65;
  corrective.rotations = rotationsOfMany.data();
  corrective.weights = weightsOfMany.data();
  corrective.offsets = offsetsOfMany.data();
  expectRefused("corrective 0", DERMIS_LIMIT_EXCEEDED);
}

TEST_F(CRigsTest, AMeshIsBentAsInCpp) {
  CMesh mesh(3, 50, written);
  const RepairedMesh same = must(bendChain(mesh.mesh.view(), joints, sameChain));
  const PackedMesh expected = must(dermis::pack(same.view(), written + driven));
  Owned<dermis_repaired> bent;
  dermis_mesh_view view = sized<dermis_mesh_view>();
  expectOk(dermis_bend_chain(&mesh.view, cJoints.data(), written + driven, &chain, &view, &bent,
                             &error));
  Owned<dermis_packed> packed;
  expectOk(dermis_pack(&view, written + driven, &packed, &error));
  dermis_packed_info info = sized<dermis_packed_info>();
  expectOk(dermis_packed_contents(packed, &info, &error));
  EXPECT_EQ(info.required_joints, 9u);  // the last of the chain is joint 8
  ASSERT_EQ(info.byte_count, expected.bytes().size());
  EXPECT_TRUE(isSame(info.bytes, expected.bytes().data(), info.byte_count));

  Owned<dermis_repaired> none;
  const auto refused = [&](const std::string& part, const dermis_mesh_view* from,
                           const dermis_rig_joint* of, std::uint32_t count,
                           const dermis_chain* along, dermis_mesh_view* to,
                           dermis_code code = DERMIS_INVALID_ARGUMENT) {
    expectError(dermis_bend_chain(from, of, count, along, to, &none, &error), part, code);
    EXPECT_EQ(none.object, nullptr);
  };
  const dermis_rig_joint* const all = cJoints.data();
  refused("mesh is null", nullptr, all, 10, &chain, &view);
  refused("joints is null", &mesh.view, nullptr, 10, &chain, &view);
  refused("chain is null", &mesh.view, all, 10, nullptr, &view);
  refused("view is null", &mesh.view, all, 10, &chain, nullptr);
  refused("dermis_bend_chain: the chain drives joints up to 8", &mesh.view, all, 8, &chain, &view);
  expectError(dermis_bend_chain(&mesh.view, all, 10, &chain, &view, nullptr, &error),
              "repaired is null");
  dermis_chain wrong = chain;
  wrong.size = 4;
  refused("chain: its size is 4", &mesh.view, all, 10, &wrong, &view);
  wrong = chain;
  wrong.joints = nullptr;
  refused("a chain's joints is null", &mesh.view, all, 10, &wrong, &view);
  mesh.view.influence_set_count = 0;
  refused("it has no joints and weights", &mesh.view, all, 10, &chain, &view, DERMIS_INVALID_MESH);
}

}  // namespace
}  // namespace dermis::test
