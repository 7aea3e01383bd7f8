#include "vulkan/system/memory_blocks.h"

#include <algorithm>
#include <string>

namespace dermis::vulkan {
namespace {

constexpr VkDeviceSize blockSize = VkDeviceSize{64} << 20;

/// Other properties need features that the engine may not have enabled, or are for other ends.
constexpr VkMemoryPropertyFlags usualProperties =
    VK_MEMORY_PROPERTY_DEVICE_LOCAL_BIT | VK_MEMORY_PROPERTY_HOST_VISIBLE_BIT |
    VK_MEMORY_PROPERTY_HOST_COHERENT_BIT | VK_MEMORY_PROPERTY_HOST_CACHED_BIT;

struct Wishes {
  VkMemoryPropertyFlags required, preferred;
};

Wishes wishesOf(MemoryUse use) {
  constexpr VkMemoryPropertyFlags mapped =
      VK_MEMORY_PROPERTY_HOST_VISIBLE_BIT | VK_MEMORY_PROPERTY_HOST_COHERENT_BIT;
  switch (use) {
    case MemoryUse::upload:
      return {mapped, VK_MEMORY_PROPERTY_DEVICE_LOCAL_BIT};
    case MemoryUse::readBack:
      return {mapped, VK_MEMORY_PROPERTY_HOST_CACHED_BIT};
    default:
      return {0, VK_MEMORY_PROPERTY_DEVICE_LOCAL_BIT};
  }
}

}  // namespace

MemoryBlocks::MemoryBlocks(const ContextState& context, const SystemFunctions& functions)
    : context_(context), functions_(functions) {
  functions.getPhysicalDeviceMemoryProperties(context.physicalDevice, &properties_);
}

MemoryBlocks::~MemoryBlocks() {
  for (const std::unique_ptr<Block>& block : blocks_)
    functions_.freeMemory(context_.device, block->memory, context_.allocator);
}

MemoryCallbacks MemoryBlocks::callbacks() {
  MemoryCallbacks callbacks;
  callbacks.user = this;
  callbacks.allocate = [](void* user, const MemoryRequest& request) {
    return static_cast<MemoryBlocks*>(user)->allocate(request);
  };
  callbacks.free = [](void* user, const MemoryBlock& memory) {
    static_cast<MemoryBlocks*>(user)->free(memory);
  };
  return callbacks;
}

/// The types that will do: first those that have all that is preferred, each in the order of the
/// device.
std::vector<std::uint32_t> MemoryBlocks::typesFor(const MemoryRequest& request) const {
  const auto [required, preferred] = wishesOf(request.use);
  std::vector<std::uint32_t> types, others;
  for (std::uint32_t type = 0; type < properties_.memoryTypeCount; ++type) {
    const VkMemoryPropertyFlags flags = properties_.memoryTypes[type].propertyFlags;
    const bool isAllowed = (request.requirements.memoryTypeBits >> type & 1) != 0;
    if (!isAllowed || (flags & required) != required || (flags & ~usualProperties) != 0) continue;
    ((flags & preferred) == preferred ? types : others).push_back(type);
  }
  types.insert(types.end(), others.begin(), others.end());
  return types;
}

Result<MemoryBlocks::Block*> MemoryBlocks::addBlock(std::uint32_t type,
                                                    const MemoryRequest& request) {
  VkMemoryAllocateFlagsInfo flags{};
  flags.sType = VK_STRUCTURE_TYPE_MEMORY_ALLOCATE_FLAGS_INFO;
  flags.flags = VK_MEMORY_ALLOCATE_DEVICE_ADDRESS_BIT;
  VkMemoryAllocateInfo info{};
  info.sType = VK_STRUCTURE_TYPE_MEMORY_ALLOCATE_INFO;
  info.pNext = request.hasDeviceAddress ? &flags : nullptr;
  info.memoryTypeIndex = type;
  auto block = std::make_unique<Block>();
  block->type = type;
  block->hasAddress = request.hasDeviceAddress;
  VkResult result = VK_ERROR_OUT_OF_DEVICE_MEMORY;
  // Where a whole block is too much, what is needed may still be there.
  for (const VkDeviceSize size :
       {std::max(blockSize, request.requirements.size), request.requirements.size}) {
    info.allocationSize = size;
    result = functions_.allocateMemory(context_.device, &info, context_.allocator, &block->memory);
    if (result == VK_SUCCESS) break;
  }
  if (result != VK_SUCCESS) return vulkanError("vkAllocateMemory", result);
  if (request.use != MemoryUse::device) {
    void* mapped = nullptr;
    result = functions_.mapMemory(context_.device, block->memory, 0, VK_WHOLE_SIZE, 0, &mapped);
    if (result != VK_SUCCESS) {
      functions_.freeMemory(context_.device, block->memory, context_.allocator);
      return vulkanError("vkMapMemory", result);
    }
    block->mapped = static_cast<std::byte*>(mapped);
  }
  block->ranges = RangeAllocator(info.allocationSize);
  blocks_.push_back(std::move(block));
  return blocks_.back().get();
}

/// A heap may be full, such as the 256 MiB of many GPUs that are device-local and mapped, although
/// another type that will do has memory.
Result<MemoryBlock> MemoryBlocks::allocate(const MemoryRequest& request) {
  Result<MemoryBlock> memory =
      Error{ErrorCode::missingFeature,
            std::string("no memory type of the device suits the buffer '") + request.name + "'"};
  for (const std::uint32_t type : typesFor(request)) {
    memory = allocateFrom(type, request);
    if (memory) break;
  }
  return memory;
}

Result<MemoryBlock> MemoryBlocks::allocateFrom(std::uint32_t type, const MemoryRequest& request) {
  const bool isMapped = request.use != MemoryUse::device;
  Block* found = nullptr;
  std::optional<Range> range;
  for (const std::unique_ptr<Block>& block : blocks_) {
    if (block->type != type || block->hasAddress != request.hasDeviceAddress ||
        (block->mapped != nullptr) != isMapped)
      continue;
    range = block->ranges.allocate(request.requirements.size, request.requirements.alignment);
    found = block.get();
    if (range) break;
  }
  if (!range) {
    Result<Block*> added = addBlock(type, request);
    if (!added) return added.error();
    found = *added;
    range = found->ranges.allocate(request.requirements.size, request.requirements.alignment);
  }
  MemoryBlock memory;
  memory.memory = found->memory;
  memory.offset = range->offset;
  memory.mapped = isMapped ? found->mapped + range->offset : nullptr;
  memory.owner = new Part{found, *range};
  return memory;
}

void MemoryBlocks::free(const MemoryBlock& memory) {
  const std::unique_ptr<Part> part(static_cast<Part*>(memory.owner));
  part->block->ranges.free(part->range);
  if (part->block->ranges.used() != 0) return;
  functions_.freeMemory(context_.device, part->block->memory, context_.allocator);
  std::erase_if(blocks_,
                [&](const std::unique_ptr<Block>& block) { return block.get() == part->block; });
}

}  // namespace dermis::vulkan
