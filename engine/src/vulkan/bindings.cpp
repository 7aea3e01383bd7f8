// The views of buffers, and the checks of a batch's buffers.

#include "dermis/vulkan/context.h"

#include <algorithm>
#include <array>
#include <string>
#include <tuple>
#include <utility>

#include "abi.h"
#include "plan/variant.h"
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

Result<void> checkBuffer(const Plan& plan, BufferRole role, const BufferRange& range,
                         const char* name) {
  const std::uint64_t needed = plan.buffer(role).size;
  const std::uint64_t given = range.buffer == VK_NULL_HANDLE ? 0 : range.size;
  if (given >= needed) return {};
  return Error{ErrorCode::invalidArgument, std::string("the plan needs ") + std::to_string(needed) +
                                               " bytes of " + name + ", but the bindings have " +
                                               std::to_string(given)};
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

Result<void> BindingsState::checkBuffers(const Plan& plan) const {
  for (const auto& [role, range, name] : {std::tuple{BufferRole::meshes, &buffers.meshes, "meshes"},
                                          {BufferRole::poses, &buffers.poses, "poses"},
                                          {BufferRole::tables, &buffers.tables, "tables"},
                                          {BufferRole::palettes, &buffers.palettes, "palettes"},
                                          {BufferRole::results, &buffers.results, "results"}}) {
    if (Result<void> good = checkBuffer(plan, role, *range, name); !good) return good;
  }
  static constexpr std::array<std::pair<BufferRole, const char*>, streamCount> outputs{
      {{BufferRole::positions, "positions"},
       {BufferRole::normals, "normals"},
       {BufferRole::tangents, "tangents"},
       {BufferRole::previousPositions, "previous positions"}}};
  for (std::size_t stream = 0; stream < streamCount; ++stream) {
    const bool isWritten = std::ranges::any_of(plan.pipelines(), [&](PipelineId id) {
      const Variant variant = variantOf(id);
      return variant.kernel == Kernel::skin && writesStream(variant, stream);
    });
    if (!isWritten) continue;
    if (Result<void> good = checkBuffer(plan, outputs[stream].first, buffers.outputs[stream],
                                        outputs[stream].second);
        !good)
      return good;
  }
  return {};
}

/// Variants that store attributes together write them through the binding of one of them.
Result<void> BindingsState::checkOneBuffer(const Plan& plan) const {
  const BufferRange& positions = buffers.outputs[Stream::positions];
  for (const PipelineId id : plan.pipelines()) {
    const Variant variant = variantOf(id);
    if (variant.kernel != Kernel::skin ||
        !(variant.pairs || variant.recordBytes != 0 ||
          shareWords(variant.positions, variant.normals, variant.tangents)))
      continue;
    for (const auto& [format, range, name] :
         {std::tuple{variant.normals, &buffers.outputs[Stream::normals], "normals"},
          {variant.tangents, &buffers.outputs[Stream::tangents], "tangents"}}) {
      if (format == VertexFormat::none ||
          (range->buffer == positions.buffer && range->offset == positions.offset))
        continue;
      return Error{ErrorCode::invalidArgument,
                   std::string("the plan was made for outputs in one buffer, but the bindings have "
                               "positions and ") +
                       name + " in two"};
    }
  }
  return {};
}

Result<void> BindingsState::check(const Plan& plan) const {
  if (Result<void> good = checkBuffers(plan); !good) return good;
  if (!plan.commands().empty() && plan.limits() != context->limits) {
    return Error{
        ErrorCode::invalidArgument,
        "the plan was made for the limits of another device; pass Context::limits() to makePlan"};
  }
  if (Result<void> good = checkOneBuffer(plan); !good) return good;
  return context->check(plan, bound, sets, "Context::prepare");
}

}  // namespace dermis::vulkan
