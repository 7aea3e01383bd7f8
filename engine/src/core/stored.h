// What all stored data of this library begins with: packed meshes, clips and rigs, joint bounds.
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <string>
#include <vector>

#include "dermis/result.h"

namespace dermis {

/// Checksum of all words after the checksum itself: the step of FNV-1a, rotated by 15 bits, since
/// multiplication carries changes upwards only. Each step is a bijection, so any single damaged
/// word is detected.
std::uint32_t checksumOf(std::span<const std::uint32_t> words);

/// One kind of stored data. The first words of its header: magic, version, checksum, word count.
struct StoredKind {
  const char* name;
  std::uint32_t magic, version;
  std::size_t headerWords;

  Error damaged(const std::string& what) const;
  /// Checks the version, the length and the checksum.
  Result<void> check(std::span<const std::uint32_t> words) const;
  /// Copies the bytes, and checks the words.
  Result<std::vector<std::uint32_t>> wordsOf(std::span<const std::byte> bytes) const;
};

/// Sets the word count and the checksum of complete data.
void finishStored(std::span<std::uint32_t> words);

}  // namespace dermis
