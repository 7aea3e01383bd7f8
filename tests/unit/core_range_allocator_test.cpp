// Ranges of a buffer: none overlaps another, none is lost.

#include "system/range_allocator.h"

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

TEST(RangeAllocator, FindsTheLowestGapBelowAPlace) {
  RangeAllocator allocator(100);
  const Range first = *allocator.allocate(20, 1);
  allocator.allocate(10, 1);
  const Range second = *allocator.allocate(20, 1);
  allocator.allocate(10, 1);
  const Range last = *allocator.allocate(20, 1);
  allocator.free(first);
  allocator.free(second);
  EXPECT_EQ(allocator.allocateBelow(21, 1, last.offset), std::nullopt);
  EXPECT_EQ(allocator.allocateBelow(20, 7, last.offset), (Range{0, 20}));
  EXPECT_EQ(allocator.allocateBelow(20, 1, 49), std::nullopt) << "it would end at 50";
  EXPECT_EQ(allocator.allocateBelow(20, 1, 50), (Range{30, 20}));
}

TEST(RangeAllocator, RandomRangesNeverOverlapAndAllComeBack) {
  std::mt19937 random(7);
  RangeAllocator allocator(10'000);
  std::vector<Range> taken;
  std::uint64_t used = 0;
  for (int step = 0; step < 20'000; ++step) {
    if (random() % 2 == 0 || taken.empty()) {
      const std::uint64_t size = 1 + random() % 400, alignment = 1 + random() % 50;
      const std::optional<Range> range = random() % 4 == 0
                                             ? allocator.allocateBelow(size, alignment, 5000)
                                             : allocator.allocate(size, alignment);
      if (!range) continue;
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
