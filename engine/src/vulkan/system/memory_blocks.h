// What a SkinningSystem takes memory from where the engine has no allocator: large blocks.
#pragma once

#include <cstdint>
#include <memory>
#include <vector>

#include "dermis/vulkan/memory.h"
#include "system/range_allocator.h"
#include "vulkan/system/functions.h"

namespace dermis::vulkan {

class MemoryBlocks {
 public:
  MemoryBlocks(const ContextState& context, const SystemFunctions& functions);
  ~MemoryBlocks();
  MemoryBlocks(const MemoryBlocks&) = delete;
  MemoryBlocks& operator=(const MemoryBlocks&) = delete;

  MemoryCallbacks callbacks();

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

  Result<MemoryBlock> allocate(const MemoryRequest& request);
  void free(const MemoryBlock& memory);
  std::vector<std::uint32_t> typesFor(const MemoryRequest& request) const;
  Result<MemoryBlock> allocateFrom(std::uint32_t type, const MemoryRequest& request);
  Result<Block*> addBlock(std::uint32_t type, const MemoryRequest& request);

  const ContextState& context_;
  const SystemFunctions& functions_;
  VkPhysicalDeviceMemoryProperties properties_{};
  std::vector<std::unique_ptr<Block>> blocks_;
};

}  // namespace dermis::vulkan
