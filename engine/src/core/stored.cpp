#include "stored.h"

#include <bit>
#include <cstring>

namespace dermis {
namespace {

constexpr std::size_t checksumWord = 2, countWord = 3;

}  // namespace

std::uint32_t checksumOf(std::span<const std::uint32_t> words) {
  std::uint32_t hash = 2166136261u;
  for (const std::uint32_t word : words.subspan(checksumWord + 1))
    hash = std::rotl((hash ^ word) * 16777619u, 15);
  return hash;
}

Error StoredKind::damaged(const std::string& what) const {
  return {ErrorCode::invalidData, name + (": " + what)};
}

Result<void> StoredKind::check(std::span<const std::uint32_t> words) const {
  if (words.size() < headerWords || words[0] != magic)
    return damaged("the bytes do not begin with its header");
  if (words[1] != version) {
    return Error{ErrorCode::unsupportedVersion,
                 std::string(name) + ": version " + std::to_string(words[1]) +
                     ", but this library reads version " + std::to_string(version)};
  }
  if (words[countWord] != words.size()) {
    return damaged("there are " + std::to_string(words.size() * 4) +
                   " bytes, but the header says " +
                   std::to_string(std::uint64_t{words[countWord]} * 4));
  }
  if (words[checksumWord] != checksumOf(words)) return damaged("the checksum does not match");
  return {};
}

Result<std::vector<std::uint32_t>> StoredKind::wordsOf(std::span<const std::byte> bytes) const {
  if (bytes.size() % 4 != 0)
    return damaged("there are " + std::to_string(bytes.size()) + " bytes, no multiple of 4");
  std::vector<std::uint32_t> words(bytes.size() / 4);
  if (!bytes.empty()) std::memcpy(words.data(), bytes.data(), bytes.size());
  if (Result<void> good = check(words); !good) return good.error();
  return words;
}

void finishStored(std::span<std::uint32_t> words) {
  words[countWord] = static_cast<std::uint32_t>(words.size());
  words[checksumWord] = checksumOf(words);
}

}  // namespace dermis
