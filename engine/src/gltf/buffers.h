// The bytes of a file's buffers: from its binary chunk, from data URIs, and from side files.
#pragma once

#include <cstddef>
#include <cstdint>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "gltf/document.h"
#include "gltf/files.h"

namespace dermis::gltf {

/// One buffer. `bytes` points into `storage` or into the file itself.
struct Buffer {
  std::uint64_t byteLength = 0;
  /// `byteLength` bytes, or empty: a buffer that no accessor reads may have no data.
  std::span<const std::byte> bytes;
  Bytes storage;  ///< shared by the buffers of one side file; null in the binary chunk
};

/// Loads all buffers. Throws `Failure`: `ioError` if a file cannot be read or lies outside the
/// folder, `invalidData` if a data URI is malformed, or `limitExceeded`. A buffer that nothing
/// skinned uses may fail, and a buffer may be shorter than its byteLength; each gives a note.
std::vector<Buffer> loadBuffers(const Document& document,
                                std::optional<std::span<const std::byte>> binaryChunk,
                                SideFiles& files, MemoryBudget& budget, Notes& notes);

/// A range of bytes in a buffer. Throws `Failure` if the buffer does not have them. No sum of
/// offset and length may overflow.
std::span<const std::byte> bytesIn(const std::vector<Buffer>& buffers, std::size_t buffer,
                                   std::uint64_t byteOffset, std::uint64_t byteLength,
                                   const std::string& where);

/// Whether this is a data URI, in any case: "DATA:" too.
bool isDataUri(std::string_view uri);

/// The bytes of a data URI (RFC 2397), base64 or percent-encoded. As in browsers, names ignore
/// case, base64 may be percent-encoded and contain white space, and a fragment is left out. Takes
/// memory of up to twice the length of the URI. `where` names it in messages.
std::vector<std::byte> decodeDataUri(std::string_view uri, const std::string& where);

}  // namespace dermis::gltf
