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

inline std::string encodeBase64(std::span<const std::byte> bytes) {
  const char* digits = "ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789+/";
  std::string text;
  for (std::size_t i = 0; i < bytes.size(); i += 3) {
    std::uint32_t bits = 0;
    for (std::size_t j = 0; j < 3; ++j) {
      bits = bits << 8 | (i + j < bytes.size() ? std::to_integer<std::uint32_t>(bytes[i + j]) : 0u);
    }
    for (std::size_t j = 0; j < 4; ++j) {
      text += i + j > bytes.size() ? '=' : digits[bits >> (18 - 6 * j) & 63];
    }
  }
  return text;
}

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
  std::size_t addView(const std::vector<std::byte>& bytes) {
    binary.resize((binary.size() + 3) / 4 * 4);
    json["bufferViews"].push_back(
        {{"buffer", 0}, {"byteOffset", binary.size()}, {"byteLength", bytes.size()}});
    binary.insert(binary.end(), bytes.begin(), bytes.end());
    return json["bufferViews"].size() - 1;
  }

  std::size_t addAccessor(Json accessor) {
    json["accessors"].push_back(std::move(accessor));
    return json["accessors"].size() - 1;
  }

  /// A bufferView of its own for the values, and an accessor for all of it.
  template <typename T>
  std::size_t add(const std::vector<T>& values, const char* type, int componentType,
                  bool normalized = false) {
    const std::string name = type;
    const std::size_t width = name == "SCALAR" ? 1
                              : name == "VEC2" ? 2
                              : name == "VEC3" ? 3
                              : name == "VEC4" ? 4
                                               : 16;
    Json accessor = {{"bufferView", addView(bytesOf(values))},
                     {"componentType", componentType},
                     {"count", values.size() / width},
                     {"type", type}};
    if (normalized) accessor["normalized"] = true;
    return addAccessor(std::move(accessor));
  }

  std::size_t addFloats(const std::vector<float>& values, const char* type) {
    return add(values, type, floatType);
  }

  Json& attributes() { return json["meshes"][0]["primitives"][0]["attributes"]; }
  Json& primitive() { return json["meshes"][0]["primitives"][0]; }
  Json& accessor(const char* attribute) {
    return json["accessors"][attributes()[attribute].get<std::size_t>()];
  }

  /// The JSON text with the buffer as a data URI.
  std::string text() const {
    Json file = json;
    if (!binary.empty() && !file.contains("buffers")) {
      file["buffers"] = {{{"byteLength", binary.size()},
                          {"uri", "data:application/octet-stream;base64," + encodeBase64(binary)}}};
    }
    return file.dump();
  }

  /// A GLB file with the buffer as its binary chunk.
  std::vector<std::byte> glb() const {
    Json file = json;
    if (!binary.empty()) file["buffers"] = {{{"byteLength", binary.size()}}};
    std::string text = file.dump();
    text.resize((text.size() + 3) / 4 * 4, ' ');
    std::vector<std::byte> chunk = binary;
    chunk.resize((chunk.size() + 3) / 4 * 4);
    std::vector<std::byte> bytes;
    const auto word = [&](std::size_t value) {
      for (int i = 0; i < 4; ++i) bytes.push_back(static_cast<std::byte>(value >> (8 * i) & 0xff));
    };
    word(0x46546c67);
    word(2);
    word(12 + 8 + text.size() + (chunk.empty() ? 0 : 8 + chunk.size()));
    word(text.size());
    word(0x4e4f534a);
    for (const char character : text) bytes.push_back(static_cast<std::byte>(character));
    if (!chunk.empty()) {
      word(chunk.size());
      word(0x004e4942);
      bytes.insert(bytes.end(), chunk.begin(), chunk.end());
    }
    return bytes;
  }

  Result<gltf::Model> load(const std::filesystem::path& folder = {}) const {
    return gltf::loadFromMemory(bytesOf(text()), folder);
  }
};

/// Node 0: a mesh of one triangle with skin 0. Nodes 1 and 2: its joints, 2 a child of 1, at y = 1.
inline FileBuilder skinnedTriangle() {
  FileBuilder file;
  const std::size_t positions = file.addFloats({0, 0, 0, 1, 0, 0, 0, 2, 0}, "VEC3");
  const std::size_t joints =
      file.add<std::uint8_t>({0, 1, 0, 0, 1, 0, 0, 0, 0, 1, 0, 0}, "VEC4", unsignedByteType);
  const std::size_t weights = file.addFloats({1, 0, 0, 0, 1, 0, 0, 0, 0.25f, 0.75f, 0, 0}, "VEC4");
  file.json["meshes"] = {
      {{"primitives",
        {{{"attributes",
           {{"POSITION", positions}, {"JOINTS_0", joints}, {"WEIGHTS_0", weights}}}}}}}};
  file.json["skins"] = {{{"joints", {1, 2}}}};
  file.json["nodes"] = {
      {{"mesh", 0}, {"skin", 0}}, {{"children", {2}}}, {{"translation", {0, 1, 0}}}};
  file.json["scenes"] = {{{"nodes", {0, 1}}}};
  file.json["scene"] = 0;
  return file;
}

/// The model, or a failed expectation and an empty one.
inline gltf::Model loaded(const Result<gltf::Model>& result) {
  EXPECT_TRUE(result.ok()) << (result.ok() ? "" : result.error().message);
  return result.ok() ? *result : gltf::Model{};
}

inline gltf::Model loaded(const FileBuilder& file) {
  return loaded(file.load());
}

/// The first primitive of mesh 0.
inline gltf::Primitive firstPrimitive(const gltf::Model& model) {
  const bool there = !model.meshes.empty() && !model.meshes[0].primitives.empty();
  EXPECT_TRUE(there);
  return there ? model.meshes[0].primitives[0] : gltf::Primitive{};
}

/// Joints or weights as the file stores them, component by component.
template <typename T>
std::vector<T> componentsOf(const std::vector<std::byte>& bytes) {
  std::vector<T> components(bytes.size() / sizeof(T));
  std::memcpy(components.data(), bytes.data(), components.size() * sizeof(T));
  return components;
}

/// The only set of influences of a primitive.
inline gltf::Influences onlySet(const gltf::Primitive& primitive) {
  EXPECT_EQ(primitive.influences.size(), 1u);
  return primitive.influences.empty() ? gltf::Influences{} : primitive.influences[0];
}

/// Expects an error of this kind whose sentence contains the text.
inline void expectError(const Result<gltf::Model>& result, ErrorCode code,
                        const std::string& text) {
  ASSERT_FALSE(result.ok()) << "loaded, where an error was expected with: " << text;
  EXPECT_EQ(errorCodeName(result.error().code), errorCodeName(code)) << result.error().message;
  EXPECT_NE(result.error().message.find(text), std::string::npos)
      << "the sentence is: " << result.error().message << "\nwithout: " << text;
  EXPECT_EQ(result.error().message.find('\n'), std::string::npos) << result.error().message;
}

inline void expectInvalid(const FileBuilder& file, const std::string& text) {
  expectError(file.load(), ErrorCode::invalidData, text);
}

}  // namespace dermis::test
