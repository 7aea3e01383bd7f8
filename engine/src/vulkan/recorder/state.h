// The state of a SceneRecorder: a scene and its buffers.
#pragma once

#include <memory>
#include <vector>

#include "dermis/vulkan/scene_recorder.h"
#include "scene/books.h"
#include "vulkan/recorder/buffer.h"
#include "vulkan/recorder/functions.h"
#include "vulkan/recorder/memory_blocks.h"
#include "vulkan/recorder/timestamps.h"

namespace dermis::vulkan {

/// Resources of one frame in flight.
struct FrameSlot {
  std::uint64_t frame = 0;     ///< that last used it; 0 if none did
  OwnBuffer staging;           ///< of uploads
  bool isStagingKept = false;  ///< when the frame is complete
  DescriptorSets sets;         ///< without push descriptors
  bool hasTimestamps = false;
};

struct SceneRecorder::State {
  State(const ContextState& contextState, const SceneRecorderDescription& own)
      : context(&contextState), description(own) {}
  ~State();

  Result<void*> createBuffer(const SceneBuffer& wanted);
  void releaseBuffer(std::uint32_t number);
  Result<BufferRange> rangeOf(const Result<BufferPart>& part) const;
  void frameBegun(std::uint64_t completedFrame);
  Result<void> makeStaging(OwnBuffer& replaced);
  SceneBooks& books() const { return SceneAccess::books(*scene); }

  /// Of the frame to be recorded.
  std::uint32_t slotNumber() const {
    return static_cast<std::uint32_t>(recordCount % slots.size());
  }
  FrameSlot& slot() { return slots[slotNumber()]; }

  const ContextState* context;  ///< its address stays the same when the Context is moved
  SceneRecorderDescription description;
  SystemFunctions functions;
  std::unique_ptr<MemoryBlocks> blocks;  ///< null if the engine has an allocator
  BufferSource source;
  std::vector<OwnBuffer> buffers;  ///< by number; empty for those of the engine
  BoundBuffers bound;              ///< by number
  std::unique_ptr<Scene> scene;
  Plan plan;  ///< of the frame

  std::uint64_t recordCount = 0;
  Timestamps timestamps;
  std::vector<FrameSlot> slots;
  RecorderStatistics statistics;
  std::uint64_t timedFrame = 0;  ///< the one of `gpuSeconds`
};

}  // namespace dermis::vulkan
