// Ranges of a buffer: none overlaps another, none is lost.

#include "scene/range_allocator.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <random>
#include <vector>

namespace dermis::test {
namespace {

TEST(RangeAllocator, GivesAllOfItsCapacityAndNoMore) {
  RangeAllocator allocator(100);
  EXPECT_EQ(allocator.allocate(60, 1), (Range{0, 60}));
  EXPECT_EQ(allocator.allocate(41, 1), std::nullopt);
  EXPECT_EQ(allocator.allocate(40, 1), (Range{60, 40}));
  EXPECT_EQ(allocator.used(), 100u);
  EXPECT_EQ(allocator.largestFree(), 0u);
}

TEST(RangeAllocator, AlignsToNumbersThatAreNoPowerOfTwo) {
  RangeAllocator allocator(1000);
  ASSERT_EQ(allocator.allocate(10, 1), (Range{0, 10}));
  EXPECT_EQ(allocator.allocate(72, 36), (Range{36, 72}));
  // What the alignment left free is found again.
  EXPECT_EQ(allocator.allocate(26, 1), (Range{10, 26}));
}

TEST(RangeAllocator, AlignmentsCountFromItsBase) {
  RangeAllocator allocator(1000, 16);
  EXPECT_EQ(allocator.allocate(72, 36), (Range{20, 72})) << "36 from the base";
  EXPECT_EQ(allocator.capacityFor(10, 36), 92u + 10);
  EXPECT_EQ(allocator.allocate(36, 36), (Range{92, 36}));
}

TEST(RangeAllocator, GrowsAtItsEnd) {
  RangeAllocator allocator(10);
  const Range first = *allocator.allocate(8, 1);
  EXPECT_EQ(allocator.capacityFor(12, 4), 20u) << "behind the 2 at its end, aligned";
  allocator.grow(allocator.capacityFor(12, 4));
  EXPECT_EQ(allocator.allocate(12, 4), (Range{8, 12}));
  EXPECT_EQ(allocator.used(), 20u);
  allocator.grow(30);
  allocator.free(first);
  EXPECT_EQ(allocator.largestFree(), 10u);
  EXPECT_EQ(allocator.capacityFor(40, 1), 60u);
}

TEST(RangeAllocator, TakesTheSmallestGapThatFits) {
  RangeAllocator allocator(100);
  const Range large = *allocator.allocate(30, 1);
  allocator.allocate(10, 1);
  const Range small = *allocator.allocate(20, 1);
  allocator.allocate(40, 1);
  allocator.free(large);
  allocator.free(small);
  EXPECT_EQ(allocator.allocate(15, 1), (Range{40, 15}));
}

TEST(RangeAllocator, GapsThatMeetBecomeOne) {
  for (const std::vector<int>& order :
       {std::vector{0, 1, 2}, {0, 2, 1}, {1, 0, 2}, {1, 2, 0}, {2, 0, 1}, {2, 1, 0}}) {
    RangeAllocator allocator(90);
    std::vector<Range> ranges;
    for (int i = 0; i < 3; ++i) ranges.push_back(*allocator.allocate(30, 1));
    for (const int index : order) allocator.free(ranges[static_cast<std::size_t>(index)]);
    EXPECT_EQ(allocator.largestFree(), 90u);
  }
}

TEST(RangeAllocator, FindsGapsBelowAPlace) {
  RangeAllocator allocator(100);
  const Range first = *allocator.allocate(20, 1);
  const Range between = *allocator.allocate(10, 1);
  const Range second = *allocator.allocate(20, 1);
  allocator.allocate(10, 1);
  const Range last = *allocator.allocate(15, 1);
  allocator.free(first);
  allocator.free(second);
  EXPECT_TRUE(allocator.hasBelow(20, last.offset));
  EXPECT_FALSE(allocator.hasBelow(21, last.offset)) << "the 25 at the end are above";
  EXPECT_EQ(allocator.allocateBelow(21, 1, last.offset), std::nullopt);
  EXPECT_EQ(allocator.allocateBelow(20, 7, last.offset), (Range{0, 20})) << "the second is at 30";
  EXPECT_EQ(allocator.allocateBelow(20, 1, between.offset), std::nullopt) << "it is above";
  EXPECT_FALSE(allocator.hasBelow(1, between.offset));
  allocator.endMoves();
  EXPECT_EQ(allocator.largestFree(), 25u);
  EXPECT_EQ(allocator.allocate(20, 1), (Range{30, 20}));
  EXPECT_EQ(allocator.allocate(25, 1), (Range{75, 25}));
}

// A scan of all gaps for each range would take seconds in a frame, with tens of thousands of them.
TEST(RangeAllocator, LooksAtFewGaps) {
  constexpr std::uint64_t count = 5000;
  RangeAllocator allocator(count * 108 + 44 * 1000);
  std::vector<Range> small, large;
  for (std::uint64_t index = 0; index < count; ++index) {
    small.push_back(*allocator.allocate(48, 12));
    large.push_back(*allocator.allocate(60, 1));
  }
  for (const Range& range : small) allocator.free(range);
  // 48 bytes hold 44 at few of these places.
  std::uint64_t visited = allocator.visitedGaps();
  for (int index = 0; index < 1000; ++index) ASSERT_TRUE(allocator.allocate(44, 44));
  EXPECT_LE(allocator.visitedGaps() - visited, count + 1 + 1000) << "all once, then one each";
  // No gap holds the large ranges, but for those behind them.
  visited = allocator.visitedGaps();
  const std::uint64_t free = allocator.largestFree();
  for (auto range = large.rbegin(); range != large.rend(); ++range) {
    ASSERT_EQ(allocator.allocateBelow(60, 1, range->offset), std::nullopt);
    ASSERT_FALSE(allocator.hasBelow(60, range->offset));
    ASSERT_TRUE(allocator.hasBelow(1, range->offset));
  }
  allocator.endMoves();
  EXPECT_LE(allocator.visitedGaps() - visited, 3 * count) << "each once, and what each call finds";
  EXPECT_EQ(allocator.largestFree(), free);
}

// As many alignments as have an index, and more of them.
TEST(RangeAllocator, FindsTheOnlyGapOfEveryAlignment) {
  const std::uint64_t most = 3 * RangeAllocator::maxAlignments;
  RangeAllocator allocator(1 << 20);
  std::vector<Range> taken;
  for (int round = 0; round < 3; ++round) {
    for (std::uint64_t alignment = 1; alignment < most; ++alignment) {
      const Range range = *allocator.allocate(alignment, alignment);
      EXPECT_EQ(range.offset % alignment, 0u);
      taken.push_back(range);
      taken.push_back(*allocator.allocate(1, 1));
    }
    // All that is free is at the end; then the only room is where one was.
    for (std::uint64_t alignment = 1; alignment < most; ++alignment) {
      RangeAllocator full = allocator;
      while (full.largestFree() != 0) full.allocate(full.largestFree(), 1);
      const Range& hole = taken[2 * (alignment - 1)];
      full.free(hole);
      EXPECT_EQ(full.allocate(alignment, alignment), hole);
    }
    for (const Range& range : taken) allocator.free(range);
    taken.clear();
  }
}

// Another alignment takes the place of an earlier one, but never of 1.
TEST(RangeAllocator, KnowsItsLargestGapAfterManyAlignments) {
  RangeAllocator allocator(1000);
  ASSERT_EQ(allocator.allocate(1, 1), (Range{0, 1}));
  for (std::uint64_t alignment = 2; alignment < 3 * RangeAllocator::maxAlignments; ++alignment) {
    allocator.free(*allocator.allocate(1, alignment));
    EXPECT_EQ(allocator.largestFree(), 999u) << alignment;
  }
}

/// What is free before `end`.
std::vector<Range> gapsBetween(std::vector<Range> taken, std::uint64_t end) {
  std::ranges::sort(taken, {}, &Range::offset);
  std::vector<Range> gaps;
  std::uint64_t begin = 0;
  for (const Range& range : taken) {
    if (range.offset > end) break;
    gaps.push_back({begin, range.offset - begin});
    begin = range.end();
  }
  if (begin < end) gaps.push_back({begin, end - begin});
  return gaps;
}

TEST(RangeAllocator, RandomRangesNeverOverlapAndAllComeBack) {
  std::mt19937 random(7);
  RangeAllocator allocator(10'000);
  std::vector<Range> taken;
  std::uint64_t used = 0;
  for (int step = 0; step < 20'000; ++step) {
    if (random() % 2 == 0 || taken.empty()) {
      const std::uint64_t size = 1 + random() % 400, alignment = 1 + random() % 50;
      const auto fits = [&](const Range& gap) {
        const std::uint64_t begin = (gap.offset + alignment - 1) / alignment * alignment;
        return begin + size <= gap.end();
      };
      const bool isBelow = random() % 4 == 0 && !taken.empty();
      const std::uint64_t end = isBelow ? taken[random() % taken.size()].offset : 10'000;
      const std::vector<Range> gaps = gapsBetween(taken, end);
      const std::optional<Range> range = isBelow ? allocator.allocateBelow(size, alignment, end)
                                                 : allocator.allocate(size, alignment);
      allocator.endMoves();
      ASSERT_EQ(range.has_value(), std::ranges::any_of(gaps, fits)) << step;
      if (!range) continue;
      ASSERT_LE(range->end(), end);
      ASSERT_EQ(range->size, size);
      ASSERT_EQ(range->offset % alignment, 0u);
      ASSERT_LE(range->end(), 10'000u);
      for (const Range& other : taken)
        ASSERT_TRUE(range->end() <= other.offset || other.end() <= range->offset);
      taken.push_back(*range);
      used += size;
    } else {
      std::swap(taken[random() % taken.size()], taken.back());
      allocator.free(taken.back());
      used -= taken.back().size;
      taken.pop_back();
    }
    ASSERT_EQ(allocator.used(), used);
  }
  for (const Range& range : taken) allocator.free(range);
  EXPECT_EQ(allocator.largestFree(), 10'000u);
}

}  // namespace
}  // namespace dermis::test
