// Stored blobs that are damaged on purpose: some words are changed, and the checksum is put right.
#pragma once

#include <bit>
#include <cstddef>
#include <cstdint>
#include <cstring>
#include <span>
#include <vector>

#include "abi.h"

namespace dermis::fuzz {

inline std::vector<std::uint32_t> wordsOf(std::span<const std::byte> bytes) {
  std::vector<std::uint32_t> words(bytes.size() / 4);
  if (!words.empty()) std::memcpy(words.data(), bytes.data(), words.size() * 4);
  return words;
}

/// The blob with some of its words changed: a place (2 bytes), a way, and a number.
inline std::vector<std::uint32_t> changedBlob(std::vector<std::uint32_t> words,
                                              std::span<const std::uint8_t> data) {
  for (; data.size() >= 7; data = data.subspan(7)) {
    std::uint32_t& word = words[(data[0] | std::size_t{data[1]} << 8) % words.size()];
    std::uint32_t number;
    std::memcpy(&number, data.data() + 3, 4);
    word = data[2] % 2 == 0 ? number : word + (number % 64 - 32);
  }
  return words;
}

/// The checksum would stop nearly every input: it is put right, so that what lies behind it is
/// attacked.
inline void putChecksumRight(std::vector<std::uint32_t>& words) {
  constexpr std::size_t checksum = offsetof(abi::MeshHeader, checksum) / 4;
  if (words.size() <= checksum) return;
  std::uint32_t hash = 2166136261u;
  for (std::size_t i = checksum + 1; i < words.size(); ++i)
    hash = std::rotl((hash ^ words[i]) * 16777619u, 15);
  words[checksum] = hash;
}

}  // namespace dermis::fuzz
