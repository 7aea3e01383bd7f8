// The buffers of a scene: room in them, how they grow, and when they are released.

#include <algorithm>
#include <numeric>
#include <string>
#include <utility>

#include "scene/books.h"

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
      sizes.outputs.fill(units);
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

Result<SceneBufferMemory> SceneBooks::create(BufferRole role, const BufferRequirement& needed) {
  const bool isMapped = role == BufferRole::poses || role == BufferRole::readBack;
  const Result<void*> made =
      owner_.createBuffer(owner_.user, {nextBuffer_, role, needed, isMapped});
  if (!made) return made.error();
  return SceneBufferMemory{nextBuffer_++, needed.size,
                           isMapped ? static_cast<std::byte*>(*made) : nullptr};
}

/// Those that exist from the beginning.
Result<void> SceneBooks::createFirstBuffers() {
  for (Store* store : {&meshStore_, &unitStore_, &outputStore_, &resultStore_}) {
    const BufferRequirement needed = sizes().requirement(store->role, 0, limits_);
    if (needed.size == 0) continue;
    const Result<SceneBufferMemory> made = create(store->role, needed);
    if (!made) return made.error();
    store->buffer.now = *made;
  }
  output_ = outputStore_.buffer.now.number;
  for (const bool writtenByGpu : {false, true}) {
    const std::uint64_t joints = jointCapacity(writtenByGpu).initial;
    if (joints == 0) continue;
    if (Result<void> added = addPoseBuffer(writtenByGpu, joints); !added) return added;
  }
  return {};
}

Result<void> SceneBooks::addPoseBuffer(bool writtenByGpu, std::uint64_t joints) {
  const BufferRole role = writtenByGpu ? BufferRole::gpuPoses : BufferRole::poses;
  joints *= slotsOf(writtenByGpu);
  PlanSizes added;
  added.isScene = true;
  added.poses = added.gpuPoses = joints * sizeof(JointMatrix);
  const Result<SceneBufferMemory> made = create(role, added.requirement(role, 0, limits_));
  if (!made) return made.error();
  PoseStore& store =
      poseBuffers_.emplace_back(PoseStore{writtenByGpu, RangeAllocator(joints), *made, {}});
  if (!writtenByGpu && made->mapped == nullptr)
    store.staged.resize(static_cast<std::size_t>(joints));
  return {};
}

/// The contents of the old buffer are copied by the next frame, unless it never got any.
void SceneBooks::replace(GrowingBuffer& buffer, const SceneBufferMemory& larger) {
  if (buffer.before.exists()) {
    owner_.releaseBuffer(owner_.user, buffer.now.number);
  } else {
    buffer.before = buffer.now;
  }
  buffer.now = larger;
}

void SceneBooks::retire(RangeAllocator& store, const Range& range) {
  retired_.push_back({frame_, &store, range});
  // Ranges that no frame uses, or only complete ones, are free at once.
  freeRetired();
}

/// `isNew`: no frame can have used it.
void SceneBooks::giveBack(RangeAllocator& store, const Range& range, bool isNew) {
  if (isNew) {
    store.free(range);
  } else {
    retire(store, range);
  }
}

void SceneBooks::retire(const SceneBufferMemory& buffer) {
  if (!buffer.exists()) return;
  retiredBuffers_.push_back({frame_, buffer.number});
  freeRetired();
}

void SceneBooks::freeRetired() {
  while (!retired_.empty() && retired_.front().frame <= completed_) {
    retired_.front().store->free(retired_.front().range);
    retired_.pop_front();
  }
  while (!retiredBuffers_.empty() && retiredBuffers_.front().frame <= completed_) {
    owner_.releaseBuffer(owner_.user, retiredBuffers_.front().number);
    retiredBuffers_.pop_front();
  }
}

/// Grows to at least `least` units, which are at most the maximum. Doubles the size if possible, so
/// that a scene that grows in small steps copies little.
Result<void> SceneBooks::grow(Store& store, std::uint64_t least) {
  const std::uint64_t twice = store.ranges.capacity() * 2;
  std::uint64_t capacity = std::min(std::max(least, twice), store.capacity.maximum);
  const auto make = [&] {
    PlanSizes grown = sizes();
    setSize(grown, store.role, capacity);
    return create(store.role, grown.requirement(store.role, 0, limits_));
  };
  Result<SceneBufferMemory> made = make();
  if (!made && capacity > least) {
    capacity = least;
    made = make();
  }
  if (!made) return made.error();
  store.ranges.grow(capacity);
  if (store.role != BufferRole::palettes) {
    replace(store.buffer, *made);
    return {};
  }
  // Poses are converted again.
  retire(std::exchange(store.buffer.now, *made));
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
  if (store.role == BufferRole::positions) least = (least + 3) / 4 * 4;
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

/// Takes `count` consecutive matrices for each slot, and sets `buffer`. Adds a pose buffer if none
/// has room. Returns nothing if the maximum is reached.
Result<std::optional<Range>> SceneBooks::takeJoints(std::uint64_t count, bool writtenByGpu,
                                                    std::uint32_t& buffer) {
  const std::uint64_t slots = slotsOf(writtenByGpu);
  // So that poses that the GPU writes can be bound at their offset.
  const std::uint64_t bound = limits_.minStorageBufferOffsetAlignment;
  const std::uint64_t alignment = writtenByGpu ? bound / std::gcd(bound, sizeof(JointMatrix)) : 1;
  std::uint64_t total = 0;
  for (buffer = 0; buffer < poseBuffers_.size(); ++buffer) {
    PoseStore& store = poseBuffers_[buffer];
    if (store.writtenByGpu != writtenByGpu) continue;
    if (const std::optional<Range> range = store.joints.allocate(count * slots, alignment))
      return range;
    total += store.joints.capacity() / slots;
  }
  const Capacity& capacity = jointCapacity(writtenByGpu);
  const std::uint64_t most = std::min(largestPoseBuffer(writtenByGpu),
                                      capacity.maximum - std::min(capacity.maximum, total));
  if (count > most) return std::optional<Range>();
  const std::uint64_t joints = std::min(std::max({count, total, leastJoints}), most);
  Result<void> made = addPoseBuffer(writtenByGpu, joints);
  if (!made && joints > count) made = addPoseBuffer(writtenByGpu, count);
  if (!made) return made.error();
  return poseBuffers_.back().joints.allocate(count * slots, 1);
}

Error SceneBooks::noJoints(std::size_t poses, std::uint64_t count, bool writtenByGpu) const {
  std::uint64_t held = 0, used = 0;
  for (const PoseStore& store : poseBuffers_) {
    if (store.writtenByGpu != writtenByGpu) continue;
    held += store.joints.capacity() / slotsOf(writtenByGpu);
    used += store.joints.used() / slotsOf(writtenByGpu);
  }
  const Capacity& capacity = jointCapacity(writtenByGpu);
  return {ErrorCode::limitExceeded,
          (poses == 1 ? std::string("a pose takes ") : std::to_string(poses) + " poses take ") +
              std::to_string(count) + " joints in one pose buffer, which holds at most " +
              std::to_string(largestPoseBuffer(writtenByGpu)) + "; all pose buffers that the " +
              (writtenByGpu ? "GPU" : "CPU") + " writes hold " + std::to_string(held) +
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

/// The buffers whose size depends on the frame. Those that are too small are replaced.
Result<void> SceneBooks::makeFrameBuffers(const PlanData& plan) {
  constexpr std::uint64_t leastTables = 4096;
  const auto make = [this](SceneBufferMemory& buffer, BufferRole role,
                           const BufferRequirement& needed) -> Result<void> {
    const Result<SceneBufferMemory> made = create(role, needed);
    if (!made) return made.error();
    retire(std::exchange(buffer, *made));
    return {};
  };
  const std::uint64_t used = plan.tables.bytes().size();
  if (tables_.size < used) {
    std::uint64_t size = std::max(tables_.size, leastTables);
    while (size < used) size *= 2;
    size = std::min(size, limits_.maxStorageBufferRange & ~std::uint64_t{3});
    if (Result<void> made = make(tables_, BufferRole::tables,
                                 sizes().requirement(BufferRole::tables, size, limits_));
        !made)
      return made;
  }
  const bool culls = !work_.culled.empty();
  if (culls) {
    const BufferRequirement needed = sizes().requirement(BufferRole::history, 0, limits_);
    if (history_.now.size < needed.size) {
      const Result<SceneBufferMemory> made = create(BufferRole::history, needed);
      if (!made) return made.error();
      replace(history_, *made);
    }
  }
  if (!culls && resultCopies_.empty()) return {};
  SceneBufferMemory& back = nextReadBack().buffer;  // the frame that used it last is complete
  BufferRequirement needed = sizes().requirement(BufferRole::readBack, 0, limits_);
  needed.size += historyCopy_.size;
  return back.size < needed.size ? make(back, BufferRole::readBack, needed) : Result<void>();
}

/// What the next frame uses.
void SceneBooks::nameBuffers() {
  PlanBuffers& buffers = buffers_;
  const auto name = [&](BufferRole role, const SceneBufferMemory& buffer) {
    buffers[role] = {buffer.number, 0, buffer.size};
  };
  for (const Store* store : {&meshStore_, &unitStore_, &outputStore_, &resultStore_})
    name(store->role, store->buffer.now);
  for (const BufferRole role :
       {BufferRole::normals, BufferRole::tangents, BufferRole::previousPositions})
    buffers[role] = buffers[BufferRole::positions];
  name(BufferRole::tables, tables_);
  name(BufferRole::history, history_.now);
  name(BufferRole::readBack, nextReadBack().buffer);
  buffers[BufferRole::visibility] = {visibilityBuffer, 0, slotCapacity_ * 4};
  buffers.poses.clear();
  for (const PoseStore& store : poseBuffers_)
    buffers.poses.push_back({store.buffer.number, 0, store.buffer.size});
}

}  // namespace dermis
