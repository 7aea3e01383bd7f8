// An engine's allocator, behind vulkan::BufferCallbacks, that counts and can fail.
#pragma once

#include <gtest/gtest.h>

#include <cstdint>
#include <set>
#include <string>

#include "dermis/vulkan/scene_recorder.h"
#include "kit/buffer.h"
#include "kit/device.h"
#include "scene_meshes.h"

namespace dermis::test {

/// Gives every buffer its own memory.
class CountingMemory {
 public:
  explicit CountingMemory(samples::Device& device) : device_(device) {}

  vulkan::BufferCallbacks callbacks() { return {this, create, destroy}; }

  std::uint32_t allocations = 0, frees = 0;
  std::uint64_t bytes = 0;
  std::uint32_t failsAt = ~0u;  ///< the number of the allocation that fails
  std::set<vulkan::BufferUse> uses;
  std::set<std::string> names;

 private:
  static Result<vulkan::CreatedBuffer> create(void* user, const VkBufferCreateInfo& info,
                                              vulkan::BufferUse use, const char* name) {
    auto& self = *static_cast<CountingMemory*>(user);
    if (self.allocations == self.failsAt)
      return Error{ErrorCode::ioError, "the engine's allocator has had enough", 7};
    const bool isMapped = use != vulkan::BufferUse::device;
    auto* own = new samples::MappedBuffer(must(samples::MappedBuffer::create(
        self.device_, info.size, info.usage, use == vulkan::BufferUse::readBack)));
    ++self.allocations;
    self.bytes += info.size;
    self.uses.insert(use);
    self.names.insert(name);
    return vulkan::CreatedBuffer{own->handle(), isMapped ? own->bytes().data() : nullptr, own};
  }
  static void destroy(void* user, const vulkan::CreatedBuffer& buffer) {
    auto& self = *static_cast<CountingMemory*>(user);
    ++self.frees;
    auto* own = static_cast<samples::MappedBuffer*>(buffer.allocation);
    EXPECT_EQ(own->handle(), buffer.buffer);
    self.bytes -= own->bytes().size();
    delete own;
  }

  samples::Device& device_;
};

}  // namespace dermis::test
