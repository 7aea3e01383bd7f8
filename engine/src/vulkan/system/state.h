// The state of a SkinningSystem: a Scene and its buffers.
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

/// Resources of one frame in flight.
struct FrameSlot {
  std::uint64_t frame = 0;  ///< that last used it; 0 if none did
  SystemBuffer upload;
  SystemBuffer readBack;
  bool hasTimestamps = false;
};

/// A packed mesh that the next `record` uploads.
struct MeshUpload {
  MeshHandle mesh;
  std::uint64_t offset = 0;  ///< in the mesh buffer
  SystemBuffer staging;
};

/// A buffer of poses: one of the system, or a range of the engine.
struct PoseMemory {
  SystemBuffer own;
  BufferRange range;
  std::byte* mapped = nullptr;  ///< null if the GPU writes them
};

struct SkinningSystem::State {
  State(ContextState& context, Scene&& ownScene);
  ~State();

  // system_buffers.cpp
  Result<void> createBuffers(const SkinningSystemDescription& description);
  Result<void> grow(const BufferGrowth& growth);
  Result<void> makeRoom();
  Recorded recordGrowth(VkCommandBuffer commandBuffer);
  void retireReplaced();
  void abandonGrowth();

  // frame.cpp
  Result<void> recordFrame(VkCommandBuffer commandBuffer, const FrameDescription& frame);
  Recorded recordUploads(VkCommandBuffer commandBuffer);
  void abandonRecord();
  FrameBuffers buffersOf(const FrameDescription& frame);

  // skinning_system.cpp
  void readBackUpTo(std::uint64_t completedFrame);

  /// Of the frame to be recorded.
  std::uint32_t slotNumber() const {
    return static_cast<std::uint32_t>(recordCount % slots.size());
  }
  FrameSlot& slot() { return slots[slotNumber()]; }
  /// Of a pose that the CPU writes.
  std::span<JointMatrix> poseAt(const PosePlace& place) {
    std::byte* const begin = poseBuffers[place.poseBuffer].mapped + place.offset;
    return {reinterpret_cast<JointMatrix*>(begin), place.jointCount};
  }

  ContextState* context;  ///< its address stays the same when the Context is moved
  SystemFunctions functions;
  std::unique_ptr<MemoryBlocks> blocks;  ///< null if the engine has an allocator
  BufferSource source;
  Scene scene;
  std::unique_ptr<State*> self;  ///< argument of the scene's growth callback
  Plan plan;                     ///< of the frame

  GrowingBuffer meshes, palettes, output, results, history;
  std::vector<PoseMemory> poseBuffers;  ///< by their numbers
  SystemBuffer tables, counters;
  Bindings bindings;
  bool bindingsAreOld = true;
  bool isGrowing = false;  ///< the next `record` replaces a buffer by a larger one
  std::uint64_t outputGeneration = 1;
  VkBufferUsageFlags outputUsage = 0;  ///< the engine's
  /// Without push descriptors: a set of the visibility kernel for each slot, and their pool.
  VkDescriptorPool visibilityPool = VK_NULL_HANDLE;
  std::vector<VkDescriptorSet> visibilitySets;
  std::uint64_t frameNumber = 0;
  std::uint64_t recordCount = 0;
  Timestamps timestamps;
  std::vector<FrameSlot> slots;
  std::vector<MeshUpload> uploads;
  std::vector<MeshUpload> recordedUploads;  ///< by the last `record`
  /// Buffers that the last `record` replaced by larger ones.
  struct Replaced {
    GrowingBuffer* buffer;
    SystemBuffer old;
  };
  std::vector<Replaced> replaced;

  /// Buffers that frames in flight may still use.
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
