// Batches to record on the pretended driver.
#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <utility>

#include <gtest/gtest.h>

#include "core_plan_simulation.h"
#include "dermis/vulkan/context.h"
#include "dermis/vulkan/scene_recorder.h"
#include "mock_vulkan.h"

namespace dermis::test {

inline const VkCommandBuffer commandBuffer =
    reinterpret_cast<VkCommandBuffer>(std::uintptr_t{1 << 20});

/// A buffer for each role, told apart by its handle.
inline VkBuffer bufferOf(BufferRole role) {
  return reinterpret_cast<VkBuffer>((std::uintptr_t{1} << 21) + static_cast<std::uintptr_t>(role));
}

inline void expectBarrier(const vulkan::Barrier& barrier, const vulkan::Barrier& expected) {
  EXPECT_EQ(barrier.sourceStages, expected.sourceStages);
  EXPECT_EQ(barrier.sourceAccesses, expected.sourceAccesses);
  EXPECT_EQ(barrier.destinationStages, expected.destinationStages);
  EXPECT_EQ(barrier.destinationAccesses, expected.destinationAccesses);
}

/// A batch, its plan, and buffers as large as the plan needs.
struct MockBatch {
  OwnedBatch batch;
  Plan plan;

  /// A mesh with everything and a palette.
  MockBatch() {
    batch.addMesh(meshOf(100, 4, 4, MeshParts{true, true, 2}));
    batch.addPose(4, JointPromise::scaling);
  }
  /// Positions and normals of one instance for each method, in one buffer.
  static MockBatch withAllMethods(const DeviceLimits& limits) {
    MockBatch result;
    for (const Method method : allMethods) result.batch.addJob(0, 0, method, true);
    result.makePlan(limits);
    return result;
  }

  void makePlan(const DeviceLimits& limits) {
    const Result<void> made = dermis::makePlan(batch.batch(), limits, {}, plan);
    EXPECT_TRUE(made.ok()) << (made ? "" : made.error().message);
  }

  vulkan::BufferRange range(BufferRole role) const {
    const std::uint64_t size = plan.buffer(role).size;
    if (size == 0) return {};
    return {bufferOf(role), 0, (size + 3) / 4 * 4};
  }
  vulkan::BatchBuffers buffers() const {
    auto outputs = ByStream<vulkan::BufferRange>::all(range(BufferRole::positions));
    if (batch.hasSeparateOutputs) {
      outputs = {{range(BufferRole::positions), range(BufferRole::normals),
                  range(BufferRole::tangents), range(BufferRole::previousPositions)}};
    }
    return {range(BufferRole::meshes),
            range(BufferRole::poses),
            range(BufferRole::tables),
            range(BufferRole::palettes),
            outputs,
            range(BufferRole::results)};
  }
};

/// A context of the pretended device, and what becomes of batches.
struct MockContextTest : public ::testing::Test {
  /// Makes the context; `mock.limits` may be changed before.
  void create(bool push = false, const std::optional<bool>& texelBuffers = {},
              const void* enabledFeatures = nullptr) {
    mock.extensions.clear();
    if (push) mock.extensions = {VK_KHR_PUSH_DESCRIPTOR_EXTENSION_NAME};
    vulkan::DeviceDescription description = mock.description();
    description.texelBuffers = texelBuffers;
    if (enabledFeatures != nullptr) description.enabledFeatures = enabledFeatures;
    Result<vulkan::Context> made = vulkan::Context::create(description);
    ASSERT_TRUE(made.ok());
    context.emplace(std::move(*made));
  }
  /// Prepares and records.
  Result<void> record(const MockBatch& batch, const vulkan::BatchBuffers& buffers) {
    mock.dispatches.clear();
    mock.commands.clear();
    mock.memoryBarriers.clear();
    mock.bufferBarriers.clear();
    if (Result<void> prepared = context->prepare(batch.plan.pipelines()); !prepared)
      return prepared;
    const Result<vulkan::Bindings> bindings = context->createBindings(buffers);
    if (!bindings) return bindings.error();
    return context->record(commandBuffer, batch.plan, *bindings);
  }
  Result<void> record(const MockBatch& batch) { return record(batch, batch.buffers()); }
  void expectRefused(const MockBatch& batch, const vulkan::BatchBuffers& buffers, ErrorCode code,
                     const std::string& text) {
    const Result<void> recorded = record(batch, buffers);
    ASSERT_FALSE(recorded.ok()) << text;
    EXPECT_EQ(recorded.error().code, code) << recorded.error().message;
    EXPECT_NE(recorded.error().message.find(text), std::string::npos) << recorded.error().message;
    EXPECT_TRUE(mock.commands.empty()) << "nothing is recorded when it fails";
  }

  MockVulkan mock;
  std::optional<vulkan::Context> context;
};

}  // namespace dermis::test
