// Reading through uniform texel buffers, on a driver that is only pretended: which variants do so,
// and what is bound for them.

#include <gtest/gtest.h>

#include <algorithm>
#include <optional>
#include <string>
#include <vector>

#include "abi.h"
#include "dermis/vulkan/context.h"
#include "dermis/vulkan/scene_recorder.h"
#include "mock_batch.h"
#include "mock_vulkan.h"
#include "plan_commands.h"

namespace dermis::test {
namespace {

struct MockTexelTest : public MockContextTest {
  MockTexelTest() {
    mock.limits.maxTexelBufferElements = 1 << 27;
    mock.limits.minTexelBufferOffsetAlignment = 16;
  }
};

TEST_F(MockTexelTest, KernelsSeeTheirBuffersThroughViewsToo) {
  for (const bool push : {false, true}) {
    ASSERT_NO_FATAL_FAILURE(create(push, true));
    mock.texelDescriptorsInPool = 0;
    const MockBatch batch = MockBatch::withAllMethods(context->limits());
    vulkan::BatchBuffers buffers = batch.buffers();
    buffers.meshes.offset = 512;
    ASSERT_TRUE(record(batch, buffers).ok());
    ASSERT_EQ(mock.dispatches.size(), 2 + allMethods.size());
    for (std::size_t index = 2; index < mock.dispatches.size(); ++index) {
      const Variant variant = dispatchesOf(batch.plan)[index].variant;
      EXPECT_TRUE(variant.texels);
      const MockDescriptors& bound = mock.dispatches[index].descriptors;
      const vulkan::BufferRange& palettes =
          variant.method == Method::linear ? buffers.poses : buffers.palettes;
      const auto expectBound = [&](std::uint32_t binding, const vulkan::BufferRange& range) {
        ASSERT_TRUE(bound.contains(binding)) << binding;
        EXPECT_EQ(bound.at(binding).buffer, range.buffer);
        EXPECT_EQ(bound.at(binding).offset, range.offset);
        EXPECT_EQ(bound.at(binding).range, range.size / 16 * 16);
      };
      expectBound(abi::BINDING_TABLE_TEXELS, buffers.tables);
      expectBound(abi::BINDING_MESH_TEXELS, buffers.meshes);
      expectBound(abi::BINDING_PALETTE_TEXELS, palettes);
    }
    EXPECT_EQ(mock.alive["BufferView"], 0) << "views go with their bindings";
    EXPECT_EQ(mock.texelDescriptorsInPool, push ? 0u : mock.setsInPool * abi::TEXEL_BINDING_COUNT);
  }
}

TEST_F(MockTexelTest, LayoutsHaveTexelBuffersWhereTheDeviceReadsThem) {
  for (const bool texelBuffers : {false, true}) {
    mock.setLayouts.clear();
    ASSERT_NO_FATAL_FAILURE(create(false, texelBuffers));
    ASSERT_EQ(mock.setLayouts.size(), 1u);
    const std::vector<VkDescriptorSetLayoutBinding>& bindings = mock.setLayouts[0].bindings;
    ASSERT_EQ(bindings.size(), abi::BINDING_COUNT + (texelBuffers ? abi::TEXEL_BINDING_COUNT : 0));
    for (std::uint32_t binding = 0; binding < bindings.size(); ++binding) {
      EXPECT_EQ(bindings[binding].binding, binding);
      EXPECT_EQ(bindings[binding].descriptorType, binding < abi::BINDING_COUNT
                                                      ? VK_DESCRIPTOR_TYPE_STORAGE_BUFFER
                                                      : VK_DESCRIPTOR_TYPE_UNIFORM_TEXEL_BUFFER);
    }
  }
}

// Measured on lavapipe; that GPUs do without is a guess.
TEST_F(MockTexelTest, CpuDevicesReadThroughTexelBuffersUnlessTheEngineSaysOtherwise) {
  for (const VkPhysicalDeviceType type :
       {VK_PHYSICAL_DEVICE_TYPE_OTHER, VK_PHYSICAL_DEVICE_TYPE_INTEGRATED_GPU,
        VK_PHYSICAL_DEVICE_TYPE_DISCRETE_GPU, VK_PHYSICAL_DEVICE_TYPE_CPU}) {
    mock.deviceType = type;
    const bool isCpu = type == VK_PHYSICAL_DEVICE_TYPE_CPU;
    vulkan::DeviceDescription description = mock.description();
    const auto reads = [&] { return vulkan::Context::create(description)->limits().texelBuffers; };
    EXPECT_EQ(reads(), isCpu);
    EXPECT_EQ(vulkan::Context::create(description)->tuning().instancesPerInvocation,
              isCpu ? 24u : 4u);
    for (const bool asked : {false, true}) {
      description.texelBuffers = asked;
      EXPECT_EQ(reads(), asked);
    }
  }
}

TEST_F(MockTexelTest, NeedScalarBlockLayoutFromOneOfItsStructuresAndIntegersOf64Bits) {
  VkPhysicalDeviceFeatures2 integers{};
  integers.sType = VK_STRUCTURE_TYPE_PHYSICAL_DEVICE_FEATURES_2;
  integers.features.shaderInt64 = VK_TRUE;
  VkPhysicalDeviceScalarBlockLayoutFeatures own{};
  own.sType = VK_STRUCTURE_TYPE_PHYSICAL_DEVICE_SCALAR_BLOCK_LAYOUT_FEATURES;
  own.pNext = &integers;
  VkPhysicalDeviceVulkan12Features vulkan12{};
  vulkan12.sType = VK_STRUCTURE_TYPE_PHYSICAL_DEVICE_VULKAN_1_2_FEATURES;
  vulkan12.pNext = &own;
  vulkan::DeviceDescription description = mock.description();
  description.enabledFeatures = &vulkan12;
  description.texelBuffers = true;
  const auto has = [&] { return vulkan::Context::create(description)->limits().texelBuffers; };
  EXPECT_FALSE(has());
  own.scalarBlockLayout = VK_TRUE;
  EXPECT_TRUE(has());
  own.scalarBlockLayout = VK_FALSE;
  vulkan12.scalarBlockLayout = VK_TRUE;
  EXPECT_TRUE(has());
  integers.features.shaderInt64 = VK_FALSE;
  EXPECT_FALSE(has());
}

TEST_F(MockTexelTest, FeaturesMayBeStatedOneByOneAsAChainOrHalfAndHalf) {
  VkPhysicalDeviceFeatures2 integers{};
  integers.sType = VK_STRUCTURE_TYPE_PHYSICAL_DEVICE_FEATURES_2;
  integers.features.shaderInt64 = VK_TRUE;
  vulkan::DeviceDescription description = mock.description();
  description.texelBuffers = true;
  const auto has = [&](const void* chain, bool scalarBlockLayout, bool shaderInt64) {
    description.enabledFeatures = chain;
    description.hasScalarBlockLayout = scalarBlockLayout;
    description.hasShaderInt64 = shaderInt64;
    return vulkan::Context::create(description)->limits().texelBuffers;
  };
  EXPECT_TRUE(has(nullptr, true, true));
  EXPECT_FALSE(has(nullptr, true, false));
  EXPECT_FALSE(has(nullptr, false, true));
  EXPECT_FALSE(has(&integers, false, false));
  EXPECT_TRUE(has(&integers, true, false)) << "both together";
}

TEST_F(MockTexelTest, AnEngineWithoutThatUsageGetsStorageBuffersOnly) {
  ASSERT_NO_FATAL_FAILURE(create(false, false));
  EXPECT_FALSE(context->limits().texelBuffers);
  const MockBatch batch = MockBatch::withAllMethods(context->limits());
  EXPECT_EQ(batch.plan.buffer(BufferRole::meshes).usage & 0x04u, 0u);
  for (const Variant& variant : variantsOf(batch.plan.pipelines())) EXPECT_FALSE(variant.texels);
  ASSERT_TRUE(record(batch).ok());
  EXPECT_TRUE(mock.views.empty());
}

// A kernel reads through texels on a device if whatever a storage buffer may hold fits: it never
// depends on the batch. Vulkan guarantees 65,536 texels and ranges of 128 MiB.
TEST_F(MockTexelTest, ADeviceWithFewTexelsReadsStorageBuffers) {
  const std::uint64_t range = mock.limits.maxStorageBufferRange;
  for (const std::uint64_t texels : {std::uint64_t{65536}, range / 16 - 1}) {
    mock.limits.maxTexelBufferElements = static_cast<std::uint32_t>(texels);
    ASSERT_NO_FATAL_FAILURE(create(false, true));
    EXPECT_FALSE(context->limits().texelBuffers);
    EXPECT_EQ(context->limits().minStorageBufferOffsetAlignment, 256u);
    const MockBatch batch = MockBatch::withAllMethods(context->limits());
    ASSERT_TRUE(record(batch).ok());
    EXPECT_TRUE(mock.views.empty());
  }
  mock.limits.maxTexelBufferElements = static_cast<std::uint32_t>(range / 16);
  ASSERT_NO_FATAL_FAILURE(create(false, true));
  EXPECT_TRUE(context->limits().texelBuffers);
}

// Positions and normals that stand together are stored together.
TEST_F(MockTexelTest, PairsAreStoredWhereAllThatTheyNeedIsThere) {
  DeviceLimits limits = richLimits();
  limits.texelBuffers = true;
  const auto pairs = [&](auto change) {
    MockBatch mockBatch;
    mockBatch.batch.addJob(0, 0, Method::dualQuaternion, true);
    Job job = mockBatch.batch.jobs[0];
    Batch batch = mockBatch.batch.batch();
    batch.outputSizes.fill(1 << 20);
    job.places[Stream::positions] = {64, 32, VertexFormat::float32x3};
    job.places[Stream::normals] = {76, 32, VertexFormat::float32x3};
    DeviceLimits changed = limits;
    change(job, batch, changed);
    batch.jobs = {&job, 1};
    Plan plan;
    EXPECT_TRUE(dermis::makePlan(batch, changed, {}, plan).ok());
    const std::vector<Variant> foreseen = *everyVariant(job, changed, {});
    for (const Variant& variant : variantsOf(plan.pipelines()))
      EXPECT_NE(std::find(foreseen.begin(), foreseen.end(), variant), foreseen.end());
    return variantsOf(plan.pipelines()).back().pairs;
  };
  EXPECT_TRUE(pairs([](Job&, Batch&, DeviceLimits&) {}));
  EXPECT_TRUE(pairs([](Job& job, Batch&, DeviceLimits&) { job.method = Method::logMatrix; }));
  EXPECT_FALSE(pairs([](Job&, Batch&, DeviceLimits& device) { device.texelBuffers = false; }));
  EXPECT_TRUE(pairs([](Job& job, Batch&, DeviceLimits&) { job.bounds = true; }));
  EXPECT_FALSE(
      pairs([](Job& job, Batch&, DeviceLimits&) { job.places[Stream::normals].offset += 4; }));
  EXPECT_FALSE(
      pairs([](Job& job, Batch&, DeviceLimits&) { job.places[Stream::normals].stride += 8; }));
  EXPECT_FALSE(pairs([](Job& job, Batch&, DeviceLimits&) { job.places[Stream::normals] = {}; }));
  EXPECT_FALSE(pairs([](Job& job, Batch&, DeviceLimits&) {
    job.places[Stream::positions].stride = job.places[Stream::normals].stride = 36;
  }));
}

// An attribute, or all of a vertex, by one store.
TEST_F(MockTexelTest, AttributesAreStoredAtOnceWhereTheyStandAtMultiplesOfTheirSize) {
  using enum VertexFormat;
  DeviceLimits limits = richLimits();
  limits.texelBuffers = true;
  MockBatch mockBatch;
  mockBatch.batch.addJob(0, 0, Method::dualQuaternion, true);
  const Job plain = mockBatch.batch.jobs[0];
  const auto variantOf = [&](const VertexLayout& layout, std::uint64_t offset = 0) {
    Job job = plain;
    job.places = *placeVertices(layout, 7, offset);
    return everyVariant(job, limits, {})->back();
  };
  const auto record = [&](VertexFormat positions, VertexFormat normals,
                          VertexFormat tangents = none) {
    return variantOf({.positions = positions, .normals = normals, .tangents = tangents})
        .recordBytes;
  };
  EXPECT_EQ(record(float32x3, float32x3), 24);
  EXPECT_EQ(record(float32x3, octahedral16x2), 16);
  EXPECT_EQ(record(float32x4, octahedral16x2, snorm8x4), 24);
  EXPECT_EQ(record(float32x4, float32x4), 32);
  EXPECT_EQ(record(float16x4, octahedral16x2), 12);
  EXPECT_EQ(record(snorm16x4, snorm8x4, snorm8x4), 16);
  EXPECT_EQ(record(float16x3, octahedral8x2), 8);
  EXPECT_EQ(record(float16x3, octahedral8x2, octahedral16x2), 12);
  EXPECT_EQ(record(float32x3, octahedral8x2, octahedral8x2), 16);
  EXPECT_EQ(record(float32x3, none, float32x4), 0);  // 28 bytes
  EXPECT_EQ(record(float32x3, none), 0);
  EXPECT_TRUE(variantOf({.positions = float32x3}).wide[0]);
  EXPECT_FALSE(variantOf({.positions = float32x3, .stride = 16}).wide[0]);
  // Previous positions, and attributes of the engine's, are no part of the record.
  const Variant kept = variantOf({.normals = float32x3, .motion = true});
  EXPECT_EQ(kept.recordBytes, 0);  // at multiples of 36 bytes
  EXPECT_EQ(kept.wide, (std::array{true, true, false, true}));
  EXPECT_EQ(variantOf({.normals = float32x3, .stride = 48}).recordBytes, 24);
  const Variant between = variantOf({.normals = float32x3, .stride = 32});
  EXPECT_TRUE(between.recordBytes == 0 && between.pairs);
  const Variant planar = variantOf({.normals = float16x4, .planar = true}, 48);
  EXPECT_EQ(planar.recordBytes, 0);
  EXPECT_EQ(planar.wide, (std::array{true, true, false, false}));
}

TEST_F(MockTexelTest, APlanWithSharedWordsNeedsOneOutputBuffer) {
  ASSERT_NO_FATAL_FAILURE(create(false, false));
  MockBatch batch;
  batch.batch.addMesh(meshOf(10, 2, 4, MeshParts{true, true, 0}));
  Job job = batch.batch.jobOf(1, 0, Method::dualQuaternion);
  job.places[Stream::normals].format = job.places[Stream::tangents].format =
      VertexFormat::octahedral8x2;
  batch.batch.place(job, Arrangement::interleaved);
  batch.makePlan(context->limits());
  vulkan::BatchBuffers buffers = batch.buffers();
  EXPECT_TRUE(record(batch, buffers).ok());
  for (const auto& [range, role] :
       {std::pair{&buffers.outputs[Stream::normals], BufferRole::normals},
        {&buffers.outputs[Stream::tangents], BufferRole::tangents}}) {
    const vulkan::BufferRange good = *range;
    range->buffer = bufferOf(role);
    expectRefused(batch, buffers, ErrorCode::invalidArgument, "one buffer");
    *range = good;
  }
}

TEST_F(MockTexelTest, APlanThatStoresPairsNeedsOneOutputBuffer) {
  ASSERT_NO_FATAL_FAILURE(create(false, true));
  MockBatch batch;
  batch.batch.addJob(0, 0, Method::dualQuaternion, true);
  Job job = batch.batch.jobs[0];
  job.places[Stream::positions] = {0, 32, VertexFormat::float32x3};
  job.places[Stream::normals] = {12, 32, VertexFormat::float32x3};
  Batch described = batch.batch.batch();
  described.jobs = {&job, 1};
  described.outputSizes.fill(100 * 32);
  ASSERT_TRUE(makePlan(described, context->limits(), {}, batch.plan).ok());
  ASSERT_TRUE(variantsOf(batch.plan.pipelines()).back().pairs);
  vulkan::BatchBuffers buffers = batch.buffers();
  EXPECT_TRUE(record(batch, buffers).ok());
  buffers.outputs[Stream::normals].buffer = bufferOf(BufferRole::normals);
  expectRefused(batch, buffers, ErrorCode::invalidArgument, "one buffer");
}

TEST_F(MockTexelTest, AlignmentIsTheGreaterOfBoth) {
  mock.limits.minTexelBufferOffsetAlignment = 1024;
  ASSERT_NO_FATAL_FAILURE(create(false, true));
  EXPECT_EQ(context->limits().minStorageBufferOffsetAlignment, 1024u);
  ASSERT_NO_FATAL_FAILURE(create(false, false));
  EXPECT_EQ(context->limits().minStorageBufferOffsetAlignment, 256u);
}

TEST_F(MockTexelTest, AFailedViewIsAnErrorAndLeaksNothing) {
  const VkAllocationCallbacks callbacks{};
  mock.allocator = &callbacks;
  for (const bool push : {false, true}) {
    for (int failAfter = 0; failAfter <= 4; ++failAfter) {
      ASSERT_NO_FATAL_FAILURE(create(push, true));
      const MockBatch batch = MockBatch::withAllMethods(context->limits());
      mock.failing = "vkCreateBufferView";
      mock.failAfter = failAfter;
      const Result<vulkan::Bindings> bindings = context->createBindings(batch.buffers());
      mock.failing.clear();
      ASSERT_EQ(bindings.ok(), failAfter == 4);
      if (bindings) continue;
      EXPECT_EQ(bindings.error().code, ErrorCode::vulkanError);
      EXPECT_NE(bindings.error().message.find("vkCreateBufferView"), std::string::npos);
      EXPECT_EQ(mock.alive["BufferView"], 0);
    }
  }
  EXPECT_FALSE(mock.wrongAllocator);
}

}  // namespace
}  // namespace dermis::test
