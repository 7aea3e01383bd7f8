// The outermost layer of a file: a GLB container, or JSON text alone.
#pragma once

#include <cstddef>
#include <cstdint>
#include <optional>
#include <span>
#include <string_view>

namespace dermis::gltf {

class Notes;

/// Views of the file's bytes.
struct Container {
  std::string_view json;
  std::optional<std::span<const std::byte>> binaryChunk;  ///< Of a GLB file that has one.
};

/// Number of bytes that `checkStart` needs from the start of a file.
inline constexpr std::size_t containerStart = 12;

/// Checks the first bytes of a file of `size` bytes. Throws `Failure` if the file cannot be read
/// whatever follows: a GLB header is truncated, does not say version 2, or says fewer bytes than
/// the header or more than the file has; or a text does not begin like a JSON object.
void checkStart(std::span<const std::byte> start, std::uint64_t size);

/// Splits the file: it is GLB if it begins with the magic number, otherwise all of it is JSON.
/// Throws `Failure` if the file is empty, or its GLB header or chunks are invalid. Faults that
/// leave the meaning clear only give notes.
Container openContainer(std::span<const std::byte> bytes, Notes& notes);

}  // namespace dermis::gltf
