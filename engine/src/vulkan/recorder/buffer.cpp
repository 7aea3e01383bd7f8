#include "vulkan/recorder/buffer.h"

#include <string>
#include <utility>

namespace dermis::vulkan {

Result<OwnBuffer> OwnBuffer::create(BufferSource& source, const Description& description) {
  VkBufferCreateInfo info{};
  info.sType = VK_STRUCTURE_TYPE_BUFFER_CREATE_INFO;
  info.size = description.size;
  info.usage = description.usage;
  info.sharingMode = VK_SHARING_MODE_EXCLUSIVE;
  BufferRequest request;
  request.info = &info;
  request.use = description.use;
  request.name = description.name;
  const Result<CreatedBuffer> created = source.callbacks.create(source.callbacks.user, request);
  if (!created) return created.error();
  OwnBuffer buffer;
  buffer.source_ = &source;
  buffer.created_ = *created;
  buffer.size_ = description.size;
  source.bytes += description.size;
  const bool isMapped = created->mapped != nullptr || description.use == BufferUse::device;
  if (created->buffer == VK_NULL_HANDLE || !isMapped) {
    return Error{ErrorCode::invalidArgument,
                 std::string("BufferCallbacks::create returned ") +
                     (isMapped ? "no buffer" : "memory that is not mapped") + " for '" +
                     description.name + "'"};
  }
  nameObject(source.context->table, source.context->device, VK_OBJECT_TYPE_BUFFER, created->buffer,
             description.name);
  return buffer;
}

OwnBuffer::~OwnBuffer() {
  release();
}

OwnBuffer::OwnBuffer(OwnBuffer&& other) noexcept
    : source_(std::exchange(other.source_, nullptr)),
      created_(std::exchange(other.created_, {})),
      size_(std::exchange(other.size_, 0)) {}

OwnBuffer& OwnBuffer::operator=(OwnBuffer&& other) noexcept {
  if (this == &other) return *this;
  release();
  source_ = std::exchange(other.source_, nullptr);
  created_ = std::exchange(other.created_, {});
  size_ = std::exchange(other.size_, 0);
  return *this;
}

void OwnBuffer::release() {
  if (source_ == nullptr) return;
  if (created_.buffer != VK_NULL_HANDLE)
    source_->callbacks.destroy(source_->callbacks.user, created_);
  source_->bytes -= size_;
  source_ = nullptr;
}

}  // namespace dermis::vulkan
