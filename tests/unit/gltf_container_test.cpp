// What stands around the content: GLB chunks, JSON text, version, extensions.
#include "gltf_builder.h"

namespace dermis::test {
namespace {

using gltf::loadFromMemory;

void setWord(std::vector<std::byte>& bytes, std::size_t offset, std::size_t value) {
  for (std::size_t i = 0; i < 4; ++i) {
    bytes[offset + i] = static_cast<std::byte>(value >> (8 * i) & 0xff);
  }
}

void expectInvalidBytes(const std::vector<std::byte>& bytes, const std::string& text) {
  expectError(loadFromMemory(bytes, {}), ErrorCode::invalidData, text);
}

std::size_t jsonChunkSize(const std::vector<std::byte>& glb) {
  return std::to_integer<std::size_t>(glb[12]) + 256 * std::to_integer<std::size_t>(glb[13]);
}

TEST(GltfContainer, ReadsTheSameFromTextAndBinary) {
  const FileBuilder file = skinnedTriangle();
  const gltf::Model text = loaded(file);
  const gltf::Model binary = loaded(loadFromMemory(file.glb(), {}));
  EXPECT_EQ(firstPrimitive(text).positions, firstPrimitive(binary).positions);
  EXPECT_EQ(onlySet(firstPrimitive(text)).joints, onlySet(firstPrimitive(binary)).joints);
  EXPECT_EQ(onlySet(firstPrimitive(text)).weights, onlySet(firstPrimitive(binary)).weights);
}

TEST(GltfContainer, ReadsAChunkThatItDoesNotKnow) {
  auto bytes = skinnedTriangle().glb();
  const std::size_t start = bytes.size();
  bytes.resize(start + 12);
  setWord(bytes, start, 4);
  setWord(bytes, start + 4, 0x12345678);
  setWord(bytes, 8, bytes.size());
  EXPECT_EQ(loaded(loadFromMemory(bytes, {})).skinnedPrimitives.size(), 1u);
}

TEST(GltfContainer, RefusesAnEmptyFile) {
  expectInvalidBytes({}, "the file is empty");
}

TEST(GltfContainer, RefusesEveryTruncation) {
  const FileBuilder file = skinnedTriangle();
  for (const auto& [form, bytes] :
       {std::pair{"binary", file.glb()}, {"text", bytesOf(file.text())}}) {
    for (std::size_t size = 0; size < bytes.size(); ++size) {
      const auto result = loadFromMemory(std::span(bytes).first(size), {});
      ASSERT_FALSE(result.ok()) << form << ", " << size;
      EXPECT_EQ(result.error().code, ErrorCode::invalidData) << form << ", " << size;
    }
  }
}

TEST(GltfContainer, RefusesBadGlbNumbers) {
  const auto good = skinnedTriangle().glb();
  const std::size_t binaryChunk = 20 + jsonChunkSize(good);

  auto bytes = good;
  bytes.resize(11);
  expectInvalidBytes(bytes, "the GLB header is truncated");

  bytes = good;
  setWord(bytes, 4, 1);
  expectError(loadFromMemory(bytes, {}), ErrorCode::unsupportedFeature, "version 1");

  bytes = good;
  setWord(bytes, 8, good.size() + 4);
  expectInvalidBytes(bytes, "the GLB header says");

  bytes = good;
  setWord(bytes, 12, 0xfffffffc);
  expectInvalidBytes(bytes, "GLB chunk 0 at byte 12 says 4294967292 bytes");

  bytes = good;
  setWord(bytes, 16, 0x004e4942);
  setWord(bytes, binaryChunk + 4, 0x12345678);
  expectInvalidBytes(bytes, "no JSON chunk");

  bytes = good;
  setWord(bytes, binaryChunk + 4, 0x4e4f534a);
  expectInvalidBytes(bytes, "GLB chunk 1 is a second JSON chunk");

  bytes = good;
  bytes.resize(good.size() + 4);
  setWord(bytes, 8, bytes.size());
  expectInvalidBytes(bytes, "the header of GLB chunk 2");

  bytes.resize(good.size() + 8);
  setWord(bytes, 8, bytes.size());
  setWord(bytes, good.size(), 0);
  setWord(bytes, good.size() + 4, 0x004e4942);
  expectInvalidBytes(bytes, "GLB chunk 2 is binary data");

  bytes.assign(good.begin(), good.begin() + 12);
  setWord(bytes, 8, 12);
  expectInvalidBytes(bytes, "no JSON chunk");
  setWord(bytes, 8, 11);
  expectInvalidBytes(bytes, "the GLB header says 11 bytes");
}

TEST(GltfContainer, ReadsChunksThatBreakRules) {
  const auto good = skinnedTriangle().glb();
  // Another chunk in front, and the binary data behind it.
  auto bytes = good;
  const std::vector<std::byte> other(12);
  bytes.insert(bytes.begin() + 12, other.begin(), other.end());
  setWord(bytes, 12, 4);
  setWord(bytes, 16, 0x12345678);
  setWord(bytes, 8, bytes.size());
  const gltf::Model model = expectNoted(bytes, "the first GLB chunk is not JSON");
  EXPECT_EQ(model.skinnedPrimitives.size(), 1u);
  ASSERT_EQ(model.notes.size(), 1u);
  EXPECT_TRUE(model.notes[0].ends_with(" (and 1 more of this kind)")) << model.notes[0];
}

TEST(GltfContainer, RefusesZeroBytesInTheText) {
  const std::string text = skinnedTriangle().text();
  expectNoted(bytesOf(text + std::string(5, '\0')), "padded with zero bytes");
  expectInvalidBytes(bytesOf(text + std::string("\0x", 2)),
                     "the JSON text is invalid at byte " + std::to_string(text.size()));
}

TEST(GltfContainer, RefusesBrokenJson) {
  expectInvalidBytes(bytesOf("{\"asset\":"), "the JSON text is invalid at byte");
  expectInvalidBytes(bytesOf("[1, 2]"), "the JSON text is not an object");
  expectInvalidBytes(bytesOf("{}"), "no object 'asset'");
  expectInvalidBytes(bytesOf("{\"asset\": {}}"), "no version");
  expectInvalidBytes(bytesOf("{\"asset\": {\"version\": \"2.0\"}, \"scene\": 1e999}"), "too large");
  expectInvalidBytes(bytesOf("{\"asset\": {\"version\": \"\xff\"}}"), "invalid at byte");
}

// A parser that recurses would end with its stack: the nesting is measured first.
TEST(GltfContainer, RefusesDeepNesting) {
  const std::string start = "{\"asset\": {\"version\": \"2.0\"}, \"extras\": ";
  const auto nested = [&](std::size_t depth) {
    return bytesOf(start + std::string(depth, '[') + std::string(depth, ']') + "}");
  };
  loaded(loadFromMemory(nested(511), {}));
  expectInvalidBytes(nested(512), "nested deeper than 512 levels at byte");
  expectInvalidBytes(nested(1'000'000), "nested deeper than 512 levels");
  expectInvalidBytes(bytesOf(std::string(1'000'000, '[')), "nested deeper than 512 levels");
  // Brackets in a string are no nesting.
  loaded(loadFromMemory(bytesOf(start + "\"" + std::string(1000, '[') + "\\\"[\"}"), {}));
}

TEST(GltfContainer, RefusesOtherVersions) {
  FileBuilder file = skinnedTriangle();
  file.json["asset"]["version"] = "1.0";
  expectError(file.load(), ErrorCode::unsupportedFeature, "glTF version '1.0'");
  file.json["asset"]["version"] = "2.1";
  loaded(file);
  file.json["asset"]["minVersion"] = "2.1";
  expectError(file.load(), ErrorCode::unsupportedFeature, "needs glTF version '2.1'");
}

TEST(GltfContainer, RefusesRequiredExtensionsThatItDoesNotKnow) {
  FileBuilder file = skinnedTriangle();
  file.json["extensionsUsed"] = {"ACME_new"};
  loaded(file);
  file.json["extensionsRequired"] = {"ACME_new"};
  expectError(file.load(), ErrorCode::unsupportedFeature,
              "requires the extension 'ACME_new', which is not supported");
}

TEST(GltfContainer, ReadsPastExtensionsThatOnlyConcernAppearance) {
  FileBuilder file = skinnedTriangle();
  file.json["extensionsRequired"] = {"KHR_texture_transform", "KHR_materials_unlit",
                                     "EXT_texture_webp", "KHR_mesh_quantization"};
  loaded(file);
}

TEST(GltfContainer, NotesRequiredExtensionsOnWhichNoPositionDepends) {
  for (const char* name :
       {"KHR_animation_pointer", "KHR_interactivity", "KHR_node_visibility", "VRM", "VRMC_vrm"}) {
    FileBuilder file = skinnedTriangle();
    file.json["extensionsUsed"] = {name};
    file.json["extensionsRequired"] = {name};
    EXPECT_TRUE(hasNote(loaded(file.load({}, {.strict = true})),
                        std::string("requires the extension '") + name + "', which is ignored"));
    file.json.erase("extensionsRequired");
    EXPECT_TRUE(loaded(file).notes.empty());
  }
}

// Dermis looks at no image, so that one that is missing is no reason to fail.
TEST(GltfContainer, ReadsPastImages) {
  FileBuilder file = skinnedTriangle();
  file.json["images"] = {{{"uri", "missing.png"}}, {{"bufferView", 77}}, 3};
  file.json["textures"] = {{{"source", 99}}};
  file.json["samplers"] = {{{"wrapS", 1}}};
  file.json["materials"] = {
      {{"pbrMetallicRoughness", {{"baseColorTexture", {{"index", 5}}}}}, {"normalTexture", 7}}};
  loaded(file);
}

// A control character in a name must not break the one line of a message.
TEST(GltfContainer, KeepsNamesInMessagesOnOneLine) {
  FileBuilder file = skinnedTriangle();
  file.json["extensionsRequired"] = {"A\nB" + std::string(300, 'x')};
  expectError(file.load(), ErrorCode::unsupportedFeature, "'A\\nBxxx");
  EXPECT_LT(file.load().error().message.size(), 200u);
}

TEST(GltfContainer, TakesWholeNumbersWithAFractionOfZero) {
  FileBuilder file = skinnedTriangle();
  file.json["scene"] = 0.0;
  file.json["accessors"][0]["count"] = 3.0;
  EXPECT_EQ(loaded(file).skinnedPrimitives.size(), 1u);
  file.json["scene"] = 0.5;
  expectInvalid(file, "the file: scene is not an integer");
  file.json["scene"] = -1;
  expectInvalid(file, "the file: scene is not an integer");
}

// 2^32 would be 0 in an int: the file would be read as another one.
TEST(GltfContainer, RefusesNumbersThatWouldWrap) {
  FileBuilder file = skinnedTriangle();
  file.json["scene"] = std::uint64_t{1} << 32;
  expectInvalid(file, "the file: scene is 4294967296");
  file.json["scene"] = ~std::uint64_t{0};
  expectInvalid(file, "the file: scene is larger than 9007199254740991");
}

TEST(GltfContainer, RefusesSectionsOfTheWrongKind) {
  for (const char* section : {"nodes", "meshes", "skins", "accessors", "bufferViews", "buffers",
                              "animations", "scenes", "materials"}) {
    FileBuilder file = skinnedTriangle();
    file.json[section] = 5;
    expectInvalid(file, std::string("'") + section + "' is not an array");
    file.json[section] = Json::array({7});
    expectInvalid(file, " is not an object");
  }
}

// Three bytes in the file become hundreds in memory: their number is bounded.
TEST(GltfContainer, RefusesCountlessEmptyThings) {
  std::string text = R"({"asset": {"version": "2.0"}, "materials": [{})";
  for (int i = 0; i < 300'000; ++i) text += ",{}";
  expectError(loadFromMemory(bytesOf(text + "]}"), {}), ErrorCode::limitExceeded,
              "300001 materials: it needs more memory than the limit for a file of this size");
}

}  // namespace
}  // namespace dermis::test
