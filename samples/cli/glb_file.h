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

/// The use of a bufferView.
enum class GlbTarget : int { none = 0, vertices = 34962, indices = 34963 };

/// Builds the binary chunk of a file, and the bufferViews and accessors that describe it. Each
/// accessor has its own bufferView, which begins at a multiple of 4 bytes.
class GlbBuffer {
 public:
  using Json = nlohmann::ordered_json;

  /// Begins a bufferView. It contains all values that are put before `end`.
  void begin();
  /// Appends the 1 to 4 lowest bytes of the value.
  void put(std::uint32_t value, int byteCount);
  void putFloat(float value);
  void putFloats(std::span<const float> values);
  /// Ends the bufferView. Returns the index of an accessor for its `count` elements. `type` is
  /// "SCALAR", "VEC3", …
  int end(GlbComponent component, const char* type, std::size_t count, GlbTarget target);

  /// An accessor, to which min, max or normalized can be added.
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

/// Returns the bytes of the file. `document` has everything except accessors, bufferViews and
/// buffers, which are added. Invalid UTF-8 in names is replaced. Empty if the file would be larger
/// than 4 GiB, the maximum of the format.
std::vector<std::byte> glbFile(nlohmann::ordered_json document, const GlbBuffer& buffer);

}  // namespace dermis::samples
