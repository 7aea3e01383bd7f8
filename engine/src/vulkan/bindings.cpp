#include "dermis/vulkan/bindings.h"

#include <algorithm>
#include <array>
#include <string>
#include <tuple>

#include "abi.h"
#include "vulkan/descriptor_writes.h"
#include "vulkan/object_name.h"
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

bool isSame(const BufferRange& a, const BufferRange& b) {
  return a.buffer == b.buffer && a.offset == b.offset && a.size == b.size;
}

VkDescriptorBufferInfo infoOf(const BufferRange& range) {
  return {range.buffer, range.offset, range.size};
}

}  // namespace

Bindings::State::~State() {
  if (context != nullptr)
    context->table.destroyDescriptorPool(context->device, pool, context->allocator);
}

const BufferRange& Bindings::State::output(std::size_t stream) const {
  const OutputBuffers& outputs = buffers.outputs;
  switch (static_cast<Stream>(stream)) {
    case Stream::normals:
      return outputs.normals;
    case Stream::tangents:
      return outputs.tangents;
    case Stream::previousPositions:
      return outputs.previousPositions;
    default:
      return outputs.positions;
  }
}

BoundBuffers Bindings::State::paletteKernel() const {
  const auto orElse = [](const BufferRange& range, const BufferRange& other) {
    return infoOf(range.buffer != VK_NULL_HANDLE ? range : other);
  };
  BoundBuffers bound{};
  bound[abi::BINDING_TABLES] = infoOf(buffers.tables);
  bound[abi::BINDING_MESHES] = orElse(buffers.matrices, buffers.tables);
  bound[abi::BINDING_PALETTES] = orElse(buffers.palettes, buffers.results);
  if (context->bindingCount() == abi::BINDING_COUNT)
    bound[abi::BINDING_RESULTS] = orElse(buffers.results, buffers.palettes);
  return bound;
}

BoundBuffers Bindings::State::skinKernel(Method method, const Windows& windows) const {
  BoundBuffers bound{};
  bound[abi::BINDING_TABLES] = infoOf(buffers.tables);
  bound[abi::BINDING_MESHES] = infoOf(buffers.meshes);
  bound[abi::BINDING_PALETTES] =
      infoOf(method == Method::linear ? buffers.matrices : buffers.palettes);
  const bool oneOutput = context->bindingCount() != abi::BINDING_COUNT;
  for (std::size_t stream = 0; stream < (oneOutput ? 1 : streamCount); ++stream) {
    const BufferRange& range = output(stream);
    VkDescriptorBufferInfo& info = bound[abi::BINDING_POSITIONS + stream];
    info = infoOf(range);
    if (range.buffer == VK_NULL_HANDLE) {
      if (stream != 0) info = bound[abi::BINDING_POSITIONS];
      continue;
    }
    const std::uint64_t begin = std::min(windows[stream], windowCount(stream) - 1) * windowStep;
    info.offset += begin;
    info.range = std::min(range.size - begin, context->limits.maxStorageBufferRange);
  }
  // Not to an output: a layer would see results read there that another dispatch wrote.
  if (!oneOutput) {
    bound[abi::BINDING_RESULTS] =
        infoOf(buffers.results.buffer != VK_NULL_HANDLE ? buffers.results : buffers.tables);
  }
  return bound;
}

std::uint32_t Bindings::State::windowCount(std::size_t stream) const {
  const std::uint64_t size = output(stream).size;
  if (size <= context->limits.maxStorageBufferRange) return 1;
  return static_cast<std::uint32_t>((size + windowStep - 1) / windowStep);
}

std::uint32_t Bindings::State::mostWindows() const {
  std::uint32_t most = 1;
  for (std::size_t stream = 0; stream < streamCount; ++stream)
    most = std::max(most, windowCount(stream));
  return most;
}

bool writesStream(const Variant& variant, std::size_t stream) {
  if (variant.kernel != Kernel::skin) return false;
  switch (static_cast<Stream>(stream)) {
    case Stream::normals:
      return variant.normals != VertexFormat::none;
    case Stream::tangents:
      return variant.tangents != VertexFormat::none;
    case Stream::previousPositions:
      return variant.motion != Motion::none;
    default:
      return true;
  }
}

std::optional<std::uint32_t> Bindings::State::commonWindow(const Dispatch& dispatch) const {
  std::uint32_t common = 0;
  for (const OutputWindow& window : dispatch.windows) common = std::max(common, window.index);
  for (std::size_t stream = 0; stream < streamCount; ++stream) {
    if (writesStream(dispatch.variant, stream) && windowCount(stream) > 1 &&
        dispatch.windows[stream].index != common)
      return std::nullopt;
  }
  return common;
}

Bindings::Bindings() = default;
Bindings::~Bindings() = default;
Bindings::Bindings(Bindings&&) noexcept = default;
Bindings& Bindings::operator=(Bindings&&) noexcept = default;

Result<Bindings> Context::createBindings(const BatchBuffers& buffers) const {
  const State& context = *state_;
  const OutputBuffers& outputs = buffers.outputs;
  for (const auto& [range, name, mayBeLarger] :
       {std::tuple{&buffers.meshes, "meshes", false},
        {&buffers.matrices, "matrices", false},
        {&buffers.tables, "tables", false},
        {&buffers.palettes, "palettes", false},
        {&buffers.results, "results", false},
        {&outputs.positions, "outputs.positions", true},
        {&outputs.normals, "outputs.normals", true},
        {&outputs.tangents, "outputs.tangents", true},
        {&outputs.previousPositions, "outputs.previousPositions", true}}) {
    if (Result<void> good = checkRange(*range, name, context.limits, mayBeLarger); !good)
      return good.error();
  }
  if (context.bindingCount() != abi::BINDING_COUNT) {
    for (const BufferRange* range :
         {&outputs.normals, &outputs.tangents, &outputs.previousPositions}) {
      if (range->buffer != VK_NULL_HANDLE && !isSame(*range, outputs.positions)) {
        return Error{ErrorCode::limitExceeded,
                     "BatchBuffers::outputs: on a device with " +
                         std::to_string(context.limits.maxStorageBuffersPerStage) +
                         " storage buffers a stage all attributes go to one buffer"};
      }
    }
  }

  Bindings bindings;
  bindings.state_ = std::make_unique<Bindings::State>();
  Bindings::State& state = *bindings.state_;
  state.context = &context;
  state.buffers = buffers;
  state.windowStep = outputWindowStep(context.limits);
  if (context.pushesDescriptors()) return bindings;

  const std::uint32_t windows = state.mostWindows();
  const std::uint32_t setCount = 1 + windows * 2;
  const VkDescriptorPoolSize size{VK_DESCRIPTOR_TYPE_STORAGE_BUFFER,
                                  setCount * context.bindingCount()};
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
  nameObject(context.table, context.device, VK_OBJECT_TYPE_DESCRIPTOR_POOL, state.pool, "dermis");
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
      update(state.skinKernel(method, {window, window, window, window}),
             state.sets[Bindings::State::setIndex(variant, window)]);
    }
  }
  return bindings;
}

}  // namespace dermis::vulkan
