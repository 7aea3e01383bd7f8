// Allocates ranges of a buffer.
#pragma once

#include <cstdint>
#include <map>
#include <optional>
#include <set>
#include <utility>

#include "dermis/export.h"

namespace dermis {

/// A part of a buffer, in whatever unit the allocator counts.
struct Range {
  std::uint64_t offset = 0;
  std::uint64_t size = 0;

  std::uint64_t end() const { return offset + size; }
  friend bool operator==(const Range&, const Range&) = default;
};

/// Allocates ranges of [0, capacity); the capacity may grow. O(log of the number of gaps), unless
/// gaps do not fit because of alignment.
class DERMIS_CORE_API RangeAllocator {
 public:
  /// `base`: alignments count from this number of units before the first one.
  explicit RangeAllocator(std::uint64_t capacity = 0, std::uint64_t base = 0);

  /// The smallest gap that holds `size` at a multiple of `alignment`, which need not be a power of
  /// two; nothing if there is none. `size` is not 0.
  std::optional<Range> allocate(std::uint64_t size, std::uint64_t alignment);
  /// The same in the gap with the lowest offset in which the range ends at or before `end`.
  std::optional<Range> allocateBelow(std::uint64_t size, std::uint64_t alignment,
                                     std::uint64_t end);
  void free(const Range& range);

  /// The smallest capacity with which `allocate` finds a range at the end.
  std::uint64_t capacityFor(std::uint64_t size, std::uint64_t alignment) const;
  /// `capacity` is larger than now.
  void grow(std::uint64_t capacity);

  std::uint64_t capacity() const { return capacity_; }
  std::uint64_t used() const { return used_; }
  std::uint64_t largestFree() const;

 private:
  using Gaps = std::map<std::uint64_t, std::uint64_t>;  // size by offset

  Range take(Gaps::iterator gap, std::uint64_t offset, std::uint64_t size);
  void addGap(std::uint64_t offset, std::uint64_t size);
  void removeGap(Gaps::iterator gap);

  std::uint64_t aligned(std::uint64_t offset, std::uint64_t alignment) const;

  std::uint64_t capacity_;
  std::uint64_t base_;
  std::uint64_t used_ = 0;
  Gaps gaps_;
  std::set<std::pair<std::uint64_t, std::uint64_t>> bySize_;  // size, offset
};

}  // namespace dermis
