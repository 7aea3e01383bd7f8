// Writes the container of binary glTF 2.0, for the sample models and the output of the command.
#pragma once

#include <cstddef>
#include <cstdint>
#include <nlohmann/json.hpp>
#include <span>
#include <vector>

namespace dermis::samples {

enum class GlbComponent : int {
  unsignedByte = 5121,
  unsignedShort = 5123,
  unsignedInt = 5125,
  float32 = 5126
};

/// What a bufferView is for.
enum class GlbTarget : int { none = 0, vertices = 34962, indices = 34963 };

/// Builds the binary chunk of a file, with the bufferViews and accessors that describe it: one
/// bufferView for each accessor, each at a multiple of 4 bytes.
class GlbBuffer {
 public:
  using Json = nlohmann::ordered_json;

  /// Begins a bufferView. Everything that is put before `end` is its contents.
  void begin();
  /// Appends the 1 to 4 lowest bytes of the value.
  void put(std::uint32_t value, int byteCount);
  void putFloat(float value);
  void putFloats(std::span<const float> values);
  /// Ends it, and returns the index of an accessor for `count` elements of it. `type` is "SCALAR",
  /// "VEC3", …
  int end(GlbComponent component, const char* type, std::size_t count, GlbTarget target);

  /// Access to an accessor, to add min, max or normalized.
  Json& accessor(int index) { return accessors_[static_cast<std::size_t>(index)]; }

  const std::vector<std::byte>& bytes() const { return bytes_; }
  const Json& views() const { return views_; }
  const Json& accessors() const { return accessors_; }

 private:
  std::vector<std::byte> bytes_;
  std::size_t start_ = 0;
  Json views_ = Json::array();
  Json accessors_ = Json::array();
};

/// The bytes of the file. `document` is everything but accessors, bufferViews and buffers, which
/// are added. Names that are not UTF-8 are mended. Empty if the file would be larger than the
/// 4 GiB that its header can say.
std::vector<std::byte> glbFile(nlohmann::ordered_json document, const GlbBuffer& buffer);

}  // namespace dermis::samples
