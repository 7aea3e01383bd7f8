// How much memory a file may make a program take: one count for all that is made of it.
#pragma once

#include <cstdint>

namespace dermis::gltf {

/// 64 MiB, and 64 times the bytes of the file and of all files that it names, each counted once.
/// What is made is spent before it is made, and never given back: so the time that a file takes is
/// bounded as well, even where memory is used again.
class MemoryBudget {
 public:
  static constexpr std::uint64_t base = std::uint64_t{64} << 20;
  static constexpr std::uint64_t perByte = 64;

  /// A file of so many bytes has been opened.
  void addFile(std::uint64_t bytes) { left_ += saturated(bytes, perByte); }

  /// Spends `count` times `bytesEach`. False where not so much is left: nothing is spent then, and
  /// nothing should be made.
  [[nodiscard]] bool spend(std::uint64_t count, std::uint64_t bytesEach = 1) {
    const std::uint64_t bytes = saturated(count, bytesEach);
    if (bytes > left_) return false;
    left_ -= bytes;
    return true;
  }

  std::uint64_t left() const { return left_; }

 private:
  /// The product; 2^62 where it is larger.
  static std::uint64_t saturated(std::uint64_t a, std::uint64_t b) {
    constexpr std::uint64_t most = std::uint64_t{1} << 62;
    return b != 0 && a > most / b ? most : a * b;
  }

  std::uint64_t left_ = base;
};

}  // namespace dermis::gltf
