// Batches to record on the pretended driver.
#pragma once

#include <cstdint>
#include <utility>

#include <gtest/gtest.h>

#include "core_plan_simulation.h"
#include "dermis/vulkan/vulkan.h"

namespace dermis::test {

inline const VkCommandBuffer commandBuffer =
    reinterpret_cast<VkCommandBuffer>(std::uintptr_t{1 << 20});

/// A buffer for each role, told apart by its handle.
inline VkBuffer bufferOf(BufferRole role) {
  return reinterpret_cast<VkBuffer>((std::uintptr_t{1} << 21) + static_cast<std::uintptr_t>(role));
}

/// A batch, its plan, and buffers as large as the plan needs.
struct MockBatch {
  OwnedBatch batch;
  Plan plan;

  /// A mesh with everything and a palette.
  MockBatch() {
    batch.addMesh(meshOf(100, 4, 4, MeshParts{true, true, 2}));
    batch.addPose(4, true);
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
    vulkan::OutputBuffers outputs = vulkan::OutputBuffers::oneBuffer(range(BufferRole::positions));
    if (batch.hasSeparateOutputs) {
      outputs = {range(BufferRole::positions), range(BufferRole::normals),
                 range(BufferRole::tangents), range(BufferRole::previousPositions)};
    }
    return {range(BufferRole::meshes),
            range(BufferRole::poses),
            range(BufferRole::tables),
            range(BufferRole::palettes),
            outputs,
            range(BufferRole::results)};
  }
};

}  // namespace dermis::test
