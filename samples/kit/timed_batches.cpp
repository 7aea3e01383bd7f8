#include "kit/timed_batches.h"

#include <cstring>
#include <utility>

#include "dermis/vulkan/context.h"

namespace dermis::samples {

Result<TimedBatches> TimedBatches::create(Device& device, vulkan::Context& context) {
  TimedBatches batches;
  batches.device_ = &device;
  batches.context_ = &context;
  Result<Timestamps> timestamps = Timestamps::create(device);
  if (!timestamps) return timestamps.error();
  batches.timestamps_ = std::move(*timestamps);
  return batches;
}

TimedBatches::~TimedBatches() {
  for (const std::unique_ptr<TimedBatch>& batch : batches_) {
    if (batch->commandBuffer != VK_NULL_HANDLE) device_->freeCommandBuffer(batch->commandBuffer);
  }
}

template <typename Buffer>
Result<void> TimedBatches::makeBuffer(const Plan& plan, BufferRole role, Buffer& buffer) {
  const BufferRequirement requirement = plan.buffer(role);
  Result<Buffer> made = Buffer::create(*device_, requirement.size, requirement.usage);
  if (!made) return made.error();
  buffer = std::move(*made);
  return {};
}

Result<void> TimedBatches::makeShared(const BatchLayout& layout, const Plan& plan) {
  for (const Result<void>& made : {makeBuffer(plan, BufferRole::meshes, meshes_),
                                   makeBuffer(plan, BufferRole::poses, matrices_),
                                   makeBuffer(plan, BufferRole::positions, output_)}) {
    if (!made) return made;
  }
  for (const auto& [mesh, offset] : layout.meshOffsets)
    std::memcpy(meshes_.bytes().data() + offset, mesh->bytes().data(), mesh->bytes().size());
  for (std::size_t index = 0; index < layout.poses.size(); ++index) {
    std::memcpy(matrices_.bytes().data() + layout.poseDescriptions[index].matrixOffset,
                layout.poses[index].data(), layout.poses[index].size_bytes());
  }
  return {};
}

Result<void> TimedBatches::record(TimedBatch& batch) {
  const VulkanFunctions& functions = device_->functions();
  VkCommandBufferBeginInfo begin{};
  begin.sType = VK_STRUCTURE_TYPE_COMMAND_BUFFER_BEGIN_INFO;
  begin.flags = VK_COMMAND_BUFFER_USAGE_SIMULTANEOUS_USE_BIT;
  batch.commandBuffer = device_->allocateCommandBuffer();
  functions.BeginCommandBuffer(batch.commandBuffer, &begin);
  context_->recordBarrier(batch.commandBuffer, Use::dermis, Use::dermis);
  timestamps_.recordBegin(batch.commandBuffer);
  const Result<void> done = context_->record(batch.commandBuffer, batch.plan, *batch.bindings);
  timestamps_.recordEnd(batch.commandBuffer);
  context_->recordBarrier(batch.commandBuffer, Use::dermis, Use::hostRead);
  functions.EndCommandBuffer(batch.commandBuffer);
  return done;
}

Result<void> TimedBatches::add(std::span<const SkinRequest> requests, const OutputLayout& output,
                               const Tuning& tuning) {
  const BatchLayout layout = layOutBatch(requests, output);
  auto batch = std::make_unique<TimedBatch>();
  if (Result<void> planned = makePlan(layout.batch(), context_->limits(), tuning, batch->plan);
      !planned)
    return planned;
  if (Result<void> ready = context_->prepare(batch->plan.pipelines()); !ready) return ready;
  if (batches_.empty()) {
    if (Result<void> made = makeShared(layout, batch->plan); !made) return made;
  }
  for (const Result<void>& made : {makeBuffer(batch->plan, BufferRole::tables, batch->tables),
                                   makeBuffer(batch->plan, BufferRole::palettes, batch->palettes),
                                   makeBuffer(batch->plan, BufferRole::results, batch->results)}) {
    if (!made) return made;
  }
  if (Result<void> written = writeTables(batch->plan, batch->tables.bytes()); !written)
    return written;
  Result<vulkan::Bindings> bindings = context_->createBindings(
      {meshes_.range(), matrices_.range(), batch->tables.range(), batch->palettes.range(),
       ByStream<vulkan::BufferRange>::all(output_.range()), batch->results.range()});
  if (!bindings) return bindings.error();
  batch->bindings.emplace(std::move(*bindings));
  batches_.push_back(std::move(batch));
  if (Result<void> recorded = record(*batches_.back()); !recorded) return recorded;
  const Result<double> first = skin(batches_.size() - 1);
  if (!first) return first.error();
  return {};
}

Result<double> TimedBatches::skin(std::size_t batch) {
  return timestamps_.measure(batches_[batch]->commandBuffer);
}

}  // namespace dermis::samples
