// glTF files made in memory, for the tests: JSON to change at will, and one buffer that grows.
#pragma once

#include <dermis/gltf.h>
#include <gtest/gtest.h>

#include <cstddef>
#include <cstdint>
#include <cstring>
#include <nlohmann/json.hpp>
#include <span>
#include <string>
#include <vector>

namespace dermis::test {

using Json = nlohmann::json;

// componentType, as numbers in the file.
inline constexpr int byteType = 5120, unsignedByteType = 5121, shortType = 5122,
                     unsignedShortType = 5123, unsignedIntType = 5125, floatType = 5126;

std::string encodeBase64(std::span<const std::byte> bytes);

template <typename T>
std::vector<std::byte> bytesOf(const std::vector<T>& values) {
  std::vector<std::byte> bytes(values.size() * sizeof(T));
  std::memcpy(bytes.data(), values.data(), bytes.size());
  return bytes;
}

inline std::vector<std::byte> bytesOf(const std::string& text) {
  return bytesOf(std::vector<char>(text.begin(), text.end()));
}

class FileBuilder {
 public:
  Json json = {{"asset", {{"version", "2.0"}}}};
  std::vector<std::byte> binary;

  /// Appends bytes to the buffer at a multiple of 4, and makes a bufferView of them.
  std::size_t addView(const std::vector<std::byte>& bytes);

  std::size_t addAccessor(Json accessor);

  /// A bufferView of its own for the values, and an accessor for all of it.
  template <typename T>
  std::size_t add(const std::vector<T>& values, const char* type, int componentType,
                  bool normalized = false) {
    return addStored(bytesOf(values), values.size(), type, componentType, normalized);
  }

  std::size_t addFloats(const std::vector<float>& values, const char* type) {
    return add(values, type, floatType);
  }

  Json& attributes();
  Json& primitive();
  Json& accessor(const char* attribute);

  /// The JSON text with the buffer as a data URI.
  std::string text() const;
  /// Writes `text` and returns the path.
  std::string writtenTo(const std::string& path) const;

  /// A GLB file with the buffer as its binary chunk.
  std::vector<std::byte> glb() const;

  Result<gltf::Model> load(const std::filesystem::path& folder = {},
                           const gltf::LoadOptions& options = {}) const;

 private:
  std::size_t addStored(const std::vector<std::byte>& bytes, std::size_t components,
                        const char* type, int componentType, bool normalized);
};

/// Node 0: a mesh of one triangle with skin 0. Nodes 1 and 2: its joints, 2 a child of 1, at y = 1.
FileBuilder skinnedTriangle();

/// The model, or a failed expectation and an empty one.
gltf::Model loaded(const Result<gltf::Model>& result);

gltf::Model loaded(const FileBuilder& file);

/// The first primitive of mesh 0.
gltf::Primitive firstPrimitive(const gltf::Model& model);

/// Joints or weights as the file stores them, component by component.
template <typename T>
std::vector<T> componentsOf(const std::vector<std::byte>& bytes) {
  std::vector<T> components(bytes.size() / sizeof(T));
  std::memcpy(components.data(), bytes.data(), components.size() * sizeof(T));
  return components;
}

/// The only set of influences of a primitive.
gltf::Influences onlySet(const gltf::Primitive& primitive);

/// Expects an error of this kind whose sentence contains the text.
void expectError(const Result<gltf::Model>& result, ErrorCode code, const std::string& text);

void expectInvalid(const FileBuilder& file, const std::string& text);

/// Expects that the file is used with a note that contains the text, and refused with that sentence
/// where strict. Returns the model.
gltf::Model expectNoted(const FileBuilder& file, const std::string& text);
gltf::Model expectNoted(const std::vector<std::byte>& bytes, const std::string& text);

/// Whether one of the notes contains the text.
bool hasNote(const gltf::Model& model, const std::string& text);

}  // namespace dermis::test
