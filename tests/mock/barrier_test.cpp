// The values of barriers at the edges: each is what the Vulkan specification asks for ("Supported
// Access Types", and the chapter of each command for what it reads and writes).

#include <gtest/gtest.h>

#include <cstdint>

#include <vulkan/vulkan_core.h>

#include "dermis/vulkan/context.h"
#include "mock_batch.h"

namespace dermis::test {
namespace {

using vulkan::Barrier;
using vulkan::barrierBetween;
using vulkan::QueueTransfer;

constexpr VkPipelineStageFlags compute = VK_PIPELINE_STAGE_COMPUTE_SHADER_BIT;
constexpr VkAccessFlags reads = VK_ACCESS_SHADER_READ_BIT, writes = VK_ACCESS_SHADER_WRITE_BIT;

struct UseByTheEngine {
  Use use;
  VkPipelineStageFlags stage;
  VkAccessFlags reads, writes;
  const char* name;
};
#define DERMIS_READER(name, stage, access) \
  { Use::name, VK_PIPELINE_STAGE_##stage, VK_ACCESS_##access, 0, #name }
#define DERMIS_WRITER(name, stage, access) \
  { Use::name, VK_PIPELINE_STAGE_##stage, 0, VK_ACCESS_##access, #name }
constexpr UseByTheEngine uses[] = {
    DERMIS_READER(vertexInput, VERTEX_INPUT_BIT, VERTEX_ATTRIBUTE_READ_BIT),
    DERMIS_READER(vertexShader, VERTEX_SHADER_BIT, SHADER_READ_BIT),
    DERMIS_READER(fragmentShader, FRAGMENT_SHADER_BIT, SHADER_READ_BIT),
    DERMIS_READER(taskShader, TASK_SHADER_BIT_EXT, SHADER_READ_BIT),
    DERMIS_READER(meshShader, MESH_SHADER_BIT_EXT, SHADER_READ_BIT),
    DERMIS_READER(rayTracing, RAY_TRACING_SHADER_BIT_KHR, SHADER_READ_BIT),
    // A build reads its vertices with the access of a shader.
    DERMIS_READER(accelerationStructureBuild, ACCELERATION_STRUCTURE_BUILD_BIT_KHR,
                  SHADER_READ_BIT),
    DERMIS_READER(computeRead, COMPUTE_SHADER_BIT, SHADER_READ_BIT),
    DERMIS_READER(copyRead, TRANSFER_BIT, TRANSFER_READ_BIT),
    DERMIS_READER(hostRead, HOST_BIT, HOST_READ_BIT),
    DERMIS_READER(indirectRead, DRAW_INDIRECT_BIT, INDIRECT_COMMAND_READ_BIT),
    DERMIS_WRITER(computeWrite, COMPUTE_SHADER_BIT, SHADER_WRITE_BIT),
    DERMIS_WRITER(copyWrite, TRANSFER_BIT, TRANSFER_WRITE_BIT),
    DERMIS_WRITER(hostWrite, HOST_BIT, HOST_WRITE_BIT),
};
#undef DERMIS_READER
#undef DERMIS_WRITER

// What `record` reads must be made visible to it; what was only read must not be flushed.
TEST(BarrierTest, RecordWaitsForTheEngine) {
  for (const UseByTheEngine& of : uses) {
    SCOPED_TRACE(of.name);
    expectBarrier(barrierBetween(of.use, Use::dermis),
                  {of.stage, of.writes, compute, reads | writes});
  }
}

// What `record` wrote is made visible to readers; and writers wait until it has read.
TEST(BarrierTest, TheEngineWaitsForRecord) {
  for (const UseByTheEngine& of : uses) {
    SCOPED_TRACE(of.name);
    expectBarrier(barrierBetween(Use::dermis, of.use),
                  {compute, writes, of.stage, of.reads | of.writes});
  }
}

TEST(BarrierTest, RecordWaitsForThePreviousRecord) {
  expectBarrier(barrierBetween(Use::dermis, Use::dermis),
                {compute, writes, compute, reads | writes});
}

TEST(BarrierTest, SeveralUsesFitIntoOneBarrier) {
  expectBarrier(barrierBetween(Use::copyWrite | Use::vertexInput,
                               Use::dermis | Use::copyRead | Use::hostRead),
                {VK_PIPELINE_STAGE_TRANSFER_BIT | VK_PIPELINE_STAGE_VERTEX_INPUT_BIT,
                 VK_ACCESS_TRANSFER_WRITE_BIT,
                 compute | VK_PIPELINE_STAGE_TRANSFER_BIT | VK_PIPELINE_STAGE_HOST_BIT,
                 reads | writes | VK_ACCESS_TRANSFER_READ_BIT | VK_ACCESS_HOST_READ_BIT});
}

// Such as a use of a later version: the barrier is right for any.
TEST(BarrierTest, AnUnknownUseMayBeAny) {
  const auto unknown = static_cast<Use>(1u << 31);
  constexpr VkPipelineStageFlags all = VK_PIPELINE_STAGE_ALL_COMMANDS_BIT;
  expectBarrier(barrierBetween(unknown, unknown),
                {all, VK_ACCESS_MEMORY_WRITE_BIT, all,
                 VK_ACCESS_MEMORY_READ_BIT | VK_ACCESS_MEMORY_WRITE_BIT});
}

// Queue Family Ownership Transfer: the release makes the writes available and ignores the second
// half of the dependency, the acquire makes them visible and ignores the first. A stage that the
// other queue lacks (a compute queue has no vertex input) must not stand in a half at all: where
// there is nothing to wait for, it is the bottom or the top of the pipe. The host belongs to no
// queue family, and a barrier with its stage must not transfer
// (VUID-vkCmdPipelineBarrier-srcStageMask-09633).
TEST(BarrierTest, TheHalvesOfAQueueFamilyTransferMatch) {
  for (const UseByTheEngine& of : uses) {
    SCOPED_TRACE(of.name);
    const auto half = [&](Use before, Use after, QueueTransfer transfer) {
      return barrierBetween(before, after, transfer);
    };
    Barrier release = barrierBetween(Use::dermis, of.use), acquire = release;
    if (of.stage != VK_PIPELINE_STAGE_HOST_BIT) {
      release = {compute, writes, VK_PIPELINE_STAGE_BOTTOM_OF_PIPE_BIT, 0};
      acquire = {VK_PIPELINE_STAGE_TOP_OF_PIPE_BIT, 0, of.stage, of.reads | of.writes};
      expectBarrier(half(Use::dermis, of.use | Use::hostRead, QueueTransfer::release), release);
      expectBarrier(half(Use::dermis, of.use | Use::hostRead, QueueTransfer::acquire), acquire);
      expectBarrier(half(of.use | Use::hostWrite, Use::dermis, QueueTransfer::release),
                    {of.stage, of.writes, VK_PIPELINE_STAGE_BOTTOM_OF_PIPE_BIT, 0});
    }
    expectBarrier(half(Use::dermis, of.use, QueueTransfer::release), release);
    expectBarrier(half(Use::dermis, of.use, QueueTransfer::acquire), acquire);
  }
}

// The four structures, with values that differ everywhere.
TEST(BarrierTest, IsConvertedToVulkansStructures) {
  const Barrier barrier = barrierBetween(Use::copyWrite, Use::vertexInput);
  const auto expectAccesses = [](const auto& structure, VkStructureType type) {
    EXPECT_EQ(structure.sType, type);
    EXPECT_EQ(structure.pNext, nullptr);
    EXPECT_EQ(structure.srcAccessMask, VK_ACCESS_TRANSFER_WRITE_BIT);
    EXPECT_EQ(structure.dstAccessMask, VK_ACCESS_VERTEX_ATTRIBUTE_READ_BIT);
  };
  const auto expectStages = [](const auto& structure) {
    EXPECT_EQ(structure.srcStageMask, VK_PIPELINE_STAGE_2_TRANSFER_BIT);
    EXPECT_EQ(structure.dstStageMask, VK_PIPELINE_STAGE_2_VERTEX_INPUT_BIT);
  };
  const auto expectWholeBuffer = [](const auto& structure) {
    EXPECT_EQ(structure.srcQueueFamilyIndex, VK_QUEUE_FAMILY_IGNORED);
    EXPECT_EQ(structure.dstQueueFamilyIndex, VK_QUEUE_FAMILY_IGNORED);
    EXPECT_EQ(structure.buffer, VkBuffer{VK_NULL_HANDLE});
    EXPECT_EQ(structure.offset, 0u);
    EXPECT_EQ(structure.size, VK_WHOLE_SIZE);
  };
  const VkMemoryBarrier memory = barrier;
  expectAccesses(memory, VK_STRUCTURE_TYPE_MEMORY_BARRIER);
  const VkBufferMemoryBarrier buffer = barrier;
  expectAccesses(buffer, VK_STRUCTURE_TYPE_BUFFER_MEMORY_BARRIER);
  expectWholeBuffer(buffer);
  const VkMemoryBarrier2 memory2 = barrier;
  expectAccesses(memory2, VK_STRUCTURE_TYPE_MEMORY_BARRIER_2);
  expectStages(memory2);
  const VkBufferMemoryBarrier2 buffer2 = barrier;
  expectAccesses(buffer2, VK_STRUCTURE_TYPE_BUFFER_MEMORY_BARRIER_2);
  expectStages(buffer2);
  expectWholeBuffer(buffer2);
}

class RecordBarrierTest : public MockContextTest {};

TEST_F(RecordBarrierTest, RecordsABarrierForAllMemory) {
  create();
  context->recordBarrier(commandBuffer, Use::vertexInput, Use::dermis);
  EXPECT_EQ(mock.commands, std::vector<std::string>{"barrier"});
  ASSERT_EQ(mock.memoryBarriers.size(), 1u);
  expectBarrier(mock.memoryBarriers[0], barrierBetween(Use::vertexInput, Use::dermis));
}

// Vulkan 1.0 allows no barrier without stages.
TEST_F(RecordBarrierTest, RecordsNothingIfNothingWaits) {
  create();
  context->recordBarrier(commandBuffer, Use{}, Use{});
  context->recordBarrier(commandBuffer, Use{}, Use::dermis);
  context->recordBarrier(commandBuffer, Use::dermis, Use{});
  EXPECT_TRUE(mock.commands.empty());
}

}  // namespace
}  // namespace dermis::test
