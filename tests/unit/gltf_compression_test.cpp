// Compressed files are the same models as those that they were made from, and damaged ones give an
// error. The encoders are those of the decoders' libraries. Without a library its files are refused
// with a sentence that helps.
#include <algorithm>
#include <cmath>
#include <random>
#include <tuple>

#include "gltf_builder.h"
#include "test_paths.h"

#ifdef DERMIS_DRACO
#include <draco/compression/expert_encode.h>
#endif
#ifdef DERMIS_MESHOPTIMIZER
#include <meshoptimizer.h>
#endif

namespace dermis::test {
namespace {

constexpr std::size_t columns = 9, rows = 7, vertices = columns * rows;

std::vector<float> floats(std::size_t width, auto value) {
  std::vector<float> all;
  for (std::size_t i = 0; i < vertices; ++i) {
    const std::array<float, 4> of =
        value(static_cast<float>(i % columns), static_cast<float>(i / columns));
    all.insert(all.end(), of.begin(), of.begin() + static_cast<std::ptrdiff_t>(width));
  }
  return all;
}

std::array<float, 4> normalAt(float x, float y) {
  const float z = 4, length = std::sqrt(x * x + y * y + z * z);
  return {x / length, y / length, z / length, 0};
}

/// A grid with every attribute that a skinned primitive may have, a morph target, and a clip.
FileBuilder skinnedGrid() {
  FileBuilder file = skinnedTriangle();
  file.binary.clear();
  file.json.erase("bufferViews");
  file.json.erase("accessors");
  std::vector<std::uint8_t> joints, weights;
  std::vector<std::uint16_t> triangles;
  for (std::size_t i = 0; i < vertices; ++i) {
    const auto weight = static_cast<std::uint8_t>(i * 255 / vertices);
    joints.insert(joints.end(), {0, 1, 0, 0});
    weights.insert(weights.end(), {weight, static_cast<std::uint8_t>(255 - weight), 0, 0});
    if (i % columns == columns - 1 || i / columns == rows - 1) continue;
    const auto at = [&](std::size_t step) { return static_cast<std::uint16_t>(i + step); };
    triangles.insert(triangles.end(),
                     {at(0), at(1), at(columns), at(1), at(columns + 1), at(columns)});
  }
  file.primitive() = {{"attributes", Json::object()}};
  Json& attributes = file.attributes();
  const auto add = [&](const char* name, std::size_t accessor) { attributes[name] = accessor; };
  add("POSITION", file.addFloats(floats(3,
                                        [](float x, float y) {
                                          return std::array<float, 4>{x, y, std::sin(x) / 3, 0};
                                        }),
                                 "VEC3"));
  add("NORMAL", file.addFloats(floats(3, normalAt), "VEC3"));
  add("TANGENT", file.addFloats(floats(4,
                                       [](float, float y) {
                                         return std::array<float, 4>{1, 0, 0, y > 3 ? 1.f : -1.f};
                                       }),
                                "VEC4"));
  add("TEXCOORD_0", file.addFloats(floats(2,
                                          [](float x, float y) {
                                            return std::array<float, 4>{x / 8, y / 8, 0, 0};
                                          }),
                                   "VEC2"));
  add("JOINTS_0", file.add(joints, "VEC4", unsignedByteType));
  add("WEIGHTS_0", file.add(weights, "VEC4", unsignedByteType, true));
  file.primitive()["indices"] = file.add(triangles, "SCALAR", unsignedShortType);
  file.primitive()["targets"] = {
      {{"POSITION", file.addFloats(floats(3,
                                          [](float x, float y) {
                                            return std::array<float, 4>{0, 0, x * y, 0};
                                          }),
                                   "VEC3")}}};
  const std::size_t times = file.addFloats({0, 1}, "SCALAR");
  const std::size_t keys =
      file.add<std::int16_t>({0, 0, 0, 32767, 0, 23170, 0, 23170}, "VEC4", shortType, true);
  file.json["animations"] = {
      {{"samplers", {{{"input", times}, {"output", keys}}}},
       {"channels", {{{"sampler", 0}, {"target", {{"node", 2}, {"path", "rotation"}}}}}}}};
  return file;
}

/// Triangles with their smallest index first, which keeps their orientation; sorted.
std::vector<std::array<std::uint32_t, 3>> sortedTriangles(std::span<const std::uint32_t> indices) {
  std::vector<std::array<std::uint32_t, 3>> triangles;
  for (std::size_t i = 0; i + 2 < indices.size(); i += 3) {
    std::array<std::uint32_t, 3> triangle{indices[i], indices[i + 1], indices[i + 2]};
    std::rotate(triangle.begin(), std::ranges::min_element(triangle), triangle.end());
    triangles.push_back(triangle);
  }
  std::ranges::sort(triangles);
  return triangles;
}

void expectTheSame(const gltf::Model& found, const gltf::Model& expected) {
  const gltf::Primitive a = firstPrimitive(found), b = firstPrimitive(expected);
  EXPECT_EQ(a.vertexCount, b.vertexCount);
  EXPECT_EQ(a.positions, b.positions);
  EXPECT_EQ(a.normals, b.normals);
  EXPECT_EQ(a.tangents, b.tangents);
  EXPECT_EQ(a.texcoords, b.texcoords);
  EXPECT_EQ(onlySet(a).joints, onlySet(b).joints);
  EXPECT_EQ(onlySet(a).weights, onlySet(b).weights);
  EXPECT_EQ(onlySet(a).weightType, onlySet(b).weightType);
  EXPECT_EQ(sortedTriangles(a.triangles.values()), sortedTriangles(b.triangles.values()));
  ASSERT_EQ(a.morphTargets.size(), b.morphTargets.size());
  for (std::size_t i = 0; i < a.morphTargets.size(); ++i)
    EXPECT_EQ(a.morphTargets[i].positions, b.morphTargets[i].positions);
  ASSERT_EQ(found.clips.size(), 1u);
  EXPECT_EQ(found.clips[0].channels[0].times, expected.clips[0].channels[0].times);
  EXPECT_EQ(found.clips[0].channels[0].values, expected.clips[0].channels[0].values);
}

/// The bytes of an accessor.
[[maybe_unused]] std::vector<std::byte> accessorBytes(const FileBuilder& file,
                                                      std::size_t accessor) {
  const Json& view =
      file.json["bufferViews"][file.json["accessors"][accessor]["bufferView"].get<std::size_t>()];
  const auto start = file.binary.begin() + view["byteOffset"].get<std::ptrdiff_t>();
  return {start, start + view["byteLength"].get<std::ptrdiff_t>()};
}

/// A bufferView's extension.
[[maybe_unused]] Json& compressed(FileBuilder& file, std::size_t view, const char* extension) {
  return file.json["bufferViews"][view]["extensions"][extension];
}

constexpr const char* meshopt = "EXT_meshopt_compression";

/// Says that the views are compressed, in buffer 0, and makes buffer 1 their fallback without data.
void declareMeshopt(FileBuilder& file, const char* extension) {
  file.json["extensionsUsed"] = {extension};
  file.json["extensionsRequired"] = {extension};
  std::size_t length = 0;
  for (Json& view : file.json["bufferViews"]) {
    view["buffer"] = 1;
    view["byteOffset"] = length;
    length += (view["byteLength"].get<std::size_t>() + 3) / 4 * 4;
  }
  file.json["buffers"] = {
      {{"byteLength", file.binary.size()},
       {"uri", "data:application/octet-stream;base64," + encodeBase64(file.binary)}},
      {{"byteLength", length}, {"extensions", {{extension, {{"fallback", true}}}}}}};
}

#ifdef DERMIS_MESHOPTIMIZER
std::vector<std::byte> encoded(const std::vector<std::byte>& bytes, std::size_t stride,
                               const std::string& mode) {
  const std::size_t count = bytes.size() / stride;
  std::vector<unsigned char> code(1000 + 4 * bytes.size());
  if (mode == "ATTRIBUTES") {
    meshopt_encodeVertexVersion(0);
    code.resize(meshopt_encodeVertexBuffer(code.data(), code.size(), bytes.data(), count, stride));
  } else {
    std::vector<unsigned int> indices;
    for (const std::uint16_t index : componentsOf<std::uint16_t>(bytes)) indices.push_back(index);
    meshopt_encodeIndexVersion(1);
    code.resize(mode == "TRIANGLES"
                    ? meshopt_encodeIndexBuffer(code.data(), code.size(), indices.data(), count)
                    : meshopt_encodeIndexSequence(code.data(), code.size(), indices.data(), count));
  }
  return bytesOf(code);
}

/// Compresses all bufferViews. `indexMode`: that of the indices.
FileBuilder compress(const FileBuilder& from, const std::string& indexMode = "TRIANGLES",
                     const char* extension = meshopt) {
  FileBuilder file = from;
  file.binary.clear();
  for (std::size_t i = 0; i < file.json["accessors"].size(); ++i) {
    const Json& accessor = file.json["accessors"][i];
    Json& view = file.json["bufferViews"][accessor["bufferView"].get<std::size_t>()];
    const std::vector<std::byte> bytes = accessorBytes(from, i);
    const std::size_t count = accessor["count"].get<std::size_t>(), stride = bytes.size() / count;
    const std::string mode = stride == 2 ? indexMode : "ATTRIBUTES";
    const std::vector<std::byte> code = encoded(bytes, stride, mode);
    view["extensions"][extension] = {{"buffer", 0},
                                     {"byteOffset", file.binary.size()},
                                     {"byteLength", code.size()},
                                     {"count", count},
                                     {"byteStride", stride},
                                     {"mode", mode}};
    file.binary.insert(file.binary.end(), code.begin(), code.end());
  }
  declareMeshopt(file, extension);
  return file;
}

TEST(MeshoptTest, FilesAreTheModelsThatTheyWereMadeFrom) {
  const FileBuilder file = skinnedGrid();
  const gltf::Model model = loaded(file);
  for (const char* indexMode : {"TRIANGLES", "INDICES"}) {
    for (const char* extension : {meshopt, "KHR_meshopt_compression"}) {
      SCOPED_TRACE(std::string(indexMode) + " " + extension);
      const FileBuilder small = compress(file, indexMode, extension);
      ASSERT_LT(small.binary.size(), file.binary.size());
      const gltf::Model found = loaded(small.load({}, {.strict = true}));
      expectTheSame(found, model);
      EXPECT_EQ(found.notes, std::vector<std::string>{});
    }
  }
}

/// A grid with one bufferView that a filter has made. Its accessor has the given format.
FileBuilder filtered(const char* filter, std::size_t view, const std::vector<std::byte>& bytes,
                     std::size_t stride, int componentType) {
  FileBuilder file = compress(skinnedGrid());
  const std::vector<std::byte> code = encoded(bytes, stride, "ATTRIBUTES");
  Json& from = compressed(file, view, meshopt);
  from["byteOffset"] = file.binary.size();
  from["byteLength"] = code.size();
  from["byteStride"] = stride;
  from["filter"] = filter;
  file.json["bufferViews"][view]["byteLength"] = bytes.size();
  file.json["bufferViews"][view]["byteStride"] = stride;
  file.json["accessors"][view]["componentType"] = componentType;
  if (componentType != floatType) file.json["accessors"][view]["normalized"] = true;
  file.binary.insert(file.binary.end(), code.begin(), code.end());
  declareMeshopt(file, meshopt);
  file.json["extensionsUsed"].push_back("KHR_mesh_quantization");
  return file;
}

void expectNear(std::span<const float> found, std::span<const float> expected, float tolerance) {
  ASSERT_EQ(found.size(), expected.size());
  for (std::size_t i = 0; i < found.size(); ++i)
    ASSERT_NEAR(found[i], expected[i], tolerance) << "component " << i;
}

TEST(MeshoptTest, DecodesOctahedralNormals) {
  const gltf::Model model = loaded(skinnedGrid());
  const std::vector<float> normals = floats(4, normalAt);
  for (const auto& [stride, type, tolerance] :
       {std::tuple(4u, byteType, 0.02f), std::tuple(8u, shortType, 1e-4f)}) {
    std::vector<std::byte> bytes(vertices * stride);
    meshopt_encodeFilterOct(bytes.data(), vertices, stride, stride == 4 ? 8 : 16, normals.data());
    const gltf::Model found = loaded(filtered("OCTAHEDRAL", 1, bytes, stride, type));
    expectNear(firstPrimitive(found).normals.values(), firstPrimitive(model).normals.values(),
               tolerance);
  }
}

TEST(MeshoptTest, DecodesExponentialPositions) {
  const gltf::Model model = loaded(skinnedGrid());
  const std::vector<float>& positions = firstPrimitive(model).positions.values();
  // By hand, since versions of the library differ: 8 bits of an exponent, 24 of a mantissa.
  std::vector<std::uint32_t> words;
  for (const float position : positions) {
    const auto mantissa = static_cast<std::uint32_t>(std::lround(position * 0x1p16f));
    words.push_back(std::uint32_t{0xf0} << 24 | (mantissa & 0xffffff));
  }
  const gltf::Model found = loaded(filtered("EXPONENTIAL", 0, bytesOf(words), 12, floatType));
  expectNear(firstPrimitive(found).positions.values(), positions, 0x1p-17f);
}

TEST(MeshoptTest, DecodesQuaternions) {
  const FileBuilder file = skinnedGrid();
  const std::size_t keys = file.json["accessors"].size() - 1;
  const std::vector<float> rotations = loaded(file).clips[0].channels[0].values;
  std::vector<std::byte> bytes(2 * 8);
  meshopt_encodeFilterQuat(bytes.data(), 2, 8, 12, rotations.data());
  const gltf::Model found = loaded(filtered("QUATERNION", keys, bytes, 8, shortType));
  expectNear(found.clips[0].channels[0].values, rotations, 1e-3f);
}

TEST(MeshoptTest, RefusesWhatTheExtensionDoesNotAllow) {
  const FileBuilder small = compress(skinnedGrid());
  constexpr std::size_t indices = 6;
  const struct {
    std::size_t view;
    const char* property;
    Json value;
    const char* sentence;
  } faults[] = {
      {0, "buffer", 9, "bufferView 0 EXT_meshopt_compression: buffer is 9"},
      {0, "buffer", 1, "are outside buffer 1 of 0 bytes"},
      {0, "byteOffset", 100000, "bufferView 0: the compressed bytes 100000 to"},
      {0, "byteLength", 1u << 20, "are outside buffer 0"},
      {0, "byteLength", 20, "bufferView 0: its data (EXT_meshopt_compression) cannot be decoded"},
      {0, "byteLength", 0, "cannot be decoded"},
      {0, "byteLength", nullptr, "byteLength is not an integer"},
      {0, "count", 0, "count is 0"},
      {0, "count", 1000, "cannot be decoded"},
      {0, "count", 10, "cannot be decoded"},
      {0, "byteStride", 8, "cannot be decoded"},
      {0, "byteStride", 10, "do not allow byteStride 10"},
      {0, "byteStride", 260, "do not allow byteStride 260"},
      {0, "mode", "TRIANGLES", "do not allow byteStride 12"},
      {0, "mode", "POINTS", "mode is 'POINTS', which is not supported"},
      {0, "mode", 3, "mode is '3', which is not supported"},
      {0, "filter", "COLOR", "filter is 'COLOR', which is not supported"},
      {0, "filter", "OCTAHEDRAL", "do not allow byteStride 12"},
      {0, "filter", "QUATERNION", "do not allow byteStride 12"},
      {indices, "filter", "EXPONENTIAL", "only mode ATTRIBUTES may have a filter"},
      {indices, "count", 287, "count 287 is not a multiple of 3"},
      {indices, "byteStride", 8, "do not allow byteStride 8"},
      {indices, "mode", "INDICES", "cannot be decoded"},
  };
  for (const auto& [view, property, value, sentence] : faults) {
    SCOPED_TRACE(std::string(property) + " " + value.dump());
    FileBuilder file = small;
    compressed(file, view, meshopt)[property] = value;
    expectInvalid(file, sentence);
  }
  FileBuilder file = small;
  file.json["bufferViews"][0]["byteStride"] = 16;
  expectInvalid(file, "byteStride is 12, but that of the bufferView is not");
  file = small;
  compressed(file, 0, meshopt) = 5;
  expectInvalid(file, "bufferView 0: EXT_meshopt_compression is not an object");
  file = small;
  Json& from = compressed(file, 0, meshopt);
  from["byteOffset"] = file.binary.size() - from["byteLength"].get<std::size_t>() + 1;
  expectInvalid(file, "are outside buffer 0");
  file = small;
  file.json["bufferViews"][0]["byteLength"] = 760;
  expectNoted(file, "63 elements of 12 bytes are not the byteLength of the bufferView");
}

// Before the memory is there, and even if nothing skinned uses the view.
TEST(MeshoptTest, SpendsWhatAViewDeclares) {
  for (const std::size_t view : {0u, 3u}) {  // POSITION, TEXCOORD_0
    FileBuilder file = compress(skinnedGrid());
    for (const std::uint64_t count : {std::uint64_t{100} << 20, (std::uint64_t{1} << 53) - 1}) {
      compressed(file, view, meshopt)["count"] = count;
      expectError(file.load(), ErrorCode::limitExceeded,
                  "bufferView " + std::to_string(view) + ": it needs more memory");
    }
  }
}

TEST(MeshoptTest, ADamagedViewThatNothingSkinnedUsesGivesANote) {
  FileBuilder file = compress(skinnedGrid());
  compressed(file, 3, meshopt)["byteLength"] = 20;  // TEXCOORD_0
  const gltf::Model model = expectNoted(file, "bufferView 3: its data");
  EXPECT_TRUE(firstPrimitive(model).texcoords.empty());
}

TEST(MeshoptTest, DamagedBytesGiveAnErrorOrAModel) {
  FileBuilder file = compress(skinnedGrid());
  const std::vector<std::byte> right = file.binary;
  std::mt19937 random(1);
  std::size_t refused = 0;
  for (int i = 0; i < 500; ++i) {
    file.binary = right;
    for (int j = 0; j < 4; ++j)
      file.binary[random() % right.size()] = static_cast<std::byte>(random());
    declareMeshopt(file, meshopt);
    const auto result = file.load();
    if (!result.ok()) ++refused;
  }
  EXPECT_GT(refused, 100u);
  EXPECT_LT(refused, 500u);
}

// What an older encoder wrote, and what the fuzzer starts from.
TEST(MeshoptTest, TheSeedOfTheFuzzerIsTheGrid) {
  const auto seed = std::filesystem::path(sourceFolder) / "tests/fuzz/seeds/meshopt.gltf";
  expectTheSame(loaded(gltf::load(seed)), loaded(skinnedGrid()));
}

// Then it holds the same numbers, but need not be there.
TEST(MeshoptTest, DoesNotReadTheFallback) {
  FileBuilder file = compress(skinnedGrid());
  file.json["buffers"][1]["uri"] = "missing.bin";
  file.json.erase("extensionsRequired");
  const gltf::Model model = loaded(file);
  expectTheSame(model, loaded(skinnedGrid()));
  EXPECT_EQ(model.notes, std::vector<std::string>{});
}
#else
TEST(MeshoptTest, ABuildWithoutTheLibraryUsesTheFallback) {
  FileBuilder file = skinnedGrid();
  const gltf::Model model = loaded(file);
  for (Json& view : file.json["bufferViews"]) {
    view["extensions"][meshopt] = {
        {"buffer", 0}, {"byteLength", 4}, {"byteStride", 4}, {"count", 1}, {"mode", "ATTRIBUTES"}};
  }
  FileBuilder required = file;
  declareMeshopt(required, meshopt);
  expectError(required.load(), ErrorCode::unsupportedFeature,
              "requires the extension 'EXT_meshopt_compression', which this build does not decode "
              "(CMake option DERMIS_MESHOPTIMIZER); 'gltf-transform copy' writes");
  required.json.erase("extensionsRequired");
  expectError(required.load(), ErrorCode::unsupportedFeature,
              "bufferView 0 has no data, but 'EXT_meshopt_compression', which this build");
  expectTheSame(loaded(file), model);
  GTEST_SKIP() << "the decoder is not tested: this build has no meshoptimizer";
}
#endif

constexpr const char* draco = "KHR_draco_mesh_compression";

Json& dracoOf(FileBuilder& file) {
  return file.primitive()["extensions"][draco];
}

#ifdef DERMIS_DRACO
using Type = ::draco::GeometryAttribute::Type;
using DataType = ::draco::DataType;

struct DracoOptions {
  int method = ::draco::MESH_EDGEBREAKER_ENCODING;
  int bits = 0;  ///< quantization of float32 attributes; 0: none
  bool hasMetadata = false;
};

/// Compresses the primitive of a file, except its morph targets.
FileBuilder compressByDraco(const FileBuilder& from, const DracoOptions& options = {}) {
  FileBuilder file = from;
  const std::vector<std::byte> indexBytes =
      accessorBytes(from, file.primitive()["indices"].get<std::size_t>());
  const auto indices = componentsOf<std::uint16_t>(indexBytes);
  ::draco::Mesh mesh;
  mesh.set_num_points(vertices);
  for (std::size_t i = 0; i + 2 < indices.size(); i += 3) {
    mesh.AddFace({::draco::PointIndex(indices[i]), ::draco::PointIndex(indices[i + 1]),
                  ::draco::PointIndex(indices[i + 2])});
  }
  Json ids;
  const std::map<std::string, Type> types{
      {"POSITION", Type::POSITION}, {"NORMAL", Type::NORMAL}, {"TEXCOORD_0", Type::TEX_COORD}};
  for (const auto& [name, accessor] : file.attributes().items()) {
    const std::vector<std::byte> bytes = accessorBytes(from, accessor.get<std::size_t>());
    const bool isFloat = file.accessor(name.c_str())["componentType"] == floatType;
    const std::size_t size = bytes.size() / vertices;
    const auto type = types.find(name);
    ::draco::GeometryAttribute attribute;
    attribute.Init(type == types.end() ? Type::GENERIC : type->second, nullptr,
                   static_cast<std::uint8_t>(isFloat ? size / 4 : size),
                   isFloat ? DataType::DT_FLOAT32 : DataType::DT_UINT8, false,
                   static_cast<std::int64_t>(size), 0);
    const int id = mesh.AddAttribute(attribute, true, vertices);
    for (std::uint32_t i = 0; i < vertices; ++i) {
      mesh.attribute(id)->SetAttributeValue(::draco::AttributeValueIndex(i), &bytes[i * size]);
    }
    ids[name] = mesh.attribute(id)->unique_id();
  }
  if (options.hasMetadata) {
    auto metadata = std::make_unique<::draco::GeometryMetadata>();
    metadata->AddEntryString("made by", "the tests");
    mesh.AddMetadata(std::move(metadata));
  }
  ::draco::ExpertEncoder encoder(mesh);
  encoder.SetEncodingMethod(options.method);
  for (int i = 0; options.bits > 0 && i < mesh.num_attributes(); ++i) {
    if (mesh.attribute(i)->data_type() == DataType::DT_FLOAT32)
      encoder.SetAttributeQuantization(i, options.bits);
  }
  ::draco::EncoderBuffer code;
  EXPECT_TRUE(encoder.EncodeToBuffer(&code).ok());
  const std::size_t view =
      file.addView(bytesOf(std::vector<char>(code.data(), code.data() + code.size())));
  dracoOf(file) = {{"bufferView", view}, {"attributes", ids}};
  for (const auto& [name, accessor] : file.attributes().items())
    file.accessor(name.c_str()).erase("bufferView");
  file.json["accessors"][file.primitive()["indices"].get<std::size_t>()].erase("bufferView");
  file.json["extensionsUsed"] = {draco};
  file.json["extensionsRequired"] = {draco};
  return file;
}

TEST(DracoTest, FilesInTheirOrderAreTheModelsThatTheyWereMadeFrom) {
  const gltf::Model model = loaded(skinnedGrid());
  for (const bool hasMetadata : {false, true}) {
    const FileBuilder file = compressByDraco(
        skinnedGrid(), {.method = ::draco::MESH_SEQUENTIAL_ENCODING, .hasMetadata = hasMetadata});
    const gltf::Model found = loaded(file.load({}, {.strict = true}));
    expectTheSame(found, model);
    EXPECT_EQ(found.notes, std::vector<std::string>{});
  }
}

/// For each vertex of a primitive the one of another that is nearest.
std::vector<std::uint32_t> nearest(const gltf::Primitive& from, const gltf::Primitive& to) {
  std::vector<std::uint32_t> found;
  for (std::uint32_t i = 0; i < from.vertexCount; ++i) {
    const auto distance = [&](std::uint32_t j) {
      float sum = 0;
      for (std::size_t k = 0; k < 3; ++k)
        sum += std::abs(from.positions[3 * i + k] - to.positions[3 * j + k]);
      return sum;
    };
    std::uint32_t best = 0;
    for (std::uint32_t j = 1; j < to.vertexCount; ++j)
      if (distance(j) < distance(best)) best = j;
    found.push_back(best);
  }
  return found;
}

// All attributes and the triangles are those of the same vertices, wherever they are.
TEST(DracoTest, VerticesAreInTheOrderOfTheDecoder) {
  const gltf::Primitive right = firstPrimitive(loaded(skinnedGrid()));
  for (const int bits : {0, 14}) {
    SCOPED_TRACE(bits);
    const gltf::Model model = loaded(compressByDraco(skinnedGrid(), {.bits = bits}));
    const gltf::Primitive found = firstPrimitive(model);
    ASSERT_EQ(found.vertexCount, vertices);
    const std::vector<std::uint32_t> same = nearest(found, right);
    std::vector<std::uint32_t> order = same;
    EXPECT_FALSE(std::ranges::is_sorted(order)) << "this decoder keeps the order";
    std::ranges::sort(order);
    EXPECT_EQ(std::ranges::adjacent_find(order), order.end()) << "a vertex is there twice";
    const float tolerance = bits == 0 ? 0 : 8 * 0x1p-13f;
    const auto compare = [&](const auto& a, const auto& b) {
      const std::size_t width = a.size() / vertices;
      ASSERT_EQ(a.size(), b.size());
      for (std::size_t i = 0; i < a.size(); ++i) {
        const auto expected = b[same[i / width] * width + i % width];
        ASSERT_NEAR(static_cast<float>(a[i]), static_cast<float>(expected), tolerance)
            << "component " << i;
      }
    };
    compare(found.positions, right.positions);
    compare(found.normals, right.normals);
    compare(found.tangents, right.tangents);
    compare(found.texcoords.at(0), right.texcoords[0]);
    compare(onlySet(found).joints, onlySet(right).joints);
    compare(onlySet(found).weights, onlySet(right).weights);
    std::vector<std::uint32_t> triangles = found.triangles;
    for (std::uint32_t& vertex : triangles) vertex = same[vertex];
    EXPECT_EQ(sortedTriangles(triangles), sortedTriangles(right.triangles.values()));
    // A morph target is not compressed; its file has the decoder's order, or it displaces others.
    EXPECT_EQ(found.morphTargets.at(0).positions, right.morphTargets[0].positions);
  }
}

// As if it were the only copy: what the accessors name besides is not read.
TEST(DracoTest, IsUsedInSpiteOfAFallback) {
  FileBuilder file = compressByDraco(skinnedGrid(), {.method = ::draco::MESH_SEQUENTIAL_ENCODING});
  file.json.erase("extensionsRequired");
  expectTheSame(loaded(file), loaded(skinnedGrid()));
  file.accessor("POSITION")["bufferView"] = 1;
  expectTheSame(loaded(file), loaded(skinnedGrid()));
}

TEST(DracoTest, AttributesThatAreNotCompressedAreReadAsEver) {
  FileBuilder file = compressByDraco(skinnedGrid(), {.method = ::draco::MESH_SEQUENTIAL_ENCODING});
  dracoOf(file)["attributes"].erase("WEIGHTS_0");
  file.accessor("WEIGHTS_0")["bufferView"] = 5;
  dracoOf(file)["attributes"]["NOT_THERE"] = 77;
  expectTheSame(loaded(file), loaded(skinnedGrid()));
}

TEST(DracoTest, PrimitivesMayShareAStreamButNotAnAccessor) {
  FileBuilder file = compressByDraco(skinnedGrid(), {.method = ::draco::MESH_SEQUENTIAL_ENCODING});
  Json& primitives = file.json["meshes"][0]["primitives"];
  primitives.push_back(primitives[0]);
  const gltf::Model model = loaded(file);
  EXPECT_EQ(model.meshes.at(0).primitives.at(1).positions.data(),
            model.meshes[0].primitives[0].positions.data());
  dracoOf(file)["attributes"]["POSITION"] = dracoOf(file)["attributes"]["NORMAL"];
  expectInvalid(file, "KHR_draco_mesh_compression: accessor 0 has other data in another primitive");
}

TEST(DracoTest, RefusesWhatDoesNotFitTheAccessors) {
  const FileBuilder right = compressByDraco(skinnedGrid());
  const auto expectRefused = [&](const char* sentence, auto change) {
    SCOPED_TRACE(sentence);
    FileBuilder file = right;
    change(file);
    expectInvalid(file, sentence);
  };
  const auto ofAccessor = [](const char* attribute, const char* property, Json value) {
    return [=](FileBuilder& file) { file.accessor(attribute)[property] = value; };
  };
  const auto ofExtension = [](const char* property, Json value) {
    return [=](FileBuilder& file) { dracoOf(file)[property] = value; };
  };
  const auto indices = [](FileBuilder& file) -> Json& {
    return file.json["accessors"][file.primitive()["indices"].get<std::size_t>()];
  };
  for (const int count : {62, 64}) {
    const std::string sentence =
        "63 vertices and 96 triangles, but the accessors have " + std::to_string(count) + " and 96";
    expectRefused(sentence.c_str(), [&](FileBuilder& file) {
      file.primitive().erase("targets");
      for (const auto& [name, index] : file.attributes().items())
        file.json["accessors"][index.get<std::size_t>()]["count"] = count;
    });
  }
  expectRefused("but the accessors have 63 and 97",
                [&](FileBuilder& file) { indices(file)["count"] = 291; });
  expectRefused("of its data has another type than accessor 4",
                ofAccessor("JOINTS_0", "componentType", unsignedShortType));
  expectRefused("of its data has another type than accessor 0", [](FileBuilder& file) {
    dracoOf(file)["attributes"]["POSITION"] = dracoOf(file)["attributes"]["TANGENT"];
  });
  expectRefused("indices: accessor 6 is SCALAR of float",
                [&](FileBuilder& file) { indices(file)["componentType"] = floatType; });
  expectRefused("the primitive has no indices",
                [](FileBuilder& file) { file.primitive().erase("indices"); });
  expectRefused("its data has no attribute 77", ofExtension("attributes", {{"POSITION", 77}}));
  expectRefused("the id of 'POSITION' is not an integer",
                ofExtension("attributes", {{"POSITION", "x"}}));
  expectRefused("there is no attribute 4294967295",
                ofExtension("attributes", {{"POSITION", 0xffffffffu}}));
  expectRefused("attributes is not an object", ofExtension("attributes", 5));
  expectRefused("bufferView is 99", ofExtension("bufferView", 99));
  expectRefused("its data is not a Draco mesh", ofExtension("bufferView", 0));
  expectRefused("KHR_draco_mesh_compression is not an object",
                [](FileBuilder& file) { dracoOf(file) = 1; });
  FileBuilder file = right;
  file.primitive()["mode"] = 5;
  expectError(file.load(), ErrorCode::unsupportedFeature, "only mode 4, triangles");
  // Decoded indices have 4 bytes; what the file has for some of them has 2.
  file = right;
  const std::size_t elements = file.addView(bytesOf(std::vector<std::uint8_t>{0, 1, 2}));
  const std::size_t values = file.addView(bytesOf(std::vector<std::uint16_t>{0, 1, 2}));
  indices(file)["sparse"] = {
      {"count", 3},
      {"indices", {{"bufferView", elements}, {"componentType", unsignedByteType}}},
      {"values", {{"bufferView", values}}}};
  expectError(file.load(), ErrorCode::unsupportedFeature, "accessor 6 of the indices is sparse");
}

TEST(DracoTest, TruncatedDataIsAnError) {
  const FileBuilder right = compressByDraco(skinnedGrid());
  const auto view = right.json["bufferViews"].size() - 1;
  const auto length = right.json["bufferViews"][view]["byteLength"].get<std::size_t>();
  for (std::size_t left = 0; left < length; left += 7) {
    FileBuilder file = right;
    file.json["bufferViews"][view]["byteLength"] = left;
    expectError(file.load(), ErrorCode::invalidData, "mesh 0 primitive 0 KHR_draco_mesh");
  }
  FileBuilder file = right;
  file.json["bufferViews"][view]["byteLength"] = length + 100;
  expectInvalid(file, "bytes");
}

// The accessors' memory is spent before it is there, and the stream's numbers are compared with
// theirs before libdraco sees them.
TEST(DracoTest, HugeNumbersAreRefusedBeforeAnythingIsDecoded) {
  FileBuilder file = compressByDraco(skinnedGrid());
  file.primitive().erase("targets");
  const std::size_t indices = file.primitive()["indices"].get<std::size_t>();
  for (const bool areIndicesHuge : {false, true}) {
    for (std::size_t i = 0; i < file.json["accessors"].size(); ++i) {
      Json& accessor = file.json["accessors"][i];
      if (!accessor.contains("bufferView") && (areIndicesHuge || i != indices))
        accessor["count"] = 300'000'000;
    }
    expectError(file.load(), ErrorCode::limitExceeded,
                "KHR_draco_mesh_compression: it needs more memory");
  }
  // In both encodings the numbers are behind 11 bytes of header, and in one a byte.
  for (const int method : {::draco::MESH_SEQUENTIAL_ENCODING, ::draco::MESH_EDGEBREAKER_ENCODING}) {
    file = compressByDraco(skinnedGrid(), {.method = method});
    Json& view = file.json["bufferViews"].back();
    const std::size_t place = view["byteOffset"].get<std::size_t>() + 11 +
                              (method == ::draco::MESH_EDGEBREAKER_ENCODING ? 1 : 0);
    for (std::size_t number = 0; number < 2; ++number) {
      FileBuilder huge = file;
      auto at = huge.binary.begin() + static_cast<std::ptrdiff_t>(place + number);
      at = huge.binary.erase(at);
      for (const int byte : {0x05, 0xff, 0xff, 0xff, 0xff})  // most significant digits last
        at = huge.binary.insert(at, static_cast<std::byte>(byte));
      huge.json["bufferViews"].back()["byteLength"] = view["byteLength"].get<std::size_t>() + 4;
      expectInvalid(huge, "but the accessors have 63 and 96");
    }
  }
}

// Nothing in the scene is skinned by it: it need not be decoded.
TEST(DracoTest, DecodesOnlySkinnedMeshes) {
  FileBuilder file = compressByDraco(skinnedGrid());
  file.json["meshes"].push_back(file.json["meshes"][0]);
  dracoOf(file)["bufferView"] = 0;
  file.json["nodes"][0]["mesh"] = 1;
  EXPECT_EQ(loaded(file).meshes.at(1).primitives.at(0).vertexCount, vertices);
}
TEST(DracoTest, DecodesRigidMeshes) {
  FileBuilder file = compressByDraco(skinnedGrid());
  Json rigid = file.json["meshes"][0];
  Json& primitive = rigid["primitives"][0];
  primitive.erase("targets");
  primitive["attributes"].erase("JOINTS_0");
  primitive["attributes"].erase("WEIGHTS_0");
  // It shares no accessor with the skinned primitive.
  for (Json* index : {&primitive["attributes"]["POSITION"], &primitive["attributes"]["NORMAL"],
                      &primitive["attributes"]["TANGENT"], &primitive["attributes"]["TEXCOORD_0"],
                      &primitive["indices"]})
    *index = file.addAccessor(file.json["accessors"][index->get<std::size_t>()]);
  file.json["meshes"].push_back(rigid);
  file.json["nodes"].push_back({{"mesh", 1}});
  file.json["nodes"][2]["children"] = {3};
  const gltf::Model model = loaded(file.load({}, {.rigidMeshes = true}));
  const gltf::Primitive& found = model.meshes.at(1).primitives.at(0);
  EXPECT_EQ(found.positions, firstPrimitive(model).positions);
  EXPECT_EQ(found.triangles, firstPrimitive(model).triangles);
  file.json["meshes"][1]["primitives"][0]["extensions"][draco]["bufferView"] = 0;
  EXPECT_TRUE(hasNote(loaded(file.load({}, {.rigidMeshes = true})),
                      "mesh 1 primitive 0 KHR_draco_mesh_compression: its data is not a Draco "
                      "mesh; it is left out"));
}
#else
TEST(DracoTest, ABuildWithoutTheLibraryUsesTheFallback) {
  FileBuilder file = skinnedGrid();
  const gltf::Model model = loaded(file);
  dracoOf(file) = {{"bufferView", 0}, {"attributes", {{"POSITION", 0}, {"NORMAL", 1}}}};
  file.json["extensionsUsed"] = {draco};
  expectTheSame(loaded(file), model);
  FileBuilder without = file;
  without.accessor("NORMAL").erase("bufferView");
  expectError(without.load(), ErrorCode::unsupportedFeature,
              "mesh 0 primitive 0: accessor 1 has no data, but 'KHR_draco_mesh_compression', which "
              "this build does not decode (CMake option DERMIS_DRACO); 'gltf-transform copy'");
  file.json["extensionsRequired"] = {draco};
  expectError(file.load(), ErrorCode::unsupportedFeature,
              "requires the extension 'KHR_draco_mesh_compression', which this build");
  GTEST_SKIP() << "the decoder is not tested: this build has no Draco";
}
#endif

}  // namespace
}  // namespace dermis::test
