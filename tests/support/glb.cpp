#include "glb.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstring>
#include <fstream>
#include <iterator>
#include <set>
#include <stdexcept>
#include <string>

namespace dermis::test {
namespace {

using nlohmann::json;

constexpr int shortType = 5123, intType = 5125, floatType = 5126;
constexpr int vertexTarget = 34962, indexTarget = 34963;

std::uint32_t wordAt(const std::string& bytes, std::size_t place) {
  std::uint32_t word = 0;
  if (place + 4 > bytes.size()) throw std::runtime_error("the file ends too early");
  std::memcpy(&word, bytes.data() + place, 4);
  return word;
}

/// The content of the chunk at `place`, which moves behind it.
std::string takeChunk(const std::string& bytes, std::uint32_t type, std::size_t& place) {
  const std::uint32_t length = wordAt(bytes, place);
  EXPECT_EQ(wordAt(bytes, place + 4), type);
  EXPECT_EQ(length % 4, 0u);
  std::string content = bytes.substr(place + 8, length);
  EXPECT_EQ(content.size(), length);
  place += 8 + content.size();
  return content;
}

struct Container {
  json document;
  std::string binary;
};

Container openGlb(const std::filesystem::path& path) {
  std::ifstream file(path, std::ios::binary);
  const std::string bytes((std::istreambuf_iterator<char>(file)), std::istreambuf_iterator<char>());
  EXPECT_EQ(bytes.substr(0, 4), "glTF");
  EXPECT_EQ(wordAt(bytes, 4), 2u);
  EXPECT_EQ(wordAt(bytes, 8), bytes.size());
  std::size_t place = 12;
  Container container;
  container.document = json::parse(takeChunk(bytes, 0x4e4f534a, place));
  container.binary = takeChunk(bytes, 0x004e4942, place);
  EXPECT_EQ(place, bytes.size());
  const json& buffers = container.document.at("buffers");
  EXPECT_EQ(buffers.size(), 1u);
  const auto length = buffers.at(0).at("byteLength").get<std::size_t>();
  EXPECT_LE(length, container.binary.size());
  EXPECT_LT(container.binary.size(), length + 4);
  return container;
}

std::size_t widthOf(const std::string& type) {
  return type == "SCALAR" ? 1 : static_cast<std::size_t>(type.at(3) - '0');
}

/// The accessor's elements as they are stored. Notes what was read, for the check that nothing is
/// left over.
template <typename T>
std::vector<T> elements(const Container& file, std::size_t index, const std::string& type,
                        int target, std::set<std::size_t>& used) {
  used.insert(index);
  const json& accessor = file.document.at("accessors").at(index);
  const json& view =
      file.document.at("bufferViews").at(accessor.at("bufferView").get<std::size_t>());
  EXPECT_EQ(accessor.at("type"), type);
  EXPECT_EQ(view.at("target"), target);
  EXPECT_FALSE(view.contains("byteStride"));
  EXPECT_GE(accessor.at("count").get<std::size_t>(), 1u);
  const std::size_t offset =
      view.at("byteOffset").get<std::size_t>() + accessor.value("byteOffset", std::size_t{0});
  std::vector<T> values(accessor.at("count").get<std::size_t>() * widthOf(type));
  EXPECT_EQ(offset % 4, 0u);
  EXPECT_LE(values.size() * sizeof(T), view.at("byteLength").get<std::size_t>());
  if (offset + values.size() * sizeof(T) > file.binary.size())
    throw std::runtime_error("an accessor is outside the buffer");
  std::memcpy(values.data(), file.binary.data() + offset, values.size() * sizeof(T));
  return values;
}

std::vector<float> floats(const Container& file, std::size_t index, const std::string& type,
                          std::set<std::size_t>& used) {
  EXPECT_EQ(file.document.at("accessors").at(index).at("componentType"), floatType);
  std::vector<float> values = elements<float>(file, index, type, vertexTarget, used);
  EXPECT_TRUE(std::all_of(values.begin(), values.end(), [](float v) { return std::isfinite(v); }));
  return values;
}

template <std::size_t width>
std::vector<std::array<float, width>> vectors(const Container& file, std::size_t index,
                                              std::set<std::size_t>& used) {
  const std::vector<float> values = floats(file, index, "VEC" + std::to_string(width), used);
  std::vector<std::array<float, width>> all(values.size() / width);
  for (std::size_t i = 0; i < values.size(); ++i) all[i / width][i % width] = values[i];
  return all;
}

void checkBounds(const json& accessor, const std::vector<std::array<float, 3>>& positions) {
  for (std::size_t axis = 0; axis < 3; ++axis) {
    const auto [low, high] =
        std::minmax_element(positions.begin(), positions.end(),
                            [axis](const auto& a, const auto& b) { return a[axis] < b[axis]; });
    EXPECT_EQ(accessor.at("min").at(axis).get<double>(), double{(*low)[axis]});
    EXPECT_EQ(accessor.at("max").at(axis).get<double>(), double{(*high)[axis]});
  }
}

std::vector<std::uint32_t> readIndices(const Container& file, std::size_t index,
                                       std::size_t vertices, std::set<std::size_t>& used) {
  std::vector<std::uint32_t> indices;
  const json type = file.document.at("accessors").at(index).at("componentType");
  if (type == shortType) {
    const auto stored = elements<std::uint16_t>(file, index, "SCALAR", indexTarget, used);
    indices.assign(stored.begin(), stored.end());
  } else {
    EXPECT_EQ(type, intType);
    indices = elements<std::uint32_t>(file, index, "SCALAR", indexTarget, used);
  }
  const std::uint32_t restart = type == shortType ? 0xffff : 0xffffffff;
  EXPECT_EQ(indices.size() % 3, 0u);
  EXPECT_TRUE(std::all_of(indices.begin(), indices.end(),
                          [&](std::uint32_t i) { return i < vertices && i != restart; }));
  return indices;
}

void checkMaterial(const json& material) {
  const auto expectUnit = [&](const json& factor) {
    EXPECT_TRUE(factor.get<double>() >= 0 && factor.get<double>() <= 1) << material;
  };
  const json& factors = material.at("pbrMetallicRoughness");
  EXPECT_EQ(factors.at("baseColorFactor").size(), 4u);
  EXPECT_EQ(material.at("emissiveFactor").size(), 3u);
  for (const json& factor : factors.at("baseColorFactor")) expectUnit(factor);
  for (const json& factor : material.at("emissiveFactor")) expectUnit(factor);
  expectUnit(factors.at("metallicFactor"));
  expectUnit(factors.at("roughnessFactor"));
  EXPECT_EQ(material.contains("alphaCutoff"), material.at("alphaMode") == "MASK");
  EXPECT_GE(material.value("alphaCutoff", 0.0), 0.0);
}

void checkTangents(const GlbPart& part) {
  if (part.tangents.empty()) return;
  EXPECT_EQ(part.tangents.size(), part.positions.size());
  EXPECT_NE(part.mode, 0) << "tangents of points";
  for (const auto& t : part.tangents) {
    EXPECT_NEAR(std::hypot(t[0], t[1], t[2]), 1, 5e-4);
    EXPECT_TRUE(t[3] == 1 || t[3] == -1) << t[3];
  }
}

GlbPart readPart(const Container& file, const json& node, std::set<std::size_t>& used) {
  for (const char* property : {"matrix", "translation", "rotation", "scale", "skin", "children"}) {
    EXPECT_FALSE(node.contains(property)) << property;
  }
  const json& mesh = file.document.at("meshes").at(node.at("mesh").get<std::size_t>());
  EXPECT_EQ(mesh.at("primitives").size(), 1u);
  const json& primitive = mesh.at("primitives").at(0);
  GlbPart part;
  part.name = node.at("name");
  part.mode = primitive.at("mode");
  for (const auto& [name, accessor] : primitive.at("attributes").items()) {
    const auto index = accessor.get<std::size_t>();
    if (name == "POSITION") {
      part.positions = vectors<3>(file, index, used);
      checkBounds(file.document.at("accessors").at(index), part.positions);
    } else if (name == "NORMAL") {
      part.normals = vectors<3>(file, index, used);
    } else if (name == "TANGENT") {
      part.tangents = vectors<4>(file, index, used);
    } else {
      const std::string type = name.starts_with("TEXCOORD_") ? "VEC2" : "VEC4";
      part.others[name] = floats(file, index, type, used);
    }
  }
  EXPECT_EQ(part.normals.size(), part.positions.size());
  for (const auto& [name, values] : part.others) {
    EXPECT_EQ(values.size(), part.positions.size() * (name == "COLOR_0" ? 4 : 2)) << name;
  }
  for (const auto& n : part.normals) EXPECT_NEAR(std::hypot(n[0], n[1], n[2]), 1, 5e-4);
  checkTangents(part);
  if (part.others.contains("COLOR_0")) {
    for (const float level : part.others["COLOR_0"]) EXPECT_TRUE(level >= 0 && level <= 1) << level;
  }
  EXPECT_EQ(primitive.contains("indices"), part.mode == 4);
  if (primitive.contains("indices"))
    part.indices = readIndices(file, primitive.at("indices"), part.positions.size(), used);
  if (primitive.contains("material")) {
    part.material = file.document.at("materials").at(primitive.at("material").get<std::size_t>());
    checkMaterial(part.material);
  }
  return part;
}

}  // namespace

Glb readGlb(const std::filesystem::path& path) {
  const Container file = openGlb(path);
  Glb glb;
  glb.json = file.document;
  EXPECT_EQ(glb.json.at("asset").at("version"), "2.0");
  EXPECT_EQ(glb.json.at("asset").at("generator"), "dermis");
  EXPECT_EQ(glb.json.at("scene"), 0);
  const json& nodes = glb.json.at("nodes");
  EXPECT_EQ(glb.json.at("scenes").at(0).at("nodes").size(), nodes.size());
  std::set<std::size_t> used;
  for (const json& root : glb.json.at("scenes").at(0).at("nodes")) {
    glb.parts.push_back(readPart(file, nodes.at(root.get<std::size_t>()), used));
  }
  EXPECT_EQ(used.size(), glb.json.at("accessors").size());
  EXPECT_EQ(used.size(), glb.json.at("bufferViews").size());
  return glb;
}

}  // namespace dermis::test
