#include "vulkan/system/buffer.h"

#include <string>
#include <utility>

namespace dermis::vulkan {

Result<SystemBuffer> SystemBuffer::create(BufferSource& source, const Description& description) {
  const ContextState& context = *source.context;
  const SystemFunctions& functions = *source.functions;
  VkBufferCreateInfo info{};
  info.sType = VK_STRUCTURE_TYPE_BUFFER_CREATE_INFO;
  info.size = description.size;
  info.usage = description.usage;
  info.sharingMode = VK_SHARING_MODE_EXCLUSIVE;
  SystemBuffer buffer;
  VkBuffer handle = VK_NULL_HANDLE;
  if (const VkResult result =
          functions.createBuffer(context.device, &info, context.allocator, &handle);
      result != VK_SUCCESS)
    return vulkanError("vkCreateBuffer", result);
  MemoryRequest request;
  functions.getBufferMemoryRequirements(context.device, handle, &request.requirements);
  request.use = description.use;
  request.name = description.name;
  request.hasDeviceAddress = (description.usage & VK_BUFFER_USAGE_SHADER_DEVICE_ADDRESS_BIT) != 0;
  Result<MemoryBlock> memory = source.memory.allocate(source.memory.user, request);
  if (!memory) {
    functions.destroyBuffer(context.device, handle, context.allocator);
    return memory.error();
  }
  buffer.source_ = &source;
  buffer.buffer_ = handle;
  buffer.memory_ = *memory;
  buffer.size_ = description.size;
  buffer.allocated_ = request.requirements.size;
  source.allocatedBytes += buffer.allocated_;
  if (const VkResult result =
          functions.bindBufferMemory(context.device, handle, memory->memory, memory->offset);
      result != VK_SUCCESS)
    return vulkanError("vkBindBufferMemory", result);
  nameObject(context.table, context.device, VK_OBJECT_TYPE_BUFFER, handle, description.name);
  if (description.use != MemoryUse::device && memory->mapped == nullptr) {
    return Error{ErrorCode::invalidArgument,
                 std::string("MemoryCallbacks::allocate gave memory that is not mapped for the "
                             "buffer '") +
                     description.name + "'"};
  }
  return buffer;
}

SystemBuffer::~SystemBuffer() {
  release();
}

SystemBuffer::SystemBuffer(SystemBuffer&& other) noexcept
    : source_(std::exchange(other.source_, nullptr)),
      buffer_(std::exchange(other.buffer_, VK_NULL_HANDLE)),
      memory_(std::exchange(other.memory_, {})),
      size_(std::exchange(other.size_, 0)),
      allocated_(std::exchange(other.allocated_, 0)) {}

SystemBuffer& SystemBuffer::operator=(SystemBuffer&& other) noexcept {
  if (this == &other) return *this;
  release();
  source_ = std::exchange(other.source_, nullptr);
  buffer_ = std::exchange(other.buffer_, VK_NULL_HANDLE);
  memory_ = std::exchange(other.memory_, {});
  size_ = std::exchange(other.size_, 0);
  allocated_ = std::exchange(other.allocated_, 0);
  return *this;
}

void SystemBuffer::release() {
  if (source_ == nullptr) return;
  source_->functions->destroyBuffer(source_->context->device, buffer_, source_->context->allocator);
  source_->memory.free(source_->memory.user, memory_);
  source_->allocatedBytes -= allocated_;
  source_ = nullptr;
}

}  // namespace dermis::vulkan
