#include "gltf/container.h"

#include <cstdint>
#include <cstring>

#include "gltf/failure.h"
#include "gltf/notes.h"

namespace dermis::gltf {
namespace {

constexpr std::size_t headerSize = containerStart;
constexpr std::size_t chunkHeaderSize = 8;
constexpr std::uint32_t magicNumber = 0x46546c67;  // "glTF"
constexpr std::uint32_t jsonChunk = 0x4e4f534a;    // "JSON"
constexpr std::uint32_t binaryChunk = 0x004e4942;  // "BIN"

std::uint32_t readWord(std::span<const std::byte> bytes, std::size_t offset) {
  std::uint32_t word = 0;
  for (std::size_t i = 0; i < 4; ++i) {
    word |= std::to_integer<std::uint32_t>(bytes[offset + i]) << (8 * i);
  }
  return word;
}

std::string_view asText(std::span<const std::byte> bytes) {
  return {reinterpret_cast<const char*>(bytes.data()), bytes.size()};
}

bool isGlb(std::span<const std::byte> bytes) {
  return bytes.size() >= 4 && readWord(bytes, 0) == magicNumber;
}

// Returns how many of the file's `size` bytes belong to the container.
std::uint32_t checkHeader(std::span<const std::byte> bytes, std::uint64_t size) {
  if (bytes.size() < headerSize) {
    failInvalid("the GLB header is truncated: ", bytes.size(), " bytes instead of ", headerSize);
  }
  const std::uint32_t version = readWord(bytes, 4);
  if (version != 2) {
    fail(ErrorCode::unsupportedFeature,
         join("the GLB header says version ", version, "; only version 2 is supported"));
  }
  const std::uint32_t length = readWord(bytes, 8);
  if (length > size || length < headerSize)
    failInvalid("the GLB header says ", length, " bytes, but the file has ", size);
  return length;
}

void takeChunk(std::size_t chunk, std::uint32_t type, std::span<const std::byte> content,
               Container& container, Notes& notes) {
  const bool hasJson = container.json.data() != nullptr;
  if (type == jsonChunk) {
    if (hasJson) failInvalid("GLB chunk ", chunk, " is a second JSON chunk");
    container.json = asText(content);
  } else if (type == binaryChunk) {
    if (container.binaryChunk) {
      failInvalid("GLB chunk ", chunk, " is binary data, which only the second chunk may be");
    }
    if (chunk != 1) {
      notes.broken(NoteKind::container, "GLB chunk ", chunk,
                   " is binary data, which only the second chunk may be");
    }
    container.binaryChunk = content;
  } else if (chunk == 0) {
    notes.broken(NoteKind::container, "the first GLB chunk is not JSON");
  }
  // Chunks of other types belong to extensions and are skipped, as the specification requires.
}

}  // namespace

void checkStart(std::span<const std::byte> start, std::uint64_t size) {
  if (isGlb(start)) {
    checkHeader(start, size);
    return;
  }
  std::string_view text = asText(start);
  if (text.starts_with("\xef\xbb\xbf")) text.remove_prefix(3);  // a byte order mark
  const std::size_t first = text.find_first_not_of(" \t\r\n");
  if (first == std::string_view::npos || text[first] == '{') return;
  failInvalid("the JSON text is invalid at byte ", text.data() + first - asText(start).data() + 1);
}

Container openContainer(std::span<const std::byte> bytes, Notes& notes) {
  if (bytes.empty()) failInvalid("the file is empty");
  if (!isGlb(bytes)) return {asText(bytes), std::nullopt};

  const std::uint32_t size = checkHeader(bytes, bytes.size());
  if (size < bytes.size()) {
    notes.remark(NoteKind::restOfFile, "the GLB header says ", size, " bytes, but the file has ",
                 bytes.size());
    bytes = bytes.first(size);
  }
  Container container;
  std::size_t offset = headerSize;
  for (std::size_t chunk = 0; offset < bytes.size(); ++chunk) {
    if (bytes.size() - offset < chunkHeaderSize) {
      failInvalid("the header of GLB chunk ", chunk, " at byte ", offset, " is truncated");
    }
    const std::uint32_t length = readWord(bytes, offset);
    const std::uint32_t type = readWord(bytes, offset + 4);
    offset += chunkHeaderSize;
    if (length > bytes.size() - offset) {
      failInvalid("GLB chunk ", chunk, " at byte ", offset - chunkHeaderSize, " says ", length,
                  " bytes, but only ", bytes.size() - offset, " are left in the file");
    }
    if (length % 4 != 0) {
      notes.broken(NoteKind::container, "the length of GLB chunk ", chunk, ", ", length,
                   ", is not a multiple of 4");
    }
    takeChunk(chunk, type, bytes.subspan(offset, length), container, notes);
    offset += length;
  }
  if (container.json.data() == nullptr) failInvalid("the GLB file has no JSON chunk");
  return container;
}

}  // namespace dermis::gltf
