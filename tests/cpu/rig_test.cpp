// Rigs by SIMD: what they drive has the bits of `evaluateRig` for every instruction set and any
// number of poses, and nothing else is written.

#include <gtest/gtest.h>

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <cstring>
#include <random>
#include <string_view>
#include <vector>

#include "cpu/task.h"
#include "dermis/cpu.h"
#include "dermis/rig.h"
#include "made_rig.h"

namespace dermis::test {
namespace {

/// A pose and what is driven in it, between floats that nothing may write.
class GuardedPose {
 public:
  GuardedPose(const PackedRig& rig, std::vector<JointMatrix> written, std::vector<float> given)
      : written_(std::move(written)),
        given_(std::move(given)),
        driven_(rig.drivenJoints() + 2, guard),
        weights_(rig.givenWeights() + rig.drivenWeights() + 2, guard.m[0][0]) {}

  cpu::RigPose pose() {
    return {written_, given_, std::span(driven_).subspan(1, driven_.size() - 2),
            std::span(weights_).subspan(1, weights_.size() - 2)};
  }
  bool hasSameBits(const GuardedPose& other) const {
    return std::memcmp(driven_.data(), other.driven_.data(), driven_.size() * sizeof(driven_[0])) ==
               0 &&
           std::memcmp(weights_.data(), other.weights_.data(),
                       weights_.size() * sizeof(weights_[0])) == 0;
  }

 private:
  static constexpr JointMatrix guard{{{7, 7, 7, 7}, {7, 7, 7, 7}, {7, 7, 7, 7}}};
  std::vector<JointMatrix> written_;
  std::vector<float> given_;
  std::vector<JointMatrix> driven_;
  std::vector<float> weights_;
};

class CpuRigTest : public ::testing::TestWithParam<std::string_view> {
 protected:
  void SetUp() override { ASSERT_TRUE(cpu::setTarget(GetParam()).ok()); }
  ~CpuRigTest() override { EXPECT_TRUE(cpu::setTarget({}).ok()); }

  static void expectSameBits(const MadeRig& made, std::size_t poseCount, double most) {
    const Result<PackedRig> rig = packRig(made.view());
    ASSERT_TRUE(rig.ok()) << rig.error().message;
    std::mt19937 random(3);
    std::vector<GuardedPose> poses;
    for (std::uint32_t i = 0; i < poseCount; ++i) {
      std::vector<float> given(rig->givenWeights());
      for (float& weight : given) weight = static_cast<float>(between(random, -1, 1));
      poses.emplace_back(*rig, made.pose(i, most, i % 3 == 1 ? 0.3 : 0), given);
    }
    std::vector<GuardedPose> expected = poses;
    std::vector<cpu::RigPose> tasks;
    for (GuardedPose& pose : poses) tasks.push_back(pose.pose());
    cpu::RigScratch scratch;
    scratch.prepare(*rig);
    cpu::dispatchRigs(*rig, tasks, scratch);
    for (std::size_t i = 0; i < poseCount; ++i) {
      const cpu::RigPose pose = expected[i].pose();
      ASSERT_TRUE(
          evaluateRig(*rig, pose.written, pose.givenWeights, pose.driven, pose.weights).ok());
      EXPECT_TRUE(poses[i].hasSameBits(expected[i])) << "pose " << i << " of " << poseCount;
    }
  }
};

TEST_P(CpuRigTest, BitsAreThoseOfCore) {
  for (std::uint32_t seed = 0; seed < 8; ++seed) {
    SCOPED_TRACE(seed);
    const MadeRig made(seed, {.writtenJoints = 20,
                              .givenWeights = 3,
                              .twists = 4,
                              .correctives = 4,
                              .inputs = 1 + seed % 3,
                              .examples = 5,
                              .weights = 1 + seed,
                              .offsetJoints = 2,
                              .chains = 2,
                              .chainJoints = 2 + seed % 3,
                              .segments = 5,
                              .linears = 3,
                              .isVaried = true});
    for (const std::size_t poses : {0u, 1u, 3u, 8u, 21u}) expectSameBits(made, poses, 6);
  }
}

TEST_P(CpuRigTest, BitsAreThoseOfCoreInBindPose) {
  expectSameBits(MadeRig(1, {.writtenJoints = 20, .linears = 1}), 5, 0);
}

TEST_P(CpuRigTest, ARigMayHaveNoDriver) {
  expectSameBits(
      MadeRig(1,
              {.writtenJoints = 20, .givenWeights = 3, .twists = 0, .correctives = 0, .chains = 0}),
      5, 1);
}

INSTANTIATE_TEST_SUITE_P(Instructions, CpuRigTest, ::testing::ValuesIn(cpu::targetNames()),
                         [](const auto& tested) { return std::string(tested.param); });

}  // namespace
}  // namespace dermis::test
