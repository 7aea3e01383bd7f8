// What a Context asks of a device, on a driver that is only pretended.

#include <gtest/gtest.h>

#include <algorithm>
#include <array>

#include "dermis/vulkan/vulkan.h"
#include "mock_vulkan.h"
#include "random_rig.h"

namespace dermis::test {
namespace {

const std::vector<std::string> neededFunctions{"vkGetDeviceProcAddr",
                                               "vkGetPhysicalDeviceProperties",
                                               "vkCreateShaderModule",
                                               "vkDestroyShaderModule",
                                               "vkCreateDescriptorSetLayout",
                                               "vkDestroyDescriptorSetLayout",
                                               "vkCreatePipelineLayout",
                                               "vkDestroyPipelineLayout",
                                               "vkCreateComputePipelines",
                                               "vkDestroyPipeline",
                                               "vkCreateDescriptorPool",
                                               "vkDestroyDescriptorPool",
                                               "vkAllocateDescriptorSets",
                                               "vkUpdateDescriptorSets",
                                               "vkCmdBindPipeline",
                                               "vkCmdBindDescriptorSets",
                                               "vkCmdPushConstants",
                                               "vkCmdPipelineBarrier",
                                               "vkCmdDispatch"};

/// A batch of one mesh with both methods, and its plan.
struct SmallBatch {
  OwnedMesh mesh = randomMesh(1, 100, 4, 4);
  PackedMesh packed = *pack(mesh.view(), 4);
  Plan plan;

  explicit SmallBatch(std::vector<Method> methods = {Method::linear, Method::dualQuaternion}) {
    const Palette palette{4, 0, true};
    std::vector<Job> jobs;
    for (const Method method : methods) {
      Job job;
      job.mesh = packed.info();
      job.method = method;
      job.positions = {jobs.size() * 2400, 24};
      job.normals = {jobs.size() * 2400 + 12, 24};
      jobs.push_back(job);
    }
    Batch batch;
    batch.palettes = {&palette, 1};
    batch.jobs = jobs;
    batch.meshesSize = packed.bytes().size();
    batch.matricesSize = 4 * sizeof(JointMatrix);
    batch.outputSize = jobs.size() * 2400;
    EXPECT_TRUE(makePlan(batch, {}, {}, plan).ok());
  }

  vulkan::BatchBuffers buffers() const {
    const auto range = [&](BufferRole role) {
      const std::uint64_t size = plan.buffer(role).size;
      return size == 0
                 ? vulkan::BufferRange{}
                 : vulkan::BufferRange{reinterpret_cast<VkBuffer>(std::uintptr_t{64}), 0, size};
    };
    return {range(BufferRole::meshes), range(BufferRole::matrices), range(BufferRole::tables),
            range(BufferRole::palettes), range(BufferRole::output)};
  }
};

const VkCommandBuffer commandBuffer = reinterpret_cast<VkCommandBuffer>(std::uintptr_t{80});

TEST(ContextTest, EveryMissingEntryPointIsNamed) {
  for (const std::string& name : neededFunctions) {
    MockVulkan mock;
    mock.missing.insert(name);
    const Result<vulkan::Context> context = vulkan::Context::create(mock.description());
    ASSERT_FALSE(context.ok()) << name;
    EXPECT_EQ(context.error().code, ErrorCode::missingEntryPoint);
    EXPECT_NE(context.error().message.find("'" + name + "'"), std::string::npos)
        << context.error().message;
    EXPECT_EQ(mock.aliveObjects(), 0);
  }
}

TEST(ContextTest, AsksForNothingThatSubmitsWaitsMapsOrAllocates) {
  MockVulkan mock;
  mock.extensions = {VK_KHR_PUSH_DESCRIPTOR_EXTENSION_NAME};
  ASSERT_TRUE(vulkan::Context::create(mock.description()).ok());
  std::set<std::string> allowed(neededFunctions.begin(), neededFunctions.end());
  allowed.erase("vkGetDeviceProcAddr");
  allowed.insert("vkCmdPushDescriptorSetKHR");
  EXPECT_EQ(mock.requested, allowed);
}

TEST(ContextTest, OnlyWhatWasEnabledIsAskedFor) {
  MockVulkan mock;
  ASSERT_TRUE(vulkan::Context::create(mock.description()).ok());
  EXPECT_FALSE(mock.requested.contains("vkCmdPushDescriptorSetKHR"));
  EXPECT_FALSE(mock.requested.contains("vkCmdBeginDebugUtilsLabelEXT"));
}

TEST(ContextTest, MissingHandlesAndOldVersionsAreRefused) {
  MockVulkan mock;
  const auto refuses = [&](auto change, ErrorCode code, const char* text) {
    vulkan::DeviceDescription description = mock.description();
    change(description);
    const Result<vulkan::Context> context = vulkan::Context::create(description);
    ASSERT_FALSE(context.ok()) << text;
    EXPECT_EQ(context.error().code, code);
    EXPECT_NE(context.error().message.find(text), std::string::npos) << context.error().message;
  };
  using Description = vulkan::DeviceDescription;
  refuses([](Description& d) { d.instance = VK_NULL_HANDLE; }, ErrorCode::invalidArgument,
          "instance");
  refuses([](Description& d) { d.physicalDevice = VK_NULL_HANDLE; }, ErrorCode::invalidArgument,
          "physicalDevice");
  refuses([](Description& d) { d.device = VK_NULL_HANDLE; }, ErrorCode::invalidArgument, "device");
  refuses([](Description& d) { d.getInstanceProcAddr = nullptr; }, ErrorCode::invalidArgument,
          "getInstanceProcAddr");
  refuses([](Description& d) { d.apiVersion = VK_API_VERSION_1_0; }, ErrorCode::missingFeature,
          "Vulkan 1.1");
  mock.limits.maxPerStageDescriptorStorageBuffers = 3;
  refuses([](Description&) {}, ErrorCode::missingFeature, "storage buffers");
}

TEST(ContextTest, AFailedCreationLeavesNothingBehind) {
  for (const char* function :
       {"vkCreateShaderModule", "vkCreateDescriptorSetLayout", "vkCreatePipelineLayout"}) {
    for (int failAfter = 0; failAfter < 2; ++failAfter) {
      MockVulkan mock;
      mock.failing = function;
      mock.failAfter = failAfter;
      const Result<vulkan::Context> context = vulkan::Context::create(mock.description());
      if (failAfter == 0) {
        ASSERT_FALSE(context.ok()) << function;
        EXPECT_EQ(context.error().code, ErrorCode::vulkanError);
        EXPECT_EQ(context.error().vulkanResult, VK_ERROR_OUT_OF_DEVICE_MEMORY);
        EXPECT_NE(context.error().message.find(function), std::string::npos);
      }
      if (!context) {
        EXPECT_EQ(mock.aliveObjects(), 0) << function;
      }
    }
  }
}

TEST(ContextTest, EveryObjectUsesTheEnginesAllocatorAndIsDestroyed) {
  const VkAllocationCallbacks callbacks{};
  MockVulkan mock;
  mock.allocator = &callbacks;
  {
    Result<vulkan::Context> context = vulkan::Context::create(mock.description());
    ASSERT_TRUE(context.ok());
    const SmallBatch batch;
    ASSERT_TRUE(context->prepare(batch.plan.variants()).ok());
    ASSERT_TRUE(context->prepare(batch.plan.variants()).ok());
    EXPECT_EQ(mock.alive["Pipeline"], 3) << "what exists is not built again";
    vulkan::Context moved = std::move(*context);
    const Result<vulkan::Bindings> bindings = moved.createBindings(batch.buffers());
    ASSERT_TRUE(bindings.ok());
    EXPECT_GT(mock.aliveObjects(), 0);
  }
  EXPECT_EQ(mock.aliveObjects(), 0);
  EXPECT_FALSE(mock.wrongAllocator);
}

TEST(ContextTest, RecordNeedsPreparedVariants) {
  MockVulkan mock;
  Result<vulkan::Context> context = vulkan::Context::create(mock.description());
  const SmallBatch batch;
  const Result<vulkan::Bindings> bindings = context->createBindings(batch.buffers());
  ASSERT_TRUE(bindings.ok());
  const Result<void> early = context->record(commandBuffer, batch.plan, *bindings);
  ASSERT_FALSE(early.ok());
  EXPECT_EQ(early.error().code, ErrorCode::notPrepared);
  EXPECT_TRUE(mock.commands.empty()) << "nothing is recorded when it fails";
  ASSERT_TRUE(context->prepare(batch.plan.variants()).ok());
  EXPECT_TRUE(context->record(commandBuffer, batch.plan, *bindings).ok());
}

TEST(ContextTest, RecordsTheBarrierBetweenItsPassesAndNoOther) {
  for (const bool push : {false, true}) {
    MockVulkan mock;
    if (push) mock.extensions = {VK_KHR_PUSH_DESCRIPTOR_EXTENSION_NAME};
    Result<vulkan::Context> context = vulkan::Context::create(mock.description());
    const SmallBatch batch;
    ASSERT_TRUE(context->prepare(batch.plan.variants()).ok());
    const Result<vulkan::Bindings> bindings = context->createBindings(batch.buffers());
    ASSERT_TRUE(context->record(commandBuffer, batch.plan, *bindings).ok());
    const std::string descriptors = push ? "push descriptors" : "bind sets";
    // The palettes, the linear instance, which needs none, and the dual-quaternion one.
    const std::vector<std::string> expected{
        "bind pipeline", descriptors,      "push constants", "dispatch", "bind pipeline",
        descriptors,     "push constants", "dispatch",       "barrier",  "bind pipeline",
        descriptors,     "push constants", "dispatch"};
    EXPECT_EQ(mock.commands, expected);
    ASSERT_EQ(mock.bufferBarriers.size(), 1u);
    EXPECT_TRUE(mock.memoryBarriers.empty());
    EXPECT_EQ(mock.bufferBarriers[0].srcAccessMask,
              static_cast<VkAccessFlags>(VK_ACCESS_SHADER_WRITE_BIT));
    EXPECT_EQ(mock.bufferBarriers[0].dstAccessMask,
              static_cast<VkAccessFlags>(VK_ACCESS_SHADER_READ_BIT));
    EXPECT_EQ(mock.bufferBarriers[0].size, batch.plan.buffer(BufferRole::palettes).size);
  }
}

TEST(ContextTest, LinearAloneNeedsNoPalettes) {
  MockVulkan mock;
  Result<vulkan::Context> context = vulkan::Context::create(mock.description());
  const SmallBatch batch({Method::linear});
  EXPECT_EQ(batch.plan.buffer(BufferRole::palettes).size, 0u);
  ASSERT_TRUE(context->prepare(batch.plan.variants()).ok());
  const Result<vulkan::Bindings> bindings = context->createBindings(batch.buffers());
  ASSERT_TRUE(context->record(commandBuffer, batch.plan, *bindings).ok());
  EXPECT_EQ(mock.commands,
            (std::vector<std::string>{"bind pipeline", "bind sets", "push constants", "dispatch"}));
}

TEST(ContextTest, AnEmptyPlanRecordsNothing) {
  MockVulkan mock;
  Result<vulkan::Context> context = vulkan::Context::create(mock.description());
  const Plan plan;
  const Result<vulkan::Bindings> bindings = context->createBindings({});
  ASSERT_TRUE(bindings.ok());
  EXPECT_TRUE(context->record(commandBuffer, plan, *bindings).ok());
  EXPECT_TRUE(mock.commands.empty());
}

TEST(ContextTest, BuffersThatAreTooSmallOrMisalignedAreRefused) {
  MockVulkan mock;
  Result<vulkan::Context> context = vulkan::Context::create(mock.description());
  const SmallBatch batch;
  ASSERT_TRUE(context->prepare(batch.plan.variants()).ok());
  for (vulkan::BufferRange vulkan::BatchBuffers::*member :
       {&vulkan::BatchBuffers::meshes, &vulkan::BatchBuffers::matrices,
        &vulkan::BatchBuffers::tables, &vulkan::BatchBuffers::palettes,
        &vulkan::BatchBuffers::output}) {
    vulkan::BatchBuffers buffers = batch.buffers();
    (buffers.*member).size -= 4;
    const Result<vulkan::Bindings> smaller = context->createBindings(buffers);
    ASSERT_TRUE(smaller.ok());
    EXPECT_EQ(context->record(commandBuffer, batch.plan, *smaller).error().code,
              ErrorCode::invalidArgument);
    buffers = batch.buffers();
    (buffers.*member).offset = 16;
    EXPECT_EQ(context->createBindings(buffers).error().code, ErrorCode::invalidArgument);
    buffers = batch.buffers();
    (buffers.*member).size = VK_WHOLE_SIZE;
    EXPECT_EQ(context->createBindings(buffers).error().code, ErrorCode::invalidArgument);
  }
  EXPECT_TRUE(mock.commands.empty());
}

TEST(ContextTest, APlanForOtherLimitsIsRefused) {
  const SmallBatch batch;
  MockVulkan mock;
  mock.limits.maxStorageBufferRange = 1 << 28;
  Result<vulkan::Context> context = vulkan::Context::create(mock.description());
  ASSERT_TRUE(context->prepare(batch.plan.variants()).ok());
  const Result<vulkan::Bindings> bindings = context->createBindings(batch.buffers());
  const Result<void> recorded = context->record(commandBuffer, batch.plan, *bindings);
  ASSERT_FALSE(recorded.ok());
  EXPECT_EQ(recorded.error().code, ErrorCode::invalidArgument);
  EXPECT_NE(recorded.error().message.find("other limits"), std::string::npos);
  EXPECT_TRUE(mock.commands.empty());
}

TEST(ContextTest, BindingsOfAnotherContextAreRefused) {
  MockVulkan mock;
  Result<vulkan::Context> one = vulkan::Context::create(mock.description());
  Result<vulkan::Context> other = vulkan::Context::create(mock.description());
  const SmallBatch batch;
  ASSERT_TRUE(one->prepare(batch.plan.variants()).ok());
  const Result<vulkan::Bindings> bindings = other->createBindings(batch.buffers());
  EXPECT_EQ(one->record(commandBuffer, batch.plan, *bindings).error().code,
            ErrorCode::invalidArgument);
  EXPECT_EQ(one->record(commandBuffer, batch.plan, vulkan::Bindings()).error().code,
            ErrorCode::invalidArgument);
}

TEST(ContextTest, AFailureWhileBindingOrPreparingIsAnErrorAndLeaksNothing) {
  const SmallBatch batch;
  for (const char* function :
       {"vkCreateDescriptorPool", "vkAllocateDescriptorSets", "vkCreateComputePipelines"}) {
    MockVulkan mock;
    {
      Result<vulkan::Context> context = vulkan::Context::create(mock.description());
      mock.failing = function;
      const bool prepared = context->prepare(batch.plan.variants()).ok();
      const Result<vulkan::Bindings> bindings = context->createBindings(batch.buffers());
      EXPECT_FALSE(prepared && bindings.ok()) << function;
      if (!bindings) {
        EXPECT_NE(bindings.error().message.find(function), std::string::npos)
            << bindings.error().message;
      }
    }
    EXPECT_EQ(mock.aliveObjects(), 0) << function;
  }
}

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

TEST(KernelsTest, SpirvAndConstantsAreThereWithoutADevice) {
  for (const Kernel kernel : {Kernel::palette, Kernel::skin}) {
    const std::span<const std::uint32_t> spirv = vulkan::kernelSpirv(kernel);
    ASSERT_GT(spirv.size(), 5u);
    EXPECT_EQ(spirv[0], 0x07230203u);
    EXPECT_EQ(spirv[1], 0x00010300u) << "SPIR-V 1.3, which Vulkan 1.1 takes";
  }
  Variant variant;
  variant.workgroupSize = 32;
  variant.influences = 4;
  variant.instancesPerInvocation = 2;
  variant.normals = true;
  const vulkan::SpecializationConstants constants = vulkan::specializationConstants(variant);
  EXPECT_EQ(constants.count, 5u);
  EXPECT_TRUE(std::ranges::equal(std::span(constants.values).first(5),
                                 std::array<std::uint32_t, 5>{32, 1, 1, 4, 2}));
}

}  // namespace
}  // namespace dermis::test
