// What Dermis does on kinds of devices that no test has: nothing beyond their limits.

#include <gtest/gtest.h>

#include <bit>
#include <string>
#include <utility>
#include <vector>

#include "abi.h"
#include "dermis/vulkan/context.h"
#include "dermis/vulkan/scene_recorder.h"
#include "device_profiles.h"
#include "mock_batch.h"
#include "mock_vulkan.h"
#include "plan_commands.h"

namespace dermis::test {
namespace {

class MockProfileTest : public ::testing::TestWithParam<DeviceProfile> {
 protected:
  MockProfileTest() {
    VkPhysicalDeviceLimits& limits = mock.limits;
    // Beyond all of them, to be lowered.
    limits.maxStorageBufferRange = limits.maxTexelBufferElements = unlimited;
    limits.maxPerStageDescriptorStorageBuffers = unlimited;
    limits.maxComputeWorkGroupCount[0] = limits.maxComputeWorkGroupCount[1] = unlimited;
    limits.maxComputeWorkGroupSize[0] = limits.maxComputeWorkGroupInvocations = unlimited;
    limits.maxComputeSharedMemorySize = unlimited;
    limits.minStorageBufferOffsetAlignment = limits.minTexelBufferOffsetAlignment = 1;
    lowerLimits(GetParam(), limits);
    mock.deviceType = GetParam().type;
    mock.vendor = GetParam().vendor;
  }
  Result<vulkan::Context> create(std::optional<bool> texelBuffers = {}) {
    vulkan::DeviceDescription description = mock.description();
    description.texelBuffers = texelBuffers;
    return vulkan::Context::create(description);
  }

  MockVulkan mock;
};

TEST_P(MockProfileTest, BindingsAndViewsKeepItsLimits) {
  const VkPhysicalDeviceLimits& device = mock.limits;
  for (const bool texelBuffers : {false, true}) {
    const Result<vulkan::Context> context = create(texelBuffers);
    ASSERT_TRUE(context.ok());
    const DeviceLimits& limits = context->limits();
    EXPECT_TRUE(std::has_single_bit(limits.minStorageBufferOffsetAlignment));
    EXPECT_EQ(limits.maxStorageBufferRange % 4, 0u);
    std::uint32_t storage = 0;
    for (const VkDescriptorSetLayoutBinding& binding : mock.setLayouts.back().bindings)
      storage += binding.descriptorType == VK_DESCRIPTOR_TYPE_STORAGE_BUFFER ? 1 : 0;
    EXPECT_LE(storage, device.maxPerStageDescriptorStorageBuffers);

    // Whatever the limits let an engine bind.
    const MockBatch batch = MockBatch::withAllMethods(limits);
    vulkan::BatchBuffers buffers = batch.buffers();
    for (vulkan::BufferRange* range : {&buffers.meshes, &buffers.tables, &buffers.palettes}) {
      range->offset = 3 * limits.minStorageBufferOffsetAlignment;
      range->size = limits.maxStorageBufferRange;
    }
    ASSERT_TRUE(context->prepare(batch.plan.pipelines()).ok());
    const Result<vulkan::Bindings> bindings = context->createBindings(buffers);
    ASSERT_TRUE(bindings.ok()) << bindings.error().message;
    mock.dispatches.clear();
    ASSERT_TRUE(context->record(commandBuffer, batch.plan, *bindings).ok());
    for (const auto& [view, info] : mock.views) {
      EXPECT_EQ(info.offset % device.minTexelBufferOffsetAlignment, 0u);
      EXPECT_LE(info.range / 16, device.maxTexelBufferElements);
    }
    EXPECT_EQ(mock.views.empty(), !limits.texelBuffers);
    ASSERT_FALSE(mock.dispatches.empty());
    for (const MockDispatch& dispatch : mock.dispatches) {
      for (const auto& [binding, bound] : dispatch.descriptors) {
        if (binding >= abi::BINDING_COUNT) continue;
        EXPECT_EQ(bound.offset % device.minStorageBufferOffsetAlignment, 0u);
        EXPECT_LE(bound.range, device.maxStorageBufferRange);
      }
    }
  }
}

// A texel buffer that holds less than every storage buffer range may have at least is no help.
TEST_P(MockProfileTest, TexelBuffersAreReadWhereTheyAreLargeEnough) {
  const Result<vulkan::Context> context = create(true);
  ASSERT_TRUE(context.ok());
  const DeviceProfile& profile = GetParam();
  const bool areRead = profile.texels >= 1u << 23 && profile.storageBuffers >= 8;
  EXPECT_EQ(context->limits().texelBuffers, areRead);
  if (areRead) {
    EXPECT_LE(context->limits().maxStorageBufferRange / 16, profile.texels);
    EXPECT_GE(context->limits().maxStorageBufferRange, 1u << 27);
  }
}

TEST_P(MockProfileTest, DispatchesOfMillionsOfWorkgroupsKeepItsLimits) {
  const Result<vulkan::Context> context = create();
  ASSERT_TRUE(context.ok());
  OwnedBatch batch;
  // Nobody reads the mesh: a plan takes no more than these numbers.
  batch.addMesh(meshOf(100, 4, 4, MeshParts{true, false, 0}));
  batch.addPose(4, JointPromise::scaleIgnored);
  for (int number = 0; number < 400; ++number) batch.addJob(0, 0, Method::dualQuaternion, true);
  constexpr std::uint32_t vertices = 1u << 21;
  std::uint64_t size = 0;
  for (Job& job : batch.jobs) {
    job.mesh.vertexCount = vertices;
    job.mesh.byteSize = (vertices + 4) * 3 * std::uint64_t{16};
    job.places[Stream::positions].offset = size;
    job.places[Stream::normals].offset = size + 12;
    size += std::uint64_t{vertices} * 24;
  }
  batch.outputSize = size;
  Batch large = batch.batch();
  large.meshesSize = context->limits().maxStorageBufferRange;
  Plan plan;
  const Result<void> planned = makePlan(large, context->limits(), context->tuning(), plan);
  ASSERT_TRUE(planned.ok()) << planned.error().message;
  std::uint64_t workgroups = 0;
  for (const PlannedDispatch& dispatch : dispatchesOf(plan)) {
    EXPECT_LE(dispatch.groupCountX, mock.limits.maxComputeWorkGroupCount[0]);
    EXPECT_LE(dispatch.groupCountY, mock.limits.maxComputeWorkGroupCount[1]);
    EXPECT_GE(std::uint64_t{dispatch.groupCountX} * dispatch.groupCountY, dispatch.workgroupCount);
    EXPECT_LE(dispatch.variant.workgroupSize, mock.limits.maxComputeWorkGroupInvocations);
    if (dispatch.variant.kernel == Kernel::skin) workgroups += dispatch.workgroupCount;
  }
  EXPECT_GE(workgroups, 400ull * vertices / (64 * 4));
}

// The defaults of the class, as docs/gpus.md lists them.
TEST_P(MockProfileTest, DefaultsAreThoseOfItsClass) {
  const Result<vulkan::Context> context = create();
  ASSERT_TRUE(context.ok());
  const VkPhysicalDeviceType type = GetParam().type;
  EXPECT_FALSE(context->limits().texelBuffers);
  // The only discrete GPU here whose compiler does not merge the stores of words.
  EXPECT_EQ(context->limits().stagedStores, GetParam().name == "nvidia");
  EXPECT_EQ(context->tuning().workgroupSize, 64u);
  EXPECT_EQ(context->tuning().instancesPerInvocation, 4u);
  EXPECT_EQ(context->tuning().minWorkgroups,
            type == VK_PHYSICAL_DEVICE_TYPE_INTEGRATED_GPU ? 256u : 2048u);
}

INSTANTIATE_TEST_SUITE_P(All, MockProfileTest, ::testing::ValuesIn(deviceProfiles),
                         [](const auto& parameter) { return std::string(parameter.param.name); });

// On a CPU device the lanes of a workgroup are one thread: nothing is gained.
TEST(DefaultsTest, CpuDevicesDoNotStageAndSkinManyInstances) {
  MockVulkan mock;
  mock.deviceType = VK_PHYSICAL_DEVICE_TYPE_CPU;
  vulkan::DeviceDescription description = mock.description();
  Result<vulkan::Context> context = vulkan::Context::create(description);
  ASSERT_TRUE(context.ok());
  EXPECT_FALSE(context->limits().stagedStores);
  EXPECT_EQ(context->tuning().instancesPerInvocation, 24u);
  EXPECT_EQ(context->tuning().minWorkgroups, 0u);
  description.stagedStores = true;
  EXPECT_TRUE(vulkan::Context::create(description)->limits().stagedStores);
}

// As many workgroups as the GPU has place for at a time, where it tells.
TEST(DefaultsTest, WorkgroupsFillTheGpu) {
  MockVulkan mock;
  const auto workgroups = [&](VkPhysicalDeviceType type, std::vector<const char*> extensions) {
    mock.deviceType = type;
    mock.physicalExtensions = std::move(extensions);
    return vulkan::Context::create(mock.description())->tuning().minWorkgroups;
  };
  const VkPhysicalDeviceType gpu = VK_PHYSICAL_DEVICE_TYPE_DISCRETE_GPU;
  EXPECT_EQ(workgroups(gpu, {"VK_KHR_maintenance1"}), 2048u);
  EXPECT_EQ(workgroups(gpu, {"VK_KHR_maintenance1", "VK_NV_shader_sm_builtins"}), 4224u);
  EXPECT_EQ(workgroups(gpu, {"VK_AMD_shader_core_properties"}), 2560u);
  EXPECT_EQ(workgroups(VK_PHYSICAL_DEVICE_TYPE_CPU, {"VK_NV_shader_sm_builtins"}), 0u);
}

TEST(DefaultsTest, DiscreteGpusStageUnlessTheirCompilerMergesStores) {
  MockVulkan mock;
  mock.deviceType = VK_PHYSICAL_DEVICE_TYPE_DISCRETE_GPU;
  for (const std::uint32_t vendor : {0u, 0x1002u, 0x10deu, 0x5143u, 0x8086u}) {
    mock.vendor = vendor;
    const Result<vulkan::Context> context = vulkan::Context::create(mock.description());
    ASSERT_TRUE(context.ok());
    EXPECT_EQ(context->limits().stagedStores, vendor != 0x1002 && vendor != 0x8086) << vendor;
  }
}

}  // namespace
}  // namespace dermis::test
