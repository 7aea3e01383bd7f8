// Room in the buffers of a scene, and how they grow.

#include <algorithm>
#include <numeric>
#include <string>

#include "system/books.h"

namespace dermis {
namespace {

constexpr std::uint64_t leastJoints = 256;  ///< of a pose buffer

/// All sizes that one store has a part in. An output may be larger than a storage buffer range.
void setSize(PlanSizes& sizes, BufferRole role, std::uint64_t units) {
  switch (role) {
    case BufferRole::meshes:
      sizes.meshes = units;
      break;
    case BufferRole::palettes:
      sizes.palettes = units * unitBytes;
      break;
    case BufferRole::results:
      sizes.results = static_cast<std::uint32_t>(units);
      break;
    default:
      sizes.outputs = OutputSizes::oneBuffer(units);
  }
}

}  // namespace

PlanSizes SceneBooks::sizes() const {
  PlanSizes sizes;
  sizes.isScene = true;
  sizes.slots = static_cast<std::uint32_t>(slotCapacity_);
  for (const Store* store : {&meshStore_, &unitStore_, &outputStore_, &resultStore_})
    setSize(sizes, store->role, store->ranges.capacity());
  return sizes;
}

Result<void> SceneBooks::growBuffer(BufferRole role, const PlanSizes& sizes,
                                    std::uint32_t poseBuffer) {
  const GrowthCallback& growth = description_.growth;
  return growth.grow(growth.user,
                     {role, sizes.requirement(role, 0, description_.limits), poseBuffer});
}

/// Grows to at least `least` units, which are at most the maximum. Doubles the size if possible, so
/// that a scene that grows in small steps copies little.
Result<void> SceneBooks::grow(Store& store, std::uint64_t least) {
  const std::uint64_t twice = store.ranges.capacity() * 2;
  std::uint64_t capacity = std::min(std::max(least, twice), store.capacity.maximum);
  PlanSizes grown = sizes();
  setSize(grown, store.role, capacity);
  Result<void> made = growBuffer(store.role, grown);
  if (!made && capacity > least) {
    capacity = least;
    setSize(grown, store.role, capacity);
    made = growBuffer(store.role, grown);
  }
  if (!made) return made;
  store.ranges.grow(capacity);
  if (store.role != BufferRole::palettes) return {};
  // The larger buffer is empty.
  for (std::uint32_t index = 0; index < poses_.capacity(); ++index) {
    if (!poses_.isUsed(index)) continue;
    for (ScenePose::Form& form : poses_.at(index).forms) form.version = 0;
  }
  return {};
}

/// Nothing if the maximum is too small. Fails if growing does.
Result<std::optional<Range>> SceneBooks::take(Store& store, std::uint64_t size,
                                              std::uint64_t alignment) {
  if (const std::optional<Range> range = store.ranges.allocate(size, alignment)) return range;
  if (size > store.capacity.maximum) return std::optional<Range>();
  // Whole units that the buffer's readers read at once.
  std::uint64_t least = store.ranges.capacityFor(size, alignment);
  if (store.role == BufferRole::meshes) least = (least + 15) / 16 * 16;
  if (least > store.capacity.maximum) return std::optional<Range>();
  if (Result<void> grown = grow(store, least); !grown) return grown.error();
  return store.ranges.allocate(size, alignment);
}

/// The error of a store that has its maximum size and no room.
Error SceneBooks::noRoom(const std::string& what, const Store& store, const char* unit) {
  const RangeAllocator& ranges = store.ranges;
  return {ErrorCode::limitExceeded,
          what + ", but of " + std::to_string(ranges.capacity()) + " " + unit +
              (ranges.capacity() < store.capacity.maximum
                   ? " (maximum " + std::to_string(store.capacity.maximum) + ")"
                   : std::string()) +
              " only " + std::to_string(ranges.capacity() - ranges.used()) +
              " are free; the largest free range has " + std::to_string(ranges.largestFree())};
}

PoseBuffer SceneBooks::poseBuffer(std::uint32_t number) const {
  const PoseStore& store = poseBuffers_[number];
  const bool isCpu = store.writer == PoseWriter::cpu;
  PlanSizes sizes;
  sizes.isScene = true;
  sizes.poses = sizes.gpuPoses = store.joints.capacity() * sizeof(JointMatrix);
  return {store.writer, sizes.requirement(isCpu ? BufferRole::poses : BufferRole::gpuPoses, 0,
                                          description_.limits)};
}

/// Takes `count` consecutive matrices for each slot, and sets `buffer`. Adds a pose buffer if none
/// has room. Returns nothing if the maximum is reached.
Result<std::optional<Range>> SceneBooks::takeJoints(std::uint64_t count, PoseWriter writer,
                                                    std::uint32_t& buffer) {
  const std::uint64_t slots = slotsOf(writer);
  // So that poses that the GPU writes can be bound at their offset.
  const std::uint64_t bound = description_.limits.minStorageBufferOffsetAlignment;
  const std::uint64_t alignment =
      writer == PoseWriter::gpu ? bound / std::gcd(bound, sizeof(JointMatrix)) : 1;
  std::uint64_t total = 0;
  for (buffer = 0; buffer < poseBuffers_.size(); ++buffer) {
    PoseStore& store = poseBuffers_[buffer];
    if (store.writer != writer) continue;
    if (const std::optional<Range> range = store.joints.allocate(count * slots, alignment))
      return range;
    total += store.joints.capacity() / slots;
  }
  const bool isCpu = writer == PoseWriter::cpu;
  const Capacity& capacity = isCpu ? description_.jointCapacity : description_.gpuJointCapacity;
  const std::uint64_t most =
      std::min(largestPoseBuffer(writer), capacity.maximum - std::min(capacity.maximum, total));
  if (count > most) return std::optional<Range>();
  std::uint64_t joints = std::min(std::max({count, total, leastJoints}), most);
  const auto make = [&] {
    PlanSizes added;
    added.isScene = true;
    added.poses = added.gpuPoses = joints * slots * sizeof(JointMatrix);
    return growBuffer(isCpu ? BufferRole::poses : BufferRole::gpuPoses, added, buffer);
  };
  Result<void> made = make();
  if (!made && joints > count) {
    joints = count;
    made = make();
  }
  if (!made) return made.error();
  return poseBuffers_.emplace_back(PoseStore{writer, RangeAllocator(joints * slots)})
      .joints.allocate(count * slots, 1);
}

Error SceneBooks::noJoints(std::size_t poses, std::uint64_t count, PoseWriter writer) const {
  const bool isCpu = writer == PoseWriter::cpu;
  std::uint64_t held = 0, used = 0;
  for (const PoseStore& store : poseBuffers_) {
    if (store.writer != writer) continue;
    held += store.joints.capacity() / slotsOf(writer);
    used += store.joints.used() / slotsOf(writer);
  }
  const Capacity& capacity = isCpu ? description_.jointCapacity : description_.gpuJointCapacity;
  return {ErrorCode::limitExceeded,
          (poses == 1 ? std::string("a pose takes ") : std::to_string(poses) + " poses take ") +
              std::to_string(count) + " joints in one pose buffer, which holds at most " +
              std::to_string(largestPoseBuffer(writer)) + "; all pose buffers that the " +
              (isCpu ? "CPU" : "GPU") + " writes hold " + std::to_string(held) +
              " joints, of which " + std::to_string(used) + " are in use; their maximum is " +
              std::to_string(capacity.maximum)};
}

/// Whether one more instance is below the maximum.
bool SceneBooks::hasSlot() const {
  return instances_.hasHole() || instances_.capacity() < description_.instanceCapacity.maximum;
}

/// Makes room for one more instance. Allocates nothing: the next plan sets the sizes of the history
/// and visibility buffers.
void SceneBooks::makeSlot() {
  if (instances_.hasHole() || instances_.capacity() < slotCapacity_) return;
  slotCapacity_ = std::min(std::max<std::uint64_t>(slotCapacity_ * 2, 16),
                           description_.instanceCapacity.maximum);
}

}  // namespace dermis
