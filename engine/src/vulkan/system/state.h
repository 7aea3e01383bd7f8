// What a SkinningSystem consists of: the books (core) and the buffers.
#pragma once

#include <deque>
#include <memory>
#include <mutex>
#include <optional>
#include <vector>

#include "dermis/vulkan/skinning_system.h"
#include "system/scene.h"
#include "vulkan/system/buffer.h"
#include "vulkan/system/functions.h"
#include "vulkan/system/memory_blocks.h"
#include "vulkan/system/timestamps.h"
#include "vulkan/system/visibility.h"

namespace dermis::vulkan {

/// What one frame in flight has for itself.
struct FrameSlot {
  std::uint64_t frame = 0;  ///< that last used it; 0 where none did
  SystemBuffer staging;     ///< of the tables
  SystemBuffer readBack;    ///< the counters, then the results
  bool hasCounters = false;
  std::vector<VkBufferCopy> results;  ///< that it read back: from the results to the read-back
  bool hasTimestamps = false;
};

/// A packed mesh on its way to the GPU.
struct MeshUpload {
  MeshHandle mesh;
  SystemBuffer staging;
};

struct SkinningSystem::State {
  State(ContextState& context, const SceneDescription& sceneDescription);
  VkBufferUsageFlags readUsage() const;
  Result<void> createBuffers(VkBufferUsageFlags outputUsage);

  // frame.cpp
  Result<void> makeRoomForTables();
  Result<void> prepareVisibility();
  const Visibility* preparedVisibility();
  Result<void> makeHistory();
  std::span<JointMatrix> poseAt(std::uint64_t offset, std::uint32_t jointCount);
  Result<void> recordFrame(VkCommandBuffer commandBuffer, const FrameDescription& frame);
  void recordCommands(VkCommandBuffer commandBuffer, const FrameDescription& frame);
  void recordCopies(VkCommandBuffer commandBuffer);
  void recordDispatches(VkCommandBuffer commandBuffer, const FrameDescription& frame);
  void findResults(std::vector<VkBufferCopy>& regions);
  void recordReadBack(VkCommandBuffer commandBuffer);
  bool hasWork() const;

  // skinning_system.cpp
  void readBackUpTo(std::uint64_t completedFrame);
  void readResults(const FrameSlot& slot);
  void readStatistics(const FrameSlot& slot);

  FrameSlot& slot() { return slots[slotNumber()]; }
  std::uint32_t slotNumber() const {
    return static_cast<std::uint32_t>((scene.recordNumber() + 1) % slots.size());
  }

  ContextState* context;  ///< stays where it is when the Context is moved
  SystemFunctions functions;
  std::unique_ptr<MemoryBlocks> blocks;  ///< where the engine has no allocator
  BufferSource source;
  Scene scene;

  SystemBuffer meshes, matrices, palettes, output, results, tables, history, counters;
  bool historyIsClear = false;
  Bindings bindings;
  /// Made by `prepare`, on any thread.
  std::mutex visibilityMutex;
  std::unique_ptr<const Visibility> visibility;
  Timestamps timestamps;
  std::vector<FrameSlot> slots;
  std::vector<MeshUpload> uploads;

  /// What frames in flight may still use.
  struct Retired {
    std::uint64_t frame;
    SystemBuffer buffer;
    Bindings bindings;
  };
  std::deque<Retired> retired;

  FrameStatistics frameStatistics;
  GpuStatistics gpuStatistics;
  std::vector<InstanceResult> latestResults;  ///< each of the newest complete frame that wrote it
  std::uint64_t latestResultsFrame = 0;
  std::vector<std::uint64_t> resultMarks;  ///< scratch: a bit for each that the frame writes
  std::vector<const FrameSlot*> completeScratch;
};

}  // namespace dermis::vulkan
