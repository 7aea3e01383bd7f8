#include "gltf_builder.h"

#include <fstream>

namespace dermis::test {

std::string encodeBase64(std::span<const std::byte> bytes) {
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

std::size_t FileBuilder::addView(const std::vector<std::byte>& bytes) {
  binary.resize((binary.size() + 3) / 4 * 4);
  json["bufferViews"].push_back(
      {{"buffer", 0}, {"byteOffset", binary.size()}, {"byteLength", bytes.size()}});
  binary.insert(binary.end(), bytes.begin(), bytes.end());
  return json["bufferViews"].size() - 1;
}

std::size_t FileBuilder::addAccessor(Json accessor) {
  json["accessors"].push_back(std::move(accessor));
  return json["accessors"].size() - 1;
}

std::size_t FileBuilder::addStored(const std::vector<std::byte>& bytes, std::size_t components,
                                   const char* type, int componentType, bool normalized) {
  const std::string name = type;
  const std::size_t width = name == "SCALAR" ? 1
                            : name == "VEC2" ? 2
                            : name == "VEC3" ? 3
                            : name == "VEC4" ? 4
                                             : 16;
  Json accessor = {{"bufferView", addView(bytes)},
                   {"componentType", componentType},
                   {"count", components / width},
                   {"type", type}};
  if (normalized) accessor["normalized"] = true;
  return addAccessor(std::move(accessor));
}

Json& FileBuilder::attributes() {
  return json["meshes"][0]["primitives"][0]["attributes"];
}

Json& FileBuilder::primitive() {
  return json["meshes"][0]["primitives"][0];
}

Json& FileBuilder::accessor(const char* attribute) {
  return json["accessors"][attributes()[attribute].get<std::size_t>()];
}

std::string FileBuilder::text() const {
  Json file = json;
  if (!binary.empty() && !file.contains("buffers")) {
    file["buffers"] = {{{"byteLength", binary.size()},
                        {"uri", "data:application/octet-stream;base64," + encodeBase64(binary)}}};
  }
  return file.dump();
}

std::string FileBuilder::writtenTo(const std::string& path) const {
  std::ofstream(path, std::ios::binary) << text();
  return path;
}

std::vector<std::byte> FileBuilder::glb() const {
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

Result<gltf::Model> FileBuilder::load(const std::filesystem::path& folder,
                                      const gltf::LoadOptions& options) const {
  return gltf::loadFromMemory(bytesOf(text()), folder, options);
}

FileBuilder skinnedTriangle() {
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

gltf::Model loaded(const Result<gltf::Model>& result) {
  EXPECT_TRUE(result.ok()) << (result.ok() ? "" : result.error().message);
  return result.ok() ? *result : gltf::Model{};
}

gltf::Model loaded(const FileBuilder& file) {
  return loaded(file.load());
}

gltf::Primitive firstPrimitive(const gltf::Model& model) {
  const bool there = !model.meshes.empty() && !model.meshes[0].primitives.empty();
  EXPECT_TRUE(there);
  return there ? model.meshes[0].primitives[0] : gltf::Primitive{};
}

gltf::Influences onlySet(const gltf::Primitive& primitive) {
  EXPECT_EQ(primitive.influences.size(), 1u);
  return primitive.influences.empty() ? gltf::Influences{} : primitive.influences[0];
}

void expectError(const Result<gltf::Model>& result, ErrorCode code, const std::string& text) {
  ASSERT_FALSE(result.ok()) << "loaded, where an error was expected with: " << text;
  EXPECT_EQ(errorCodeName(result.error().code), errorCodeName(code)) << result.error().message;
  EXPECT_NE(result.error().message.find(text), std::string::npos)
      << "the sentence is: " << result.error().message << "\nwithout: " << text;
  EXPECT_EQ(result.error().message.find('\n'), std::string::npos) << result.error().message;
}

void expectInvalid(const FileBuilder& file, const std::string& text) {
  expectError(file.load(), ErrorCode::invalidData, text);
}

bool hasNote(const gltf::Model& model, const std::string& text) {
  for (const std::string& note : model.notes) {
    if (note.find(text) != std::string::npos) return true;
  }
  return false;
}

gltf::Model expectNoted(const std::vector<std::byte>& bytes, const std::string& text) {
  gltf::Model model = loaded(gltf::loadFromMemory(bytes, {}));
  EXPECT_TRUE(hasNote(model, text))
      << "the notes are: " << testing::PrintToString(model.notes) << "\nwithout: " << text;
  expectError(gltf::loadFromMemory(bytes, {}, {.strict = true}), ErrorCode::invalidData, text);
  return model;
}

gltf::Model expectNoted(const FileBuilder& file, const std::string& text) {
  return expectNoted(bytesOf(file.text()), text);
}

}  // namespace dermis::test
