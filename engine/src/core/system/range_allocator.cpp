#include "system/range_allocator.h"

#include <iterator>

namespace dermis {

RangeAllocator::RangeAllocator(std::uint64_t capacity, std::uint64_t base)
    : capacity_(capacity), base_(base) {
  if (capacity != 0) addGap(0, capacity);
}

std::uint64_t RangeAllocator::aligned(std::uint64_t offset, std::uint64_t alignment) const {
  const std::uint64_t over = (base_ + offset) % alignment;
  return over == 0 ? offset : offset + alignment - over;
}

void RangeAllocator::addGap(std::uint64_t offset, std::uint64_t size) {
  gaps_.emplace(offset, size);
  bySize_.emplace(size, offset);
}

void RangeAllocator::removeGap(Gaps::iterator gap) {
  bySize_.erase({gap->second, gap->first});
  gaps_.erase(gap);
}

/// What an alignment leaves before the range stays a gap.
Range RangeAllocator::take(Gaps::iterator gap, std::uint64_t offset, std::uint64_t size) {
  const auto [gapOffset, gapSize] = *gap;
  removeGap(gap);
  if (offset > gapOffset) addGap(gapOffset, offset - gapOffset);
  const std::uint64_t end = offset + size, gapEnd = gapOffset + gapSize;
  if (end < gapEnd) addGap(end, gapEnd - end);
  used_ += size;
  return {offset, size};
}

std::optional<Range> RangeAllocator::allocate(std::uint64_t size, std::uint64_t alignment) {
  for (auto entry = bySize_.lower_bound({size, 0}); entry != bySize_.end(); ++entry) {
    const auto [gapSize, gapOffset] = *entry;
    const std::uint64_t offset = aligned(gapOffset, alignment);
    if (offset - gapOffset <= gapSize - size) return take(gaps_.find(gapOffset), offset, size);
  }
  return std::nullopt;
}

std::optional<Range> RangeAllocator::allocateBelow(std::uint64_t size, std::uint64_t alignment,
                                                   std::uint64_t end) {
  for (auto gap = gaps_.begin(); gap != gaps_.end() && gap->first + size <= end; ++gap) {
    const std::uint64_t offset = aligned(gap->first, alignment);
    if (offset + size <= end && gap->second >= size && offset - gap->first <= gap->second - size)
      return take(gap, offset, size);
  }
  return std::nullopt;
}

void RangeAllocator::free(const Range& range) {
  std::uint64_t offset = range.offset, size = range.size;
  used_ -= size;
  const auto next = gaps_.lower_bound(offset);
  if (next != gaps_.begin()) {
    const auto before = std::prev(next);
    if (before->first + before->second == offset) {
      offset = before->first;
      size += before->second;
      removeGap(before);
    }
  }
  const auto after = gaps_.find(range.end());
  if (after != gaps_.end()) {
    size += after->second;
    removeGap(after);
  }
  addGap(offset, size);
}

std::uint64_t RangeAllocator::capacityFor(std::uint64_t size, std::uint64_t alignment) const {
  std::uint64_t begin = capacity_;
  if (!gaps_.empty()) {
    const auto& [offset, gapSize] = *gaps_.rbegin();
    if (offset + gapSize == capacity_) begin = offset;
  }
  return aligned(begin, alignment) + size;
}

void RangeAllocator::grow(std::uint64_t capacity) {
  const Range added{capacity_, capacity - capacity_};
  capacity_ = capacity;
  used_ += added.size;
  free(added);
}

std::uint64_t RangeAllocator::largestFree() const {
  return bySize_.empty() ? 0 : bySize_.rbegin()->first;
}

}  // namespace dermis
