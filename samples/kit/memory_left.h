// What a program makes from a model counts against `gltf::Model::memoryLeft`.
#pragma once

#include <cstdint>

namespace dermis::samples {

/// Subtracts `count` × `bytesEach` bytes from `left`. If less is left, it returns false and
/// subtracts nothing; the caller must then not allocate.
[[nodiscard]] inline bool spend(std::uint64_t& left, std::uint64_t count,
                                std::uint64_t bytesEach = 1) {
  if (bytesEach != 0 && count > left / bytesEach) return false;
  left -= count * bytesEach;
  return true;
}

}  // namespace dermis::samples
