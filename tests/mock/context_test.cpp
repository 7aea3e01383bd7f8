// What a Context asks of a device, on a driver that is only pretended.

#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <set>
#include <string>
#include <vector>

#include "abi.h"
#include "dermis/vulkan/context.h"
#include "dermis/vulkan/scene_recorder.h"
#include "mock_batch.h"
#include "mock_vulkan.h"
#include "plan/variant.h"

namespace dermis::test {
namespace {

const std::vector<std::string> neededFunctions{"vkGetDeviceProcAddr",
                                               "vkGetPhysicalDeviceProperties",
                                               "vkGetPhysicalDeviceProperties2",
                                               "vkEnumerateDeviceExtensionProperties",
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
                                               "vkResetDescriptorPool",
                                               "vkAllocateDescriptorSets",
                                               "vkUpdateDescriptorSets",
                                               "vkCreateBufferView",
                                               "vkDestroyBufferView",
                                               "vkCmdBindPipeline",
                                               "vkCmdBindDescriptorSets",
                                               "vkCmdPushConstants",
                                               "vkCmdPipelineBarrier",
                                               "vkCmdDispatch",
                                               "vkCmdDispatchIndirect",
                                               "vkCmdCopyBuffer",
                                               "vkCmdFillBuffer"};

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
  refuses([](Description& d) { d.apiVersion = 0; }, ErrorCode::invalidArgument,
          "state the lower of the API versions of instance and device");
  refuses([](Description& d) { d.apiVersion = VK_API_VERSION_1_0; }, ErrorCode::missingFeature,
          "Vulkan 1.1");
  mock.limits.maxPerStageDescriptorStorageBuffers = 3;
  refuses([](Description&) {}, ErrorCode::missingFeature,
          "3 storage buffers per stage, but Dermis needs 4");
}

TEST(ContextTest, AFailedCreationLeavesNothingBehind) {
  for (const char* function : {"vkCreateDescriptorSetLayout", "vkCreatePipelineLayout"}) {
    for (int failAfter = 0; failAfter <= 1; ++failAfter) {
      MockVulkan mock;
      mock.failing = function;
      mock.failAfter = failAfter;
      {
        const Result<vulkan::Context> context = vulkan::Context::create(mock.description());
        ASSERT_EQ(context.ok(), failAfter == 1) << function;
        if (!context) {
          EXPECT_EQ(context.error().code, ErrorCode::vulkanError);
          EXPECT_EQ(context.error().vulkanResult, VK_ERROR_OUT_OF_DEVICE_MEMORY);
          EXPECT_NE(context.error().message.find(function), std::string::npos);
        }
      }
      EXPECT_EQ(mock.aliveObjects(), 0) << function << ", after " << failAfter;
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
    const MockBatch batch = MockBatch::withAllMethods(context->limits());
    ASSERT_TRUE(context->prepare(batch.plan.pipelines()).ok());
    ASSERT_TRUE(context->prepare(batch.plan.pipelines()).ok());
    EXPECT_EQ(mock.alive["Pipeline"], 2 + static_cast<int>(allMethods.size()))
        << "what exists is not built again";
    vulkan::Context moved = std::move(*context);
    const Result<vulkan::Bindings> bindings = moved.createBindings(batch.buffers());
    ASSERT_TRUE(bindings.ok());
    EXPECT_GT(mock.aliveObjects(), 0);
  }
  EXPECT_EQ(mock.aliveObjects(), 0);
  EXPECT_FALSE(mock.wrongAllocator);
}

/// A batch on a driver where one function fails, after succeeding so many times.
struct FailingContext {
  explicit FailingContext(const char* function, int failAfter)
      : context(vulkan::Context::create(mock.description())),
        batch(MockBatch::withAllMethods(context->limits())) {
    mock.failing = function;
    mock.failAfter = failAfter;
  }
  MockVulkan mock;
  Result<vulkan::Context> context;
  MockBatch batch;
};

void expectFailureOf(const char* function, const Error& error) {
  EXPECT_EQ(error.code, ErrorCode::vulkanError) << function;
  EXPECT_EQ(error.vulkanResult, VK_ERROR_OUT_OF_DEVICE_MEMORY) << function;
  EXPECT_NE(error.message.find(function), std::string::npos) << error.message;
}

TEST(ContextTest, AFailureWhileBindingIsAnErrorAndLeaksNothing) {
  for (const char* function : {"vkCreateDescriptorPool", "vkAllocateDescriptorSets"}) {
    FailingContext failing(function, 0);
    ASSERT_TRUE(failing.context->prepare(failing.batch.plan.pipelines()).ok());
    const int before = failing.mock.aliveObjects();
    {
      const Result<vulkan::Bindings> bindings =
          failing.context->createBindings(failing.batch.buffers());
      ASSERT_TRUE(bindings.ok()) << function;
      const auto record = [&] {
        return failing.context->record(commandBuffer, failing.batch.plan, *bindings);
      };
      const Result<void> recorded = record();
      ASSERT_FALSE(recorded.ok()) << function;
      expectFailureOf(function, recorded.error());
      EXPECT_TRUE(failing.mock.commands.empty());
      failing.mock.failing.clear();
      EXPECT_TRUE(record().ok()) << function;
    }
    EXPECT_EQ(failing.mock.aliveObjects(), before) << function;
  }
}

// What was built before the failure stays built, and the next attempt builds the rest.
TEST(ContextTest, AFailureWhilePreparingIsAnErrorAndLeaksNothing) {
  const int pipelines = 2 + static_cast<int>(allMethods.size());
  for (const char* function : {"vkCreateShaderModule", "vkCreateComputePipelines"}) {
    for (int built = 0; built < pipelines; ++built) {
      FailingContext failing(function, built);
      const Result<void> prepared = failing.context->prepare(failing.batch.plan.pipelines());
      ASSERT_FALSE(prepared.ok()) << built;
      expectFailureOf(function, prepared.error());
      EXPECT_EQ(failing.mock.alive["Pipeline"], built);
      EXPECT_EQ(failing.mock.alive["ShaderModule"], 0);
      failing.mock.failing.clear();
      EXPECT_TRUE(failing.context->prepare(failing.batch.plan.pipelines()).ok());
      EXPECT_EQ(failing.mock.alive["Pipeline"], pipelines);
      failing.context = Error{};
      EXPECT_EQ(failing.mock.aliveObjects(), 0);
    }
  }
}

// The engine stores it, loads it and destroys it.
TEST(ContextTest, EveryPipelineIsBuiltWithTheEnginesCache) {
  for (const std::uintptr_t handle : {std::uintptr_t{0}, std::uintptr_t{77}}) {
    const auto cache = reinterpret_cast<VkPipelineCache>(handle);
    MockVulkan mock;
    vulkan::DeviceDescription description = mock.description();
    description.pipelineCache = cache;
    Result<vulkan::Context> context = vulkan::Context::create(description);
    const MockBatch batch = MockBatch::withAllMethods(context->limits());
    ASSERT_TRUE(context->prepare(batch.plan.pipelines()).ok());
    const std::vector<VkPipelineCache> expected(2 + allMethods.size(), cache);
    EXPECT_EQ(mock.cachesOfPipelines, expected);
  }
}

// ---- What the device can do

DeviceLimits limitsWith(const void* enabledFeatures) {
  MockVulkan mock;
  vulkan::DeviceDescription description = mock.description();
  description.enabledFeatures = enabledFeatures;
  description.texelBuffers = true;
  mock.limits.maxTexelBufferElements = mock.limits.maxStorageBufferRange / 16;
  const Result<vulkan::Context> context = vulkan::Context::create(description);
  EXPECT_TRUE(context.ok());
  return context->limits();
}

/// The structures that an engine may have chained, none of them enabling anything that is used; and
/// some that Dermis does not know, of which every word is true.
struct FeatureChain {
  VkPhysicalDeviceScalarBlockLayoutFeatures scalar{};
  VkPhysicalDeviceVulkan11Features vulkan11{};
  VkPhysicalDeviceVulkan12Features vulkan12{};
  VkPhysicalDeviceFeatures2 features2{};
  VkPhysicalDeviceVariablePointersFeatures pointers{};
  std::vector<VkBaseOutStructure*> order;

  FeatureChain() {
    scalar.sType = VK_STRUCTURE_TYPE_PHYSICAL_DEVICE_SCALAR_BLOCK_LAYOUT_FEATURES;
    vulkan11.sType = VK_STRUCTURE_TYPE_PHYSICAL_DEVICE_VULKAN_1_1_FEATURES;
    vulkan12.sType = VK_STRUCTURE_TYPE_PHYSICAL_DEVICE_VULKAN_1_2_FEATURES;
    features2.sType = VK_STRUCTURE_TYPE_PHYSICAL_DEVICE_FEATURES_2;
    pointers.sType = VK_STRUCTURE_TYPE_PHYSICAL_DEVICE_VARIABLE_POINTERS_FEATURES;
    // Neighbors of the members that are meant.
    vulkan11.storageBuffer16BitAccess = vulkan11.storagePushConstant16 = VK_TRUE;
    vulkan12.imagelessFramebuffer = vulkan12.uniformBufferStandardLayout = VK_TRUE;
    features2.features.shaderFloat64 = features2.features.shaderInt16 = VK_TRUE;
    pointers.variablePointersStorageBuffer = pointers.variablePointers = VK_TRUE;
    order = {base(scalar), base(vulkan11), base(vulkan12), base(features2), base(pointers)};
    std::sort(order.begin(), order.end());
  }
  FeatureChain(const FeatureChain&) = delete;
  FeatureChain& operator=(const FeatureChain&) = delete;

  template <typename Structure>
  static VkBaseOutStructure* base(Structure& structure) {
    return reinterpret_cast<VkBaseOutStructure*>(&structure);
  }
  const void* chain() {
    for (std::size_t i = 0; i < order.size(); ++i)
      order[i]->pNext = i + 1 < order.size() ? order[i + 1] : nullptr;
    return order[0];
  }
};

TEST(ContextTest, FeaturesAreFoundInAnyOrderOfTheChain) {
  EXPECT_FALSE(limitsWith(nullptr).texelBuffers);
  FeatureChain features;
  const auto expectAll = [&](bool texelBuffers) {
    std::sort(features.order.begin(), features.order.end());
    do {
      ASSERT_EQ(limitsWith(features.chain()).texelBuffers, texelBuffers);
    } while (std::next_permutation(features.order.begin(), features.order.end()));
  };
  expectAll(false);
  for (VkBool32* enabled :
       {&features.scalar.scalarBlockLayout, &features.vulkan12.scalarBlockLayout}) {
    *enabled = VK_TRUE;
    expectAll(false);
    features.features2.features.shaderInt64 = VK_TRUE;
    expectAll(true);
    *enabled = VK_FALSE;
    expectAll(false);
    features.features2.features.shaderInt64 = VK_FALSE;
  }
}

TEST(ContextTest, LimitsAreTheDevices) {
  MockVulkan mock;
  mock.limits.maxStorageBufferRange = 0xffffffffu;
  mock.limits.minStorageBufferOffsetAlignment = 64;
  mock.limits.maxComputeWorkGroupCount[0] = 1000;
  mock.limits.maxComputeWorkGroupCount[1] = 70000;
  mock.limits.maxPerStageDescriptorStorageBuffers = 35;
  const Result<vulkan::Context> context = vulkan::Context::create(mock.description());
  DeviceLimits expected;
  expected.maxStorageBufferRange = 0xfffffffcu;  // whole words
  expected.minStorageBufferOffsetAlignment = 64;
  expected.maxWorkgroupCountX = 1000;
  expected.maxWorkgroupCountY = 70000;
  expected.maxStorageBuffersPerStage = 35;
  expected.separateRanges = false;
  EXPECT_TRUE(context->limits() == expected);
}

TEST(ContextTest, LayoutsHaveEightBindingsWhereTheDeviceAllowsThem) {
  for (const std::uint32_t allowed : {4u, 5u, 7u, 8u, 9u, 0xffffffffu}) {
    for (const bool push : {false, true}) {
      MockVulkan mock;
      mock.limits.maxPerStageDescriptorStorageBuffers = allowed;
      if (push) mock.extensions = {VK_KHR_PUSH_DESCRIPTOR_EXTENSION_NAME};
      ASSERT_TRUE(vulkan::Context::create(mock.description()).ok());
      ASSERT_EQ(mock.setLayouts.size(), 1u);
      const std::vector<VkDescriptorSetLayoutBinding>& bindings = mock.setLayouts[0].bindings;
      ASSERT_EQ(bindings.size(), allowed >= 8 ? 8u : 4u) << allowed;
      for (std::uint32_t binding = 0; binding < bindings.size(); ++binding) {
        EXPECT_EQ(bindings[binding].binding, binding);
        EXPECT_EQ(bindings[binding].descriptorType, VK_DESCRIPTOR_TYPE_STORAGE_BUFFER);
        EXPECT_EQ(bindings[binding].descriptorCount, 1u);
      }
      EXPECT_EQ(mock.setLayouts[0].flags != 0, push);
    }
  }
}

// Each when it is first needed, and for as long as its pipeline is built.
TEST(ContextTest, ModulesAreCreatedForThePipelinesThatAreBuilt) {
  MockVulkan mock;
  Result<vulkan::Context> context = vulkan::Context::create(mock.description());
  EXPECT_TRUE(mock.modules.empty());
  std::vector<const std::uint32_t*> expected;
  for (const Variant& variant : {Variant{.method = Method::linear},
                                 Variant{.method = Method::logMatrix}, Variant{.bounds = true}}) {
    const PipelineId id = variant.id();
    for (int twice = 0; twice < 2; ++twice) ASSERT_TRUE(context->prepare({&id, 1}).ok());
    expected.push_back(vulkan::pipelineDescription(id)->spirv.data());
  }
  EXPECT_EQ(mock.modules, expected) << "every day, for comparison, results";
  EXPECT_EQ(mock.alive["ShaderModule"], 0);
}

TEST(ContextTest, APipelineThatNeedsAFeatureIsRefusedWithoutIt) {
  MockVulkan mock;
  Result<vulkan::Context> context = vulkan::Context::create(mock.description());
  const PipelineId texels = Variant{.texels = true}.id();
  const Result<void> prepared = context->prepare({&texels, 1});
  ASSERT_FALSE(prepared.ok());
  EXPECT_EQ(prepared.error().code, ErrorCode::missingFeature);
  EXPECT_NE(prepared.error().message.find("scalarBlockLayout"), std::string::npos);
  EXPECT_TRUE(mock.modules.empty()) << "a module needs the feature, too";
  EXPECT_EQ(mock.alive["Pipeline"], 0);
}

TEST(ContextTest, APipelineOfARicherDeviceIsRefused) {
  MockVulkan mock;
  mock.limits.maxPerStageDescriptorStorageBuffers = 4;
  const vulkan::Context context = *vulkan::Context::create(mock.description());
  for (const bool oneOutput : {false, true}) {
    const PipelineId id = Variant{.oneOutput = oneOutput}.id();
    const Result<void> prepared = context.prepare({&id, 1});
    ASSERT_EQ(prepared.ok(), oneOutput);
    if (!oneOutput) {
      EXPECT_EQ(prepared.error().code, ErrorCode::missingFeature);
    }
  }
}

// ---- Kernels as data

TEST(KernelsTest, SpirvIsThereWithoutADevice) {
  std::set<const std::uint32_t*> modules;
  for (const bool oneOutput : {false, true}) {
    for (const Kernel kernel : {Kernel::palette, Kernel::clear, Kernel::skin}) {
      for (const bool texels : {false, true}) {
        const Variant variant{.kernel = kernel, .texels = texels, .oneOutput = oneOutput};
        const vulkan::PipelineDescription pipeline = *vulkan::pipelineDescription(variant.id());
        ASSERT_GT(pipeline.spirv.size(), 5u);
        EXPECT_EQ(pipeline.spirv[0], 0x07230203u);
        EXPECT_EQ(pipeline.spirv[1], 0x00010300u) << "SPIR-V 1.3, which Vulkan 1.1 takes";
        EXPECT_EQ(pipeline.storageBuffers, oneOutput ? 4u : storageBuffersWanted);
        EXPECT_EQ(pipeline.texelBuffers, texels ? 3u : 0u);
        modules.insert(pipeline.spirv.data());
      }
    }
  }
  EXPECT_EQ(modules.size(), 5u) << "palettes, results, words, texels, one output";
}

TEST(KernelsTest, ANumberThatStandsForNoPipelineIsRefused) {
  const auto codeOf = [](PipelineId id) {
    const Result<vulkan::PipelineDescription> pipeline = vulkan::pipelineDescription(id);
    return pipeline ? std::nullopt : std::optional(pipeline.error().code);
  };
  const PipelineId good = Variant().id();
  EXPECT_EQ(codeOf(good), std::nullopt);
  EXPECT_EQ(codeOf(PipelineId{}), ErrorCode::invalidArgument);
  EXPECT_EQ(codeOf(PipelineId{~std::uint64_t{0}}), ErrorCode::invalidArgument);
  EXPECT_EQ(codeOf(PipelineId{static_cast<std::uint64_t>(good) | std::uint64_t{1} << 63}),
            ErrorCode::invalidArgument);
}

TEST(KernelsTest, ConstantsStandAtTheirIds) {
  Variant variant;
  variant.method = Method::linear;
  variant.positions = VertexFormat::snorm16x4;
  variant.normals = VertexFormat::octahedral8x2;
  variant.tangents = VertexFormat::snorm8x4;
  variant.wide = {true, false, true, true};
  variant.motion = true;
  variant.morphs = true;
  variant.bounds = true;
  variant.scales = true;
  variant.fullInfluences = true;
  variant.recordBytes = 24;
  variant.influences = 4;
  variant.instancesPerInvocation = 3;
  variant.workgroupSize = 32;
  const std::vector<std::uint32_t> constants = vulkan::pipelineDescription(variant.id())->constants;
  ASSERT_EQ(constants.size(), abi::CONSTANT_COUNT);
  const std::pair<std::uint32_t, std::uint32_t> expected[] = {
      {abi::CONSTANT_WORKGROUP_SIZE, 32},
      {abi::CONSTANT_METHOD, abi::METHOD_LINEAR},
      {abi::CONSTANT_INFLUENCES, 4},
      {abi::CONSTANT_INSTANCES, 3},
      {abi::CONSTANT_POSITION_FORMAT, abi::FORMAT_SNORM16X4},
      {abi::CONSTANT_NORMAL_FORMAT, abi::FORMAT_OCTAHEDRAL8X2},
      {abi::CONSTANT_TANGENT_FORMAT, abi::FORMAT_SNORM8X4},
      {abi::CONSTANT_WIDE, 0b1101},
      {abi::CONSTANT_MOTION, 1},
      {abi::CONSTANT_MORPHS, 1},
      {abi::CONSTANT_BOUNDS, 1},
      {abi::CONSTANT_SCALES, 1},
      {abi::CONSTANT_FULL, 1},
      {abi::CONSTANT_RECORD, 24},
      {abi::CONSTANT_RIGID, 0},
      {abi::CONSTANT_RIGGED, 0}};
  ASSERT_EQ(std::size(expected), abi::CONSTANT_COUNT);
  for (const auto& [id, value] : expected) EXPECT_EQ(constants[id], value) << id;

  Variant palette;
  palette.kernel = Kernel::palette;
  palette.rigid = true;
  EXPECT_EQ(vulkan::pipelineDescription(palette.id())->constants[abi::CONSTANT_RIGID], 1u);
  palette.rigged = true;
  EXPECT_EQ(vulkan::pipelineDescription(palette.id())->constants[abi::CONSTANT_RIGGED], 1u);
}

}  // namespace
}  // namespace dermis::test
