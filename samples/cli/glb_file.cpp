#include "glb_file.h"

#include <bit>
#include <limits>
#include <string>

namespace dermis::samples {
namespace {

static_assert(std::endian::native == std::endian::little, "glTF buffers are little-endian");

constexpr std::size_t padded(std::size_t size) {
  return (size + 3) / 4 * 4;
}

void putWord(std::vector<std::byte>& bytes, std::size_t value) {
  for (unsigned byte = 0; byte < 4; ++byte) {
    bytes.push_back(static_cast<std::byte>((value >> (8U * byte)) & 0xFFU));
  }
}

void putChunk(std::vector<std::byte>& file, std::size_t type, std::span<const std::byte> content,
              char padding) {
  putWord(file, padded(content.size()));
  putWord(file, type);
  file.insert(file.end(), content.begin(), content.end());
  while (file.size() % 4 != 0) file.push_back(static_cast<std::byte>(padding));
}

}  // namespace

void GlbBuffer::begin() {
  bytes_.resize(padded(bytes_.size()));
  start_ = bytes_.size();
}

void GlbBuffer::put(std::uint32_t value, int byteCount) {
  for (int byte = 0; byte < byteCount; ++byte) {
    bytes_.push_back(static_cast<std::byte>((value >> (8 * byte)) & 0xFFU));
  }
}

void GlbBuffer::putFloat(float value) {
  put(std::bit_cast<std::uint32_t>(value), 4);
}

void GlbBuffer::putFloats(std::span<const float> values) {
  const std::span<const std::byte> stored = std::as_bytes(values);
  bytes_.insert(bytes_.end(), stored.begin(), stored.end());
}

int GlbBuffer::end(GlbComponent component, const char* type, std::size_t count, GlbTarget target) {
  Json view = {{"buffer", 0}, {"byteOffset", start_}, {"byteLength", bytes_.size() - start_}};
  if (target != GlbTarget::none) view["target"] = static_cast<int>(target);
  views_.push_back(view);
  accessors_.push_back({{"bufferView", views_.size() - 1},
                        {"componentType", static_cast<int>(component)},
                        {"count", count},
                        {"type", type}});
  return static_cast<int>(accessors_.size()) - 1;
}

std::vector<std::byte> glbFile(nlohmann::ordered_json document, const GlbBuffer& buffer) {
  document["accessors"] = buffer.accessors();
  document["bufferViews"] = buffer.views();
  document["buffers"] =
      nlohmann::ordered_json::array({{{"byteLength", padded(buffer.bytes().size())}}});
  const std::string text =
      document.dump(-1, ' ', false, nlohmann::ordered_json::error_handler_t::replace);

  constexpr std::size_t magic = 0x46546C67U;        // "glTF"
  constexpr std::size_t jsonChunk = 0x4E4F534AU;    // "JSON"
  constexpr std::size_t binaryChunk = 0x004E4942U;  // "BIN\0"
  constexpr std::size_t headerSize = 12;
  constexpr std::size_t chunkHeaderSize = 8;
  const std::size_t size =
      headerSize + 2 * chunkHeaderSize + padded(text.size()) + padded(buffer.bytes().size());
  if (size > std::numeric_limits<std::uint32_t>::max()) return {};

  std::vector<std::byte> file;
  file.reserve(size);
  putWord(file, magic);
  putWord(file, 2);
  putWord(file, size);
  putChunk(file, jsonChunk, std::as_bytes(std::span(text)), ' ');
  putChunk(file, binaryChunk, buffer.bytes(), '\0');
  return file;
}

}  // namespace dermis::samples
