// Limits the memory that a file can make a program use. One budget counts everything that is made
// from the file.
#pragma once

#include <cstdint>

namespace dermis::gltf {

/// 64 MiB, plus 64 times the bytes that are read from the file and from the files that it names.
/// `load` calls `spend` before each allocation. Nothing is given back, so the budget limits the
/// time that a file takes, too.
class MemoryBudget {
 public:
  static constexpr std::uint64_t base = std::uint64_t{64} << 20;  ///< bytes without any file
  static constexpr std::uint64_t perByte = 64;                    ///< bytes for each byte of a file

  explicit MemoryBudget(std::uint64_t left = base) : left_(left) {}

  /// Adds the budget for a file of `bytes` bytes. Call it once for each file.
  void addFile(std::uint64_t bytes) { left_ += saturated(bytes, perByte); }

  /// Spends `count` × `bytesEach` bytes. If less is left, it returns false and spends nothing; the
  /// caller must then not allocate.
  [[nodiscard]] bool spend(std::uint64_t count, std::uint64_t bytesEach = 1) {
    const std::uint64_t bytes = saturated(count, bytesEach);
    if (bytes > left_) return false;
    left_ -= bytes;
    return true;
  }

  /// Bytes that are left.
  std::uint64_t left() const { return left_; }

 private:
  /// The product, but at most 2^62.
  static std::uint64_t saturated(std::uint64_t a, std::uint64_t b) {
    constexpr std::uint64_t most = std::uint64_t{1} << 62;
    return b != 0 && a > most / b ? most : a * b;
  }

  std::uint64_t left_;
};

}  // namespace dermis::gltf
