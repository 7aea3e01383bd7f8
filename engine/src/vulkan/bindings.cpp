#include "dermis/vulkan/context.h"

#include <algorithm>
#include <array>
#include <string>
#include <tuple>
#include <utility>

#include "abi.h"
#include "vulkan/descriptor_writes.h"
#include "vulkan/state.h"

namespace dermis::vulkan {
namespace {

Result<void> checkRange(const BufferRange& range, const char* name, const DeviceLimits& limits,
                        bool mayBeLarger) {
  if (range.buffer == VK_NULL_HANDLE) return {};
  const std::string prefix = std::string("BatchBuffers::") + name;
  if (range.size == 0 || range.size == VK_WHOLE_SIZE || range.size % 4 != 0) {
    return Error{
        ErrorCode::invalidArgument,
        prefix + ": its size must be a multiple of 4 bytes, and not 0 or VK_WHOLE_SIZE; it is " +
            std::to_string(range.size)};
  }
  if (range.offset % limits.minStorageBufferOffsetAlignment != 0) {
    return Error{ErrorCode::invalidArgument,
                 prefix + ": the offset " + std::to_string(range.offset) +
                     " is not a multiple of this device's " +
                     std::to_string(limits.minStorageBufferOffsetAlignment)};
  }
  if (!mayBeLarger && range.size > limits.maxStorageBufferRange) {
    return Error{ErrorCode::limitExceeded,
                 prefix + ": " + std::to_string(range.size) +
                     " bytes are more than this device's storage buffer range of " +
                     std::to_string(limits.maxStorageBufferRange)};
  }
  return {};
}

bool isSame(const BufferRange& a, const BufferRange& b) {
  return a.buffer == b.buffer && a.offset == b.offset && a.size == b.size;
}

}  // namespace

// -- Views.

Result<void> createTexelView(const ContextState& context, BufferRole role, BoundBuffer& buffer) {
  const bool isRead = role == BufferRole::tables || role == BufferRole::meshes ||
                      role == BufferRole::palettes || role == BufferRole::poses ||
                      role == BufferRole::gpuPoses;
  const std::uint64_t texels = buffer.range.size / abi::TEXEL_BYTES;
  if (context.texelBindingCount() == 0 || !isRead || buffer.range.buffer == VK_NULL_HANDLE ||
      texels == 0)
    return {};
  VkBufferViewCreateInfo info{};
  info.sType = VK_STRUCTURE_TYPE_BUFFER_VIEW_CREATE_INFO;
  info.buffer = buffer.range.buffer;
  // Unsigned integers, so that no NaN is changed. Every device supports it for uniform texel
  // buffers.
  info.format = VK_FORMAT_R32G32B32A32_UINT;
  info.offset = buffer.range.offset;
  info.range = texels * abi::TEXEL_BYTES;
  if (const VkResult result =
          context.table.createBufferView(context.device, &info, context.allocator, &buffer.view);
      result != VK_SUCCESS) {
    buffer.view = VK_NULL_HANDLE;  // what a failed call leaves there is undefined
    return vulkanError("vkCreateBufferView", result);
  }
  return {};
}

void destroyTexelView(const ContextState& context, BoundBuffer& buffer) {
  context.table.destroyBufferView(context.device, buffer.view, context.allocator);
  buffer.view = VK_NULL_HANDLE;
}

// -- Descriptors.

Descriptors::Descriptors(const ContextState& context, const DispatchCommand& dispatch,
                         const BoundBuffers& bound) {
  for (const Binding& binding : dispatch.bindings) {
    const BoundBuffer& buffer = bound[binding.part.buffer];
    if (binding.isTexelBuffer) {
      texels[binding.slot - abi::BINDING_COUNT] = buffer.view;
      continue;
    }
    const std::uint64_t size = buffer.range.size - binding.part.offset;
    buffers[binding.slot] = {buffer.range.buffer, buffer.range.offset + binding.part.offset,
                             std::min(size, context.limits.maxStorageBufferRange)};
  }
}

DescriptorSets::~DescriptorSets() {
  for (const Pool& pool : pools_)
    context->table.destroyDescriptorPool(context->device, pool.pool, context->allocator);
}

DescriptorSets::DescriptorSets(DescriptorSets&& other) noexcept
    : context(other.context), pools_(std::move(other.pools_)), made_(std::move(other.made_)) {}

Result<void> DescriptorSets::addPool(std::uint32_t count) {
  const std::array<VkDescriptorPoolSize, 2> sizes{
      {{VK_DESCRIPTOR_TYPE_STORAGE_BUFFER, count * context->bindingCount()},
       {VK_DESCRIPTOR_TYPE_UNIFORM_TEXEL_BUFFER, count * context->texelBindingCount()}}};
  VkDescriptorPoolCreateInfo poolInfo{};
  poolInfo.sType = VK_STRUCTURE_TYPE_DESCRIPTOR_POOL_CREATE_INFO;
  poolInfo.maxSets = count;
  poolInfo.poolSizeCount = context->texelBindingCount() != 0 ? 2 : 1;
  poolInfo.pPoolSizes = sizes.data();
  VkDescriptorPool pool = VK_NULL_HANDLE;
  if (const VkResult result = context->table.createDescriptorPool(context->device, &poolInfo,
                                                                  context->allocator, &pool);
      result != VK_SUCCESS)
    return vulkanError("vkCreateDescriptorPool", result);
  nameObject(context->table, context->device, VK_OBJECT_TYPE_DESCRIPTOR_POOL, pool, "dermis");
  pools_.push_back({pool, count, count});
  return {};
}

VkDescriptorSet DescriptorSets::findMade(const Descriptors& descriptors) const {
  const auto isSame = [&](const Made& made) {
    const auto areEqual = [](const VkDescriptorBufferInfo& a, const VkDescriptorBufferInfo& b) {
      return a.buffer == b.buffer && a.offset == b.offset && a.range == b.range;
    };
    return made.descriptors.texels == descriptors.texels &&
           std::ranges::equal(made.descriptors.buffers, descriptors.buffers, areEqual);
  };
  const auto found = std::ranges::find_if(made_, isSame);
  return found == made_.end() ? VK_NULL_HANDLE : found->set;
}

VkDescriptorSet DescriptorSets::find(const Descriptors& descriptors) const {
  const std::scoped_lock lock(mutex_);
  return findMade(descriptors);
}

Result<void> DescriptorSets::make(const Descriptors& descriptors) {
  const std::scoped_lock lock(mutex_);
  if (findMade(descriptors) != VK_NULL_HANDLE) return {};
  auto pool = std::ranges::find_if(pools_, [](const Pool& one) { return one.left != 0; });
  if (pool == pools_.end()) {
    const auto count = static_cast<std::uint32_t>(std::max<std::size_t>(made_.size(), 4));
    if (Result<void> added = addPool(count); !added) return added;
    pool = pools_.end() - 1;
  }
  VkDescriptorSetAllocateInfo allocateInfo{};
  allocateInfo.sType = VK_STRUCTURE_TYPE_DESCRIPTOR_SET_ALLOCATE_INFO;
  allocateInfo.descriptorPool = pool->pool;
  allocateInfo.descriptorSetCount = 1;
  allocateInfo.pSetLayouts = &context->setLayout;
  VkDescriptorSet set = VK_NULL_HANDLE;
  if (const VkResult result =
          context->table.allocateDescriptorSets(context->device, &allocateInfo, &set);
      result != VK_SUCCESS)
    return vulkanError("vkAllocateDescriptorSets", result);
  --pool->left;
  const DescriptorWrites writes(descriptors, set);
  if (writes.count() != 0) {
    context->table.updateDescriptorSets(context->device, writes.count(), writes.data(), 0, nullptr);
  }
  made_.push_back({descriptors, set});
  return {};
}

void DescriptorSets::reset() {
  for (Pool& pool : pools_) {
    context->table.resetDescriptorPool(context->device, pool.pool, 0);
    pool.left = pool.count;
  }
  made_.clear();
}

// -- Bindings of batches.

BindingsState::~BindingsState() {
  if (context == nullptr) return;
  for (BoundBuffer& buffer : bound) destroyTexelView(*context, buffer);
}

Bindings::Bindings() = default;
Bindings::~Bindings() = default;
Bindings::Bindings(Bindings&&) noexcept = default;
Bindings& Bindings::operator=(Bindings&&) noexcept = default;

Result<Bindings> Context::createBindings(const BatchBuffers& buffers) const {
  const DeviceLimits& limits = state_->limits;
  const ByStream<BufferRange>& outputs = buffers.outputs;
  for (const auto& [range, name, mayBeLarger] :
       {std::tuple{&buffers.meshes, "meshes", false},
        {&buffers.poses, "poses", false},
        {&buffers.tables, "tables", false},
        {&buffers.palettes, "palettes", false},
        {&buffers.results, "results", false},
        {&outputs[Stream::positions], "outputs[positions]", true},
        {&outputs[Stream::normals], "outputs[normals]", true},
        {&outputs[Stream::tangents], "outputs[tangents]", true},
        {&outputs[Stream::previousPositions], "outputs[previousPositions]", true}}) {
    if (Result<void> good = checkRange(*range, name, limits, mayBeLarger); !good)
      return good.error();
  }
  if (state_->bindingCount() != abi::BINDING_COUNT) {
    for (const BufferRange& range : outputs) {
      if (range.buffer != VK_NULL_HANDLE && !isSame(range, outputs[Stream::positions])) {
        return Error{ErrorCode::limitExceeded,
                     "BatchBuffers::outputs: on a device with " +
                         std::to_string(limits.maxStorageBuffersPerStage) +
                         " storage buffers per stage all attributes must go to one buffer"};
      }
    }
  }

  Bindings bindings;
  bindings.state_ = std::make_unique<BindingsState>();
  BindingsState& state = *bindings.state_;
  state.context = state.sets.context = state_.get();
  state.buffers = buffers;
  state.bound.resize(bufferRoleCount);
  for (const auto& [role, range] :
       {std::pair{BufferRole::meshes, &buffers.meshes},
        {BufferRole::poses, &buffers.poses},
        {BufferRole::tables, &buffers.tables},
        {BufferRole::palettes, &buffers.palettes},
        {BufferRole::results, &buffers.results},
        {BufferRole::positions, &outputs[Stream::positions]},
        {BufferRole::normals, &outputs[Stream::normals]},
        {BufferRole::tangents, &outputs[Stream::tangents]},
        {BufferRole::previousPositions, &outputs[Stream::previousPositions]}}) {
    BoundBuffer& bound = state.bound[static_cast<std::size_t>(role)];
    bound.range = *range;
    if (Result<void> made = createTexelView(*state.context, role, bound); !made)
      return made.error();
  }
  return bindings;
}

}  // namespace dermis::vulkan
