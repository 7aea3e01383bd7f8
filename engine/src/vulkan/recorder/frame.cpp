// The commands of a frame.

#include <chrono>
#include <string>
#include <utility>

#include "vulkan/recorder/state.h"

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

/// Room for all uploads, one after the other. The slot's last frame is complete. The buffer is kept
/// for the next frames, which mostly upload tables only, unless meshes made it large.
Result<void> SceneRecorder::State::makeStaging() {
  constexpr std::uint64_t least = 4096, keptOfMeshes = 16 << 10;
  std::uint64_t tables = 0, others = 0;
  for (const Command& command : plan.commands()) {
    const auto* upload = std::get_if<UploadCommand>(&command);
    if (upload == nullptr) continue;
    (upload->to.buffer == books().tables_.number ? tables : others) += upload->to.size;
  }
  FrameSlot& own = slot();
  if (tables + others <= own.staging.size()) return {};
  std::uint64_t size = std::max(own.staging.size(), least);
  while (size < tables) size *= 2;
  if (others != 0) size = tables + others;
  Result<OwnBuffer> made = OwnBuffer::create(
      source, {size, VK_BUFFER_USAGE_TRANSFER_SRC_BIT, BufferUse::upload, "dermis upload"});
  if (!made) return made.error();
  own.staging = std::move(*made);
  own.isStagingKept = others == 0 || size <= keptOfMeshes;
  return {};
}

Result<void> SceneRecorder::State::recordFrame(VkCommandBuffer commandBuffer,
                                               const FrameDescription& frame) {
  const Stopwatch planning;
  if (Result<void> planned = books().plan(plan); !planned) return planned;
  if (!books().work_.culled.empty() && frame.visibility == VK_NULL_HANDLE) {
    return Error{ErrorCode::invalidArgument,
                 "FrameDescription::visibility is null, but there are instances that are culled on "
                 "the GPU"};
  }
  const std::uint32_t alignment = context->limits.minStorageBufferOffsetAlignment;
  if (frame.visibilityOffset % alignment != 0) {
    return Error{ErrorCode::invalidArgument,
                 "FrameDescription::visibilityOffset is " + std::to_string(frame.visibilityOffset) +
                     ", but must be a multiple of " + std::to_string(alignment)};
  }
  bound[visibilityBuffer].range = {frame.visibility, frame.visibilityOffset,
                                   scene->visibilityCount() * VkDeviceSize{4}};
  FrameSlot& own = slot();
  own.sets.reset();
  if (Result<void> good = context->check(plan, bound, own.sets, "SceneRecorder::prepare"); !good)
    return good;
  if (Result<void> made = makeStaging(); !made) return made;
  const double planSeconds = planning.seconds();

  const Stopwatch recording;
  statistics = {.gpuSeconds = statistics.gpuSeconds};
  own.hasTimestamps = false;
  if (!plan.commands().empty()) {
    const Label label(context->table, commandBuffer, "dermis: skin a frame");
    timestamps.begin(commandBuffer, slotNumber());
    Staging staging{own.staging.handle(), own.staging.bytes()};
    const Recorded recorded =
        recordCommands(commandBuffer, *context, plan, bound, own.sets, &staging);
    timestamps.end(commandBuffer, slotNumber());
    own.hasTimestamps = timestamps.isCreated();
    statistics.dispatches = recorded.dispatches;
    statistics.workgroups = recorded.workgroups;
    statistics.copies = recorded.copies;
    statistics.uploadedBytes = staging.used + books().planned_.poseBytes;
  }
  own.frame = scene->frame();
  if (Result<void> committed = books().commit(); !committed) return committed;
  ++recordCount;
  statistics.planSeconds = planSeconds;
  statistics.recordSeconds = recording.seconds();
  return {};
}

}  // namespace dermis::vulkan
