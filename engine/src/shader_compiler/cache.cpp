#include "shader_compiler/cache.h"

#include <cstddef>
#include <cstdio>
#include <optional>
#include <string_view>
#include <system_error>

#include "shader_compiler/file_io.h"
#include "shader_compiler/hash.h"

namespace dermis {
namespace {

// An entry is little-endian words, whatever the machine:
//   magic, version, key (4 words), length of the module in words, checksum (2 words), module
// The checksum covers all that stands before it, and the module.
constexpr std::string_view magic = "DSKC";
constexpr std::uint32_t formatVersion = 2;
constexpr std::size_t checksumOffset = 28;
constexpr std::size_t headerSize = 36;
constexpr std::size_t wordSize = 4;

void appendWord(std::string& bytes, std::uint32_t word) {
  for (std::uint32_t shift = 0; shift < 32; shift += 8) {
    bytes.push_back(static_cast<char>((word >> shift) & 0xff));
  }
}

void appendDoubleWord(std::string& bytes, std::uint64_t value) {
  appendWord(bytes, static_cast<std::uint32_t>(value));
  appendWord(bytes, static_cast<std::uint32_t>(value >> 32));
}

std::uint32_t wordAt(std::string_view bytes, std::size_t offset) {
  std::uint32_t word = 0;
  for (std::size_t index = 0; index < wordSize; ++index) {
    const auto byte = static_cast<unsigned char>(bytes[offset + index]);
    word |= static_cast<std::uint32_t>(byte) << (8 * index);
  }
  return word;
}

std::uint64_t doubleWordAt(std::string_view bytes, std::size_t offset) {
  return wordAt(bytes, offset) | static_cast<std::uint64_t>(wordAt(bytes, offset + wordSize)) << 32;
}

std::uint64_t checksumOf(std::string_view headerBeforeChecksum, std::string_view module) {
  Hash64 hash;
  hash.add(headerBeforeChecksum);
  hash.add(module);
  return hash.value();
}

std::string encodeEntry(const CacheKey& key, std::span<const std::uint32_t> words) {
  std::string header(magic);
  appendWord(header, formatVersion);
  for (const std::uint64_t lane : key) appendDoubleWord(header, lane);
  appendWord(header, static_cast<std::uint32_t>(words.size()));
  std::string module;
  module.reserve(words.size() * wordSize);
  for (const std::uint32_t word : words) appendWord(module, word);
  const std::uint64_t checksum = checksumOf(header, module);
  appendDoubleWord(header, checksum);
  return header + module;
}

// What is wrong with an entry; null if nothing is.
const char* findDamage(std::string_view bytes, const CacheKey& key) {
  if (bytes.size() < headerSize || !bytes.starts_with(magic)) return "has no header";
  if (wordAt(bytes, 4) != formatVersion) return "has another version of the cache's format";
  if (doubleWordAt(bytes, 8) != key[0] || doubleWordAt(bytes, 16) != key[1]) {
    return "belongs to another shader";
  }
  const std::size_t moduleSize = std::size_t{wordAt(bytes, 24)} * wordSize;
  if (moduleSize == 0 || bytes.size() - headerSize != moduleSize) return "has a wrong length";
  const std::uint64_t checksum =
      checksumOf(bytes.substr(0, checksumOffset), bytes.substr(headerSize));
  return checksum == doubleWordAt(bytes, checksumOffset) ? nullptr : "has a wrong checksum";
}

std::vector<std::uint32_t> decodeModule(std::string_view bytes) {
  std::vector<std::uint32_t> words;
  words.reserve((bytes.size() - headerSize) / wordSize);
  for (std::size_t offset = headerSize; offset < bytes.size(); offset += wordSize) {
    words.push_back(wordAt(bytes, offset));
  }
  return words;
}

}  // namespace

CacheLookup Cache::load(const CacheKey& key) const {
  const std::filesystem::path path = pathOf(key);
  std::error_code failure;
  if (!std::filesystem::exists(path, failure)) return {};
  const std::optional<std::string> bytes = readFile(path);
  if (!bytes) return {{}, "cache entry '" + path.string() + "' cannot be read"};
  const char* damage = findDamage(*bytes, key);
  if (damage == nullptr) return {decodeModule(*bytes), {}};
  std::filesystem::remove(path, failure);
  return {{}, "cache entry '" + path.string() + "' " + damage + " and was deleted"};
}

Result<void> Cache::store(const CacheKey& key, std::span<const std::uint32_t> words) const {
  std::error_code failure;
  std::filesystem::create_directories(folder_, failure);
  if (failure) {
    return Error{ErrorCode::ioError,
                 "cannot create the cache folder '" + folder_.string() + "': " + failure.message()};
  }
  return writeFileAtomically(pathOf(key), encodeEntry(key, words));
}

std::filesystem::path Cache::pathOf(const CacheKey& key) const {
  std::array<char, 40> name;
  const int length = std::snprintf(name.data(), name.size(), "%016llx%016llx.spvc",
                                   static_cast<unsigned long long>(key[0]),
                                   static_cast<unsigned long long>(key[1]));
  return folder_ / std::string_view(name.data(), static_cast<std::size_t>(length));
}

}  // namespace dermis
