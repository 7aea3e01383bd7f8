// The commands of a frame.

#include <algorithm>
#include <chrono>
#include <utility>

#include "vulkan/system/state.h"

namespace dermis::vulkan {
namespace {

constexpr std::uint64_t leastTables = 64 * 1024;

class Stopwatch {
 public:
  double seconds() const {
    return std::chrono::duration<double>(std::chrono::steady_clock::now() - begin_).count();
  }

 private:
  std::chrono::steady_clock::time_point begin_ = std::chrono::steady_clock::now();
};

}  // namespace

/// Tables that are too small are replaced, the old ones kept until their frames are complete.
Result<void> SkinningSystem::State::makeRoomForTables() {
  const BufferRequirement needed = plan.buffer(BufferRole::tables);
  std::uint64_t size = std::max(tables.size(), leastTables);
  while (size < needed.size) size *= 2;
  size = std::min(size, context->limits.maxStorageBufferRange & ~std::uint64_t{3});
  if (tables.size() < needed.size || tables.size() == 0) {
    Result<SystemBuffer> made =
        SystemBuffer::create(source, {size, needed.usage, MemoryUse::device, "dermis tables"});
    if (!made) return made.error();
    BatchBuffers buffers{meshes.range(),
                         poses.range(),
                         made->range(),
                         palettes.range(),
                         OutputBuffers::oneBuffer(outputRange),
                         results.range()};
    Result<Bindings> bound = context->createBindings(buffers);
    if (!bound) return bound.error();
    retired.push_back({frameNumber, std::exchange(tables, std::move(*made)),
                       std::exchange(bindings, std::move(*bound))});
  }
  FrameSlot& own = slot();
  if (own.upload.size() >= needed.size && own.upload.size() != 0) return {};
  Result<SystemBuffer> upload = SystemBuffer::create(
      source,
      {size, plan.buffer(BufferRole::upload).usage, MemoryUse::upload, "dermis table upload"});
  if (!upload) return upload.error();
  own.upload = std::move(*upload);  // its last frame is complete
  return {};
}

/// With the first instance that is culled on the GPU.
Result<void> SkinningSystem::State::makeHistory() {
  if (history.size() != 0) return {};
  const BufferRequirement needed = plan.buffer(BufferRole::history);
  Result<SystemBuffer> made = SystemBuffer::create(
      source, {needed.size, needed.usage, MemoryUse::device, "dermis history"});
  if (!made) return made.error();
  history = std::move(*made);
  return {};
}

FrameBuffers SkinningSystem::State::buffersOf(const FrameDescription& frame) {
  FrameBuffers buffers;
  buffers.upload = slot().upload.range();
  buffers.readBack = slot().readBack.range();
  buffers.visibility = {frame.visibility, frame.visibilityOffset,
                        plan.buffer(BufferRole::visibility).size};
  buffers.history = history.range();
  buffers.counters = counters.range();
  if (!visibilitySets.empty()) buffers.visibilitySet = visibilitySets[slotNumber()];
  return buffers;
}

Result<void> SkinningSystem::State::recordFrame(VkCommandBuffer commandBuffer,
                                                const FrameDescription& frame) {
  const Stopwatch planning;
  if (Result<void> planned = scene.plan(plan); !planned) return planned;
  if (plan.buffer(BufferRole::visibility).size != 0) {
    if (frame.visibility == VK_NULL_HANDLE) {
      return Error{ErrorCode::invalidArgument,
                   "FrameDescription::visibility is null, and there are instances that are culled "
                   "on the GPU"};
    }
    if (Result<void> made = makeHistory(); !made) return made;
  }
  const bool works = !plan.commands().empty() || !uploads.empty();
  if (works) {
    if (Result<void> room = makeRoomForTables(); !room) return room;
    if (Result<void> good = bindings.state_->check(plan); !good) return good;
    if (Result<void> written = writeTables(plan, slot().upload.bytes()); !written) return written;
  }
  const double planSeconds = planning.seconds();

  const Stopwatch recording;
  frameStatistics = {};
  FrameSlot& own = slot();
  own.frame = frameNumber;
  own.hasTimestamps = false;
  if (works) {
    const Label label(context->table, commandBuffer, "dermis: skin a frame");
    timestamps.begin(commandBuffer, slotNumber());
    frameStatistics.uploadedBytes = plan.buffer(BufferRole::tables).size;
    const Recorded uploaded = recordUploads(commandBuffer);
    const FrameBuffers buffers = buffersOf(frame);
    const Recorded recorded = recordCommands(commandBuffer, plan, *bindings.state_, &buffers);
    timestamps.end(commandBuffer, slotNumber());
    own.hasTimestamps = timestamps.isCreated();
    frameStatistics.dispatches = recorded.dispatches;
    frameStatistics.workgroups = recorded.workgroups;
    frameStatistics.copies = uploaded.copies + recorded.copies;
  }
  if (Result<void> committed = scene.commit(); !committed) return committed;
  ++recordCount;
  static_cast<FrameWorkStatistics&>(frameStatistics) = scene.statistics().lastFrame;
  frameStatistics.uploadedBytes += frameStatistics.poseBytes;
  frameStatistics.planSeconds = planSeconds;
  frameStatistics.recordSeconds = recording.seconds();
  return {};
}

/// Packed meshes. No frame in flight reads their bytes; the first barrier of the plan, or of a
/// later one, makes them visible.
Recorded SkinningSystem::State::recordUploads(VkCommandBuffer commandBuffer) {
  Recorded recorded;
  for (MeshUpload& upload : uploads) {
    const VkBufferCopy region{0, upload.offset, upload.staging.size()};
    context->table.cmdCopyBuffer(commandBuffer, upload.staging.handle(), meshes.handle(), 1,
                                 &region);
    ++recorded.copies;
    frameStatistics.uploadedBytes += upload.staging.size();
    recordedUploads.push_back(std::move(upload));
  }
  uploads.clear();
  return recorded;
}

/// Of the last `record`, which can no longer be abandoned.
void SkinningSystem::State::retireUploads() {
  for (MeshUpload& upload : recordedUploads)
    retired.push_back({frameNumber, std::move(upload.staging), {}});
  recordedUploads.clear();
}

/// The GPU has seen nothing of it: its slot is free again, its meshes are not uploaded yet.
void SkinningSystem::State::abandonRecord() {
  --recordCount;
  slot().frame = 0;
  slot().hasTimestamps = false;
  for (MeshUpload& upload : recordedUploads) {
    if (scene.meshOffset(upload.mesh)) uploads.push_back(std::move(upload));
  }
  recordedUploads.clear();
  frameStatistics = {};
}

}  // namespace dermis::vulkan
