#include "dermis/vulkan/bindings.h"

#include <algorithm>
#include <array>
#include <string>
#include <tuple>

#include "abi.h"
#include "vulkan/descriptor_writes.h"
#include "vulkan/state.h"
#include "vulkan/vulkan_error.h"

namespace dermis::vulkan {
namespace {

Result<void> checkRange(const BufferRange& range, const char* name, const DeviceLimits& limits,
                        bool mayBeLarger) {
  if (range.buffer == VK_NULL_HANDLE) return {};
  const std::string prefix = std::string("BatchBuffers::") + name;
  if (range.size == 0 || range.size == VK_WHOLE_SIZE || range.size % 4 != 0) {
    return Error{ErrorCode::invalidArgument,
                 prefix + ": its size must be a number of bytes, a multiple of 4"};
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

VkDescriptorBufferInfo infoOf(const BufferRange& range) {
  return {range.buffer, range.offset, range.size};
}

}  // namespace

Bindings::State::~State() {
  if (context != nullptr)
    context->table.destroyDescriptorPool(context->device, pool, context->allocator);
}

BoundBuffers Bindings::State::paletteKernel() const {
  BoundBuffers bound{};
  bound[abi::BINDING_TABLES] = infoOf(buffers.tables);
  bound[abi::BINDING_MESHES] = infoOf(buffers.matrices);
  bound[abi::BINDING_PALETTES] = infoOf(buffers.palettes);
  return bound;
}

BoundBuffers Bindings::State::skinKernel(Method method, std::uint32_t window,
                                         const DeviceLimits& limits) const {
  BoundBuffers bound{};
  bound[abi::BINDING_TABLES] = infoOf(buffers.tables);
  bound[abi::BINDING_MESHES] = infoOf(buffers.meshes);
  bound[abi::BINDING_PALETTES] =
      infoOf(method == Method::linear ? buffers.matrices : buffers.palettes);
  bound[abi::BINDING_OUTPUT] = infoOf(buffers.output);
  if (buffers.output.buffer != VK_NULL_HANDLE) {
    const std::uint64_t begin = window * windowStep;
    bound[abi::BINDING_OUTPUT].offset += begin;
    bound[abi::BINDING_OUTPUT].range =
        std::min(buffers.output.size - begin, limits.maxStorageBufferRange);
  }
  return bound;
}

std::uint32_t Bindings::State::windowCount() const {
  if (buffers.output.size <= context->limits.maxStorageBufferRange) return 1;
  return static_cast<std::uint32_t>((buffers.output.size + windowStep - 1) / windowStep);
}

Bindings::Bindings() = default;
Bindings::~Bindings() = default;
Bindings::Bindings(Bindings&&) noexcept = default;
Bindings& Bindings::operator=(Bindings&&) noexcept = default;

Result<Bindings> Context::createBindings(const BatchBuffers& buffers) const {
  const State& context = *state_;
  for (const auto& [range, name, mayBeLarger] : {std::tuple{&buffers.meshes, "meshes", false},
                                                 {&buffers.matrices, "matrices", false},
                                                 {&buffers.tables, "tables", false},
                                                 {&buffers.palettes, "palettes", false},
                                                 {&buffers.output, "output", true}}) {
    if (Result<void> good = checkRange(*range, name, context.limits, mayBeLarger); !good)
      return good.error();
  }

  Bindings bindings;
  bindings.state_ = std::make_unique<Bindings::State>();
  Bindings::State& state = *bindings.state_;
  state.context = &context;
  state.buffers = buffers;
  state.windowStep = outputWindowStep(context.limits);
  if (context.pushesDescriptors()) return bindings;

  const std::uint32_t windows = state.windowCount();
  const std::uint32_t setCount = 1 + windows * 2;
  const VkDescriptorPoolSize size{VK_DESCRIPTOR_TYPE_STORAGE_BUFFER, setCount * abi::BINDING_COUNT};
  VkDescriptorPoolCreateInfo poolInfo{};
  poolInfo.sType = VK_STRUCTURE_TYPE_DESCRIPTOR_POOL_CREATE_INFO;
  poolInfo.maxSets = setCount;
  poolInfo.poolSizeCount = 1;
  poolInfo.pPoolSizes = &size;
  if (const VkResult result = context.table.createDescriptorPool(context.device, &poolInfo,
                                                                 context.allocator, &state.pool);
      result != VK_SUCCESS) {
    state.pool = VK_NULL_HANDLE;  // what a failed call leaves there is undefined
    return vulkanError("vkCreateDescriptorPool", result);
  }
  const std::vector<VkDescriptorSetLayout> layouts(setCount, context.setLayout);
  state.sets.resize(setCount);
  VkDescriptorSetAllocateInfo allocateInfo{};
  allocateInfo.sType = VK_STRUCTURE_TYPE_DESCRIPTOR_SET_ALLOCATE_INFO;
  allocateInfo.descriptorPool = state.pool;
  allocateInfo.descriptorSetCount = setCount;
  allocateInfo.pSetLayouts = layouts.data();
  if (const VkResult result =
          context.table.allocateDescriptorSets(context.device, &allocateInfo, state.sets.data());
      result != VK_SUCCESS) {
    return vulkanError("vkAllocateDescriptorSets", result);
  }

  const auto update = [&](const BoundBuffers& bound, VkDescriptorSet set) {
    const DescriptorWrites writes(bound, set);
    if (writes.count() != 0) {
      context.table.updateDescriptorSets(context.device, writes.count(), writes.data(), 0, nullptr);
    }
  };
  update(state.paletteKernel(), state.sets[0]);
  for (std::uint32_t window = 0; window < windows; ++window) {
    for (const Method method : {Method::linear, Method::dualQuaternion}) {
      Variant variant;
      variant.method = method;
      update(state.skinKernel(method, window, context.limits),
             state.sets[Bindings::State::setIndex(variant, window)]);
    }
  }
  return bindings;
}

}  // namespace dermis::vulkan
