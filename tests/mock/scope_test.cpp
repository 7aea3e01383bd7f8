// The values of barriers at the edges: each is what the Vulkan specification asks for ("Supported
// Access Types", and the chapter of each command for what it reads and writes).

#include <gtest/gtest.h>

#include <cstdint>
#include <optional>

#include <vulkan/vulkan_core.h>

#include "dermis/vulkan/scope.h"

namespace dermis::test {
namespace {

using vulkan::Consumer;
using vulkan::Dependency;
using vulkan::PreviousUse;
using vulkan::QueueTransfer;
using vulkan::Scope;
using vulkan::Writer;

constexpr Scope nothing{0, 0};
constexpr Scope computeReads{VK_PIPELINE_STAGE_COMPUTE_SHADER_BIT, VK_ACCESS_SHADER_READ_BIT};
constexpr Scope computeUses{VK_PIPELINE_STAGE_COMPUTE_SHADER_BIT,
                            VK_ACCESS_SHADER_READ_BIT | VK_ACCESS_SHADER_WRITE_BIT};
constexpr Scope kernelsRead{VK_PIPELINE_STAGE_COMPUTE_SHADER_BIT, 0};
constexpr Scope computeWrites{VK_PIPELINE_STAGE_COMPUTE_SHADER_BIT, VK_ACCESS_SHADER_WRITE_BIT};

void expectScope(const Scope& scope, const Scope& expected, const char* what) {
  EXPECT_EQ(scope.stages, expected.stages) << what;
  EXPECT_EQ(scope.accesses, expected.accesses) << what;
}

struct Reader {
  Consumer consumer;
  std::optional<PreviousUse> use;  ///< the same before `record`
  Scope scope;
  const char* name;
};
#define DERMIS_READER(name, stage, access) \
  { Consumer::name, PreviousUse::name, {VK_PIPELINE_STAGE_##stage, VK_ACCESS_##access}, #name }
constexpr Reader readers[] = {
    DERMIS_READER(vertexInput, VERTEX_INPUT_BIT, VERTEX_ATTRIBUTE_READ_BIT),
    DERMIS_READER(vertexShader, VERTEX_SHADER_BIT, SHADER_READ_BIT),
    DERMIS_READER(fragmentShader, FRAGMENT_SHADER_BIT, SHADER_READ_BIT),
    DERMIS_READER(taskShader, TASK_SHADER_BIT_EXT, SHADER_READ_BIT),
    DERMIS_READER(meshShader, MESH_SHADER_BIT_EXT, SHADER_READ_BIT),
    DERMIS_READER(rayTracingShader, RAY_TRACING_SHADER_BIT_KHR, SHADER_READ_BIT),
    DERMIS_READER(compute, COMPUTE_SHADER_BIT, SHADER_READ_BIT),
    // A build reads its vertices with the access of a shader.
    DERMIS_READER(accelerationStructureBuild, ACCELERATION_STRUCTURE_BUILD_BIT_KHR,
                  SHADER_READ_BIT),
    DERMIS_READER(transfer, TRANSFER_BIT, TRANSFER_READ_BIT),
    {Consumer::hostRead, {}, {VK_PIPELINE_STAGE_HOST_BIT, VK_ACCESS_HOST_READ_BIT}, "hostRead"},
};
#undef DERMIS_READER

TEST(ScopeTest, OutputScopesNameTheConsumer) {
  for (const Reader& reader : readers) {
    const Dependency dependency = vulkan::outputScope(reader.consumer);
    expectScope(dependency.source, computeWrites, reader.name);
    expectScope(dependency.destination, reader.scope, reader.name);
  }
}

// What `record` reads must be made visible to it; what it overwrites must only have been read.
TEST(ScopeTest, InputScopesWaitForWritersAndReaders) {
  const auto expectInput = [](PreviousUse use, const Scope& source, const Scope& destination,
                              const char* name) {
    expectScope(vulkan::inputScope(use).source, source, name);
    expectScope(vulkan::inputScope(use).destination, destination, name);
  };
  for (const Reader& reader : readers) {
    if (reader.use) expectInput(*reader.use, {reader.scope.stages, 0}, kernelsRead, reader.name);
  }
  expectInput(PreviousUse::hostWrite, {VK_PIPELINE_STAGE_HOST_BIT, VK_ACCESS_HOST_WRITE_BIT},
              computeReads, "hostWrite");
  expectInput(PreviousUse::transferWrite,
              {VK_PIPELINE_STAGE_TRANSFER_BIT, VK_ACCESS_TRANSFER_WRITE_BIT}, computeUses,
              "transferWrite");
  expectInput(PreviousUse::computeWrite, computeWrites, computeUses, "computeWrite");
  expectInput(PreviousUse::previousRecord, computeWrites, computeUses, "previousRecord");
}

// Write after read, and after the write that was read: an execution dependency from the kernels,
// and the access of the writer.
TEST(ScopeTest, OverwritersWaitForKernels) {
  expectScope(vulkan::overwriteScope(Writer::compute).source, kernelsRead, "source");
  expectScope(vulkan::overwriteScope(Writer::compute).destination,
              {VK_PIPELINE_STAGE_COMPUTE_SHADER_BIT, VK_ACCESS_SHADER_WRITE_BIT}, "compute");
  expectScope(vulkan::overwriteScope(Writer::transfer).source, kernelsRead, "source");
  expectScope(vulkan::overwriteScope(Writer::transfer).destination,
              {VK_PIPELINE_STAGE_TRANSFER_BIT, VK_ACCESS_TRANSFER_WRITE_BIT}, "transfer");
}

TEST(ScopeTest, Synchronization2HasTheSameStagesAndAccesses) {
  for (const Reader& reader : readers) {
    const Dependency dependency = vulkan::outputScope(reader.consumer);
    const VkMemoryBarrier2 memory = vulkan::memoryBarrier2(dependency);
    EXPECT_EQ(memory.sType, VK_STRUCTURE_TYPE_MEMORY_BARRIER_2);
    EXPECT_EQ(memory.pNext, nullptr);
    EXPECT_EQ(memory.srcStageMask, VK_PIPELINE_STAGE_2_COMPUTE_SHADER_BIT);
    EXPECT_EQ(memory.srcAccessMask, VK_ACCESS_2_SHADER_WRITE_BIT);
    EXPECT_EQ(memory.dstStageMask, reader.scope.stages) << reader.name;
    EXPECT_EQ(memory.dstAccessMask, reader.scope.accesses) << reader.name;

    const auto buffer = reinterpret_cast<VkBuffer>(std::uintptr_t{5});
    const VkBufferMemoryBarrier2 part = vulkan::bufferBarrier2(dependency, buffer, 16, 32, 1, 2);
    EXPECT_EQ(part.sType, VK_STRUCTURE_TYPE_BUFFER_MEMORY_BARRIER_2);
    EXPECT_EQ(part.pNext, nullptr);
    EXPECT_EQ(part.srcStageMask, memory.srcStageMask);
    EXPECT_EQ(part.srcAccessMask, memory.srcAccessMask);
    EXPECT_EQ(part.dstStageMask, memory.dstStageMask);
    EXPECT_EQ(part.dstAccessMask, memory.dstAccessMask);
    EXPECT_EQ(part.srcQueueFamilyIndex, 1u);
    EXPECT_EQ(part.dstQueueFamilyIndex, 2u);
    EXPECT_EQ(part.buffer, buffer);
    EXPECT_EQ(part.offset, 16u);
    EXPECT_EQ(part.size, 32u);
  }
}

TEST(ScopeTest, TwoNeedsFitIntoOneBarrier) {
  const Dependency both =
      vulkan::inputScope(PreviousUse::transferWrite) | vulkan::inputScope(PreviousUse::vertexInput);
  expectScope(both.source,
              {VK_PIPELINE_STAGE_TRANSFER_BIT | VK_PIPELINE_STAGE_VERTEX_INPUT_BIT,
               VK_ACCESS_TRANSFER_WRITE_BIT},
              "source");
  expectScope(both.destination, computeUses, "destination");
  const VkMemoryBarrier barrier = vulkan::memoryBarrier(both);
  EXPECT_EQ(barrier.sType, VK_STRUCTURE_TYPE_MEMORY_BARRIER);
  EXPECT_EQ(barrier.pNext, nullptr);
  EXPECT_EQ(barrier.srcAccessMask, both.source.accesses);
  EXPECT_EQ(barrier.dstAccessMask, both.destination.accesses);
}

VkBufferMemoryBarrier half(Consumer consumer, QueueTransfer transfer) {
  return vulkan::bufferBarrier(vulkan::outputScope(consumer, transfer),
                               reinterpret_cast<VkBuffer>(std::uintptr_t{5}), 16, 32, 1, 2);
}

// Queue Family Ownership Transfer: the release makes the writes available and ignores the second
// half of the dependency, the acquire makes them visible and ignores the first; families, buffer
// and range are the same in both. A stage that the other queue lacks (a compute queue has no vertex
// input) must not stand in a half at all: where there is nothing to wait for, it is the bottom or
// the top of the pipe.
TEST(ScopeTest, TheHalvesOfAQueueFamilyTransferMatch) {
  for (const Reader& reader : readers) {
    if (reader.consumer == Consumer::hostRead) continue;
    const Dependency release = vulkan::outputScope(reader.consumer, QueueTransfer::release);
    expectScope(release.source, computeWrites, reader.name);
    expectScope(release.destination, {VK_PIPELINE_STAGE_BOTTOM_OF_PIPE_BIT, 0}, reader.name);
    const Dependency acquire = vulkan::outputScope(reader.consumer, QueueTransfer::acquire);
    expectScope(acquire.source, {VK_PIPELINE_STAGE_TOP_OF_PIPE_BIT, 0}, reader.name);
    expectScope(acquire.destination, reader.scope, reader.name);

    const VkBufferMemoryBarrier released = half(reader.consumer, QueueTransfer::release);
    const VkBufferMemoryBarrier acquired = half(reader.consumer, QueueTransfer::acquire);
    EXPECT_EQ(released.srcAccessMask, computeWrites.accesses) << reader.name;
    EXPECT_EQ(released.dstAccessMask, nothing.accesses) << reader.name;
    EXPECT_EQ(acquired.srcAccessMask, nothing.accesses) << reader.name;
    EXPECT_EQ(acquired.dstAccessMask, reader.scope.accesses) << reader.name;
    for (const VkBufferMemoryBarrier& barrier : {released, acquired}) {
      EXPECT_EQ(barrier.sType, VK_STRUCTURE_TYPE_BUFFER_MEMORY_BARRIER);
      EXPECT_EQ(barrier.pNext, nullptr);
      EXPECT_EQ(barrier.srcQueueFamilyIndex, 1u);
      EXPECT_EQ(barrier.dstQueueFamilyIndex, 2u);
      EXPECT_EQ(barrier.buffer, reinterpret_cast<VkBuffer>(std::uintptr_t{5}));
      EXPECT_EQ(barrier.offset, 16u);
      EXPECT_EQ(barrier.size, 32u);
    }
  }
}

// The host belongs to no queue family, and a barrier with the host's stage must not transfer
// (VUID-vkCmdPipelineBarrier-srcStageMask-09633).
TEST(ScopeTest, NothingIsTransferredToTheHost) {
  for (const QueueTransfer transfer : {QueueTransfer::release, QueueTransfer::acquire}) {
    const Dependency dependency = vulkan::outputScope(Consumer::hostRead, transfer);
    expectScope(dependency.source, computeWrites, "source");
    expectScope(dependency.destination, {VK_PIPELINE_STAGE_HOST_BIT, VK_ACCESS_HOST_READ_BIT},
                "destination");
  }
}

TEST(ScopeTest, ABufferBarrierTransfersNothingUnlessTold) {
  const VkBufferMemoryBarrier barrier =
      vulkan::bufferBarrier(vulkan::outputScope(Consumer::vertexInput),
                            reinterpret_cast<VkBuffer>(std::uintptr_t{5}), 16, 32);
  EXPECT_EQ(barrier.srcQueueFamilyIndex, VK_QUEUE_FAMILY_IGNORED);
  EXPECT_EQ(barrier.dstQueueFamilyIndex, VK_QUEUE_FAMILY_IGNORED);
}

}  // namespace
}  // namespace dermis::test
