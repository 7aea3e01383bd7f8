// How much memory a file may make a program take: one count for all that is made of it.
#pragma once

#include <cstdint>

namespace dermis::gltf {

/// 64 MiB plus 64 times the bytes of the file and of all files that it names, each counted once.
/// Every allocation is spent before it is made and never given back. So the budget bounds the time
/// that a file takes, too.
class MemoryBudget {
 public:
  static constexpr std::uint64_t base = std::uint64_t{64} << 20;
  static constexpr std::uint64_t perByte = 64;

  /// Adds what a file of `bytes` bytes justifies. Call it once for each file.
  void addFile(std::uint64_t bytes) { left_ += saturated(bytes, perByte); }

  /// Spends `count` times `bytesEach`. Returns false and spends nothing if less is left; the caller
  /// must then not allocate.
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
