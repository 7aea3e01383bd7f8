// What comes back from the GPU.

#include <cstring>

#include "abi.h"
#include "vulkan/system/state.h"

namespace dermis::vulkan {

/// Slots are used again soon: what is in those of complete frames is copied. A later frame that
/// found nothing out does not take away what an earlier one did.
void SkinningSystem::State::readBackUpTo(std::uint64_t completedFrame) {
  FrameSlot* newest = nullptr;
  FrameSlot* newestResults = nullptr;
  const auto isNewer = [](const FrameSlot& slot, const FrameSlot* than) {
    return than == nullptr || slot.frame > than->frame;
  };
  for (FrameSlot& slot : slots) {
    if (slot.frame == 0 || slot.frame > completedFrame) continue;
    if (slot.frame > gpuStatistics.frame && isNewer(slot, newest)) newest = &slot;
    if (slot.frame > latestResultsFrame && slot.resultCount != 0 && isNewer(slot, newestResults))
      newestResults = &slot;
  }
  if (newest != nullptr) readStatistics(*newest);
  if (newestResults == nullptr) return;
  latestResults.resize(newestResults->resultCount);
  std::memcpy(latestResults.data(),
              newestResults->readBack.bytes().data() + sizeof(abi::CounterRecord),
              newestResults->resultCount * sizeof(InstanceResult));
  latestResultsFrame = newestResults->frame;
}

void SkinningSystem::State::readStatistics(const FrameSlot& slot) {
  gpuStatistics = {};
  gpuStatistics.frame = slot.frame;
  if (slot.hasTimestamps)
    gpuStatistics.seconds = timestamps.seconds(static_cast<std::uint32_t>(&slot - slots.data()));
  if (!slot.hasCounters) return;
  abi::CounterRecord counted;
  std::memcpy(&counted, slot.readBack.bytes().data(), sizeof(counted));
  gpuStatistics.visibleInstances = counted.visible;
  gpuStatistics.skinnedInstances = counted.skinned;
  gpuStatistics.settledInstances = counted.settled;
  gpuStatistics.workgroups = counted.workgroups;
}

Result<std::optional<Box>> SkinningSystem::bounds(InstanceHandle handle) const {
  const Result<InstanceOutput> known = state_->scene.output(handle);
  if (!known) return known.error();
  const SceneInstance& instance = *state_->scene.instances().find(handle);
  if (!instance.bounds || instance.firstFrame == 0 ||
      instance.firstFrame > state_->latestResultsFrame)
    return std::optional<Box>();
  return state_->latestResults[instance.extras.result].box();
}

}  // namespace dermis::vulkan
