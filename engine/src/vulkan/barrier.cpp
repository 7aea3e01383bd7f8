#include "dermis/vulkan/context.h"

#include <vulkan/vulkan_core.h>

#include "vulkan/state.h"

namespace dermis::vulkan {
namespace {

constexpr Use without(Use uses, Use others) {
  return static_cast<Use>(static_cast<std::uint32_t>(uses) & ~static_cast<std::uint32_t>(others));
}

struct Side {
  VkPipelineStageFlags stages = 0;
  VkAccessFlags reads = 0, writes = 0;
};

struct Row {
  Use use;
  Side side;
};
constexpr Row rows[] = {
    // Dermis orders its copies with its kernels.
    {Use::dermis,
     {VK_PIPELINE_STAGE_COMPUTE_SHADER_BIT, VK_ACCESS_SHADER_READ_BIT, VK_ACCESS_SHADER_WRITE_BIT}},
    {Use::vertexInput, {VK_PIPELINE_STAGE_VERTEX_INPUT_BIT, VK_ACCESS_VERTEX_ATTRIBUTE_READ_BIT}},
    {Use::vertexShader, {VK_PIPELINE_STAGE_VERTEX_SHADER_BIT, VK_ACCESS_SHADER_READ_BIT}},
    {Use::fragmentShader, {VK_PIPELINE_STAGE_FRAGMENT_SHADER_BIT, VK_ACCESS_SHADER_READ_BIT}},
    {Use::taskShader, {VK_PIPELINE_STAGE_TASK_SHADER_BIT_EXT, VK_ACCESS_SHADER_READ_BIT}},
    {Use::meshShader, {VK_PIPELINE_STAGE_MESH_SHADER_BIT_EXT, VK_ACCESS_SHADER_READ_BIT}},
    {Use::rayTracing, {VK_PIPELINE_STAGE_RAY_TRACING_SHADER_BIT_KHR, VK_ACCESS_SHADER_READ_BIT}},
    // A build reads its geometry as shader reads (VK_KHR_acceleration_structure).
    {Use::accelerationStructureBuild,
     {VK_PIPELINE_STAGE_ACCELERATION_STRUCTURE_BUILD_BIT_KHR, VK_ACCESS_SHADER_READ_BIT}},
    {Use::computeRead, {VK_PIPELINE_STAGE_COMPUTE_SHADER_BIT, VK_ACCESS_SHADER_READ_BIT}},
    {Use::computeWrite, {VK_PIPELINE_STAGE_COMPUTE_SHADER_BIT, 0, VK_ACCESS_SHADER_WRITE_BIT}},
    {Use::copyRead, {VK_PIPELINE_STAGE_TRANSFER_BIT, VK_ACCESS_TRANSFER_READ_BIT}},
    {Use::copyWrite, {VK_PIPELINE_STAGE_TRANSFER_BIT, 0, VK_ACCESS_TRANSFER_WRITE_BIT}},
    {Use::hostRead, {VK_PIPELINE_STAGE_HOST_BIT, VK_ACCESS_HOST_READ_BIT}},
    {Use::hostWrite, {VK_PIPELINE_STAGE_HOST_BIT, 0, VK_ACCESS_HOST_WRITE_BIT}},
    {Use::indirectRead, {VK_PIPELINE_STAGE_DRAW_INDIRECT_BIT, VK_ACCESS_INDIRECT_COMMAND_READ_BIT}},
};

Side sideOf(Use uses) {
  Side side;
  const auto add = [&](const Side& added) {
    side.stages |= added.stages;
    side.reads |= added.reads;
    side.writes |= added.writes;
  };
  for (const Row& row : rows) {
    if (includes(uses, row.use)) add(row.side);
    uses = without(uses, row.use);
  }
  // Bits of no use: the barrier is right for any.
  if (uses != Use{})
    add({VK_PIPELINE_STAGE_ALL_COMMANDS_BIT, VK_ACCESS_MEMORY_READ_BIT,
         VK_ACCESS_MEMORY_WRITE_BIT});
  return side;
}

// The structures of Vulkan 1.0 and of synchronization2 have the same members, except for the
// stages.

template <typename Structure>
Structure structureOf(VkStructureType type, const Barrier& barrier) {
  Structure made{};
  made.sType = type;
  made.srcAccessMask = barrier.sourceAccesses;
  made.dstAccessMask = barrier.destinationAccesses;
  if constexpr (requires { made.srcStageMask; }) {
    made.srcStageMask = barrier.sourceStages;
    made.dstStageMask = barrier.destinationStages;
  }
  if constexpr (requires { made.buffer; }) {
    made.srcQueueFamilyIndex = made.dstQueueFamilyIndex = VK_QUEUE_FAMILY_IGNORED;
    made.size = VK_WHOLE_SIZE;
  }
  return made;
}

}  // namespace

Barrier::operator VkMemoryBarrier() const {
  return structureOf<VkMemoryBarrier>(VK_STRUCTURE_TYPE_MEMORY_BARRIER, *this);
}
Barrier::operator VkBufferMemoryBarrier() const {
  return structureOf<VkBufferMemoryBarrier>(VK_STRUCTURE_TYPE_BUFFER_MEMORY_BARRIER, *this);
}
Barrier::operator VkMemoryBarrier2() const {
  return structureOf<VkMemoryBarrier2>(VK_STRUCTURE_TYPE_MEMORY_BARRIER_2, *this);
}
Barrier::operator VkBufferMemoryBarrier2() const {
  return structureOf<VkBufferMemoryBarrier2>(VK_STRUCTURE_TYPE_BUFFER_MEMORY_BARRIER_2, *this);
}

Barrier barrierBetween(Use before, Use after, QueueTransfer transfer) {
  constexpr Use host = Use::hostRead | Use::hostWrite;
  const Use deviceBefore = without(before, host), deviceAfter = without(after, host);
  if (transfer != QueueTransfer::none && deviceBefore != Use{} && deviceAfter != Use{}) {
    before = transfer == QueueTransfer::acquire ? Use{} : deviceBefore;
    after = transfer == QueueTransfer::release ? Use{} : deviceAfter;
  }
  Side source = sideOf(before), destination = sideOf(after);
  if (source.stages == 0) source.stages = VK_PIPELINE_STAGE_TOP_OF_PIPE_BIT;
  if (destination.stages == 0) destination.stages = VK_PIPELINE_STAGE_BOTTOM_OF_PIPE_BIT;
  return {source.stages, source.writes, destination.stages, destination.reads | destination.writes};
}

void ContextState::recordBarrier(VkCommandBuffer commandBuffer, Use before, Use after) const {
  const Barrier barrier = barrierBetween(before, after);
  constexpr VkPipelineStageFlags top = VK_PIPELINE_STAGE_TOP_OF_PIPE_BIT,
                                 bottom = VK_PIPELINE_STAGE_BOTTOM_OF_PIPE_BIT;
  if ((barrier.sourceStages & ~top) == 0 || (barrier.destinationStages & ~bottom) == 0) return;
  const VkMemoryBarrier memory = barrier;
  table.cmdPipelineBarrier(commandBuffer, barrier.sourceStages, barrier.destinationStages, 0, 1,
                           &memory, 0, nullptr, 0, nullptr);
}

void Context::recordBarrier(VkCommandBuffer commandBuffer, Use before, Use after) const {
  state_->recordBarrier(commandBuffer, before, after);
}

}  // namespace dermis::vulkan
