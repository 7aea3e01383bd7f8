// The layer's silence is worth something: a barrier that is left out on purpose is reported.

#include <gtest/gtest.h>

#include <algorithm>

#include "intercepted_device.h"
#include "kit/batch_runner.h"
#include "random_rig.h"
#include "test_device.h"

namespace dermis::test {
namespace {

/// As if Dermis had forgotten its barriers.
void VKAPI_CALL forgetBarrier(VkCommandBuffer, VkPipelineStageFlags, VkPipelineStageFlags,
                              VkDependencyFlags, std::uint32_t, const VkMemoryBarrier*,
                              std::uint32_t, const VkBufferMemoryBarrier*, std::uint32_t,
                              const VkImageMemoryBarrier*) {}

class SynchronizationTest : public DeviceTest {};

std::size_t countHazards(const std::vector<std::string>& messages) {
  return static_cast<std::size_t>(
      std::count_if(messages.begin(), messages.end(), [](const std::string& message) {
        return message.starts_with("SYNC-HAZARD-READ-AFTER-WRITE");
      }));
}

TEST_F(SynchronizationTest, AMissingBarrierBetweenThePassesIsReported) {
  OwnedMesh mesh = randomMesh(1, 100, 5, 4);
  const PackedMesh packedMesh = *pack(mesh.view(), 5);
  const std::vector<JointMatrix> pose = randomPose(2, 5, Rigidity::rigid);
  const samples::SkinRequest request{&packedMesh, pose, JointPromise::scaling,
                                     Method::dualQuaternion};

  ASSERT_TRUE(samples::runBatch(device(), context(), {&request, 1}).ok());
  EXPECT_TRUE(device().takeValidationMessages().empty()) << "with the barrier the layer is silent";

  InterceptedDevice intercepted(device().description());
  intercepted.replace("vkCmdPipelineBarrier", forgetBarrier);
  Result<vulkan::Context> forgetful = vulkan::Context::create(intercepted.description());
  ASSERT_TRUE(forgetful.ok());
  ASSERT_TRUE(samples::runBatch(device(), *forgetful, {&request, 1}).ok());
  const std::vector<std::string> messages = device().takeValidationMessages();
  EXPECT_GE(countHazards(messages), 1u)
      << "the layer does not see a missing barrier: " << messages.size() << " messages";
}

}  // namespace
}  // namespace dermis::test
