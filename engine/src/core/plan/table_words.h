// The tables of a plan, while they are written.
#pragma once

#include <algorithm>
#include <array>
#include <cstddef>
#include <cstdint>
#include <cstring>
#include <span>
#include <vector>

namespace dermis {

/// Words, in memory that the caller lent, or in memory of their own if that is too small. They are
/// written, and read only to move them: lent memory may be a mapping that is slow to read.
class TableWords {
 public:
  /// Forgets all words. Those that follow are written to `lent`.
  void begin(std::span<std::byte> lent) {
    memory_ = lent.empty() ? std::span(own_) : lent;
    size_ = 0;
  }
  std::uint32_t size() const { return static_cast<std::uint32_t>(size_); }
  std::span<const std::byte> bytes() const { return memory_.first(size_ * wordBytes); }

  /// Adds words for the caller to write, all of them. Returns the first.
  std::uint32_t grow(std::size_t count) {
    const std::size_t first = size_;
    size_ += count;
    if (size_ * wordBytes > memory_.size()) move(first);
    return static_cast<std::uint32_t>(first);
  }
  std::uint32_t appendZeros(std::size_t count) {
    const std::uint32_t first = grow(count);
    std::fill_n(at(first, count), count * wordBytes, std::byte{0});
    return first;
  }
  /// Appends zeros up to a multiple of four words, at which records begin.
  void alignToUnit() { appendZeros((4 - size_ % 4) % 4); }
  template <typename Record>
  std::uint32_t append(const Record& record) {
    const std::uint32_t first = grow(sizeof(Record) / wordBytes);
    store(first, record);
    return first;
  }
  template <typename Record>
  std::uint32_t appendAll(const std::vector<Record>& records) {
    const std::size_t count = records.size() * (sizeof(Record) / wordBytes);
    const std::uint32_t first = grow(count);
    if (count != 0) std::memcpy(at(first, count), records.data(), count * wordBytes);
    return first;
  }
  template <typename Record>
  void store(std::size_t first, const Record& record) {
    std::memcpy(at(first, sizeof(Record) / wordBytes), &record, sizeof(Record));
  }
  template <std::size_t count>
  void storeWords(std::size_t first, const std::array<std::uint32_t, count>& words) {
    std::byte* const to = at(first, count);
    for (std::size_t k = 0; k < count; ++k) std::memcpy(to + k * wordBytes, &words[k], wordBytes);
  }

 private:
  static constexpr std::size_t wordBytes = sizeof(std::uint32_t);

  std::byte* at(std::size_t first, std::size_t count) {
    return memory_.subspan(first * wordBytes, count * wordBytes).data();
  }
  /// Moves the first words to own memory, and makes that large enough.
  void move(std::size_t count) {
    const std::size_t needed = size_ * wordBytes;
    std::vector<std::byte> larger(own_.size() < needed ? std::max(needed, 2 * own_.size()) : 0);
    std::vector<std::byte>& room = larger.empty() ? own_ : larger;  // then the words were lent
    if (count != 0) std::memcpy(room.data(), memory_.data(), count * wordBytes);
    if (!larger.empty()) own_.swap(larger);
    memory_ = own_;
  }

  std::vector<std::byte> own_;
  std::span<std::byte> memory_;
  std::size_t size_ = 0;  ///< words
};

}  // namespace dermis
