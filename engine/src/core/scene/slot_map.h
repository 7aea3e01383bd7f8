// Objects by handle: found in O(1). Handles of removed objects are rejected.
#pragma once

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <string>
#include <utility>
#include <vector>

#include "dermis/result.h"
#include "dermis/scene.h"

namespace dermis {

/// Indices are reused, the last removed one first; generations distinguish their users. The address
/// of an object changes when others are added.
template <typename Thing, typename ThingHandle>
class SlotMap {
 public:
  ThingHandle add(Thing thing) {
    std::uint32_t index;
    if (free_.empty()) {
      index = static_cast<std::uint32_t>(slots_.size());
      slots_.push_back({1, true, std::move(thing)});
    } else {
      index = free_.back();
      free_.pop_back();
      slots_[index].thing = std::move(thing);
      slots_[index].isUsed = true;
    }
    ++size_;
    return {index, slots_[index].generation};
  }

  /// Of a handle that `find` knows.
  void remove(ThingHandle handle) {
    Slot& slot = slots_[handle.index];
    slot.thing = Thing{};
    slot.isUsed = false;
    // After 2^32 - 1 objects a slot is never used again: its generation would be 0 (a null handle)
    // or repeat.
    if (++slot.generation != 0) free_.push_back(handle.index);
    --size_;
  }

  Thing* find(ThingHandle handle) {
    return contains(handle) ? &slots_[handle.index].thing : nullptr;
  }
  const Thing* find(ThingHandle handle) const {
    return contains(handle) ? &slots_[handle.index].thing : nullptr;
  }

  bool contains(ThingHandle handle) const {
    return handle.index < slots_.size() && slots_[handle.index].isUsed &&
           slots_[handle.index].generation == handle.generation;
  }

  /// Of an index that is used.
  Thing& at(std::uint32_t index) { return slots_[index].thing; }
  const Thing& at(std::uint32_t index) const { return slots_[index].thing; }
  ThingHandle handleOf(std::uint32_t index) const { return {index, slots_[index].generation}; }
  bool isUsed(std::uint32_t index) const { return slots_[index].isUsed; }

  std::uint32_t size() const { return size_; }
  /// Whether the next thing gets an index that another had.
  bool hasHole() const { return !free_.empty(); }
  /// Larger than every index so far.
  std::uint32_t capacity() const { return static_cast<std::uint32_t>(slots_.size()); }

  /// Fetches the first cache lines of what `find` and `at` will soon be asked for.
  void prefetch(std::uint32_t index, std::size_t most) const {
#if defined(__GNUC__)
    if (index >= slots_.size()) return;
    const auto* const bytes = reinterpret_cast<const char*>(&slots_[index]);
    const std::size_t lines = std::min(sizeof(Slot) / alignof(Slot), most);
    for (std::size_t line = 0; line < lines; ++line)
      __builtin_prefetch(bytes + line * alignof(Slot));
#else
    static_cast<void>(index);
    static_cast<void>(most);
#endif
  }

 private:
  struct alignas(64) Slot {  // a cache line
    std::uint32_t generation = 1;
    bool isUsed = false;
    Thing thing;
  };
  std::vector<Slot> slots_;
  std::vector<std::uint32_t> free_;
  std::uint32_t size_ = 0;
};

/// `kind` is "mesh", "pose", "instance", "clips" or "figure".
template <typename Thing>
Error unknownHandle(const char* kind, Handle<Thing> handle) {
  if (!handle) return {ErrorCode::invalidArgument, std::string("the ") + kind + " handle is null"};
  return {ErrorCode::invalidArgument, "there is no " + std::string(kind) + " " +
                                          std::to_string(handle.index) + " of generation " +
                                          std::to_string(handle.generation) +
                                          "; it was removed, or belongs to another system"};
}

/// `kind` as for `unknownHandle`, `user` is "instance" or "figure".
inline Error isUsed(const char* kind, std::uint32_t index, std::uint32_t users,
                    const char* user = "instance") {
  return {ErrorCode::invalidArgument, std::string(kind) + " " + std::to_string(index) +
                                          " is used by " + std::to_string(users) + " " + user +
                                          (users == 1 ? "" : "s")};
}

}  // namespace dermis
