#include "gltf/buffers.h"

#include <algorithm>
#include <array>
#include <cstdint>
#include <fstream>
#include <system_error>

#include "gltf/failure.h"

namespace dermis::gltf {
namespace {

constexpr std::uint8_t notADigit = 0xff;

std::uint8_t hexadecimalDigit(char character) {
  if (character >= '0' && character <= '9') return static_cast<std::uint8_t>(character - '0');
  if (character >= 'a' && character <= 'f') return static_cast<std::uint8_t>(character - 'a' + 10);
  if (character >= 'A' && character <= 'F') return static_cast<std::uint8_t>(character - 'A' + 10);
  return notADigit;
}

std::uint8_t base64Digit(char character) {
  if (character >= 'A' && character <= 'Z') return static_cast<std::uint8_t>(character - 'A');
  if (character >= 'a' && character <= 'z') return static_cast<std::uint8_t>(character - 'a' + 26);
  if (character >= '0' && character <= '9') return static_cast<std::uint8_t>(character - '0' + 52);
  // The URL-safe alphabet of RFC 4648 too.
  if (character == '+' || character == '-') return 62;
  if (character == '/' || character == '_') return 63;
  return notADigit;
}

std::vector<std::byte> decodeBase64(std::string_view text, const std::string& where) {
  const std::size_t length = text.size();
  while (!text.empty() && text.back() == '=' && length - text.size() < 2) text.remove_suffix(1);
  if (text.size() % 4 == 1) failInvalid(where, ": the base64 text of its data URI is cut off");

  std::vector<std::byte> bytes;
  bytes.reserve(text.size() * 3 / 4);
  std::uint32_t bits = 0;
  std::uint32_t bitCount = 0;
  for (std::size_t i = 0; i < text.size(); ++i) {
    const std::uint8_t digit = base64Digit(text[i]);
    if (digit == notADigit) failInvalid(where, ": character ", i, " of its data URI is not base64");
    bits = (bits << 6 | digit) & 0xffff;
    bitCount += 6;
    if (bitCount < 8) continue;
    bitCount -= 8;
    bytes.push_back(static_cast<std::byte>(bits >> bitCount & 0xff));
  }
  return bytes;
}

// RFC 3986: a scheme is a letter and then letters, digits, '+', '-' or '.', up to a colon.
bool hasScheme(std::string_view uri) {
  const std::size_t colon = uri.find(':');
  return colon != std::string_view::npos && uri.find('/') > colon;
}

// The path of a side file inside the folder, or a failure.
std::filesystem::path sidePath(std::string_view uri, const std::filesystem::path& folder,
                               const std::string& where) {
  if (hasScheme(uri)) {
    fail(ErrorCode::ioError, join(where, ": ", inQuotes(uri), " is not a file beside this one"));
  }
  const std::string text = decodePercent(uri, where);
  const bool hostile = text.empty() || text.find('\0') != std::string::npos ||
                       text.find('\\') != std::string::npos || hasScheme(text);
  const std::filesystem::path relative(std::u8string(text.begin(), text.end()));
  const bool outside = hostile || relative.is_absolute() || relative.has_root_path() ||
                       std::find(relative.begin(), relative.end(), "..") != relative.end();
  if (outside) {
    fail(ErrorCode::ioError,
         join(where, ": ", inQuotes(text), " is outside the file's folder and is not opened"));
  }
  if (folder.empty()) {
    fail(ErrorCode::ioError, join(where, ": ", inQuotes(text), " cannot be read without a folder"));
  }
  return folder / relative;
}

Buffer loadBuffer(const BufferDescription& description,
                  const std::optional<std::span<const std::byte>>& binaryChunk,
                  const std::filesystem::path& folder, const std::string& where) {
  Buffer buffer;
  buffer.byteLength = description.byteLength;
  if (!description.uri) {
    if (!binaryChunk) return buffer;
    buffer.bytes = *binaryChunk;
  } else {
    buffer.storage = description.uri->starts_with("data:")
                         ? decodeDataUri(*description.uri, where)
                         : loadSideFile(*description.uri, description.byteLength, folder, where);
    buffer.bytes = buffer.storage;
  }
  if (buffer.bytes.size() < description.byteLength) {
    failInvalid(where, ": byteLength says ", description.byteLength, " bytes, ",
                buffer.bytes.size(), " are there");
  }
  buffer.bytes = buffer.bytes.first(static_cast<std::size_t>(description.byteLength));
  return buffer;
}

}  // namespace

std::vector<std::byte> loadSideFile(std::string_view uri, std::uint64_t limit,
                                    const std::filesystem::path& folder, const std::string& where) {
  const std::filesystem::path path = sidePath(uri, folder, where);
  std::error_code error;
  // Not a device or a pipe, which might never end.
  if (!std::filesystem::is_regular_file(path, error)) {
    fail(ErrorCode::ioError, join(where, ": there is no file ", inQuotes(path.string())));
  }
  return readFile(path, limit, where);
}

std::string decodePercent(std::string_view text, const std::string& where) {
  std::string decoded;
  decoded.reserve(text.size());
  for (std::size_t i = 0; i < text.size(); ++i) {
    if (text[i] != '%') {
      decoded.push_back(text[i]);
      continue;
    }
    const std::uint8_t high = i + 2 < text.size() ? hexadecimalDigit(text[i + 1]) : notADigit;
    const std::uint8_t low = i + 2 < text.size() ? hexadecimalDigit(text[i + 2]) : notADigit;
    if (high == notADigit || low == notADigit) {
      failInvalid(where, ": character ", i, " of its uri is a '%' without two digits");
    }
    decoded.push_back(static_cast<char>(high << 4 | low));
    i += 2;
  }
  return decoded;
}

std::vector<std::byte> decodeDataUri(std::string_view uri, const std::string& where) {
  const std::size_t comma = uri.find(',');
  if (comma == std::string_view::npos) failInvalid(where, ": its data URI has no comma");
  const std::string_view header = uri.substr(0, comma);
  const std::string_view data = uri.substr(comma + 1);
  if (header.ends_with(";base64")) return decodeBase64(data, where);

  const std::string text = decodePercent(data, where);
  std::vector<std::byte> bytes(text.size());
  std::transform(text.begin(), text.end(), bytes.begin(),
                 [](char character) { return static_cast<std::byte>(character); });
  return bytes;
}

std::vector<std::byte> readFile(const std::filesystem::path& path, std::uint64_t limit,
                                const std::string& where) {
  std::ifstream stream(path, std::ios::binary);
  std::error_code error;
  if (!stream || std::filesystem::is_directory(path, error)) {
    fail(ErrorCode::ioError, join(where, ": ", inQuotes(path.string()), " cannot be opened"));
  }
  // Read in pieces: the number of bytes that a file claims is not to be trusted, and a pipe claims
  // none.
  constexpr std::size_t pieceSize = std::size_t{1} << 20;
  std::vector<std::byte> bytes;
  while (stream && bytes.size() < limit) {
    const std::size_t wanted =
        static_cast<std::size_t>(std::min<std::uint64_t>(pieceSize, limit - bytes.size()));
    const std::size_t start = bytes.size();
    bytes.resize(start + wanted);
    stream.read(reinterpret_cast<char*>(bytes.data() + start),
                static_cast<std::streamsize>(wanted));
    bytes.resize(start + static_cast<std::size_t>(stream.gcount()));
  }
  if (stream.bad()) {
    fail(ErrorCode::ioError, join(where, ": reading ", inQuotes(path.string()), " failed"));
  }
  return bytes;
}

std::vector<Buffer> loadBuffers(const std::vector<BufferDescription>& descriptions,
                                std::optional<std::span<const std::byte>> binaryChunk,
                                const std::filesystem::path& folder) {
  std::vector<Buffer> buffers;
  buffers.reserve(descriptions.size());
  for (std::size_t i = 0; i < descriptions.size(); ++i) {
    // Only the first buffer may be the binary chunk.
    buffers.push_back(loadBuffer(descriptions[i], i == 0 ? binaryChunk : std::nullopt, folder,
                                 join("buffer ", i)));
  }
  return buffers;
}

}  // namespace dermis::gltf
