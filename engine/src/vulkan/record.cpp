// How a command is recorded, with its descriptors.

#include <algorithm>
#include <array>
#include <string>
#include <utility>
#include <variant>

#include "abi.h"
#include "dermis/vulkan/context.h"
#include "plan/variant.h"
#include "vulkan/state.h"

namespace dermis::vulkan {
namespace {

/// The descriptor writes of one kernel, for a set or to push.
class DescriptorWrites {
 public:
  /// Bindings without a buffer are left out: the kernel's module does not declare them, or the
  /// kernel is not recorded. `bound` must outlive this object.
  explicit DescriptorWrites(const Descriptors& bound, VkDescriptorSet set = VK_NULL_HANDLE) {
    for (std::uint32_t binding = 0; binding < bound.buffers.size(); ++binding) {
      if (bound.buffers[binding].buffer == VK_NULL_HANDLE) continue;
      add(set, binding, VK_DESCRIPTOR_TYPE_STORAGE_BUFFER).pBufferInfo = &bound.buffers[binding];
    }
    for (std::uint32_t index = 0; index < bound.texels.size(); ++index) {
      if (bound.texels[index] == VK_NULL_HANDLE) continue;
      add(set, abi::BINDING_COUNT + index, VK_DESCRIPTOR_TYPE_UNIFORM_TEXEL_BUFFER)
          .pTexelBufferView = &bound.texels[index];
    }
  }

  std::uint32_t count() const { return count_; }
  const VkWriteDescriptorSet* data() const { return writes_.data(); }

 private:
  VkWriteDescriptorSet& add(VkDescriptorSet set, std::uint32_t binding, VkDescriptorType type) {
    VkWriteDescriptorSet& write = writes_[count_++];
    write.sType = VK_STRUCTURE_TYPE_WRITE_DESCRIPTOR_SET;
    write.dstSet = set;
    write.dstBinding = binding;
    write.descriptorCount = 1;
    write.descriptorType = type;
    return write;
  }

  std::array<VkWriteDescriptorSet, abi::BINDING_COUNT + abi::TEXEL_BINDING_COUNT> writes_{};
  std::uint32_t count_ = 0;
};

}  // namespace

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
    const std::span<std::byte> staged =
        staging_->bytes.subspan(static_cast<std::size_t>(staging_->used));
    if (upload.bytes.data() != staged.data()) std::ranges::copy(upload.bytes, staged.begin());
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
