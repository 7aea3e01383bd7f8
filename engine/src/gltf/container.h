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

/// Number of bytes at the start of a file that show whether it can be one.
inline constexpr std::size_t containerStart = 12;

/// Checks the first bytes of a file of `size` bytes. Throws `Failure` if the file cannot be read
/// whatever follows: the header of a GLB file disagrees with its size, or a text is not a JSON
/// object.
void checkStart(std::span<const std::byte> start, std::uint64_t size);

/// Splits the file: it is GLB if it begins with the magic number, otherwise all of it is JSON.
/// Throws `Failure` if a GLB header or chunk needs more bytes than there are.
Container openContainer(std::span<const std::byte> bytes, Notes& notes);

}  // namespace dermis::gltf
