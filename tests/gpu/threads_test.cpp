// One context, many threads: each records into a command buffer of its own while another builds
// pipelines.

#include <gtest/gtest.h>

#include <array>
#include <atomic>
#include <cstring>
#include <thread>

#include "buffer.h"
#include "dermis/vulkan/context.h"
#include "dermis/vulkan/scope.h"
#include "random_rig.h"
#include "test_device.h"

namespace dermis::test {
namespace {

constexpr std::size_t threadCount = 4;

/// A pool and a command buffer, which belong to one thread.
struct ThreadCommands {
  VkCommandPool pool = VK_NULL_HANDLE;
  VkCommandBuffer buffer = VK_NULL_HANDLE;

  void begin(const samples::Device& device) {
    VkCommandPoolCreateInfo poolInfo{};
    poolInfo.sType = VK_STRUCTURE_TYPE_COMMAND_POOL_CREATE_INFO;
    poolInfo.queueFamilyIndex = device.queueFamily();
    device.functions().CreateCommandPool(device.handle(), &poolInfo, nullptr, &pool);
    VkCommandBufferAllocateInfo info{};
    info.sType = VK_STRUCTURE_TYPE_COMMAND_BUFFER_ALLOCATE_INFO;
    info.commandPool = pool;
    info.commandBufferCount = 1;
    device.functions().AllocateCommandBuffers(device.handle(), &info, &buffer);
    VkCommandBufferBeginInfo beginInfo{};
    beginInfo.sType = VK_STRUCTURE_TYPE_COMMAND_BUFFER_BEGIN_INFO;
    device.functions().BeginCommandBuffer(buffer, &beginInfo);
  }
};

/// What one thread skins: its own pose and output, the mesh shared.
struct Work {
  Plan plan;
  samples::MappedBuffer matrices, tables, palettes, output;
  std::optional<vulkan::Bindings> bindings;
  ThreadCommands commands;
};

class ThreadsTest : public DeviceTest {
 protected:
  /// Each repeat uses the palettes and the output of the one before.
  void recordEdge(VkCommandBuffer commandBuffer) {
    const vulkan::Dependency dependency = vulkan::inputScope(vulkan::PreviousUse::previousRecord);
    const VkMemoryBarrier barrier = vulkan::memoryBarrier(dependency);
    device().functions().CmdPipelineBarrier(commandBuffer, dependency.source.stages,
                                            dependency.destination.stages, 0, 1, &barrier, 0,
                                            nullptr, 0, nullptr);
  }

  void prepareWork(Work& work, const PackedMesh& mesh, const samples::MappedBuffer& meshes,
                   std::uint32_t seed) {
    const std::vector<JointMatrix> pose = randomPose(seed, 10, Rigidity::rigid);
    const Palette palette{10, 0, false};
    Job job;
    job.mesh = mesh.info();
    job.positions = {0, 24, VertexFormat::float32x3};
    job.normals = {12, 24, VertexFormat::float32x3};
    Batch batch;
    batch.palettes = {&palette, 1};
    batch.jobs = {&job, 1};
    batch.meshesSize = mesh.bytes().size();
    batch.matricesSize = pose.size() * sizeof(JointMatrix);
    batch.outputs = OutputSizes::oneBuffer(std::uint64_t{mesh.vertexCount()} * 24);
    ASSERT_TRUE(makePlan(batch, context().limits(), {}, work.plan).ok());
    const auto make = [&](BufferRole role) {
      const BufferRequirement requirement = work.plan.buffer(role);
      return *samples::MappedBuffer::create(device(), requirement.size, requirement.usage, true);
    };
    work.matrices = make(BufferRole::matrices);
    work.tables = make(BufferRole::tables);
    work.palettes = make(BufferRole::palettes);
    work.output = make(BufferRole::positions);
    std::memcpy(work.matrices.bytes().data(), pose.data(), work.matrices.bytes().size());
    ASSERT_TRUE(writeTables(work.plan, work.tables.bytes()).ok());
    work.bindings.emplace(
        *context().createBindings({meshes.range(),
                                   work.matrices.range(),
                                   work.tables.range(),
                                   work.palettes.range(),
                                   vulkan::OutputBuffers::oneBuffer(work.output.range()),
                                   {}}));
    work.commands.begin(device());
  }
};

TEST_F(ThreadsTest, ManyRecordWhileOnePrepares) {
  OwnedMesh mesh = randomMesh(1, 500, 10, 4);
  const PackedMesh packed = *pack(mesh.view(), 10);
  const samples::MappedBuffer meshes = *samples::MappedBuffer::create(
      device(), packed.bytes().size(),
      VK_BUFFER_USAGE_STORAGE_BUFFER_BIT | VK_BUFFER_USAGE_UNIFORM_TEXEL_BUFFER_BIT);
  std::memcpy(meshes.bytes().data(), packed.bytes().data(), packed.bytes().size());
  std::array<Work, threadCount> works;
  for (std::size_t i = 0; i < threadCount; ++i)
    prepareWork(works[i], packed, meshes, i == 0 ? 1 : 2);
  ASSERT_TRUE(context().prepare(works[0].plan.variants()).ok());

  std::atomic<int> failures = 0;
  std::vector<std::thread> threads;
  for (Work& work : works) {
    threads.emplace_back([&] {
      for (int repeat = 0; repeat < 20; ++repeat) {
        recordEdge(work.commands.buffer);
        if (!context().record(work.commands.buffer, work.plan, *work.bindings)) ++failures;
      }
    });
  }
  threads.emplace_back([&] {
    for (std::uint8_t instances = 1; instances <= 8; ++instances) {
      Variant variant;
      variant.instancesPerInvocation = instances;
      variant.workgroupSize = 16;
      if (!context().prepare({&variant, 1})) ++failures;
    }
  });
  for (std::thread& thread : threads) thread.join();
  EXPECT_EQ(failures, 0);

  for (Work& work : works) {
    device().functions().EndCommandBuffer(work.commands.buffer);
    ASSERT_TRUE(device().submitAndWait(work.commands.buffer).ok());
  }
  const auto sameOutput = [&](const Work& a, const Work& b) {
    return std::memcmp(a.output.bytes().data(), b.output.bytes().data(), a.output.bytes().size()) ==
           0;
  };
  EXPECT_TRUE(sameOutput(works[1], works[2]));
  EXPECT_TRUE(sameOutput(works[1], works[3]));
  EXPECT_FALSE(sameOutput(works[0], works[1]));
  for (Work& work : works) {
    device().functions().DestroyCommandPool(device().handle(), work.commands.pool, nullptr);
  }
}

}  // namespace
}  // namespace dermis::test
