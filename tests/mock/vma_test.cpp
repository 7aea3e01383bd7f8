// The callbacks for the Vulkan Memory Allocator, with a stand-in that records what it is asked for.
#include "vk_mem_alloc.h"

#include "dermis/vulkan/vma.h"

#include <gtest/gtest.h>

#include <cstdint>
#include <string>

namespace {

template <typename Handle>
Handle handleOf(std::uintptr_t number) {
  return reinterpret_cast<Handle>(number);
}

/// The last calls.
struct Calls {
  VkResult result = VK_SUCCESS;
  VmaAllocator allocator{};
  const VkBufferCreateInfo* info = nullptr;
  VmaAllocationCreateInfo wanted{};
  std::string name;
  VkBuffer destroyed{};
  VmaAllocation freed{};
} calls;
int mapped = 0;

}  // namespace

VkResult vmaCreateBuffer(VmaAllocator allocator, const VkBufferCreateInfo* info,
                         const VmaAllocationCreateInfo* wanted, VkBuffer* buffer,
                         VmaAllocation* allocation, VmaAllocationInfo* made) {
  calls.allocator = allocator;
  calls.info = info;
  calls.wanted = *wanted;
  if (calls.result != VK_SUCCESS) return calls.result;
  *buffer = handleOf<VkBuffer>(16);
  *allocation = handleOf<VmaAllocation>(32);
  made->pMappedData = &mapped;
  return VK_SUCCESS;
}
void vmaDestroyBuffer(VmaAllocator allocator, VkBuffer buffer, VmaAllocation allocation) {
  calls.allocator = allocator;
  calls.destroyed = buffer;
  calls.freed = allocation;
}
void vmaSetAllocationName(VmaAllocator, VmaAllocation, const char* name) {
  calls.name = name;
}

namespace dermis::vulkan {
namespace {

struct VmaTest : public testing::Test {
  VmaTest() { calls = {}; }
  Result<CreatedBuffer> create(BufferUse use) const {
    return callbacks.create(callbacks.user, info, use, "dermis output");
  }

  const VmaAllocator allocator = handleOf<VmaAllocator>(48);
  const VkBufferCreateInfo info{};
  const BufferCallbacks callbacks = vmaBufferCallbacks(allocator);
};

TEST_F(VmaTest, EachUseHasItsMemory) {
  const struct {
    BufferUse use;
    VmaMemoryUsage usage;
    VkFlags flags;
    VkMemoryPropertyFlags required;
  } table[] = {
      {BufferUse::device, VMA_MEMORY_USAGE_AUTO_PREFER_DEVICE, 0, 0},
      {BufferUse::upload, VMA_MEMORY_USAGE_AUTO_PREFER_DEVICE,
       VMA_ALLOCATION_CREATE_MAPPED_BIT | VMA_ALLOCATION_CREATE_HOST_ACCESS_SEQUENTIAL_WRITE_BIT,
       VK_MEMORY_PROPERTY_HOST_COHERENT_BIT},
      {BufferUse::readBack, VMA_MEMORY_USAGE_AUTO_PREFER_HOST,
       VMA_ALLOCATION_CREATE_MAPPED_BIT | VMA_ALLOCATION_CREATE_HOST_ACCESS_RANDOM_BIT,
       VK_MEMORY_PROPERTY_HOST_COHERENT_BIT}};
  for (const auto& row : table) {
    SCOPED_TRACE(static_cast<int>(row.use));
    const Result<CreatedBuffer> created = create(row.use);
    ASSERT_TRUE(created.ok());
    EXPECT_EQ(calls.allocator, allocator);
    EXPECT_EQ(calls.info, &info);
    EXPECT_EQ(calls.wanted.usage, row.usage);
    EXPECT_EQ(calls.wanted.flags, row.flags);
    EXPECT_EQ(calls.wanted.requiredFlags, row.required);
    EXPECT_EQ(calls.name, "dermis output");
    EXPECT_EQ(created->buffer, handleOf<VkBuffer>(16));
    EXPECT_EQ(created->mapped, &mapped);
    calls = {};
    callbacks.destroy(callbacks.user, *created);
    EXPECT_EQ(calls.allocator, allocator);
    EXPECT_EQ(calls.destroyed, created->buffer);
    EXPECT_EQ(calls.freed, handleOf<VmaAllocation>(32));
  }
}

TEST_F(VmaTest, AFailureHasTheResult) {
  calls.result = VK_ERROR_OUT_OF_DEVICE_MEMORY;
  const Result<CreatedBuffer> created = create(BufferUse::device);
  ASSERT_FALSE(created.ok());
  EXPECT_EQ(created.error().code, ErrorCode::vulkanError);
  EXPECT_EQ(created.error().vulkanResult, VK_ERROR_OUT_OF_DEVICE_MEMORY);
  EXPECT_TRUE(calls.name.empty());
}

}  // namespace
}  // namespace dermis::vulkan
