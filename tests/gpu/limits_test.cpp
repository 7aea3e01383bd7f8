// Batches that are larger than a device's limits allow in one piece. The device is made to look
// smaller than it is, so that the test needs no large memory; the validation layer still sees every
// command.

#include <gtest/gtest.h>

#include "intercepted_device.h"
#include "kit/batch_runner.h"
#include "random_rig.h"
#include "test_device.h"

namespace dermis::test {
namespace {

class LimitsTest : public DeviceTest {};

TEST_F(LimitsTest, OutputLargerThanAStorageBufferRangeIsSplit) {
  std::vector<OwnedMesh> meshes{randomMesh(1, 1234, 20, 4), randomMesh(2, 70, 20, 2)};
  const std::vector<PackedMesh> packed{*pack(meshes[0].view(), 20), *pack(meshes[1].view(), 20)};
  std::vector<std::vector<JointMatrix>> poses;
  for (std::uint32_t i = 0; i < 50; ++i) poses.push_back(randomPose(i, 20, Rigidity::rigid));
  std::vector<samples::SkinRequest> requests;
  for (std::uint32_t i = 0; i < 50; ++i) {
    requests.push_back({&packed[i % 2], poses[i], JointPromise::scaleIgnored,
                        i % 3 == 0 ? Method::linear : Method::dualQuaternion});
  }
  samples::RunOptions options;
  options.output.gap = 4;
  const Result<samples::BatchResult> whole =
      samples::runBatch(device(), context(), requests, options);
  ASSERT_TRUE(whole.ok());

  for (const bool pushDescriptors : {true, false}) {
    useDevice(pushDescriptors);
    InterceptedDevice small(device().description());
    // 880 kB of output in ranges of 128 KiB; an instance of 34 kB is longer than the 8 KiB that two
    // ranges share.
    small.changeLimits(
        [](VkPhysicalDeviceLimits& limits) { limits.maxStorageBufferRange = 128 << 10; });
    Result<vulkan::Context> context = vulkan::Context::create(small.description());
    ASSERT_TRUE(context.ok());
    const Result<samples::BatchResult> split =
        samples::runBatch(device(), *context, requests, options);
    ASSERT_TRUE(split.ok()) << split.error().message;
    EXPECT_GT(split->dispatches, whole->dispatches + 7);
    EXPECT_EQ(split->untouchedBytesChanged, 0u);
    for (std::size_t i = 0; i < requests.size(); ++i) {
      EXPECT_EQ(split->instances[i].positions, whole->instances[i].positions) << i;
      EXPECT_EQ(split->instances[i].normals, whole->instances[i].normals) << i;
    }
  }
}

TEST_F(LimitsTest, MoreWorkgroupsThanADimensionHasAreFolded) {
  OwnedMesh mesh = randomMesh(3, 1000, 10, 4);
  const PackedMesh packed = *pack(mesh.view(), 10);
  std::vector<std::vector<JointMatrix>> poses;
  for (std::uint32_t i = 0; i < 30; ++i) poses.push_back(randomPose(i, 10, Rigidity::rigid));
  std::vector<samples::SkinRequest> requests;
  for (const std::vector<JointMatrix>& pose : poses)
    requests.push_back({&packed, pose, JointPromise::scaleIgnored});
  const Result<samples::BatchResult> flat = samples::runBatch(device(), context(), requests);
  ASSERT_TRUE(flat.ok());

  InterceptedDevice narrow(device().description());
  narrow.changeLimits(
      [](VkPhysicalDeviceLimits& limits) { limits.maxComputeWorkGroupCount[0] = 13; });
  Result<vulkan::Context> context = vulkan::Context::create(narrow.description());
  ASSERT_TRUE(context.ok());
  const Result<samples::BatchResult> folded = samples::runBatch(device(), *context, requests);
  ASSERT_TRUE(folded.ok()) << folded.error().message;
  for (std::size_t i = 0; i < requests.size(); ++i) {
    EXPECT_EQ(folded->instances[i].positions, flat->instances[i].positions) << i;
  }
}

}  // namespace
}  // namespace dermis::test
