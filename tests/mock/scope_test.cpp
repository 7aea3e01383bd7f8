// The values of barriers at the edges.

#include <gtest/gtest.h>

#include <cstdint>

#include "dermis/vulkan/scope.h"

namespace dermis::test {
namespace {

TEST(ScopeTest, OutputScopesNameTheConsumer) {
  using namespace vulkan;
  for (const Consumer consumer :
       {Consumer::vertexInput, Consumer::vertexShader, Consumer::compute,
        Consumer::accelerationStructureBuild, Consumer::transfer, Consumer::hostRead}) {
    const Dependency dependency = outputScope(consumer);
    EXPECT_EQ(dependency.source.stages,
              static_cast<VkPipelineStageFlags>(VK_PIPELINE_STAGE_COMPUTE_SHADER_BIT));
    EXPECT_EQ(dependency.source.accesses, static_cast<VkAccessFlags>(VK_ACCESS_SHADER_WRITE_BIT));
    EXPECT_NE(dependency.destination.stages, 0u);
    EXPECT_NE(dependency.destination.accesses, 0u);
    // The release makes available, the acquire makes visible; the other halves are empty.
    EXPECT_EQ(outputScope(consumer, QueueTransfer::release).destination.accesses, 0u);
    EXPECT_EQ(outputScope(consumer, QueueTransfer::release).source.accesses,
              dependency.source.accesses);
    EXPECT_EQ(outputScope(consumer, QueueTransfer::acquire).source.accesses, 0u);
    EXPECT_EQ(outputScope(consumer, QueueTransfer::acquire).destination.accesses,
              dependency.destination.accesses);
  }
  const VkBufferMemoryBarrier barrier =
      bufferBarrier(outputScope(Consumer::vertexInput, QueueTransfer::release),
                    reinterpret_cast<VkBuffer>(std::uintptr_t{5}), 16, 32, 1, 2);
  EXPECT_EQ(barrier.srcQueueFamilyIndex, 1u);
  EXPECT_EQ(barrier.dstQueueFamilyIndex, 2u);
  EXPECT_EQ(barrier.offset, 16u);
  EXPECT_EQ(barrier.size, 32u);
}

TEST(ScopeTest, InputScopesWaitForWritersAndReaders) {
  using namespace vulkan;
  for (const PreviousUse writer :
       {PreviousUse::hostWrite, PreviousUse::transferWrite, PreviousUse::computeWrite}) {
    EXPECT_NE(inputScope(writer).source.accesses, 0u);
    EXPECT_EQ(inputScope(writer).destination.accesses,
              static_cast<VkAccessFlags>(VK_ACCESS_SHADER_READ_BIT));
  }
  for (const PreviousUse reader :
       {PreviousUse::vertexInput, PreviousUse::vertexShader, PreviousUse::compute,
        PreviousUse::accelerationStructureBuild, PreviousUse::transfer}) {
    EXPECT_NE(inputScope(reader).source.stages, 0u);
    EXPECT_EQ(inputScope(reader).source.accesses, 0u);
    EXPECT_EQ(inputScope(reader).destination.stages,
              static_cast<VkPipelineStageFlags>(VK_PIPELINE_STAGE_COMPUTE_SHADER_BIT));
  }
  const Dependency both =
      inputScope(PreviousUse::transferWrite) | inputScope(PreviousUse::vertexInput);
  EXPECT_EQ(both.source.stages,
            static_cast<VkPipelineStageFlags>(VK_PIPELINE_STAGE_TRANSFER_BIT |
                                              VK_PIPELINE_STAGE_VERTEX_INPUT_BIT));
  EXPECT_EQ(memoryBarrier(both).srcAccessMask,
            static_cast<VkAccessFlags>(VK_ACCESS_TRANSFER_WRITE_BIT));
}

}  // namespace
}  // namespace dermis::test
