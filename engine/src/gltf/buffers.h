// The bytes of the buffers that a file names: in its binary chunk, in data URIs, in files beside
// it.
#pragma once

#include <cstddef>
#include <filesystem>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "gltf/document.h"

namespace dermis::gltf {

/// One buffer. `bytes` points into `storage` or into the file itself.
struct Buffer {
  std::uint64_t byteLength = 0;
  /// As many as `byteLength` says, or none: a file may name a buffer without saying where it is, as
  /// long as nobody reads it.
  std::span<const std::byte> bytes;
  std::vector<std::byte> storage;
};

/// Fetches them all. `folder` empty: no side files. Throws `Failure`: `ioError` where a file cannot
/// be read or lies outside the folder, `invalidData` where a buffer has fewer bytes than it says.
std::vector<Buffer> loadBuffers(const std::vector<BufferDescription>& descriptions,
                                std::optional<std::span<const std::byte>> binaryChunk,
                                const std::filesystem::path& folder);

/// The bytes of a data URI (RFC 2397), base64 or percent-encoded. `where` names it in messages.
std::vector<std::byte> decodeDataUri(std::string_view uri, const std::string& where);

/// At most `limit` bytes of a file that a relative URI names. Throws `Failure` with `ioError` where
/// it is outside the folder, or cannot be read.
std::vector<std::byte> loadSideFile(std::string_view uri, std::uint64_t limit,
                                    const std::filesystem::path& folder, const std::string& where);

/// `%20` to a space and so on. Throws `Failure` where a '%' is not followed by two hexadecimal
/// digits.
std::string decodePercent(std::string_view text, const std::string& where);

/// At most `limit` bytes of a file. Throws `Failure` with `ioError`.
std::vector<std::byte> readFile(const std::filesystem::path& path, std::uint64_t limit,
                                const std::string& where);

}  // namespace dermis::gltf
