// What the skin kernel finds out besides vertices: boxes, and vertices that were clamped.

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <limits>

#include "dermis/mesh.h"
#include "dermis/verify.h"
#include "intercepted_device.h"
#include "kit/batch_runner.h"
#include "random_rig.h"
#include "test_device.h"

namespace dermis::test {
namespace {

class ResultsTest : public DeviceTest {
 protected:
  void SetUp() override {
    DeviceTest::SetUp();
    if (device_ == nullptr) return;
    if (context().limits().maxStorageBuffersPerStage < storageBuffersWanted)
      GTEST_SKIP() << "the device has too few storage buffers for results";
  }
  samples::BatchResult run(vulkan::Context& context, std::span<const samples::SkinRequest> requests,
                           const samples::RunOptions& options) {
    Result<samples::BatchResult> result = samples::runBatch(device(), context, requests, options);
    EXPECT_TRUE(result.ok()) << (result ? "" : result.error().message);
    return result ? std::move(*result) : samples::BatchResult{};
  }
};

Box boxOf(const std::vector<float>& positions) {
  Box box;
  std::fill(std::begin(box.min), std::end(box.min), std::numeric_limits<float>::infinity());
  std::fill(std::begin(box.max), std::end(box.max), -std::numeric_limits<float>::infinity());
  for (std::size_t i = 0; i < positions.size(); ++i) {
    box.min[i % 3] = std::min(box.min[i % 3], positions[i]);
    box.max[i % 3] = std::max(box.max[i % 3], positions[i]);
  }
  return box;
}

void expectSameBox(const std::optional<Box>& box, const Box& expected) {
  ASSERT_TRUE(box.has_value());
  for (std::size_t axis = 0; axis < 3; ++axis) {
    EXPECT_EQ(box->min[axis], expected.min[axis]);
    EXPECT_EQ(box->max[axis], expected.max[axis]);
  }
}

samples::RunOptions withBounds() {
  samples::RunOptions options;
  options.output.bounds = true;
  return options;
}

TEST_F(ResultsTest, BoxesAreExactForEveryInstanceOfABatch) {
  OwnedMesh mesh = randomMesh(1, 1234, 10, 4);
  const PackedMesh packed = *pack(mesh.view(), 10);
  std::vector<std::vector<JointMatrix>> poses;
  for (std::uint32_t i = 0; i < 30; ++i) poses.push_back(randomPose(i, 10, Rigidity::rigid, 3));
  std::vector<samples::SkinRequest> requests;
  for (std::uint32_t i = 0; i < 30; ++i)
    requests.push_back({&packed, poses[i], JointPromise::scaling,
                        i % 2 == 0 ? Method::linear : Method::dualQuaternion});
  const samples::BatchResult result = run(context(), requests, withBounds());
  for (const samples::SkinnedVertices& instance : result.instances)
    expectSameBox(instance.result.box(), boxOf(instance.positions));
}

// An instance cut into pieces by output ranges still has one box.
TEST_F(ResultsTest, BoxesGoAcrossOutputRanges) {
  OwnedMesh mesh = randomMesh(2, 5000, 10, 4);
  const PackedMesh packed = *pack(mesh.view(), 10);
  std::vector<std::vector<JointMatrix>> poses;
  for (std::uint32_t i = 0; i < 8; ++i) poses.push_back(randomPose(i, 10, Rigidity::rigid));
  std::vector<samples::SkinRequest> requests;
  for (const std::vector<JointMatrix>& pose : poses) requests.push_back({&packed, pose});
  InterceptedDevice small(device().description());
  small.changeLimits(
      [](VkPhysicalDeviceLimits& limits) { limits.maxStorageBufferRange = 384 << 10; });
  Result<vulkan::Context> context = vulkan::Context::create(small.description());
  ASSERT_TRUE(context.ok());
  const samples::BatchResult result = run(*context, requests, withBounds());
  EXPECT_GT(result.dispatches, 3u);
  for (const samples::SkinnedVertices& instance : result.instances)
    expectSameBox(instance.result.box(), boxOf(instance.positions));
}

TEST_F(ResultsTest, VerticesThatAreNotFiniteAreLeftOutOfTheBox) {
  OwnedMesh mesh = randomMesh(3, 300, 2, 1);
  const PackedMesh packed = *pack(mesh.view(), 2);
  std::vector<JointMatrix> pose = randomPose(4, 2, Rigidity::rigid);
  const samples::SkinRequest request{&packed, pose, JointPromise::scaling, Method::linear};
  pose[1].m[0][0] = std::numeric_limits<float>::quiet_NaN();
  samples::BatchResult result = run(context(), {&request, 1}, withBounds());
  std::vector<float> finite;
  for (const float value : result.instances[0].positions) finite.push_back(value);
  Box expected = boxOf(finite);  // std::min and max keep what they have beside a NaN
  expectSameBox(result.instances[0].result.box(), expected);

  pose[0] = pose[1] = {};
  for (JointMatrix& joint : pose) {
    for (auto& row : joint.m)
      std::fill(std::begin(row), std::end(row), std::numeric_limits<float>::quiet_NaN());
  }
  for (float& weight : mesh.weights) weight = 1;
  const PackedMesh weighted = *pack(mesh.view(), 2);
  const samples::SkinRequest none{&weighted, pose, JointPromise::scaling, Method::linear};
  result = run(context(), {&none, 1}, withBounds());
  EXPECT_FALSE(result.instances[0].result.box().has_value());
}

// The box that is known before skinning holds the one that is found out by it.
TEST_F(ResultsTest, ConservativeBoxesHoldTheExactOnes) {
  for (const Rigidity rigidity : {Rigidity::rigid, Rigidity::uniformScale, Rigidity::shear,
                                  Rigidity::mirrored, Rigidity::mirroredAlongOneAxis}) {
    OwnedMesh mesh = randomMesh(5, 2000, 12, 5);
    const PackedMesh packed = *pack(mesh.view(), 12);
    const Result<JointBounds> joints = jointBounds(mesh.view(), 12);
    ASSERT_TRUE(joints.ok()) << joints.error().message;
    for (std::uint32_t seed = 0; seed < 10; ++seed) {
      const std::vector<JointMatrix> pose = randomPose(seed, 12, rigidity);
      const JointPromise promise =
          seed % 2 == 0 ? JointPromise::scaling : JointPromise::scaleIgnored;
      for (const Method method : allMethods) {
        const samples::SkinRequest request{&packed, pose, promise, method};
        const samples::BatchResult result = run(context(), {&request, 1}, withBounds());
        const std::optional<Box> exact = result.instances[0].result.box();
        ASSERT_TRUE(exact.has_value());
        const Box box = skinnedBounds(*joints, pose, method, promise);
        for (std::size_t axis = 0; axis < 3; ++axis) {
          EXPECT_LE(box.min[axis], exact->min[axis]);
          EXPECT_GE(box.max[axis], exact->max[axis]);
        }
      }
    }
  }
}

/// Of the reference's positions, and a little more than they may be off by.
Box referenceBox(OwnedMesh& mesh, std::span<const JointMatrix> pose, Method method) {
  const reference::SkinnedMesh skinned = *reference::skin(mesh.view(), pose, method);
  std::vector<float> positions;
  for (const reference::Double3& position : skinned.positions) {
    for (const double coordinate : position) positions.push_back(static_cast<float>(coordinate));
  }
  Box box = boxOf(positions);
  for (std::size_t axis = 0; axis < 3; ++axis) {
    box.min[axis] -= 1e-3f;
    box.max[axis] += 1e-3f;
  }
  return box;
}

TEST_F(ResultsTest, ConservativeBoxesClampNothing) {
  OwnedMesh mesh = randomMesh(6, 2000, 12, 4);
  const PackedMesh packed = *pack(mesh.view(), 12);
  const JointBounds joints = *jointBounds(mesh.view(), 12);
  const std::vector<JointMatrix> pose = randomPose(7, 12, Rigidity::shear);
  samples::RunOptions options;
  options.output.positions = VertexFormat::snorm16x4;
  for (const Method method : {Method::linear, Method::dualQuaternion, Method::blended}) {
    samples::SkinRequest request{&packed, pose, JointPromise::scaling, method};
    request.box = skinnedBounds(joints, pose, method);
    // Of some methods nothing is proven: there the engine has a box of its own.
    if (!std::isfinite(request.box.min[0])) request.box = referenceBox(mesh, pose, method);
    EXPECT_EQ(run(context(), {&request, 1}, options).instances[0].result.clampedVertices, 0u);
    request.box = {{-0.1f, -0.1f, -0.1f}, {0.1f, 0.1f, 0.1f}};
    EXPECT_GT(run(context(), {&request, 1}, options).instances[0].result.clampedVertices, 0u);
  }
}

}  // namespace
}  // namespace dermis::test
