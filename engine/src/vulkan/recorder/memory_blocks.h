// Allocates the buffers of a SceneRecorder from large blocks of memory, if the engine has no
// allocator.
#pragma once

#include <cstdint>
#include <memory>
#include <vector>

#include "dermis/vulkan/scene_recorder.h"
#include "scene/range_allocator.h"
#include "vulkan/recorder/functions.h"

namespace dermis::vulkan {

class MemoryBlocks {
 public:
  MemoryBlocks(const ContextState& context, const SystemFunctions& functions);
  ~MemoryBlocks();
  MemoryBlocks(const MemoryBlocks&) = delete;
  MemoryBlocks& operator=(const MemoryBlocks&) = delete;

  BufferCallbacks callbacks();
  std::uint64_t bytes() const;  ///< of all blocks

 private:
  struct Block {
    VkDeviceMemory memory = VK_NULL_HANDLE;
    std::uint32_t type = 0;
    bool hasAddress = false;
    std::byte* mapped = nullptr;
    RangeAllocator ranges;
  };
  struct Part {
    Block* block;
    Range range;
  };
  /// Memory requirements of a buffer.
  struct Need {
    VkMemoryRequirements requirements{};
    BufferUse use = BufferUse::device;
    bool hasAddress = false;
  };

  Result<CreatedBuffer> create(const VkBufferCreateInfo& info, BufferUse use, const char* name);
  Result<Part> allocate(const Need& need, const char* name);
  void free(const Part& part);
  std::vector<std::uint32_t> typesFor(const Need& need) const;
  static bool isOfKind(const Block& block, std::uint32_t type, const Need& need);
  Result<Part> allocateFrom(std::uint32_t type, const Need& need);
  Result<Block*> addBlock(std::uint32_t type, const Need& need);

  const ContextState& context_;
  const SystemFunctions& functions_;
  VkPhysicalDeviceMemoryProperties properties_{};
  std::vector<std::unique_ptr<Block>> blocks_;
};

}  // namespace dermis::vulkan
