// Records the commands of a frame.

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
/// for the next frames, which mostly upload tables only, unless meshes made it large. `replaced`
/// gets one that was too small: it may have the tables.
Result<void> SceneRecorder::State::makeStaging(OwnBuffer& replaced) {
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
  replaced = std::exchange(own.staging, std::move(*made));
  own.isStagingKept = others == 0 || size <= keptOfMeshes;
  return {};
}

Result<void> SceneRecorder::record(VkCommandBuffer commandBuffer, const BufferRange& visibility) {
  State& state = *state_;
  const ContextState& context = *state.context;
  SceneBooks& books = state.books();
  const Stopwatch planning;
  FrameSlot& own = state.slot();
  if (Result<void> planned = books.plan(state.plan, own.staging.bytes()); !planned) return planned;
  const std::uint32_t alignment = context.limits.minStorageBufferOffsetAlignment;
  if (visibility.offset % alignment != 0) {
    return Error{ErrorCode::invalidArgument,
                 "visibility.offset is " + std::to_string(visibility.offset) +
                     ", but must be a multiple of " + std::to_string(alignment)};
  }
  const std::uint64_t needed = state.scene->visibilityCount() * VkDeviceSize{4};
  const std::uint64_t given = visibility.buffer == VK_NULL_HANDLE ? 0 : visibility.size;
  if (!books.work_.culled.empty() && given < needed) {
    return Error{ErrorCode::invalidArgument,
                 "instances that are culled on the GPU need " + std::to_string(needed) +
                     " bytes of words, but visibility has " + std::to_string(given)};
  }
  state.bound[visibilityBuffer].range = {visibility.buffer, visibility.offset, needed};
  own.sets.reset();
  if (Result<void> good =
          context.check(state.plan, state.bound, own.sets, "SceneRecorder::prepare");
      !good)
    return good;
  OwnBuffer replaced;
  if (Result<void> made = state.makeStaging(replaced); !made) return made;
  const double planSeconds = planning.seconds();

  const Stopwatch recording;
  state.statistics = {.gpuSeconds = state.statistics.gpuSeconds};
  own.hasTimestamps = false;
  if (!state.plan.commands().empty()) {
    const Label label(context.table, commandBuffer, "dermis: skin a frame");
    state.timestamps.begin(commandBuffer, state.slotNumber());
    Staging staging{own.staging.handle(), own.staging.bytes()};
    const Recorded recorded =
        recordCommands(commandBuffer, context, state.plan, state.bound, own.sets, &staging);
    state.timestamps.end(commandBuffer, state.slotNumber());
    own.hasTimestamps = state.timestamps.isCreated();
    state.statistics.dispatches = recorded.dispatches;
    state.statistics.workgroups = recorded.workgroups;
    state.statistics.copies = recorded.copies;
    state.statistics.uploadedBytes = staging.used + books.planned_.poseBytes;
  }
  own.frame = state.scene->frame();
  if (Result<void> committed = books.commit(); !committed) return committed;
  ++state.recordCount;
  state.statistics.planSeconds = planSeconds;
  state.statistics.recordSeconds = recording.seconds();
  return {};
}

}  // namespace dermis::vulkan
