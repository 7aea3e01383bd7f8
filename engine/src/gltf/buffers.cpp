#include "gltf/buffers.h"

#include <algorithm>
#include <cstdint>
#include <map>
#include <utility>

#include "gltf/failure.h"
#include "gltf/notes.h"

namespace dermis::gltf {
namespace {

constexpr std::uint8_t notADigit = 0xff;

bool isSpace(char character) {
  return std::string_view(" \t\n\f\r").find(character) != std::string_view::npos;
}

std::uint8_t base64Digit(char character) {
  if (character >= 'A' && character <= 'Z') return static_cast<std::uint8_t>(character - 'A');
  if (character >= 'a' && character <= 'z') return static_cast<std::uint8_t>(character - 'a' + 26);
  if (character >= '0' && character <= '9') return static_cast<std::uint8_t>(character - '0' + 52);
  // Also accepts the URL-safe alphabet of RFC 4648.
  if (character == '+' || character == '-') return 62;
  if (character == '/' || character == '_') return 63;
  return notADigit;
}

std::vector<std::byte> decodeBase64(std::string_view text, const std::string& where) {
  for (int padding = 0; !text.empty() && (isSpace(text.back()) || text.back() == '=');) {
    if (text.back() == '=' && ++padding > 2) break;
    text.remove_suffix(1);
  }
  std::vector<std::byte> bytes;
  bytes.reserve(text.size() * 3 / 4);
  std::uint32_t bits = 0;
  std::uint32_t bitCount = 0;
  for (std::size_t i = 0; i < text.size(); ++i) {
    if (isSpace(text[i])) continue;
    const std::uint8_t digit = base64Digit(text[i]);
    if (digit == notADigit) failInvalid(where, ": character ", i, " of its data URI is not base64");
    bits = (bits << 6 | digit) & 0xffff;
    bitCount += 6;
    if (bitCount < 8) continue;
    bitCount -= 8;
    bytes.push_back(static_cast<std::byte>(bits >> bitCount & 0xff));
  }
  if (bitCount == 6) failInvalid(where, ": the base64 text of its data URI is truncated");
  return bytes;
}

// Of the ASCII letters, the lower case.
std::string lowerCase(std::string_view text) {
  std::string lower(text);
  for (char& letter : lower) {
    if (letter >= 'A' && letter <= 'Z') letter = static_cast<char>(letter - 'A' + 'a');
  }
  return lower;
}

// A buffer may be shorter than its byteLength. The bytes that an accessor needs must exist.
std::uint64_t lengthOf(const BufferDescription& description, std::uint64_t there,
                       const std::string& where, Notes& notes) {
  if (there >= description.byteLength) return description.byteLength;
  notes.broken(NoteKind::bufferLength, where, ": byteLength is ", description.byteLength,
               ", but there are only ", there, " bytes");
  return there;
}

// Buffers in side files. Each file is read once, as far as its longest buffer needs.
class SideBuffers {
 public:
  explicit SideBuffers(SideFiles& files) : files_(files) {}

  void find(std::size_t buffer, const BufferDescription& description, const std::string& where) {
    FileToRead file = files_.find(*description.uri, where);
    std::uint64_t& needed = needed_[file.path];
    needed = std::max(needed, std::min(description.byteLength, file.size));
    found_.emplace(buffer, std::move(file));
  }

  Bytes read(std::size_t buffer, const std::string& where) {
    const FileToRead& file = found_.at(buffer);
    return files_.read(file, needed_.at(file.path), where);
  }

 private:
  SideFiles& files_;
  std::map<std::size_t, FileToRead> found_;  // keyed by buffer
  std::map<std::filesystem::path, std::uint64_t> needed_;
};

}  // namespace

std::span<const std::byte> bytesIn(const std::vector<Buffer>& buffers, std::size_t buffer,
                                   std::uint64_t byteOffset, std::uint64_t byteLength,
                                   const std::string& where) {
  const std::uint64_t size = buffer < buffers.size() ? buffers[buffer].bytes.size() : 0;
  const std::uint64_t end = byteOffset + byteLength;
  if (end > size) {
    failInvalid(where, ": the compressed bytes ", byteOffset, " to ", end, " are outside buffer ",
                buffer, " of ", size, " bytes");
  }
  return buffers[buffer].bytes.subspan(static_cast<std::size_t>(byteOffset),
                                       static_cast<std::size_t>(byteLength));
}

bool isDataUri(std::string_view uri) {
  return lowerCase(uri.substr(0, 5)) == "data:";
}

std::vector<std::byte> decodeDataUri(std::string_view uri, const std::string& where) {
  uri = uri.substr(0, uri.find('#'));
  const std::size_t comma = uri.find(',');
  if (comma == std::string_view::npos) failInvalid(where, ": its data URI has no comma");
  std::string_view header = uri.substr(0, comma);
  while (isSpace(header.back())) header.remove_suffix(1);
  constexpr std::string_view base64 = ";base64";
  const std::string text = decodePercent(uri.substr(comma + 1), where);
  if (lowerCase(header.substr(header.size() - std::min(header.size(), base64.size()))) == base64)
    return decodeBase64(text, where);

  std::vector<std::byte> bytes(text.size());
  std::transform(text.begin(), text.end(), bytes.begin(),
                 [](char character) { return static_cast<std::byte>(character); });
  return bytes;
}

std::vector<Buffer> loadBuffers(const Document& document,
                                std::optional<std::span<const std::byte>> binaryChunk,
                                SideFiles& files, MemoryBudget& budget, Notes& notes) {
  const std::vector<BufferDescription>& descriptions = document.buffers;
  std::vector<bool> isLost(descriptions.size());
  // A buffer that nothing skinned uses may fail.
  const auto attempt = [&](std::size_t i, auto function) {
    if (!notes.tolerateUnlessUsed(document.usage.buffers[i], function)) isLost[i] = true;
  };
  SideBuffers side(files);
  for (std::size_t i = 0; i < descriptions.size(); ++i) {
    const std::optional<std::string>& uri = descriptions[i].uri;
    if (uri && !isDataUri(*uri))
      attempt(i, [&] { side.find(i, descriptions[i], join("buffer ", i)); });
  }
  std::vector<Buffer> buffers(descriptions.size());
  for (std::size_t i = 0; i < descriptions.size(); ++i) {
    const BufferDescription& description = descriptions[i];
    const std::string where = join("buffer ", i);
    Buffer& buffer = buffers[i];
    buffer.byteLength = description.byteLength;
    if (isLost[i]) continue;
    attempt(i, [&] {
      if (description.uri && isDataUri(*description.uri)) {
        spend(budget, description.uri->size(), 2, where);
        buffer.storage =
            std::make_shared<const std::vector<std::byte>>(decodeDataUri(*description.uri, where));
      } else if (description.uri) {
        buffer.storage = side.read(i, where);
      }
      if (buffer.storage != nullptr) {
        buffer.bytes = *buffer.storage;
      } else if (i == 0 && binaryChunk) {
        buffer.bytes = *binaryChunk;  // Only the first buffer may be the binary chunk.
      } else {
        return;
      }
      buffer.byteLength = lengthOf(description, buffer.bytes.size(), where, notes);
      buffer.bytes = buffer.bytes.first(static_cast<std::size_t>(buffer.byteLength));
    });
  }
  return buffers;
}

}  // namespace dermis::gltf
