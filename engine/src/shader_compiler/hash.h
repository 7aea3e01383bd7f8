// Hashes for the cache: against accidents, not against an attacker.
#pragma once

#include <array>
#include <bit>
#include <cstdint>
#include <string_view>

namespace dermis {

/// 64-bit FNV-1a (http://www.isthe.com/chongo/tech/comp/fnv/).
class Hash64 {
 public:
  void add(std::string_view bytes) {
    for (const char byte : bytes) {
      state_ = (state_ ^ static_cast<unsigned char>(byte)) * 0x00000100000001b3u;
    }
  }
  std::uint64_t value() const { return state_; }

 private:
  std::uint64_t state_ = 0xcbf29ce484222325u;
};

/// Two lanes of 64 bits that mix differently. Each field is preceded by its length, so that "ab",
/// "c" is not "a", "bc".
class Hash128 {
 public:
  void add(std::string_view field) {
    addWord(field.size());
    first_.add(field);
    for (const char byte : field) mixSecond(static_cast<unsigned char>(byte));
  }

  void addWord(std::uint64_t word) {
    std::array<char, 8> bytes;
    for (char& byte : bytes) {
      byte = static_cast<char>(word & 0xff);
      word >>= 8;
    }
    first_.add({bytes.data(), bytes.size()});
    for (const char byte : bytes) mixSecond(static_cast<unsigned char>(byte));
  }

  std::array<std::uint64_t, 2> value() const { return {first_.value(), second_}; }

 private:
  // An odd multiplier without structure (2^64 divided by the golden ratio), and a rotation that
  // brings high bits back down, which FNV never does.
  void mixSecond(std::uint64_t byte) {
    second_ = std::rotl((second_ + byte) * 0x9e3779b97f4a7c15u, 29);
  }

  Hash64 first_;
  std::uint64_t second_ = 0x6a09e667f3bcc908u;
};

}  // namespace dermis
