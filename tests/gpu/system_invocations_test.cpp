// What is skipped costs nothing in the dispatch, by the device's own count of invocations.

#include "system_visibility.h"

namespace dermis::test {
namespace {

class SystemInvocationsTest : public SystemVisibilityTest {
 protected:
  void SetUp() override {
    SystemVisibilityTest::SetUp();
    if (device_ == nullptr) return;
    samples::DeviceOptions options = testDeviceOptions();
    options.pipelineStatistics = true;
    counting_.emplace(must(samples::openDevice(options)));
    if (!counting_->device->info().pipelineStatistics) GTEST_SKIP() << "the device counts nothing";
    VkQueryPoolCreateInfo info{};
    info.sType = VK_STRUCTURE_TYPE_QUERY_POOL_CREATE_INFO;
    info.queryType = VK_QUERY_TYPE_PIPELINE_STATISTICS;
    info.queryCount = 1;
    info.pipelineStatistics = VK_QUERY_PIPELINE_STATISTIC_COMPUTE_SHADER_INVOCATIONS_BIT;
    ASSERT_EQ(functions().CreateQueryPool(counting_->device->handle(), &info, nullptr, &pool_),
              VK_SUCCESS);
  }
  void TearDown() override {
    engine_.reset();
    words_ = {};
    if (pool_ != VK_NULL_HANDLE)
      functions().DestroyQueryPool(counting_->device->handle(), pool_, nullptr);
    if (counting_) {
      for (const std::string& message : counting_->device->takeValidationMessages())
        ADD_FAILURE() << message;
    }
    counting_.reset();
    SystemVisibilityTest::TearDown();
  }
  void openCounting(bool culledOnGpu) {
    vulkan::SceneRecorderDescription counted = description();
    open(*counting_->device, counting_->context, counted, culledOnGpu, plainLayout());
    engine_->beforeRecord = [this](VkCommandBuffer commandBuffer) {
      functions().CmdResetQueryPool(commandBuffer, pool_, 0, 1);
      functions().CmdBeginQuery(commandBuffer, pool_, 0, 0);
    };
    engine_->afterRecord = [this](VkCommandBuffer commandBuffer) {
      functions().CmdEndQuery(commandBuffer, pool_, 0);
    };
  }
  /// Of the frame that was submitted last.
  std::uint64_t invocations() {
    engine_->finish();
    std::uint64_t count = 0;
    EXPECT_EQ(functions().GetQueryPoolResults(counting_->device->handle(), pool_, 0, 1,
                                              sizeof(count), &count, sizeof(count),
                                              VK_QUERY_RESULT_64_BIT | VK_QUERY_RESULT_WAIT_BIT),
              VK_SUCCESS);
    return count;
  }
  const samples::VulkanFunctions& functions() const { return counting_->device->functions(); }

  std::optional<samples::OpenDevice> counting_;
  VkQueryPool pool_ = VK_NULL_HANDLE;
};

TEST_F(SystemInvocationsTest, WhatRestsRunsNoInvocation) {
  openCounting(false);
  engine_->submit();
  const std::uint64_t all = invocations();
  EXPECT_EQ(all, engine_->lastFrame().workgroups * Tuning{}.workgroupSize);
  engine_->runFrame();
  EXPECT_EQ(invocations(), 0u);
  engine_->begin();
  for (std::uint32_t i = 0; i < 6; ++i) engine_->writePose(palettes_[i], systemPose(i));
  engine_->submit();
  EXPECT_LE(invocations() * 5, all);
  EXPECT_EQ(invocations(), engine_->lastFrame().workgroups * Tuning{}.workgroupSize);
}

TEST_F(SystemInvocationsTest, WhatIsHiddenRunsNoInvocation) {
  openCounting(false);
  engine_->submit();
  const std::uint64_t all = invocations();
  engine_->begin();
  moveAll(100);
  for (std::uint32_t i = 6; i < instanceCount; ++i)
    must((*engine_)->change({.instance = instances_[i], .visible = false}));
  engine_->submit();
  EXPECT_LE(invocations() * 5, all);
}

TEST_F(SystemInvocationsTest, WhatTheGpuCullsRunsFewInvocations) {
  openCounting(true);
  submit();
  const std::uint64_t all = invocations();
  const std::uint32_t workgroups = completed().workgroups;
  show(0, 0);
  moveAll(100);
  submit();
  const std::uint64_t none = invocations();
  EXPECT_EQ(completed().workgroups, 0u);
  // What is left are the palettes and the visibility kernel, which are a few invocations each.
  EXPECT_EQ(all - none, std::uint64_t{workgroups} * Tuning{}.workgroupSize);
  submit();
}

}  // namespace
}  // namespace dermis::test
