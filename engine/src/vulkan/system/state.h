// What a SkinningSystem consists of: a Scene and its buffers.
#pragma once

#include <deque>
#include <memory>
#include <optional>
#include <vector>

#include "dermis/scene.h"
#include "dermis/vulkan/skinning_system.h"
#include "vulkan/system/buffer.h"
#include "vulkan/system/functions.h"
#include "vulkan/system/memory_blocks.h"
#include "vulkan/system/timestamps.h"

namespace dermis::vulkan {

/// What one frame in flight has for itself.
struct FrameSlot {
  std::uint64_t frame = 0;  ///< that last used it; 0 where none did
  SystemBuffer upload;
  SystemBuffer readBack;
  bool hasTimestamps = false;
};

/// A packed mesh on its way to the GPU.
struct MeshUpload {
  MeshHandle mesh;
  std::uint64_t offset = 0;  ///< in the mesh buffer
  SystemBuffer staging;
};

struct SkinningSystem::State {
  State(ContextState& context, Scene&& ownScene);
  ~State();
  Result<void> createBuffers(const SkinningSystemDescription& description);

  // frame.cpp
  Result<void> makeRoomForTables();
  Result<void> makeHistory();
  std::span<JointMatrix> poseAt(const PosePlace& place);
  Result<void> recordFrame(VkCommandBuffer commandBuffer, const FrameDescription& frame);
  Recorded recordUploads(VkCommandBuffer commandBuffer);
  void retireUploads();
  void abandonRecord();
  FrameBuffers buffersOf(const FrameDescription& frame);

  // skinning_system.cpp
  void readBackUpTo(std::uint64_t completedFrame);

  /// Of the frame to be recorded.
  std::uint32_t slotNumber() const {
    return static_cast<std::uint32_t>(recordCount % slots.size());
  }
  FrameSlot& slot() { return slots[slotNumber()]; }

  ContextState* context;  ///< stays where it is when the Context is moved
  SystemFunctions functions;
  std::unique_ptr<MemoryBlocks> blocks;  ///< where the engine has no allocator
  BufferSource source;
  Scene scene;
  Plan plan;  ///< of the frame

  SystemBuffer meshes, poses, palettes, output, results, tables, history, counters;
  BufferRange outputRange;  ///< of `output`, or the engine's
  Bindings bindings;
  /// Without push descriptors: one for each slot.
  VkDescriptorPool visibilityPool = VK_NULL_HANDLE;
  std::vector<VkDescriptorSet> visibilitySets;
  std::uint64_t frameNumber = 0;
  std::uint64_t recordCount = 0;
  Timestamps timestamps;
  std::vector<FrameSlot> slots;
  std::vector<MeshUpload> uploads;
  std::vector<MeshUpload> recordedUploads;  ///< by the last `record`

  /// What frames in flight may still use.
  struct Retired {
    std::uint64_t frame;
    SystemBuffer buffer;
    Bindings bindings;
  };
  std::deque<Retired> retired;

  FrameStatistics frameStatistics;
  GpuStatistics gpuStatistics;
  std::vector<const FrameSlot*> completeScratch;
};

}  // namespace dermis::vulkan
