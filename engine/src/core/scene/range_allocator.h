// Allocates ranges of a buffer.
#pragma once

#include <cstddef>
#include <cstdint>
#include <map>
#include <optional>
#include <set>
#include <utility>
#include <vector>

#include "dermis/result.h"

namespace dermis {

/// A part of a buffer, in whatever unit the allocator counts.
struct Range {
  std::uint64_t offset = 0;
  std::uint64_t size = 0;

  std::uint64_t end() const { return offset + size; }
  friend bool operator==(const Range&, const Range&) = default;
};

/// Allocates ranges of [0, capacity); the capacity may grow. All functions take O(a log g), for g
/// gaps and a alignments: of the alignments in use, the last `maxAlignments` have an index of their
/// own. Only an allocation with another one looks at all gaps, to index them.
class DERMIS_CORE_API RangeAllocator {
 public:
  static constexpr std::size_t maxAlignments = 32;

  /// `base`: alignments count from this number of units before the first one.
  explicit RangeAllocator(std::uint64_t capacity = 0, std::uint64_t base = 0);

  /// The smallest gap that holds `size` at a multiple of `alignment`, which need not be a power of
  /// two; nothing if there is none. `size` is not 0.
  std::optional<Range> allocate(std::uint64_t size, std::uint64_t alignment);
  void free(const Range& range);

  /// For ranges that move towards the beginning, the last one first: `allocate` among the gaps
  /// before `end`, where a range begins; and whether one of these is large enough, if alignments
  /// did not matter. `end` must descend from call to call: gaps after it are put aside until
  /// `endMoves`, so that each is looked at once.
  std::optional<Range> allocateBelow(std::uint64_t size, std::uint64_t alignment,
                                     std::uint64_t end);
  bool hasBelow(std::uint64_t size, std::uint64_t end);
  void endMoves();

  /// The smallest capacity with which `allocate` finds a range at the end.
  std::uint64_t capacityFor(std::uint64_t size, std::uint64_t alignment) const;
  /// `capacity` is larger than now.
  void grow(std::uint64_t capacity);

  std::uint64_t capacity() const { return capacity_; }
  std::uint64_t used() const { return used_; }
  std::uint64_t largestFree() const;
  std::uint64_t visitedGaps() const { return visitedGaps_; }  ///< for tests: by all calls so far

 private:
  using Gaps = std::map<std::uint64_t, std::uint64_t>;  // size by offset
  /// The gaps by what is left of them behind the first multiple of the alignment.
  struct Index {
    using Entry = std::pair<std::uint64_t, std::uint64_t>;  // usable size, offset

    std::uint64_t alignment = 1;
    std::set<Entry> gaps;
    std::vector<Entry> aside;  ///< until `endMoves`
  };

  std::uint64_t usable(const Index& index, const Gaps::value_type& gap) const;
  Index& indexOf(std::uint64_t alignment);
  Gaps::iterator findBelow(Index& index, std::uint64_t size, std::uint64_t end);
  Range take(Gaps::iterator gap, std::uint64_t offset, std::uint64_t size);
  void addGap(std::uint64_t offset, std::uint64_t size);
  void removeGap(Gaps::iterator gap);

  std::uint64_t aligned(std::uint64_t offset, std::uint64_t alignment) const;

  std::uint64_t capacity_;
  std::uint64_t base_;
  std::uint64_t used_ = 0;
  Gaps gaps_;
  std::vector<Index> indices_{1};  ///< the first has the alignment 1
  std::size_t nextIndex_ = 0;      ///< to be replaced, if there are as many as may be
  std::uint64_t visitedGaps_ = 0;
};

}  // namespace dermis
