#include <algorithm>
#include <array>
#include <string>
#include <tuple>
#include <utility>
#include <variant>

#include "dermis/vulkan/context.h"
#include "plan/variant.h"
#include "vulkan/descriptor_writes.h"
#include "vulkan/state.h"

namespace dermis::vulkan {
namespace {

Result<void> checkBuffer(const Plan& plan, BufferRole role, const BufferRange& range,
                         const char* name) {
  const std::uint64_t needed = plan.buffer(role).size;
  const std::uint64_t given = range.buffer == VK_NULL_HANDLE ? 0 : range.size;
  if (given >= needed) return {};
  return Error{ErrorCode::invalidArgument, std::string("the plan needs ") + std::to_string(needed) +
                                               " bytes of " + name + ", but the bindings have " +
                                               std::to_string(given)};
}

}  // namespace

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

Result<void> ContextState::check(const Plan& plan, const BoundBuffers& buffers,
                                 DescriptorSets& sets, const char* prepare) const {
  for (const PipelineId id : plan.pipelines()) {
    if (pipelines->find(id) == VK_NULL_HANDLE)
      return Error{ErrorCode::notPrepared, "the " + pipelineName(variantOf(id)) +
                                               " has no pipeline; call " + prepare +
                                               " for it first"};
  }
  if (pushesDescriptors()) return {};
  for (const Command& command : plan.commands()) {
    const auto* dispatch = std::get_if<DispatchCommand>(&command);
    if (dispatch == nullptr) continue;
    if (Result<void> made = sets.make({*this, *dispatch, buffers}); !made) return made;
  }
  return {};
}

namespace {

/// Records one command after the other.
class Recorder {
 public:
  Recorder(VkCommandBuffer commandBuffer, const ContextState& context, const BoundBuffers& buffers,
           const DescriptorSets& sets, Staging* staging)
      : commandBuffer_(commandBuffer),
        context_(context),
        table_(context.table),
        buffers_(buffers),
        sets_(sets),
        staging_(staging) {}

  void operator()(const BarrierCommand& barrier) {
    context_.recordBarrier(commandBuffer_, barrier.before, barrier.after);
  }

  void operator()(const ClearCommand& clear) {
    const BufferRange& range = buffers_[clear.part.buffer].range;
    table_.cmdFillBuffer(commandBuffer_, range.buffer, range.offset + clear.part.offset,
                         clear.part.size, 0);
  }

  void operator()(const CopyCommand& copy) {
    const BufferRange &from = buffers_[copy.from].range, &to = buffers_[copy.to].range;
    addCopy(from.buffer, to.buffer,
            {from.offset + copy.fromOffset, to.offset + copy.toOffset, copy.size});
  }

  void operator()(const UploadCommand& upload) {
    const BufferRange& to = buffers_[upload.to.buffer].range;
    std::ranges::copy(upload.bytes,
                      staging_->bytes.begin() + static_cast<std::ptrdiff_t>(staging_->used));
    addCopy(staging_->buffer, to.buffer,
            {staging_->used, to.offset + upload.to.offset, upload.to.size});
    staging_->used += upload.to.size;
  }

  void operator()(const DispatchCommand& dispatch) {
    table_.cmdBindPipeline(commandBuffer_, VK_PIPELINE_BIND_POINT_COMPUTE,
                           context_.pipelines->find(dispatch.pipeline));
    bind({context_, dispatch, buffers_});
    table_.cmdPushConstants(commandBuffer_, context_.pipelineLayout, VK_SHADER_STAGE_COMPUTE_BIT, 0,
                            dispatch.constantCount * 4, dispatch.constants.data());
    ++recorded_.dispatches;
    recorded_.workgroups += dispatch.workgroupCount;
    if (dispatch.indirect.size != 0) {
      const BufferRange& arguments = buffers_[dispatch.indirect.buffer].range;
      table_.cmdDispatchIndirect(commandBuffer_, arguments.buffer,
                                 arguments.offset + dispatch.indirect.offset);
    } else {
      table_.cmdDispatch(commandBuffer_, dispatch.groupCountX, dispatch.groupCountY, 1);
    }
  }

  /// Before a command that is no copy. Copies between the same buffers are recorded in one call.
  void endCopies() {
    if (regionCount_ == 0) return;
    table_.cmdCopyBuffer(commandBuffer_, from_, to_, regionCount_, regions_.data());
    ++recorded_.copies;
    regionCount_ = 0;
  }

  const Recorded& recorded() const { return recorded_; }

 private:
  void addCopy(VkBuffer from, VkBuffer to, const VkBufferCopy& region) {
    if (from != from_ || to != to_ || regionCount_ == regions_.size()) endCopies();
    from_ = from;
    to_ = to;
    regions_[regionCount_++] = region;
  }

  void bind(const Descriptors& descriptors) {
    if (context_.pushesDescriptors()) {
      const DescriptorWrites writes(descriptors);
      table_.cmdPushDescriptorSet(commandBuffer_, VK_PIPELINE_BIND_POINT_COMPUTE,
                                  context_.pipelineLayout, 0, writes.count(), writes.data());
      return;
    }
    const VkDescriptorSet set = sets_.find(descriptors);
    table_.cmdBindDescriptorSets(commandBuffer_, VK_PIPELINE_BIND_POINT_COMPUTE,
                                 context_.pipelineLayout, 0, 1, &set, 0, nullptr);
  }

  VkCommandBuffer commandBuffer_;
  const ContextState& context_;
  const DispatchTable& table_;
  const BoundBuffers& buffers_;
  const DescriptorSets& sets_;
  Staging* staging_;
  VkBuffer from_ = VK_NULL_HANDLE, to_ = VK_NULL_HANDLE;  ///< of the copies that are collected
  std::array<VkBufferCopy, 64> regions_;
  std::uint32_t regionCount_ = 0;
  Recorded recorded_;
};

}  // namespace

Recorded recordCommands(VkCommandBuffer commandBuffer, const ContextState& context,
                        const Plan& plan, const BoundBuffers& buffers, const DescriptorSets& sets,
                        Staging* staging) {
  Recorder recorder(commandBuffer, context, buffers, sets, staging);
  for (const Command& command : plan.commands()) {
    const bool copies = std::holds_alternative<CopyCommand>(command) ||
                        std::holds_alternative<UploadCommand>(command);
    if (!copies) recorder.endCopies();
    std::visit([&recorder](const auto& one) { recorder(one); }, command);
  }
  recorder.endCopies();
  return recorder.recorded();
}

Result<void> Context::record(VkCommandBuffer commandBuffer, const Plan& plan,
                             const Bindings& bindings) const {
  const ContextState& context = *state_;
  if (bindings.state_ == nullptr || bindings.state_->context != &context) {
    return Error{ErrorCode::invalidArgument, "the bindings were not made by this context"};
  }
  const BindingsState& bound = *bindings.state_;
  if (Result<void> good = bound.check(plan); !good) return good;
  const Label label(context.table, commandBuffer, "dermis: skin a batch");
  recordCommands(commandBuffer, context, plan, bound.bound, bound.sets);
  return {};
}

}  // namespace dermis::vulkan
