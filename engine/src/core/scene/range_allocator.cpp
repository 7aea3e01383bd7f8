#include "scene/range_allocator.h"

#include <algorithm>
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

/// 0 if the gap ends before it.
std::uint64_t RangeAllocator::usable(const Index& index, const Gaps::value_type& gap) const {
  const std::uint64_t lost = aligned(gap.first, index.alignment) - gap.first;
  return gap.second - std::min(gap.second, lost);
}

void RangeAllocator::addGap(std::uint64_t offset, std::uint64_t size) {
  const auto gap = gaps_.emplace(offset, size).first;
  for (Index& index : indices_) {
    if (const std::uint64_t left = usable(index, *gap); left != 0) index.gaps.emplace(left, offset);
  }
}

void RangeAllocator::removeGap(Gaps::iterator gap) {
  for (Index& index : indices_) index.gaps.erase({usable(index, *gap), gap->first});
  gaps_.erase(gap);
}

RangeAllocator::Index& RangeAllocator::indexOf(std::uint64_t alignment) {
  const auto found = std::ranges::find(indices_, alignment, &Index::alignment);
  if (found != indices_.end()) return *found;
  const bool isFull = indices_.size() == maxAlignments;
  nextIndex_ = isFull ? nextIndex_ % (maxAlignments - 1) + 1 : indices_.size();
  Index& index = isFull ? indices_[nextIndex_] : indices_.emplace_back();
  index.alignment = alignment;
  index.gaps.clear();
  index.aside.clear();
  for (const Gaps::value_type& gap : gaps_) {
    if (const std::uint64_t left = usable(index, gap); left != 0)
      index.gaps.emplace(left, gap.first);
  }
  visitedGaps_ += gaps_.size();
  return index;
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
  return allocateBelow(size, alignment, capacity_);
}

RangeAllocator::Gaps::iterator RangeAllocator::findBelow(Index& index, std::uint64_t size,
                                                         std::uint64_t end) {
  if (gaps_.empty() || gaps_.begin()->first >= end) return gaps_.end();
  auto entry = index.gaps.lower_bound({size, 0});
  while (entry != index.gaps.end()) {
    ++visitedGaps_;
    if (entry->second < end) return gaps_.find(entry->second);
    index.aside.push_back(*entry);
    entry = index.gaps.erase(entry);
  }
  return gaps_.end();
}

std::optional<Range> RangeAllocator::allocateBelow(std::uint64_t size, std::uint64_t alignment,
                                                   std::uint64_t end) {
  const auto gap = findBelow(indexOf(alignment), size, end);
  if (gap == gaps_.end()) return std::nullopt;
  return take(gap, aligned(gap->first, alignment), size);
}

bool RangeAllocator::hasBelow(std::uint64_t size, std::uint64_t end) {
  return findBelow(indices_.front(), size, end) != gaps_.end();
}

void RangeAllocator::endMoves() {
  for (Index& index : indices_) {
    for (const Index::Entry& entry : index.aside) {
      const auto gap = gaps_.find(entry.second);
      // What has become another gap is in all indices.
      if (gap != gaps_.end() && usable(index, *gap) == entry.first) index.gaps.insert(entry);
    }
    index.aside.clear();
  }
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
  const auto& gaps = indices_.front().gaps;
  return gaps.empty() ? 0 : gaps.rbegin()->first;
}

}  // namespace dermis
