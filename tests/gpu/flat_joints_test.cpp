// Joints that flatten what they move: matrices of rank 2, whose determinant rounding makes a little
// more or a little less than 0. They are no mirrors, and blend with each other as if it were 0.

#include <gtest/gtest.h>

#include <cmath>

#include "dermis/verify.h"
#include "inexact_context.h"
#include "kit/batch_runner.h"
#include "random_rig.h"
#include "test_device.h"

namespace dermis::test {
namespace {

double determinantOf(const JointMatrix& joint) {
  const auto m = [&](int row, int column) { return double{joint.m[row][column]}; };
  return m(0, 0) * (m(1, 1) * m(2, 2) - m(1, 2) * m(2, 1)) -
         m(0, 1) * (m(1, 0) * m(2, 2) - m(1, 2) * m(2, 0)) +
         m(0, 2) * (m(1, 0) * m(2, 1) - m(1, 1) * m(2, 0));
}

/// Rigid joints behind a projection along a random direction of each, in float32.
std::vector<JointMatrix> flatPose(std::uint32_t seed, std::uint32_t jointCount) {
  std::vector<JointMatrix> pose = randomPose(seed, jointCount, Rigidity::rigid);
  const std::vector<JointMatrix> directions = randomPose(seed + 1, jointCount, Rigidity::rigid);
  for (std::uint32_t joint = 0; joint < jointCount; ++joint) {
    const JointMatrix rigid = pose[joint];
    for (int row = 0; row < 3; ++row) {
      double along = 0;
      for (int k = 0; k < 3; ++k)
        along += double{rigid.m[row][k]} * double{directions[joint].m[0][k]};
      for (int column = 0; column < 3; ++column)
        pose[joint].m[row][column] = static_cast<float>(
            double{rigid.m[row][column]} - along * double{directions[joint].m[0][column]});
    }
  }
  return pose;
}

class FlatJointsTest : public DeviceTest, public ::testing::WithParamInterface<Method> {};

TEST_P(FlatJointsTest, AreNotTakenForMirrors) {
  constexpr std::uint32_t jointCount = 40;
  const Method method = GetParam();
  OwnedMesh mesh = randomMesh(1, 2000, jointCount, 4);
  const std::vector<JointMatrix> pose = flatPose(2, jointCount);
  std::uint32_t below = 0, above = 0;
  for (const JointMatrix& joint : pose) {
    const double determinant = determinantOf(joint);
    EXPECT_LT(std::abs(determinant), 1e-6);
    below += determinant < 0;
    above += determinant > 0;
  }
  EXPECT_GT(below, 5u);
  EXPECT_GT(above, 5u);
  const Result<PackedMesh> packed = pack(mesh.view(), jointCount);
  ASSERT_TRUE(packed.ok());
  const samples::SkinRequest request{&*packed, pose, JointPromise::scaling, method};
  const Result<reference::SkinnedMesh> expected = reference::skin(mesh.view(), pose, method);
  ASSERT_TRUE(expected.ok());
  const Exemptions exemptions{exemptionsOf(*expected).onlyFinite, 0};
  Inexact fused(device().description(), {"fused", {.fuses = true}});
  ASSERT_TRUE(fused.context.ok());
  for (vulkan::Context* const each : {&context(), &*fused.context}) {
    SCOPED_TRACE(each == &context() ? "as the device rounds" : "where fma rounds once");
    const Result<samples::BatchResult> result = samples::runBatch(device(), *each, {&request, 1});
    ASSERT_TRUE(result.ok()) << result.error().message;
    const Result<Comparison> comparison =
        compareWithReference(*expected, result->instances[0].view(), exemptions);
    ASSERT_TRUE(comparison.ok());
    EXPECT_TRUE(comparison->passed()) << "positions up to " << comparison->worstPosition
                                      << " of the bound, normals up to " << comparison->worstNormal;
    EXPECT_EQ(comparison->compared + comparison->exempt.onlyFinite, mesh.vertexCount());
    EXPECT_LE(comparison->exempt.onlyFinite, mesh.vertexCount() / 100);
  }
}

INSTANTIATE_TEST_SUITE_P(Methods, FlatJointsTest, ::testing::ValuesIn(allMethods),
                         [](const ::testing::TestParamInfo<Method>& method) {
                           return std::string(methodName(method.param));
                         });

}  // namespace
}  // namespace dermis::test
