#include "vulkan/recorder/memory_blocks.h"

#include <algorithm>
#include <string>

namespace dermis::vulkan {
namespace {

// A new block has a quarter of the memory that blocks of its kind already have, so that small
// scenes take little memory and large scenes few blocks.
constexpr VkDeviceSize leastBlock = VkDeviceSize{128} << 10;
constexpr VkDeviceSize largestBlock = VkDeviceSize{64} << 20;

/// Other properties need features that the engine may not have enabled, or serve other purposes.
constexpr VkMemoryPropertyFlags usualProperties =
    VK_MEMORY_PROPERTY_DEVICE_LOCAL_BIT | VK_MEMORY_PROPERTY_HOST_VISIBLE_BIT |
    VK_MEMORY_PROPERTY_HOST_COHERENT_BIT | VK_MEMORY_PROPERTY_HOST_CACHED_BIT;

struct Wishes {
  VkMemoryPropertyFlags required, preferred;
};

Wishes wishesOf(BufferUse use) {
  constexpr VkMemoryPropertyFlags mapped =
      VK_MEMORY_PROPERTY_HOST_VISIBLE_BIT | VK_MEMORY_PROPERTY_HOST_COHERENT_BIT;
  switch (use) {
    case BufferUse::upload:
      return {mapped, VK_MEMORY_PROPERTY_DEVICE_LOCAL_BIT};
    case BufferUse::readBack:
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

std::uint64_t MemoryBlocks::bytes() const {
  std::uint64_t bytes = 0;
  for (const std::unique_ptr<Block>& block : blocks_) bytes += block->ranges.capacity();
  return bytes;
}

BufferCallbacks MemoryBlocks::callbacks() {
  BufferCallbacks callbacks;
  callbacks.user = this;
  callbacks.create = [](void* user, const VkBufferCreateInfo& info, BufferUse use,
                        const char* name) {
    return static_cast<MemoryBlocks*>(user)->create(info, use, name);
  };
  callbacks.destroy = [](void* user, const CreatedBuffer& buffer) {
    auto& self = *static_cast<MemoryBlocks*>(user);
    const std::unique_ptr<Part> part(static_cast<Part*>(buffer.allocation));
    self.functions_.destroyBuffer(self.context_.device, buffer.buffer, self.context_.allocator);
    self.free(*part);
  };
  return callbacks;
}

Result<CreatedBuffer> MemoryBlocks::create(const VkBufferCreateInfo& info, BufferUse use,
                                           const char* name) {
  CreatedBuffer buffer;
  if (const VkResult result =
          functions_.createBuffer(context_.device, &info, context_.allocator, &buffer.buffer);
      result != VK_SUCCESS)
    return vulkanError("vkCreateBuffer", result);
  Need need;
  functions_.getBufferMemoryRequirements(context_.device, buffer.buffer, &need.requirements);
  need.use = use;
  need.hasAddress = (info.usage & VK_BUFFER_USAGE_SHADER_DEVICE_ADDRESS_BIT) != 0;
  const Result<Part> part = allocate(need, name);
  if (!part) {
    functions_.destroyBuffer(context_.device, buffer.buffer, context_.allocator);
    return part.error();
  }
  const Block& block = *part->block;
  if (const VkResult result = functions_.bindBufferMemory(context_.device, buffer.buffer,
                                                          block.memory, part->range.offset);
      result != VK_SUCCESS) {
    functions_.destroyBuffer(context_.device, buffer.buffer, context_.allocator);
    free(*part);
    return vulkanError("vkBindBufferMemory", result);
  }
  if (block.mapped != nullptr) buffer.mapped = block.mapped + part->range.offset;
  buffer.allocation = new Part(*part);
  return buffer;
}

/// The usable types: first those with all preferred properties, each group in the order of the
/// device.
std::vector<std::uint32_t> MemoryBlocks::typesFor(const Need& need) const {
  const auto [required, preferred] = wishesOf(need.use);
  std::vector<std::uint32_t> types, others;
  for (std::uint32_t type = 0; type < properties_.memoryTypeCount; ++type) {
    const VkMemoryPropertyFlags flags = properties_.memoryTypes[type].propertyFlags;
    const bool isAllowed = (need.requirements.memoryTypeBits >> type & 1) != 0;
    if (!isAllowed || (flags & required) != required || (flags & ~usualProperties) != 0) continue;
    ((flags & preferred) == preferred ? types : others).push_back(type);
  }
  types.insert(types.end(), others.begin(), others.end());
  return types;
}

bool MemoryBlocks::isOfKind(const Block& block, std::uint32_t type, const Need& need) {
  return block.type == type && block.hasAddress == need.hasAddress &&
         (block.mapped != nullptr) == (need.use != BufferUse::device);
}

Result<MemoryBlocks::Block*> MemoryBlocks::addBlock(std::uint32_t type, const Need& need) {
  VkMemoryAllocateFlagsInfo flags{};
  flags.sType = VK_STRUCTURE_TYPE_MEMORY_ALLOCATE_FLAGS_INFO;
  flags.flags = VK_MEMORY_ALLOCATE_DEVICE_ADDRESS_BIT;
  VkMemoryAllocateInfo info{};
  info.sType = VK_STRUCTURE_TYPE_MEMORY_ALLOCATE_INFO;
  info.pNext = need.hasAddress ? &flags : nullptr;
  info.memoryTypeIndex = type;
  auto block = std::make_unique<Block>();
  block->type = type;
  block->hasAddress = need.hasAddress;
  VkDeviceSize usual = 0;
  for (const std::unique_ptr<Block>& other : blocks_)
    if (isOfKind(*other, type, need)) usual += other->ranges.capacity() / 4;
  usual = std::clamp(usual, leastBlock, largestBlock);
  VkResult result = VK_ERROR_OUT_OF_DEVICE_MEMORY;
  // A large buffer gets its own block. If there is no memory for a whole block, there may still be
  // enough for the buffer alone.
  const VkDeviceSize needed = need.requirements.size;
  for (const VkDeviceSize size : {needed > usual / 2 ? needed : usual, needed}) {
    info.allocationSize = size;
    result = functions_.allocateMemory(context_.device, &info, context_.allocator, &block->memory);
    if (result == VK_SUCCESS) break;
  }
  if (result != VK_SUCCESS) return vulkanError("vkAllocateMemory", result);
  if (need.use != BufferUse::device) {
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

/// A heap may be full (on many GPUs only 256 MiB are device-local and mapped) while another usable
/// type has memory.
Result<MemoryBlocks::Part> MemoryBlocks::allocate(const Need& need, const char* name) {
  Result<Part> part =
      Error{ErrorCode::missingFeature,
            std::string("no memory type of the device suits the buffer '") + name + "'"};
  for (const std::uint32_t type : typesFor(need)) {
    part = allocateFrom(type, need);
    if (part) break;
  }
  return part;
}

Result<MemoryBlocks::Part> MemoryBlocks::allocateFrom(std::uint32_t type, const Need& need) {
  const VkMemoryRequirements& needed = need.requirements;
  for (const std::unique_ptr<Block>& block : blocks_) {
    if (!isOfKind(*block, type, need)) continue;
    if (const std::optional<Range> range = block->ranges.allocate(needed.size, needed.alignment))
      return Part{block.get(), *range};
  }
  Result<Block*> added = addBlock(type, need);
  if (!added) return added.error();
  return Part{*added, *(*added)->ranges.allocate(needed.size, needed.alignment)};
}

void MemoryBlocks::free(const Part& part) {
  part.block->ranges.free(part.range);
  if (part.block->ranges.used() != 0) return;
  functions_.freeMemory(context_.device, part.block->memory, context_.allocator);
  std::erase_if(blocks_,
                [&](const std::unique_ptr<Block>& block) { return block.get() == part.block; });
}

}  // namespace dermis::vulkan
