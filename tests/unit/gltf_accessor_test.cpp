// Accessors: formats, strides, sparse values, ranges, and how much memory they may ask for.
#include <algorithm>
#include <cstddef>
#include <limits>

#include "gltf_builder.h"

namespace dermis::test {
namespace {

using Floats = std::vector<float>;

// Positions can be anything once a file is quantized: they show what a format is read as.
template <typename T>
Floats readAs(const std::vector<T>& nine, int componentType, bool normalized) {
  FileBuilder file = skinnedTriangle();
  file.json["extensionsUsed"] = {"KHR_mesh_quantization"};
  std::vector<T> padded;
  constexpr std::size_t stride = sizeof(T) == 1 ? 4 : sizeof(T) == 2 ? 4 : 3;
  for (std::size_t i = 0; i < 9; ++i) {
    padded.push_back(nine[i]);
    if (i % 3 == 2) padded.resize((i + 1) / 3 * stride, T{99});
  }
  const std::size_t view = file.addView(bytesOf(padded));
  if (stride != 3) file.json["bufferViews"][view]["byteStride"] = stride * sizeof(T);
  file.attributes()["POSITION"] = file.addAccessor({{"bufferView", view},
                                                    {"componentType", componentType},
                                                    {"normalized", normalized},
                                                    {"count", 3},
                                                    {"type", "VEC3"}});
  return firstPrimitive(loaded(file)).positions;
}

TEST(GltfAccessor, ReadsEveryComponentType) {
  EXPECT_EQ(readAs<std::int8_t>({-128, -127, 0, 1, 2, 3, 4, 5, 127}, byteType, false),
            (Floats{-128, -127, 0, 1, 2, 3, 4, 5, 127}));
  EXPECT_EQ(readAs<std::uint8_t>({0, 1, 2, 3, 4, 5, 6, 254, 255}, unsignedByteType, false),
            (Floats{0, 1, 2, 3, 4, 5, 6, 254, 255}));
  EXPECT_EQ(readAs<std::int16_t>({-32768, -1, 0, 1, 2, 3, 4, 5, 32767}, shortType, false),
            (Floats{-32768, -1, 0, 1, 2, 3, 4, 5, 32767}));
  EXPECT_EQ(readAs<std::uint16_t>({0, 1, 2, 3, 4, 5, 6, 7, 65535}, unsignedShortType, false),
            (Floats{0, 1, 2, 3, 4, 5, 6, 7, 65535}));
  EXPECT_EQ(readAs<float>({-1.5f, 0, 1e30f, 1, 2, 3, 4, 5, 6}, floatType, false),
            (Floats{-1.5f, 0, 1e30f, 1, 2, 3, 4, 5, 6}));
}

// glTF 2.0, 3.6.2.2: c / 127 and so on, and nothing below −1.
TEST(GltfAccessor, NormalizesIntegers) {
  EXPECT_EQ(readAs<std::int8_t>({-128, -127, 0, 64, 127, 1, -1, 2, 3}, byteType, true),
            (Floats{-1, -1, 0, 64 / 127.0f, 1, 1 / 127.0f, -1 / 127.0f, 2 / 127.0f, 3 / 127.0f}));
  EXPECT_EQ(readAs<std::uint8_t>({0, 1, 51, 128, 254, 255, 2, 3, 4}, unsignedByteType, true),
            (Floats{0, 1 / 255.0f, 0.2f, 128 / 255.0f, 254 / 255.0f, 1, 2 / 255.0f, 3 / 255.0f,
                    4 / 255.0f}));
  EXPECT_EQ(
      readAs<std::int16_t>({-32768, -32767, 0, 1, 32767, 2, 3, 4, 5}, shortType, true),
      (Floats{-1, -1, 0, 1 / 32767.0f, 1, 2 / 32767.0f, 3 / 32767.0f, 4 / 32767.0f, 5 / 32767.0f}));
  EXPECT_EQ(readAs<std::uint16_t>({0, 1, 65535, 2, 3, 4, 5, 6, 7}, unsignedShortType, true),
            (Floats{0, 1 / 65535.0f, 1, 2 / 65535.0f, 3 / 65535.0f, 4 / 65535.0f, 5 / 65535.0f,
                    6 / 65535.0f, 7 / 65535.0f}));
}

TEST(GltfAccessor, ReadsInterleavedAttributes) {
  FileBuilder file = skinnedTriangle();
  // Position and normal side by side, with four bytes between vertices that belong to nobody.
  Floats interleaved;
  for (int i = 0; i < 3; ++i) {
    const float base = static_cast<float>(10 * i);
    interleaved.insert(interleaved.end(), {base, base + 1, base + 2, 0, 0, 1, -777});
  }
  interleaved.pop_back();  // The last element need not be followed by a whole stride.
  const std::size_t view = file.addView(bytesOf(interleaved));
  file.json["bufferViews"][view]["byteStride"] = 28;
  const Json accessor = {
      {"bufferView", view}, {"componentType", floatType}, {"count", 3}, {"type", "VEC3"}};
  file.attributes()["POSITION"] = file.addAccessor(accessor);
  Json normals = accessor;
  normals["byteOffset"] = 12;
  file.attributes()["NORMAL"] = file.addAccessor(normals);

  const gltf::Primitive primitive = firstPrimitive(loaded(file));
  EXPECT_EQ(primitive.positions, (Floats{0, 1, 2, 10, 11, 12, 20, 21, 22}));
  EXPECT_EQ(primitive.normals, (Floats{0, 0, 1, 0, 0, 1, 0, 0, 1}));
}

// The accessor of the positions, with sparse values for vertices 0 and 2.
FileBuilder sparseTriangle(int indexType, const std::vector<std::byte>& indices) {
  FileBuilder file = skinnedTriangle();
  const std::size_t values = file.addView(bytesOf(Floats{7, 8, 9, -1, -2, -3}));
  const std::size_t view = file.addView(indices);
  file.accessor("POSITION")["sparse"] = {
      {"count", 2},
      {"indices", {{"bufferView", view}, {"componentType", indexType}}},
      {"values", {{"bufferView", values}}}};
  return file;
}

TEST(GltfAccessor, ReadsSparseValues) {
  const Floats expected = {7, 8, 9, 1, 0, 0, -1, -2, -3};
  const auto bytes = bytesOf(std::vector<std::uint8_t>{0, 2});
  const auto shorts = bytesOf(std::vector<std::uint16_t>{0, 2});
  const auto words = bytesOf(std::vector<std::uint32_t>{0, 2});
  EXPECT_EQ(firstPrimitive(loaded(sparseTriangle(unsignedByteType, bytes))).positions, expected);
  EXPECT_EQ(firstPrimitive(loaded(sparseTriangle(unsignedShortType, shorts))).positions, expected);
  EXPECT_EQ(firstPrimitive(loaded(sparseTriangle(unsignedIntType, words))).positions, expected);
}

TEST(GltfAccessor, ReadsSparseValuesWithOffsets) {
  FileBuilder file = skinnedTriangle();
  const std::size_t values = file.addView(bytesOf(Floats{99, 5, 6, 7}));
  const std::size_t indices = file.addView(bytesOf(std::vector<std::uint16_t>{99, 1}));
  file.accessor("POSITION")["sparse"] = {
      {"count", 1},
      {"indices",
       {{"bufferView", indices}, {"byteOffset", 2}, {"componentType", unsignedShortType}}},
      {"values", {{"bufferView", values}, {"byteOffset", 4}}}};
  EXPECT_EQ(firstPrimitive(loaded(file)).positions, (Floats{0, 0, 0, 5, 6, 7, 0, 2, 0}));
}

// glTF 2.0, 3.6.2.3: without a bufferView the rest is zeros.
TEST(GltfAccessor, ReadsSparseValuesWithoutABufferView) {
  FileBuilder file = sparseTriangle(unsignedByteType, bytesOf(std::vector<std::uint8_t>{0, 2}));
  file.accessor("POSITION").erase("bufferView");
  EXPECT_EQ(firstPrimitive(loaded(file)).positions, (Floats{7, 8, 9, 0, 0, 0, -1, -2, -3}));
  file.accessor("POSITION").erase("sparse");
  EXPECT_EQ(firstPrimitive(loaded(file)).positions, Floats(9, 0.0f));
}

TEST(GltfAccessor, ReadsSparseIndicesOfTriangles) {
  FileBuilder file = skinnedTriangle();
  const std::size_t values = file.addView(bytesOf(std::vector<std::uint16_t>{1, 2}));
  const std::size_t indices = file.addView(bytesOf(std::vector<std::uint8_t>{1, 2}));
  file.primitive()["indices"] = file.addAccessor(
      {{"componentType", unsignedShortType},
       {"count", 3},
       {"type", "SCALAR"},
       {"sparse",
        {{"count", 2},
         {"indices", {{"bufferView", indices}, {"componentType", unsignedByteType}}},
         {"values", {{"bufferView", values}}}}}});
  EXPECT_EQ(firstPrimitive(loaded(file)).triangles, (std::vector<std::uint32_t>{0, 1, 2}));
}

TEST(GltfAccessor, RefusesBadSparseData) {
  const auto withIndices = [](std::vector<std::uint8_t> indices) {
    return sparseTriangle(unsignedByteType, bytesOf(indices));
  };
  expectInvalid(withIndices({0, 3}), "accessor 0: sparse index 1 is 3");
  expectInvalid(withIndices({1}), "accessor 0 sparse indices: bytes 0 to 2 are outside bufferView");

  FileBuilder file = withIndices({0, 2});
  Json& sparse = file.accessor("POSITION")["sparse"];
  const Json good = sparse;
  sparse["count"] = 4;
  expectInvalid(file, "accessor 0: sparse: count 4 is not from 1");
  sparse["count"] = 3;
  expectInvalid(file, "are outside bufferView");
  sparse = good;
  sparse["indices"]["componentType"] = shortType;
  expectInvalid(file, "accessor 0: sparse indices: componentType is '5122'");
  sparse = good;
  sparse["indices"]["bufferView"] = 55;
  expectInvalid(file, "accessor 0: sparse indices: bufferView is 55");
  sparse = good;
  sparse.erase("values");
  expectInvalid(file, "accessor 0: sparse: it has no values");
  sparse = good;
  sparse["values"]["byteOffset"] = 2;
  expectInvalid(file, "accessor 0 sparse values: bytes 2 to 26");
  sparse = good;
  sparse["values"]["byteOffset"] = std::uint64_t{1} << 40;
  expectError(file.load(), ErrorCode::limitExceeded, "accessor 0: sparse values");
  sparse = good;
  file.json["bufferViews"][sparse["values"]["bufferView"].get<std::size_t>()]["byteStride"] = 16;
  expectInvalid(file, "accessor 0 sparse: bufferView 3 has a byteStride");
}

/// Of a size or an offset in a file.
constexpr std::uint64_t largestInteger =
    std::min((std::uint64_t{1} << 53) - 1, std::uint64_t{std::numeric_limits<std::size_t>::max()});

TEST(GltfAccessor, RefusesRangesOutsideTheirBytes) {
  FileBuilder file = skinnedTriangle();
  file.accessor("POSITION")["count"] = 4;
  expectInvalid(file, "accessor 0: bytes 0 to 48 are outside bufferView 0 of 36 bytes");
  file.accessor("POSITION")["count"] = 3;
  file.accessor("POSITION")["byteOffset"] = 4;
  expectInvalid(file, "accessor 0: bytes 4 to 40 are outside bufferView 0");
  file.accessor("POSITION")["byteOffset"] = largestInteger - 3;
  expectInvalid(file, "accessor 0: bytes " + std::to_string(largestInteger - 3) + " to " +
                          std::to_string(largestInteger + 33));
  file.accessor("POSITION")["count"] = 2'000'000'000u;
  expectInvalid(file, "are outside bufferView 0");
  if constexpr (sizeof(std::size_t) == 8) {
    file.accessor("POSITION")["count"] = std::uint64_t{1} << 32;
    expectError(file.load(), ErrorCode::limitExceeded, "accessor 0: a count of 4294967296");
  }

  file = skinnedTriangle();
  file.json["bufferViews"][1]["byteOffset"] = largestInteger;
  file.json["bufferViews"][1]["byteLength"] = largestInteger;
  expectInvalid(file, "accessor 1: bytes 0 to 12 are outside bufferView 1 of 0 bytes");
}

// 32-bit builds would cut off the upper half: offset 2^32 would be offset 0.
TEST(GltfAccessor, RefusesIntegersThatAreTooLarge) {
  for (const std::uint64_t number : {largestInteger + 1, std::uint64_t{1} << 63}) {
    FileBuilder file = skinnedTriangle();
    file.accessor("POSITION")["byteOffset"] = number;
    expectInvalid(file, "accessor 0: byteOffset is larger than");
    file.accessor("POSITION")["byteOffset"] = static_cast<double>(number);
    expectInvalid(file, "accessor 0: byteOffset is larger than");
    for (const char* property : {"byteOffset", "byteLength"}) {
      file = skinnedTriangle();
      file.json["bufferViews"][0][property] = number;
      expectInvalid(file, "bufferView 0: " + std::string(property) + " is larger than");
    }
  }
}

TEST(GltfAccessor, RefusesBadStrides) {
  FileBuilder file = skinnedTriangle();
  Json& view = file.json["bufferViews"][0];
  view["byteStride"] = std::uint64_t{1} << 40;
  expectInvalid(file, "bufferView 0: byteStride is 1099511627776, more than 2 GiB");
  view["byteStride"] = std::uint64_t{1} << 30;
  expectInvalid(file, "accessor 0: bytes 0 to 2147483660 are outside bufferView 0");
  view["byteStride"] = 8;
  expectInvalid(file, "accessor 0: its elements of 12 bytes do not fit the byteStride 8");
}

TEST(GltfAccessor, RefusesBadDescriptions) {
  FileBuilder file = skinnedTriangle();
  const Json good = file.accessor("POSITION");
  const auto expectAfter = [&](const char* property, const Json& value, const char* text) {
    file.accessor("POSITION") = good;
    if (value.is_null()) {
      file.accessor("POSITION").erase(property);
    } else {
      file.accessor("POSITION")[property] = value;
    }
    expectInvalid(file, text);
  };
  expectAfter("componentType", 5124, "accessor 0: componentType is '5124'");
  expectAfter("componentType", nullptr, "accessor 0: it has no componentType");
  expectAfter("type", "VEC5", "accessor 0: type is 'VEC5'");
  expectAfter("type", nullptr, "accessor 0: it has no type");
  expectAfter("count", 0, "JOINTS_0: accessor 1 has 3 elements, but POSITION has 0");
  expectAfter("count", -3, "accessor 0: count is not an integer");
  expectAfter("count", nullptr, "accessor 0: it has no count");
  expectAfter("bufferView", 12, "accessor 0: bufferView is 12, and the file has 3 bufferViews");
  expectAfter("bufferView", -1, "accessor 0: bufferView is not an integer");
  expectAfter("normalized", 1, "accessor 0: normalized is neither true nor false");
  expectAfter("byteOffset", "4", "accessor 0: byteOffset is not an integer");
  // Not of one that only the triangles use.
  file = skinnedTriangle();
  const std::size_t view = file.addView(bytesOf(std::vector<std::uint32_t>{0, 1, 2}));
  file.primitive()["indices"] = file.addAccessor({{"bufferView", view},
                                                  {"componentType", unsignedIntType},
                                                  {"normalized", true},
                                                  {"count", 3},
                                                  {"type", "SCALAR"}});
  expectInvalid(file, "accessor 3: unsigned int may not be normalized");

  file = skinnedTriangle();
  file.json["bufferViews"][0]["buffer"] = 1;
  expectInvalid(file, "bufferView 0: buffer is 1, and the file has 1 buffers");
  file.json["bufferViews"][0].erase("buffer");
  expectInvalid(file, "bufferView 0: it has no buffer");
  file = skinnedTriangle();
  file.json["bufferViews"][0]["byteLength"] = 0;
  expectInvalid(file, "accessor 0: bytes 0 to 36 are outside bufferView 0 of 0 bytes");
}

TEST(GltfAccessor, NotesBadDescriptions) {
  FileBuilder file = skinnedTriangle();
  file.accessor("POSITION")["normalized"] = true;
  EXPECT_EQ(firstPrimitive(expectNoted(file, "accessor 0: float may not be normalized")).positions,
            firstPrimitive(loaded(skinnedTriangle())).positions);
  // No vertices are nothing to skin.
  file = skinnedTriangle();
  for (const char* attribute : {"POSITION", "JOINTS_0", "WEIGHTS_0"})
    file.accessor(attribute)["count"] = 0;
  EXPECT_TRUE(expectNoted(file, "accessor 0: count is 0").skinnedPrimitives.empty());
}

// What no node with a skin uses, and no animation, may be as wrong as it likes.
TEST(GltfAccessor, NotesFaultsOfWhatNothingSkinnedUses) {
  FileBuilder file = skinnedTriangle();
  const Json good = file.accessor("POSITION");
  const std::size_t unused = file.addAccessor(good);
  for (const auto& [property, value] : {std::pair("count", Json(1000)),
                                        {"count", Json(-1)},
                                        {"type", Json("VEC5")},
                                        {"bufferView", Json(77)},
                                        {"componentType", Json(1)},
                                        {"sparse", Json{{"count", 1}}}}) {
    file.json["accessors"][unused] = good;
    file.json["accessors"][unused][property] = value;
    EXPECT_EQ(expectNoted(file, "accessor 3").skinnedPrimitives.size(), 1u) << property;
  }
  // A mesh that is not skinned may use it; an attribute that concerns no vertex is left out.
  file.json["meshes"].push_back({{"primitives", {{{"attributes", {{"POSITION", unused}}}}}}});
  file.json["nodes"].push_back({{"mesh", 1}});
  file.json["scenes"][0]["nodes"].push_back(3);
  file.attributes()["TEXCOORD_0"] = unused;
  const gltf::Model model = expectNoted(file, "accessor 3: sparse: it has no indices");
  EXPECT_TRUE(firstPrimitive(model).texcoords.empty());
  EXPECT_TRUE(hasNote(model, "TEXCOORD_0: accessor 3 is SCALAR of unsigned byte, not VEC2"))
      << testing::PrintToString(model.notes);
  // As soon as it is skinned, it is an error.
  file.json["nodes"].back()["skin"] = 0;
  expectInvalid(file, "accessor 3: sparse: it has no indices");
}

// An accessor without bytes costs nothing in the file, so it must not cost memory without end.
TEST(GltfAccessor, RefusesMoreZerosThanTheFileJustifies) {
  FileBuilder file = skinnedTriangle();
  for (const char* attribute : {"POSITION", "JOINTS_0", "WEIGHTS_0"}) {
    file.accessor(attribute).erase("bufferView");
    file.accessor(attribute)["count"] = 4'000'000'000u;
  }
  expectError(file.load(), ErrorCode::limitExceeded, "accessor 0 of 4000000000 elements");
}

}  // namespace
}  // namespace dermis::test
