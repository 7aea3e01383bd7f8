// The buffers of a SceneRecorder.

#include "vulkan/recorder/buffer.h"

#include <algorithm>
#include <cstddef>
#include <string>
#include <utility>

#include "vulkan/recorder/state.h"

namespace dermis::vulkan {
namespace {

const char* nameOf(BufferRole role) {
  switch (role) {
    case BufferRole::meshes:
      return "dermis meshes";
    case BufferRole::poses:
      return "dermis poses";
    case BufferRole::gpuPoses:
      return "dermis GPU poses";
    case BufferRole::palettes:
      return "dermis palettes";
    case BufferRole::results:
      return "dermis results";
    case BufferRole::history:
      return "dermis history";
    case BufferRole::tables:
      return "dermis tables";
    case BufferRole::readBack:
      return "dermis read-back";
    default:
      return "dermis output";
  }
}

}  // namespace

Result<OwnBuffer> OwnBuffer::create(BufferSource& source, const Description& description) {
  VkBufferCreateInfo info{};
  info.sType = VK_STRUCTURE_TYPE_BUFFER_CREATE_INFO;
  info.size = description.size;
  info.usage = description.usage;
  info.sharingMode = VK_SHARING_MODE_EXCLUSIVE;
  const Result<CreatedBuffer> created =
      source.callbacks.create(source.callbacks.user, info, description.use, description.name);
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

/// A range of the engine, or a new buffer.
Result<void*> SceneRecorder::State::createBuffer(const SceneBuffer& wanted) {
  BufferRange range;
  void* mapped = nullptr;
  if (wanted.role == BufferRole::meshes) range = description.meshes;
  if (wanted.role == BufferRole::positions) range = description.output;
  if (wanted.role == BufferRole::gpuPoses) range = description.gpuPoses;
  if (wanted.role == BufferRole::poses) {
    range = description.poses;
    mapped = description.mappedPoses;
  }
  OwnBuffer own;
  if (range.buffer != VK_NULL_HANDLE) {
    range.size = wanted.requirement.size;  // whole objects, of which kernels can see all
  } else {
    VkBufferUsageFlags usage = wanted.requirement.usage;
    if (wanted.role == BufferRole::positions) usage |= description.outputUsage;
    const BufferUse use = !wanted.isMapped                      ? BufferUse::device
                          : wanted.role == BufferRole::readBack ? BufferUse::readBack
                                                                : BufferUse::upload;
    Result<OwnBuffer> made =
        OwnBuffer::create(source, {wanted.requirement.size, usage, use, nameOf(wanted.role)});
    if (!made) return made.error();
    own = std::move(*made);
    range = own.range();
    if (wanted.isMapped) mapped = own.bytes().data();
  }
  BoundBuffer buffer{range};
  if (Result<void> made = createTexelView(*context, wanted.role, buffer); !made)
    return made.error();
  buffers.resize(std::max(buffers.size(), wanted.number + std::size_t{1}));
  bound.resize(buffers.size());
  buffers[wanted.number] = std::move(own);
  bound[wanted.number] = buffer;
  return mapped;
}

void SceneRecorder::State::releaseBuffer(std::uint32_t number) {
  destroyTexelView(*context, bound[number]);
  bound[number] = {};
  buffers[number] = OwnBuffer();
}

}  // namespace dermis::vulkan
