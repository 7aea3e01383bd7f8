#include "dermis/vulkan/bindings.h"

#include <algorithm>
#include <array>
#include <string>
#include <tuple>
#include <utility>

#include "abi.h"
#include "plan/placement.h"
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

VkDescriptorBufferInfo infoOf(const BufferRange& range) {
  return {range.buffer, range.offset, range.size};
}

}  // namespace

BindingsState::~BindingsState() {
  if (context == nullptr) return;
  for (const VkBufferView view : {tableTexels, meshTexels, meshWords, matrixTexels, paletteTexels})
    context->table.destroyBufferView(context->device, view, context->allocator);
  context->table.destroyDescriptorPool(context->device, pool, context->allocator);
}

const BufferRange& BindingsState::output(std::size_t stream) const {
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

BoundBuffers BindingsState::paletteKernel(std::uint32_t poseBuffer) const {
  const auto orElse = [](const BufferRange& range, const BufferRange& other) {
    return infoOf(range.buffer != VK_NULL_HANDLE ? range : other);
  };
  BoundBuffers bound;
  bound.buffers[abi::BINDING_TABLES] = infoOf(buffers.tables);
  bound.buffers[abi::BINDING_MESHES] = orElse(poseBuffers[poseBuffer], buffers.tables);
  bound.buffers[abi::BINDING_PALETTES] = orElse(buffers.palettes, buffers.results);
  if (context->bindingCount() == abi::BINDING_COUNT)
    bound.buffers[abi::BINDING_RESULTS] = orElse(buffers.results, buffers.palettes);
  return bound;
}

BoundBuffers BindingsState::skinKernel(BufferRole joints, const Windows& windows) const {
  BoundBuffers bound;
  bound.buffers[abi::BINDING_TABLES] = infoOf(buffers.tables);
  bound.buffers[abi::BINDING_MESHES] = infoOf(buffers.meshes);
  bound.buffers[abi::BINDING_PALETTES] =
      infoOf(joints == BufferRole::poses ? buffers.poses : buffers.palettes);
  const bool oneOutput = context->bindingCount() != abi::BINDING_COUNT;
  for (std::size_t stream = 0; stream < (oneOutput ? 1 : streamCount); ++stream) {
    const BufferRange& range = output(stream);
    VkDescriptorBufferInfo& info = bound.buffers[abi::BINDING_POSITIONS + stream];
    info = infoOf(range);
    if (range.buffer == VK_NULL_HANDLE) {
      if (stream != 0) info = bound.buffers[abi::BINDING_POSITIONS];
      continue;
    }
    const std::uint64_t begin = std::min(windows[stream], windowCount(stream) - 1) * windowStep;
    info.offset += begin;
    info.range = std::min(range.size - begin, context->limits.maxStorageBufferRange);
  }
  bound.texels[abi::BINDING_TABLE_TEXELS - abi::BINDING_COUNT] = tableTexels;
  bound.texels[abi::BINDING_MESH_TEXELS - abi::BINDING_COUNT] = meshTexels;
  bound.texels[abi::BINDING_MESH_WORDS - abi::BINDING_COUNT] = meshWords;
  bound.texels[abi::BINDING_PALETTE_TEXELS - abi::BINDING_COUNT] =
      joints == BufferRole::poses ? matrixTexels : paletteTexels;
  // Not an output: the validation layer would report results that are read there and that another
  // dispatch wrote.
  if (!oneOutput) {
    bound.buffers[abi::BINDING_RESULTS] =
        infoOf(buffers.results.buffer != VK_NULL_HANDLE ? buffers.results : buffers.tables);
  }
  return bound;
}

BoundBuffers BindingsState::visibilityKernel(const FrameBuffers& frame) const {
  BoundBuffers bound;
  bound.buffers[abi::BINDING_TABLES] = infoOf(buffers.tables);
  bound.buffers[abi::BINDING_VISIBILITY] = infoOf(frame.visibility);
  bound.buffers[abi::BINDING_HISTORY] = infoOf(frame.history);
  bound.buffers[abi::BINDING_COUNTERS] = infoOf(frame.counters);
  if (context->bindingCount() == abi::BINDING_COUNT) {
    // Without bounds there is no results buffer, and no record refers to one.
    bound.buffers[abi::BINDING_RESULTS] =
        infoOf(buffers.results.buffer != VK_NULL_HANDLE ? buffers.results : frame.counters);
  }
  return bound;
}

Result<void> BindingsState::createTexelViews() {
  if (context->texelBindingCount() == 0) return {};
  const auto create = [this](const BufferRange& range, VkFormat format, std::uint32_t texelSize,
                             VkBufferView& view) -> Result<void> {
    const std::uint64_t texels = range.size / texelSize;
    if (range.buffer == VK_NULL_HANDLE || texels == 0) return {};
    VkBufferViewCreateInfo info{};
    info.sType = VK_STRUCTURE_TYPE_BUFFER_VIEW_CREATE_INFO;
    info.buffer = range.buffer;
    info.format = format;
    info.offset = range.offset;
    info.range = texels * texelSize;
    if (const VkResult result =
            context->table.createBufferView(context->device, &info, context->allocator, &view);
        result != VK_SUCCESS) {
      view = VK_NULL_HANDLE;  // what a failed call leaves there is undefined
      return vulkanError("vkCreateBufferView", result);
    }
    return {};
  };
  // Unsigned integers, so that no NaN is changed. Every device supports both formats for uniform
  // texel buffers.
  constexpr VkFormat unit = VK_FORMAT_R32G32B32A32_UINT;
  if (Result<void> good = create(buffers.tables, unit, 16, tableTexels); !good) return good;
  if (Result<void> good = create(buffers.meshes, unit, 16, meshTexels); !good) return good;
  if (Result<void> good = create(buffers.meshes, VK_FORMAT_R32_UINT, 4, meshWords); !good)
    return good;
  if (Result<void> good = create(buffers.poses, unit, 16, matrixTexels); !good) return good;
  return create(buffers.palettes, unit, 16, paletteTexels);
}

std::uint32_t BindingsState::windowCount(std::size_t stream) const {
  const std::uint64_t size = output(stream).size;
  if (size <= context->limits.maxStorageBufferRange) return 1;
  return static_cast<std::uint32_t>((size + windowStep - 1) / windowStep);
}

std::uint32_t BindingsState::mostWindows() const {
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

std::uint32_t BindingsState::commonWindow(const DispatchCommand& dispatch) {
  std::uint32_t common = 0;
  for (const OutputWindow& window : dispatch.windows) common = std::max(common, window.index);
  return common;
}

Result<void> ContextState::allocateSets(std::uint32_t count, VkDescriptorPool& pool,
                                        std::vector<VkDescriptorSet>& sets) const {
  const std::array<VkDescriptorPoolSize, 2> sizes{
      {{VK_DESCRIPTOR_TYPE_STORAGE_BUFFER, count * bindingCount()},
       {VK_DESCRIPTOR_TYPE_UNIFORM_TEXEL_BUFFER, count * texelBindingCount()}}};
  VkDescriptorPoolCreateInfo poolInfo{};
  poolInfo.sType = VK_STRUCTURE_TYPE_DESCRIPTOR_POOL_CREATE_INFO;
  poolInfo.maxSets = count;
  poolInfo.poolSizeCount = texelBindingCount() != 0 ? 2 : 1;
  poolInfo.pPoolSizes = sizes.data();
  if (const VkResult result = table.createDescriptorPool(device, &poolInfo, allocator, &pool);
      result != VK_SUCCESS) {
    pool = VK_NULL_HANDLE;  // what a failed call leaves there is undefined
    return vulkanError("vkCreateDescriptorPool", result);
  }
  nameObject(table, device, VK_OBJECT_TYPE_DESCRIPTOR_POOL, pool, "dermis");
  const std::vector<VkDescriptorSetLayout> layouts(count, setLayout);
  sets.resize(count);
  VkDescriptorSetAllocateInfo allocateInfo{};
  allocateInfo.sType = VK_STRUCTURE_TYPE_DESCRIPTOR_SET_ALLOCATE_INFO;
  allocateInfo.descriptorPool = pool;
  allocateInfo.descriptorSetCount = count;
  allocateInfo.pSetLayouts = layouts.data();
  if (const VkResult result = table.allocateDescriptorSets(device, &allocateInfo, sets.data());
      result != VK_SUCCESS)
    return vulkanError("vkAllocateDescriptorSets", result);
  return {};
}

/// Descriptor sets for every kernel and window.
Result<void> BindingsState::createSets() {
  const std::uint32_t windows = mostWindows();
  const auto poses = static_cast<std::uint32_t>(poseBuffers.size());
  if (Result<void> made = context->allocateSets(poses + windows * 2, pool, sets); !made)
    return made;
  const auto update = [&](const BoundBuffers& bound, VkDescriptorSet set) {
    const DescriptorWrites writes(bound, set);
    if (writes.count() != 0) {
      context->table.updateDescriptorSets(context->device, writes.count(), writes.data(), 0,
                                          nullptr);
    }
  };
  for (std::uint32_t number = 0; number < poses; ++number)
    update(paletteKernel(number), sets[number]);
  for (std::uint32_t window = 0; window < windows; ++window) {
    for (const BufferRole joints : {BufferRole::poses, BufferRole::palettes})
      update(skinKernel(joints, {window, window, window, window}), sets[skinSet(joints, window)]);
  }
  return {};
}

Bindings::Bindings() = default;
Bindings::~Bindings() = default;
Bindings::Bindings(Bindings&&) noexcept = default;
Bindings& Bindings::operator=(Bindings&&) noexcept = default;

Result<Bindings> Context::createBindings(const BatchBuffers& buffers) const {
  return state_->createBindings(buffers);
}

Result<Bindings> ContextState::createBindings(const BatchBuffers& buffers,
                                              std::vector<BufferRange> poseBuffers) const {
  const OutputBuffers& outputs = buffers.outputs;
  for (const auto& [range, name, mayBeLarger] :
       {std::tuple{&buffers.meshes, "meshes", false},
        {&buffers.poses, "poses", false},
        {&buffers.tables, "tables", false},
        {&buffers.palettes, "palettes", false},
        {&buffers.results, "results", false},
        {&outputs.positions, "outputs.positions", true},
        {&outputs.normals, "outputs.normals", true},
        {&outputs.tangents, "outputs.tangents", true},
        {&outputs.previousPositions, "outputs.previousPositions", true}}) {
    if (Result<void> good = checkRange(*range, name, limits, mayBeLarger); !good)
      return good.error();
  }
  if (bindingCount() != abi::BINDING_COUNT) {
    for (const BufferRange* range :
         {&outputs.normals, &outputs.tangents, &outputs.previousPositions}) {
      if (range->buffer != VK_NULL_HANDLE && !isSame(*range, outputs.positions)) {
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
  state.context = this;
  state.buffers = buffers;
  state.poseBuffers = std::move(poseBuffers);
  if (state.poseBuffers.empty()) state.poseBuffers.push_back(buffers.poses);
  state.windowStep = outputWindowStep(limits);
  if (Result<void> good = state.createTexelViews(); !good) return good.error();
  if (pushesDescriptors()) return bindings;
  if (Result<void> good = state.createSets(); !good) return good.error();
  return bindings;
}

}  // namespace dermis::vulkan
