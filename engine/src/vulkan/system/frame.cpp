// The commands of a frame.

#include <chrono>
#include <utility>

#include "dermis/vulkan/barrier.h"
#include "vulkan/system/state.h"

namespace dermis::vulkan {
namespace {

class Stopwatch {
 public:
  double seconds() const {
    return std::chrono::duration<double>(std::chrono::steady_clock::now() - begin_).count();
  }

 private:
  std::chrono::steady_clock::time_point begin_ = std::chrono::steady_clock::now();
};

}  // namespace

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
                   "FrameDescription::visibility is null, but there are instances that are culled "
                   "on the GPU"};
    }
  }
  const bool works = !plan.commands().empty() || !uploads.empty() || isGrowing;
  if (works) {
    if (Result<void> room = makeRoom(); !room) return room;
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
    const Recorded grown = recordGrowth(commandBuffer);
    const Recorded uploaded = recordUploads(commandBuffer);
    const FrameBuffers buffers = buffersOf(frame);
    const Recorded recorded = recordCommands(commandBuffer, plan, *bindings.state_, &buffers);
    timestamps.end(commandBuffer, slotNumber());
    own.hasTimestamps = timestamps.isCreated();
    frameStatistics.dispatches = recorded.dispatches;
    frameStatistics.workgroups = recorded.workgroups;
    frameStatistics.copies = grown.copies + uploaded.copies + recorded.copies;
  }
  if (Result<void> committed = scene.commit(); !committed) return committed;
  ++recordCount;
  frameStatistics.planSeconds = planSeconds;
  frameStatistics.recordSeconds = recording.seconds();
  return {};
}

/// Uploads packed meshes. No frame in flight reads these bytes, but frames read bytes around them,
/// and the validation layer does not distinguish them. The first barrier of this plan, or of a
/// later one, makes the copies visible.
Recorded SkinningSystem::State::recordUploads(VkCommandBuffer commandBuffer) {
  Recorded recorded;
  if (uploads.empty()) return recorded;
  context->recordBarrier(commandBuffer, barrierBetween(Use::dermis, Use::copyWrite));
  for (MeshUpload& upload : uploads) {
    const BufferRange to = meshes.range();
    const VkBufferCopy region{0, to.offset + upload.offset, upload.staging.size()};
    context->table.cmdCopyBuffer(commandBuffer, upload.staging.handle(), to.buffer, 1, &region);
    ++recorded.copies;
    frameStatistics.uploadedBytes += upload.staging.size();
    recordedUploads.push_back(std::move(upload));
  }
  uploads.clear();
  return recorded;
}

/// The GPU never executes the frame: its slot is free again, and its meshes must be uploaded again.
void SkinningSystem::State::abandonRecord() {
  --recordCount;
  slot().frame = 0;
  slot().hasTimestamps = false;
  for (MeshUpload& upload : recordedUploads) {
    if (scene.meshOffset(upload.mesh)) uploads.push_back(std::move(upload));
  }
  recordedUploads.clear();
  abandonGrowth();
  frameStatistics = {};
}

}  // namespace dermis::vulkan
