// Bindings, and what a plan becomes in a command buffer, on a driver that is only pretended.

#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <optional>
#include <random>
#include <set>
#include <string>
#include <utility>
#include <vector>

#include "abi.h"
#include "dermis/vulkan/context.h"
#include "dermis/vulkan/scene_recorder.h"
#include "mock_batch.h"
#include "mock_vulkan.h"
#include "plan_commands.h"

namespace dermis::test {
namespace {

using vulkan::BatchBuffers;
using vulkan::BufferRange;

struct RecordTest : public MockContextTest {};

/// Everything of a batch in buffers of its own: all formats, motion, bounds.
MockBatch richBatch(const DeviceLimits& limits) {
  MockBatch result;
  Job job = result.batch.jobOf(0, 0, Method::dualQuaternion);
  job.places[Stream::normals].format = VertexFormat::octahedral16x2;
  job.places[Stream::tangents].format = VertexFormat::snorm8x4;
  job.places[Stream::previousPositions].format = job.places[Stream::positions].format;
  job.bounds = true;
  result.batch.place(job, Arrangement::separate);
  job.method = Method::linear;
  result.batch.place(job, Arrangement::separate);
  result.makePlan(limits);
  return result;
}

// ---- Bindings

struct BoundRole {
  BufferRole role;
  const char* name;
  BufferRange& (*range)(BatchBuffers&);
};
const BoundRole roles[] = {
    {BufferRole::meshes, "meshes", [](BatchBuffers& b) -> BufferRange& { return b.meshes; }},
    {BufferRole::poses, "poses", [](BatchBuffers& b) -> BufferRange& { return b.poses; }},
    {BufferRole::tables, "tables", [](BatchBuffers& b) -> BufferRange& { return b.tables; }},
    {BufferRole::palettes, "palettes", [](BatchBuffers& b) -> BufferRange& { return b.palettes; }},
    {BufferRole::results, "results", [](BatchBuffers& b) -> BufferRange& { return b.results; }},
    {BufferRole::positions, "outputs[positions]",
     [](BatchBuffers& b) -> BufferRange& { return b.outputs[Stream::positions]; }},
    {BufferRole::normals, "outputs[normals]",
     [](BatchBuffers& b) -> BufferRange& { return b.outputs[Stream::normals]; }},
    {BufferRole::tangents, "outputs[tangents]",
     [](BatchBuffers& b) -> BufferRange& { return b.outputs[Stream::tangents]; }},
    {BufferRole::previousPositions, "outputs[previousPositions]",
     [](BatchBuffers& b) -> BufferRange& { return b.outputs[Stream::previousPositions]; }}};

TEST_F(RecordTest, RangesThatCannotBeBoundAreRefused) {
  ASSERT_NO_FATAL_FAILURE(create());
  const MockBatch batch = richBatch(context->limits());
  ASSERT_TRUE(record(batch).ok());
  for (const auto& [role, name, rangeOf] : roles) {
    BatchBuffers buffers = batch.buffers();
    ASSERT_NE(rangeOf(buffers).size, 0u) << name;
    rangeOf(buffers).offset = 16;
    expectRefused(batch, buffers, ErrorCode::invalidArgument,
                  std::string(name) + ": the offset 16 is not a multiple of this device's 256");
    buffers = batch.buffers();
    for (const VkDeviceSize size :
         {VkDeviceSize{0}, VkDeviceSize{VK_WHOLE_SIZE}, rangeOf(buffers).size + 2}) {
      rangeOf(buffers).size = size;
      expectRefused(batch, buffers, ErrorCode::invalidArgument,
                    std::string(name) + ": its size must be");
    }
    rangeOf(buffers).offset = 512;
    rangeOf(buffers).size = batch.range(role).size;
    EXPECT_TRUE(record(batch, buffers).ok()) << name;
  }
}

TEST_F(RecordTest, OnlyOutputsMayBeLargerThanARange) {
  ASSERT_NO_FATAL_FAILURE(create());
  const MockBatch batch = richBatch(context->limits());
  for (const auto& [role, name, rangeOf] : roles) {
    BatchBuffers buffers = batch.buffers();
    rangeOf(buffers).size = context->limits().maxStorageBufferRange;
    EXPECT_TRUE(record(batch, buffers).ok()) << name;
    rangeOf(buffers).size += 4;
    if (role >= BufferRole::positions) {
      EXPECT_TRUE(record(batch, buffers).ok()) << name;
    } else {
      expectRefused(batch, buffers, ErrorCode::limitExceeded,
                    std::string(name) + ": 134217732 bytes");
    }
  }
}

TEST_F(RecordTest, WithFourStorageBuffersAllAttributesGoToOne) {
  mock.limits.maxPerStageDescriptorStorageBuffers = 4;
  ASSERT_NO_FATAL_FAILURE(create());
  const MockBatch batch = MockBatch::withAllMethods(context->limits());
  EXPECT_TRUE(record(batch).ok());
  for (const Stream stream : {Stream::normals, Stream::tangents, Stream::previousPositions}) {
    BatchBuffers buffers = batch.buffers();
    const auto expectOtherRefused = [&] {
      expectRefused(batch, buffers, ErrorCode::limitExceeded, "4 storage buffers per stage");
      buffers = batch.buffers();
    };
    buffers.outputs[stream].buffer = bufferOf(BufferRole::results);
    expectOtherRefused();
    buffers.outputs[stream].offset = 256;
    expectOtherRefused();
    buffers.outputs[stream].size += 4;
    expectOtherRefused();
    // Not wanted, not given.
    if (stream != Stream::normals) {
      buffers.outputs[stream] = {};
      EXPECT_TRUE(record(batch, buffers).ok());
    }
  }
}

TEST_F(RecordTest, BuffersThatThePlanUsesMustBeLargeEnough) {
  ASSERT_NO_FATAL_FAILURE(create());
  const MockBatch batch = richBatch(context->limits());
  for (const auto& [role, name, rangeOf] : roles) {
    const std::string prefix = "outputs[";
    std::string text = name;
    if (text.find(prefix) == 0) text = text.substr(prefix.size(), text.size() - prefix.size() - 1);
    if (text == "previousPositions") text = "previous positions";
    const std::string needed = std::to_string(batch.plan.buffer(role).size);
    BatchBuffers buffers = batch.buffers();
    rangeOf(buffers).size -= 4;
    expectRefused(batch, buffers, ErrorCode::invalidArgument, needed + " bytes of " + text);
    rangeOf(buffers) = {};
    expectRefused(batch, buffers, ErrorCode::invalidArgument, "the bindings have 0");
  }
}

TEST_F(RecordTest, WhatThePlanDoesNotUseMayBeMissing) {
  ASSERT_NO_FATAL_FAILURE(create());
  MockBatch batch;
  batch.batch.addJob(0, 0, Method::linear, false, 12);
  batch.makePlan(context->limits());
  BatchBuffers buffers = batch.buffers();
  EXPECT_EQ(buffers.palettes.buffer, VkBuffer{VK_NULL_HANDLE});
  EXPECT_EQ(buffers.results.buffer, VkBuffer{VK_NULL_HANDLE});
  for (const Stream stream : {Stream::normals, Stream::tangents, Stream::previousPositions}) {
    buffers.outputs[stream] = {bufferOf(BufferRole::normals), 0, 4};
    EXPECT_TRUE(record(batch, buffers).ok()) << "too small for a plan that used it";
    buffers.outputs[stream] = {};
  }
  EXPECT_TRUE(record(batch, buffers).ok());
}

/// Every binding of the layout is bound, to a buffer of the batch.
TEST_F(RecordTest, EveryBindingThatAModuleNamesIsBound) {
  for (const bool push : {false, true}) {
    for (const std::uint32_t storageBuffers : {4u, 8u}) {
      mock.limits.maxPerStageDescriptorStorageBuffers = storageBuffers;
      ASSERT_NO_FATAL_FAILURE(create(push));
      for (const bool rich : {false, true}) {
        if (rich && storageBuffers == 4) continue;
        const MockBatch batch =
            rich ? richBatch(context->limits()) : MockBatch::withAllMethods(context->limits());
        ASSERT_TRUE(record(batch).ok());
        // Before those of the skin kernel: palettes, and results to clear; or two forms of
        // palettes.
        ASSERT_EQ(mock.dispatches.size(), 2 + (rich ? 2u : allMethods.size()));
        for (const MockDispatch& dispatch : mock.dispatches) {
          const bool isSkin = &dispatch >= &mock.dispatches[2];
          // The others name no attribute.
          std::set<std::uint32_t> wanted{0, 1, 2};
          if (isSkin) wanted.insert(3);
          if (isSkin && storageBuffers == 8) wanted.insert({4, 5, 6});
          if (storageBuffers == 8) wanted.insert(7);
          for (const std::uint32_t binding : wanted) {
            EXPECT_TRUE(dispatch.descriptors.contains(binding)) << binding;
          }
          for (const auto& [binding, descriptor] : dispatch.descriptors) {
            EXPECT_LT(binding, storageBuffers);
            EXPECT_NE(descriptor.buffer, VkBuffer{VK_NULL_HANDLE});
            EXPECT_GT(descriptor.range, 0u);
          }
        }
      }
    }
  }
}

TEST_F(RecordTest, EachKernelSeesItsBuffers) {
  for (const bool push : {false, true}) {
    ASSERT_NO_FATAL_FAILURE(create(push));
    const MockBatch batch = richBatch(context->limits());
    ASSERT_TRUE(record(batch).ok());
    const auto expectBound = [&](const MockDispatch& dispatch, std::uint32_t binding,
                                 BufferRole role) {
      ASSERT_TRUE(dispatch.descriptors.contains(binding));
      const MockDescriptor expected{bufferOf(role), 0, batch.range(role).size};
      EXPECT_TRUE(dispatch.descriptors.at(binding) == expected) << binding;
    };
    ASSERT_EQ(mock.dispatches.size(), 4u);
    const MockDispatch& palette = mock.dispatches[0];
    expectBound(palette, abi::BINDING_TABLES, BufferRole::tables);
    expectBound(palette, abi::BINDING_MESHES, BufferRole::poses);
    expectBound(palette, abi::BINDING_PALETTES, BufferRole::palettes);
    const MockDispatch& clear = mock.dispatches[1];
    expectBound(clear, abi::BINDING_TABLES, BufferRole::tables);
    expectBound(clear, abi::BINDING_RESULTS, BufferRole::results);
    for (std::size_t index = 2; index < 4; ++index) {
      const MockDispatch& skin = mock.dispatches[index];
      const bool linear = dispatchesOf(batch.plan)[index].variant.method == Method::linear;
      expectBound(skin, abi::BINDING_TABLES, BufferRole::tables);
      expectBound(skin, abi::BINDING_MESHES, BufferRole::meshes);
      expectBound(skin, abi::BINDING_PALETTES, linear ? BufferRole::poses : BufferRole::palettes);
      expectBound(skin, abi::BINDING_POSITIONS, BufferRole::positions);
      expectBound(skin, abi::BINDING_NORMALS, BufferRole::normals);
      expectBound(skin, abi::BINDING_TANGENTS, BufferRole::tangents);
      expectBound(skin, abi::BINDING_PREVIOUS, BufferRole::previousPositions);
      expectBound(skin, abi::BINDING_RESULTS, BufferRole::results);
    }
  }
}

// ---- Windows

/// Instances all over outputs of 300000 bytes.
MockBatch wideBatch(const DeviceLimits& limits, bool near) {
  MockBatch result;
  result.batch.outputSize = 300000;
  for (std::uint64_t place = 0; place < 280000; place += 20000) {
    Job job = result.batch.jobOf(0, 0, Method::linear);
    job.places[Stream::positions] = {place, 24, VertexFormat::float32x3};
    job.places[Stream::normals] = {near ? place + 12 : 290000 - place, 24, VertexFormat::float32x3};
    result.batch.jobs.push_back(job);
  }
  result.makePlan(limits);
  return result;
}

TEST_F(RecordTest, WindowsOfOutputsAreBoundWhereTheyBegin) {
  mock.limits.maxStorageBufferRange = 65536;
  for (const bool push : {false, true}) {
    for (const std::uint32_t storageBuffers : {4u, 8u}) {
      mock.limits.maxPerStageDescriptorStorageBuffers = storageBuffers;
      ASSERT_NO_FATAL_FAILURE(create(push));
      const MockBatch batch = wideBatch(context->limits(), true);
      BatchBuffers buffers = batch.buffers();
      buffers.outputs[Stream::positions].offset = 4096;
      buffers.outputs.fill(buffers.outputs[Stream::positions]);
      ASSERT_TRUE(record(batch, buffers).ok());
      ASSERT_EQ(mock.dispatches.size(), dispatchesOf(batch.plan).size());
      ASSERT_GT(mock.dispatches.size(), 4u);
      for (std::size_t index = 0; index < mock.dispatches.size(); ++index) {
        const PlannedDispatch dispatch = dispatchesOf(batch.plan)[index];
        for (std::uint32_t stream = 0; stream < 2; ++stream) {
          if (stream == 1 && storageBuffers == 4) continue;
          const MockDescriptor& bound =
              mock.dispatches[index].descriptors.at(abi::BINDING_POSITIONS + stream);
          EXPECT_EQ(bound.offset, 4096 + dispatch.outputPart(stream).offset);
          EXPECT_EQ(bound.range,
                    std::min<std::uint64_t>(65536, 300000 - dispatch.outputPart(stream).offset));
        }
      }
    }
  }
}

TEST_F(RecordTest, WindowsThatDifferNeedPushDescriptors) {
  mock.limits.maxStorageBufferRange = 65536;
  ASSERT_NO_FATAL_FAILURE(create(true));
  const MockBatch batch = wideBatch(context->limits(), false);
  ASSERT_TRUE(record(batch).ok());
  for (std::size_t index = 0; index < mock.dispatches.size(); ++index) {
    for (std::uint32_t stream = 0; stream < 2; ++stream) {
      EXPECT_EQ(mock.dispatches[index].descriptors.at(abi::BINDING_POSITIONS + stream).offset,
                dispatchesOf(batch.plan)[index].outputPart(stream).offset);
    }
  }
  ASSERT_NO_FATAL_FAILURE(create(false));
  expectRefused(batch, batch.buffers(), ErrorCode::invalidArgument, "limits of another device");
  EXPECT_FALSE(context->limits().separateRanges);
}

// A window is the only one of a buffer within a range, whatever those of the others.
TEST_F(RecordTest, BuffersWithinARangeHaveNoWindows) {
  mock.limits.maxStorageBufferRange = 65536;
  for (const bool push : {false, true}) {
    ASSERT_NO_FATAL_FAILURE(create(push));
    MockBatch batch;
    batch.batch.hasSeparateOutputs = true;
    batch.batch.separateSizes = {300000, 40000, 0, 0};
    for (std::uint64_t instance = 0; instance < 5; ++instance) {
      Job job = batch.batch.jobOf(0, 0, Method::linear);
      job.places[Stream::positions] = {instance * 60000, 24, VertexFormat::float32x3};
      job.places[Stream::normals] = {instance * 400, 4, VertexFormat::octahedral16x2};
      batch.batch.jobs.push_back(job);
    }
    batch.makePlan(context->limits());
    ASSERT_TRUE(record(batch).ok());
    std::set<VkDeviceSize> positions;
    for (const MockDispatch& dispatch : mock.dispatches) {
      positions.insert(dispatch.descriptors.at(abi::BINDING_POSITIONS).offset);
      EXPECT_EQ(dispatch.descriptors.at(abi::BINDING_NORMALS).offset, 0u);
      EXPECT_EQ(dispatch.descriptors.at(abi::BINDING_NORMALS).range, 40000u);
    }
    EXPECT_GT(positions.size(), 3u);
  }
}

// A set for each list of buffers that a dispatch binds, whichever plan has it.
TEST_F(RecordTest, SetsAreMadeOnce) {
  mock.limits.maxStorageBufferRange = 65536;
  for (const std::uint32_t storageBuffers : {4u, 8u}) {
    mock.limits.maxPerStageDescriptorStorageBuffers = storageBuffers;
    ASSERT_NO_FATAL_FAILURE(create());
    const MockBatch batch = wideBatch(context->limits(), true);
    ASSERT_TRUE(context->prepare(batch.plan.pipelines()).ok());
    const Result<vulkan::Bindings> bindings = context->createBindings(batch.buffers());
    ASSERT_TRUE(bindings.ok());
    std::set<VkDescriptorSet> sets;
    for (int times = 0; times < 3; ++times) {
      mock.dispatches.clear();
      ASSERT_TRUE(context->record(commandBuffer, batch.plan, *bindings).ok());
      for (const MockDispatch& dispatch : mock.dispatches) sets.insert(dispatch.set);
      EXPECT_EQ(sets.size(), mock.dispatches.size());
    }
    EXPECT_GT(sets.size(), 4u);
    EXPECT_EQ(mock.descriptorsInPool, mock.setsInPool * storageBuffers);
  }
}

// ---- Recording

TEST_F(RecordTest, NeedsPreparedPipelinesAndNamesTheMissingOne) {
  ASSERT_NO_FATAL_FAILURE(create());
  const MockBatch batch = richBatch(context->limits());
  const Result<vulkan::Bindings> bindings = context->createBindings(batch.buffers());
  ASSERT_TRUE(bindings.ok());
  const std::string skin =
      " with positions as float32x3, normals as octahedral16x2, tangents as snorm8x4, previous "
      "positions, bounds, for 4 influences";
  const std::string end = " has no pipeline; call Context::prepare for it first";
  const std::string sentences[] = {
      "the palette kernel for dual quaternions with joints that scale" + end,
      "the clear kernel" + end,
      "the skin kernel for linear" + skin + " and joints that scale" + end,
      "the skin kernel for dual_quaternion" + skin + " and joints that scale" + end};
  ASSERT_EQ(batch.plan.pipelines().size(), 4u);
  for (std::size_t prepared = 0; prepared < 4; ++prepared) {
    const Result<void> early = context->record(commandBuffer, batch.plan, *bindings);
    ASSERT_FALSE(early.ok());
    EXPECT_EQ(early.error().code, ErrorCode::notPrepared);
    EXPECT_EQ(early.error().message, sentences[prepared]);
    EXPECT_TRUE(mock.commands.empty()) << "nothing is recorded when it fails";
    ASSERT_TRUE(context->prepare(batch.plan.pipelines().subspan(prepared, 1)).ok());
  }
  EXPECT_TRUE(context->record(commandBuffer, batch.plan, *bindings).ok());
}

TEST_F(RecordTest, TheSentenceOfAMissingPipelineTellsOfMorphTargetsAndAnyNumber) {
  ASSERT_NO_FATAL_FAILURE(create());
  MockBatch batch;
  batch.batch.addMesh(meshOf(10, 5, 5, MeshParts{false, false, 1}));
  batch.batch.addPose(5, JointPromise::scaleIgnored);
  batch.batch.addJob(1, 1, Method::linear, false).morphs = batch.batch.keep({{0, 1.0f}});
  batch.makePlan(context->limits());
  const Result<vulkan::Bindings> bindings = context->createBindings(batch.buffers());
  EXPECT_EQ(
      context->record(commandBuffer, batch.plan, *bindings).error().message,
      "the skin kernel for linear with positions as float32x3, morph targets, for any number "
      "of influences and joints that scale has no pipeline; call Context::prepare for it first");
}

/// A few methods and layouts, and batches of nothing else.
struct KnownLayouts {
  explicit KnownLayouts(std::uint32_t seed) : engine(seed) {
    const OwnedBatch random = randomRichBatch(seed, 200, false);
    for (const Job& job : random.jobs) {
      if (layouts.size() < 3) layouts.push_back(job);
    }
    Job pairs;  // stored two words at a time
    pairs.places[Stream::positions] = {0, 24, VertexFormat::float32x3};
    pairs.places[Stream::normals] = {12, 24, VertexFormat::float32x3};
    layouts.push_back(pairs);
  }

  std::uint32_t below(std::uint32_t count) { return static_cast<std::uint32_t>(engine()) % count; }

  /// Meshes, palettes and morph targets at random.
  MockBatch batch(const DeviceLimits& limits) {
    MockBatch result;
    OwnedBatch& owned = result.batch;
    owned = OwnedBatch();
    for (int mesh = 0; mesh < 4; ++mesh) {
      owned.addMesh(meshOf(1 + below(200), 1 + below(9), 5, MeshParts{true, true, 3}));
      owned.addPose(5 + below(4), static_cast<JointPromise>(below(3)));
    }
    for (std::uint32_t count = below(30); count > 0; --count) {
      const Job& layout = layouts[below(static_cast<std::uint32_t>(layouts.size()))];
      Job job = owned.jobOf(below(4), below(4), layout.method);
      job.places = layout.places;
      for (OutputAttribute& attribute : job.places.attributes) attribute.offset += owned.outputSize;
      job.bounds = layout.bounds;
      job.box = {{0, 0, 0}, {1, 1, 1}};
      if (below(2) == 0) job.morphs = owned.keep({{below(3), static_cast<float>(below(2))}});
      owned.jobs.push_back(job);
      owned.outputSize += 1 << 20;
    }
    result.makePlan(limits);
    return result;
  }

  std::mt19937 engine;
  std::vector<Job> layouts;
};

// What is known while loading decides which pipelines there are: nothing that happens to be in a
// batch needs another.
TEST_F(RecordTest, PreparedMethodsAndLayoutsRecordAnyBatch) {
  for (std::uint32_t seed = 0; seed < 24; ++seed) {
    SCOPED_TRACE(seed);
    mock.limits.maxTexelBufferElements = seed % 2 == 0 ? 65536 : 1 << 27;
    VkPhysicalDeviceFeatures2 integers{};
    integers.sType = VK_STRUCTURE_TYPE_PHYSICAL_DEVICE_FEATURES_2;
    integers.features.shaderInt64 = VK_TRUE;
    VkPhysicalDeviceVulkan12Features scalar{};
    scalar.sType = VK_STRUCTURE_TYPE_PHYSICAL_DEVICE_VULKAN_1_2_FEATURES;
    scalar.scalarBlockLayout = seed % 8 < 4 ? VK_TRUE : VK_FALSE;
    scalar.pNext = &integers;
    vulkan::DeviceDescription description = mock.description();
    description.enabledFeatures = &scalar;
    description.texelBuffers = true;
    Result<vulkan::Context> made = vulkan::Context::create(description);
    ASSERT_TRUE(made.ok());
    KnownLayouts known(seed);
    for (const Job& layout : known.layouts)
      ASSERT_TRUE(made->prepare(*pipelines(layout, made->limits(), made->tuning())).ok());
    const int pipelines = mock.alive["Pipeline"];
    for (int number = 0; number < 30; ++number) {
      const MockBatch batch = known.batch(made->limits());
      const Result<vulkan::Bindings> bindings = made->createBindings(batch.buffers());
      ASSERT_TRUE(bindings.ok()) << bindings.error().message;
      const Result<void> recorded = made->record(commandBuffer, batch.plan, *bindings);
      ASSERT_TRUE(recorded.ok()) << recorded.error().message;
    }
    EXPECT_EQ(mock.alive["Pipeline"], pipelines);
  }
}

TEST_F(RecordTest, DispatchesAreThoseOfThePlan) {
  ASSERT_NO_FATAL_FAILURE(create());
  MockBatch batch = richBatch(context->limits());
  Job other = batch.batch.jobOf(0, 0, Method::linear);
  other.places[Stream::positions].format = VertexFormat::float16x4;
  batch.batch.place(other, Arrangement::separate);
  batch.makePlan(context->limits());
  ASSERT_TRUE(record(batch).ok());
  ASSERT_EQ(mock.dispatches.size(), 5u);
  for (std::size_t index = 0; index < 5; ++index) {
    const PlannedDispatch expected = dispatchesOf(batch.plan)[index];
    const MockDispatch& actual = mock.dispatches[index];
    EXPECT_EQ(actual.code, vulkan::pipelineDescription(expected.pipeline)->spirv.data());
    EXPECT_EQ(actual.groupCountX, expected.groupCountX);
    EXPECT_EQ(actual.groupCountY, expected.groupCountY);
    ASSERT_LE(expected.constantCount, actual.constants.size());
    EXPECT_TRUE(std::equal(actual.constants.begin(),
                           actual.constants.begin() + expected.constantCount,
                           expected.constants.begin()));
  }
}

TEST_F(RecordTest, RecordsTheBarrierBetweenItsPassesAndNoOther) {
  for (const bool push : {false, true}) {
    ASSERT_NO_FATAL_FAILURE(create(push));
    const MockBatch batch = MockBatch::withAllMethods(context->limits());
    ASSERT_TRUE(record(batch).ok());
    const std::string descriptors = push ? "push descriptors" : "bind sets";
    // Two forms of palettes, the linear instance, which needs none, and those of the other methods.
    std::vector<std::string> expected;
    for (std::size_t dispatch = 0; dispatch < 2 + allMethods.size(); ++dispatch) {
      if (dispatch == 3) expected.emplace_back("barrier");
      expected.insert(expected.end(), {"bind pipeline", descriptors, "push constants", "dispatch"});
    }
    EXPECT_EQ(mock.commands, expected);
    EXPECT_TRUE(mock.bufferBarriers.empty());
    ASSERT_EQ(mock.memoryBarriers.size(), 1u);
    // The skin kernel reads palettes, and adds to results, that the palette kernel wrote.
    constexpr VkPipelineStageFlags compute = VK_PIPELINE_STAGE_COMPUTE_SHADER_BIT;
    expectBarrier(mock.memoryBarriers[0], {compute, VK_ACCESS_SHADER_WRITE_BIT, compute,
                                           VK_ACCESS_SHADER_READ_BIT | VK_ACCESS_SHADER_WRITE_BIT});
  }
}

TEST_F(RecordTest, LinearJobsWithBoundsWaitToo) {
  ASSERT_NO_FATAL_FAILURE(create());
  ASSERT_TRUE(record(richBatch(context->limits())).ok());
  EXPECT_EQ(std::count(mock.commands.begin(), mock.commands.end(), "barrier"), 1);
  EXPECT_EQ(mock.commands[8], "barrier");
}

TEST_F(RecordTest, LinearAloneNeedsNoPalettes) {
  ASSERT_NO_FATAL_FAILURE(create());
  MockBatch batch;
  batch.batch.addJob(0, 0, Method::linear, true);
  batch.makePlan(context->limits());
  EXPECT_EQ(batch.plan.buffer(BufferRole::palettes).size, 0u);
  ASSERT_TRUE(record(batch).ok());
  EXPECT_EQ(mock.commands,
            (std::vector<std::string>{"bind pipeline", "bind sets", "push constants", "dispatch"}));
}

TEST_F(RecordTest, LinearJobsWithBoundsNeedNoPaletteBuffer) {
  for (const bool push : {false, true}) {
    ASSERT_NO_FATAL_FAILURE(create(push));
    MockBatch batch;
    batch.batch.addJob(0, 0, Method::linear, true).bounds = true;
    batch.makePlan(context->limits());
    ASSERT_EQ(batch.buffers().palettes.buffer, VkBuffer{VK_NULL_HANDLE});
    ASSERT_TRUE(record(batch).ok());
    ASSERT_EQ(mock.dispatches.size(), 2u);
    EXPECT_EQ(mock.memoryBarriers.size(), 1u);
    // The clear kernel's set has both: what it does not use is bound to what there is.
    EXPECT_EQ(mock.dispatches[0].descriptors.at(abi::BINDING_PALETTES).buffer,
              bufferOf(BufferRole::results));
    EXPECT_EQ(mock.dispatches[0].descriptors.at(abi::BINDING_RESULTS).buffer,
              bufferOf(BufferRole::results));
  }
}

TEST_F(RecordTest, AnEmptyPlanRecordsNothing) {
  ASSERT_NO_FATAL_FAILURE(create());
  const Plan plan;
  const Result<vulkan::Bindings> bindings = context->createBindings({});
  ASSERT_TRUE(bindings.ok());
  EXPECT_TRUE(context->record(commandBuffer, plan, *bindings).ok());
  EXPECT_TRUE(mock.commands.empty());
}

TEST_F(RecordTest, APlanForOtherLimitsIsRefused) {
  ASSERT_NO_FATAL_FAILURE(create());
  DeviceLimits other[] = {context->limits(), context->limits(), context->limits()};
  other[0].maxStorageBufferRange = 1 << 28;
  other[1].maxStorageBuffersPerStage = 9;
  other[2].stagedStores = !other[2].stagedStores;
  for (const DeviceLimits& limits : other) {
    const MockBatch batch = MockBatch::withAllMethods(limits);
    expectRefused(batch, batch.buffers(), ErrorCode::invalidArgument, "limits of another device");
  }
}

TEST_F(RecordTest, BindingsOfAnotherContextAreRefused) {
  ASSERT_NO_FATAL_FAILURE(create());
  const Result<vulkan::Context> other = vulkan::Context::create(mock.description());
  const MockBatch batch = MockBatch::withAllMethods(context->limits());
  ASSERT_TRUE(context->prepare(batch.plan.pipelines()).ok());
  const Result<vulkan::Bindings> bindings = other->createBindings(batch.buffers());
  EXPECT_EQ(context->record(commandBuffer, batch.plan, *bindings).error().code,
            ErrorCode::invalidArgument);
  EXPECT_EQ(context->record(commandBuffer, batch.plan, vulkan::Bindings()).error().code,
            ErrorCode::invalidArgument);
}

}  // namespace
}  // namespace dermis::test
