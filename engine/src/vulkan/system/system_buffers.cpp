// The buffers of a SkinningSystem: how they are created, and how larger ones replace them.

#include <algorithm>
#include <array>
#include <utility>

#include "dermis/vulkan/barrier.h"
#include "vulkan/system/state.h"

namespace dermis::vulkan {
namespace {

constexpr std::uint64_t leastTables = 4096;

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
    case BufferRole::counters:
      return "dermis counters";
    case BufferRole::tables:
      return "dermis tables";
    case BufferRole::upload:
      return "dermis table upload";
    case BufferRole::readBack:
      return "dermis read-back";
    default:
      return "dermis output";
  }
}

BufferUse useOf(BufferRole role) {
  if (role == BufferRole::poses || role == BufferRole::upload) return BufferUse::upload;
  return role == BufferRole::readBack ? BufferUse::readBack : BufferUse::device;
}

Result<SystemBuffer> createBuffer(BufferSource& source, BufferRole role,
                                  const BufferRequirement& needed, VkBufferUsageFlags usage = 0) {
  return SystemBuffer::create(source,
                              {needed.size, needed.usage | usage, useOf(role), nameOf(role)});
}

}  // namespace

Result<void> SkinningSystem::State::createBuffers(const SkinningSystemDescription& description) {
  meshes.engines = description.meshes;
  if (meshes.engines.buffer != VK_NULL_HANDLE)
    meshes.engines.size = scene.buffer(BufferRole::meshes).size;
  output.engines = description.output;
  outputUsage = description.outputUsage;
  for (const BufferRole role :
       {BufferRole::meshes, BufferRole::palettes, BufferRole::positions, BufferRole::results}) {
    const BufferRequirement needed = scene.buffer(role);
    const bool isEngines =
        (role == BufferRole::meshes && meshes.engines.buffer != VK_NULL_HANDLE) ||
        (role == BufferRole::positions && output.engines.buffer != VK_NULL_HANDLE);
    if (needed.size == 0 || isEngines) continue;
    if (Result<void> made = grow({role, needed}); !made) return made;
  }
  for (std::uint32_t number = 0; number < scene.poseBufferCount(); ++number) {
    const PoseBuffer needed = scene.poseBuffer(number);
    const bool isCpu = needed.writer == PoseWriter::cpu;
    const BufferRange& range = isCpu ? description.poses.range : description.gpuPoses;
    if (range.buffer != VK_NULL_HANDLE) {
      PoseMemory& memory = poseBuffers.emplace_back();
      memory.range = range;
      memory.range.size = needed.requirement.size;  // whole joints, of which kernels can see all
      if (isCpu) memory.mapped = static_cast<std::byte*>(description.poses.mapped);
    } else if (Result<void> made = grow(
                   {isCpu ? BufferRole::poses : BufferRole::gpuPoses, needed.requirement, number});
               !made) {
      return made;
    }
  }
  // They are still empty.
  for (GrowingBuffer* buffer : {&meshes, &palettes, &output, &results})
    buffer->own = std::exchange(buffer->larger, {});
  isGrowing = false;
  return {};
}

/// A larger buffer for the next `record`, or one more for poses.
Result<void> SkinningSystem::State::grow(const BufferGrowth& growth) {
  VkBufferUsageFlags usage = 0;  // the engine's
  if (growth.role == BufferRole::positions) usage = outputUsage;
  if (growth.role == BufferRole::gpuPoses) usage = VK_BUFFER_USAGE_TRANSFER_DST_BIT;
  Result<SystemBuffer> made = createBuffer(source, growth.role, growth.requirement, usage);
  if (!made) return made.error();
  bindingsAreOld = true;
  switch (growth.role) {
    case BufferRole::poses:
    case BufferRole::gpuPoses: {
      PoseMemory& memory = poseBuffers.emplace_back();
      memory.own = std::move(*made);
      memory.range = memory.own.range();
      if (growth.role == BufferRole::poses) memory.mapped = memory.own.bytes().data();
      return {};
    }
    case BufferRole::meshes:
      meshes.larger = std::move(*made);
      break;
    case BufferRole::palettes:
      palettes.larger = std::move(*made);
      break;
    case BufferRole::results:
      results.larger = std::move(*made);
      break;
    default:
      output.larger = std::move(*made);
  }
  isGrowing = true;
  return {};
}

/// Creates the buffers whose size depends on the plan. Tables that are too small are replaced; the
/// old ones are kept until their frames are complete.
Result<void> SkinningSystem::State::makeRoom() {
  if (const BufferRequirement needed = plan.buffer(BufferRole::history);
      needed.size > history.range().size) {
    Result<SystemBuffer> made = createBuffer(source, BufferRole::history, needed);
    if (!made) return made.error();
    history.larger = std::move(*made);
    isGrowing = true;
  }
  if (const BufferRequirement needed = plan.buffer(BufferRole::counters);
      needed.size > counters.size()) {
    Result<SystemBuffer> made = createBuffer(source, BufferRole::counters, needed);
    if (!made) return made.error();
    counters = std::move(*made);  // there was none
  }
  BufferRequirement needed = plan.buffer(BufferRole::tables);
  const std::uint64_t used = needed.size;
  needed.size = std::max(tables.size(), leastTables);
  while (needed.size < used) needed.size *= 2;
  needed.size = std::min(needed.size, context->limits.maxStorageBufferRange & ~std::uint64_t{3});
  SystemBuffer newTables;
  if (tables.size() < used || tables.size() == 0) {
    Result<SystemBuffer> made = createBuffer(source, BufferRole::tables, needed);
    if (!made) return made.error();
    newTables = std::move(*made);
  }
  if (bindingsAreOld || newTables.size() != 0) {
    BatchBuffers buffers;
    buffers.meshes = meshes.range();
    buffers.tables = newTables.size() != 0 ? newTables.range() : tables.range();
    buffers.palettes = palettes.range();
    buffers.outputs = OutputBuffers::oneBuffer(output.range());
    buffers.results = results.range();
    std::vector<BufferRange> poses;
    for (const PoseMemory& memory : poseBuffers) poses.push_back(memory.range);
    Result<Bindings> bound = context->createBindings(buffers, std::move(poses));
    if (!bound) return bound.error();
    SystemBuffer oldTables;
    if (newTables.size() != 0) oldTables = std::exchange(tables, std::move(newTables));
    retired.push_back(
        {frameNumber, std::move(oldTables), std::exchange(bindings, std::move(*bound))});
    bindingsAreOld = false;
  }
  FrameSlot& own = slot();  // its last frame is complete
  if (own.upload.size() < used || own.upload.size() == 0) {
    BufferRequirement upload = plan.buffer(BufferRole::upload);
    upload.size = needed.size;
    Result<SystemBuffer> made = createBuffer(source, BufferRole::upload, upload);
    if (!made) return made.error();
    own.upload = std::move(*made);
  }
  if (const BufferRequirement back = plan.buffer(BufferRole::readBack);
      own.readBack.size() < back.size) {
    Result<SystemBuffer> made = createBuffer(source, BufferRole::readBack, back);
    if (!made) return made.error();
    own.readBack = std::move(*made);
  }
  return {};
}

/// Two barriers order the copies with the accesses of frames in flight and of this frame.
Recorded SkinningSystem::State::recordGrowth(VkCommandBuffer commandBuffer) {
  Recorded recorded;
  if (!isGrowing) return recorded;
  isGrowing = false;
  constexpr Use earlierAndLater = Use::dermis | Use::copyRead | Use::copyWrite;
  context->recordBarrier(commandBuffer, barrierBetween(earlierAndLater, Use::copyRead));
  for (GrowingBuffer* buffer : {&meshes, &palettes, &output, &results, &history}) {
    if (buffer->larger.size() == 0) continue;
    if (buffer->own.size() != 0 && buffer != &palettes) {
      const VkBufferCopy all{0, 0, buffer->own.size()};
      context->table.cmdCopyBuffer(commandBuffer, buffer->own.handle(), buffer->larger.handle(), 1,
                                   &all);
      ++recorded.copies;
    }
    replaced.push_back(
        {buffer, std::exchange(buffer->own, std::exchange(buffer->larger, SystemBuffer()))});
    if (buffer == &output) ++outputGeneration;
  }
  context->recordBarrier(commandBuffer, barrierBetween(Use::copyWrite, earlierAndLater));
  return recorded;
}

/// The last `record` can no longer be abandoned.
void SkinningSystem::State::retireReplaced() {
  for (Replaced& old : replaced) retired.push_back({frameNumber, std::move(old.old), {}});
  replaced.clear();
  for (MeshUpload& upload : recordedUploads)
    retired.push_back({frameNumber, std::move(upload.staging), {}});
  recordedUploads.clear();
}

/// The old buffers hold the contents. Their replacements will still replace them, unless there is a
/// larger one.
void SkinningSystem::State::abandonGrowth() {
  for (Replaced& old : replaced) {
    GrowingBuffer& buffer = *old.buffer;
    SystemBuffer unused = std::exchange(buffer.own, std::move(old.old));
    if (buffer.larger.size() == 0) buffer.larger = std::move(unused);
    isGrowing = true;
    if (&buffer == &output) ++outputGeneration;
  }
  replaced.clear();
}

}  // namespace dermis::vulkan
