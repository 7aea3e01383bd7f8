#include <algorithm>
#include <array>
#include <bit>
#include <charconv>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <cstdlib>
#include <limits>
#include <map>
#include <nlohmann/json.hpp>
#include <span>
#include <string>
#include <utility>
#include <vector>

#include "mesh_output.h"

namespace dermis::cli {
namespace {

using Json = nlohmann::ordered_json;

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
  /// Begins a bufferView. It contains all values that are put before `end`.
  void begin();
  /// Appends the 1 to 4 lowest bytes of the value.
  void put(std::uint32_t value, int byteCount);
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

void GlbBuffer::begin() {
  bytes_.resize(padded(bytes_.size()));
  start_ = bytes_.size();
}

void GlbBuffer::put(std::uint32_t value, int byteCount) {
  for (int byte = 0; byte < byteCount; ++byte) {
    bytes_.push_back(static_cast<std::byte>((value >> (8 * byte)) & 0xFFU));
  }
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

/// Returns the bytes of the file. `document` has everything except accessors, bufferViews and
/// buffers, which are added. Invalid UTF-8 in names is replaced. Empty if the file would be larger
/// than 4 GiB, the maximum of the format.
std::vector<std::byte> glbContainer(Json document, const GlbBuffer& buffer) {
  document["accessors"] = buffer.accessors();
  document["bufferViews"] = buffer.views();
  document["buffers"] = Json::array({{{"byteLength", padded(buffer.bytes().size())}}});
  const std::string text = document.dump(-1, ' ', false, Json::error_handler_t::replace);

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

constexpr int pointsMode = 0;
constexpr int trianglesMode = 4;

int putVertices(GlbBuffer& buffer, const std::vector<float>& values, const char* type,
                std::size_t components) {
  buffer.begin();
  buffer.putFloats(values);
  return buffer.end(GlbComponent::float32, type, values.size() / components, GlbTarget::vertices);
}

int putPositions(GlbBuffer& buffer, const std::vector<float>& positions) {
  std::array<float, 3> low{positions[0], positions[1], positions[2]};
  std::array<float, 3> high = low;
  for (std::size_t i = 0; i < positions.size(); ++i) {
    low[i % 3] = std::min(low[i % 3], positions[i]);
    high[i % 3] = std::max(high[i % 3], positions[i]);
  }
  const int accessor = putVertices(buffer, positions, "VEC3", 3);
  buffer.accessor(accessor)["min"] = low;
  buffer.accessor(accessor)["max"] = high;
  return accessor;
}

using Vector = std::array<double, 3>;

Vector vectorAt(const std::vector<float>& values, std::size_t first) {
  return {double{values[first]}, double{values[first + 1]}, double{values[first + 2]}};
}

double lengthOf(const Vector& v) {
  return std::hypot(v[0], v[1], v[2]);
}

/// Normalizes the three floats from `first` on, or replaces them by the normalized fallback if they
/// have no direction. A vector whose length is 1 except for rounding is unchanged.
void makeUnit(std::vector<float>& values, std::size_t first, const Vector& fallback) {
  constexpr double tolerance = 1e-4;
  Vector direction = vectorAt(values, first);
  double length = lengthOf(direction);
  if (std::abs(length - 1) <= tolerance) return;
  if (!(length > 0) || !std::isfinite(length)) {
    direction = fallback;
    length = lengthOf(fallback);
  }
  for (std::size_t axis = 0; axis < 3; ++axis)
    values[first + axis] = static_cast<float>(direction[axis] / length);
}

/// glTF 2.0, 3.7.2.1: normals have unit length.
std::vector<float> unitNormals(std::vector<float> normals) {
  for (std::size_t i = 0; i + 2 < normals.size(); i += 3) makeUnit(normals, i, {0, 0, 1});
  return normals;
}

/// A vector perpendicular to a unit vector.
Vector squareTo(const Vector& n) {
  return std::abs(n[0]) < 0.5 ? Vector{0, n[2], -n[1]} : Vector{-n[2], 0, n[0]};
}

/// glTF 2.0, 3.7.2.1: tangents have unit length, and their handedness is 1 or -1.
std::vector<float> unitTangents(std::vector<float> tangents, const std::vector<float>& normals) {
  for (std::size_t vertex = 0; vertex * 4 < tangents.size(); ++vertex) {
    makeUnit(tangents, vertex * 4, squareTo(vectorAt(normals, vertex * 3)));
    float& handedness = tangents[vertex * 4 + 3];
    handedness = handedness < 0 ? -1.0f : 1.0f;
  }
  return tangents;
}

std::vector<float> finiteTexcoords(std::vector<float> texcoords) {
  std::replace_if(
      texcoords.begin(), texcoords.end(), [](float value) { return !std::isfinite(value); }, 0.0f);
  return texcoords;
}

/// Clamps to [0, 1]; NaN becomes 0.
float clamped(float value) {
  return value > 0 ? std::min(value, 1.0f) : 0;
}

std::vector<float> clampedColors(std::vector<float> colors) {
  std::transform(colors.begin(), colors.end(), colors.begin(), clamped);
  return colors;
}

/// The largest value of an index type must not be used: some graphics APIs use it to restart a
/// strip.
int putIndices(GlbBuffer& buffer, const gltf::Primitive& primitive) {
  const bool isShort = primitive.vertexCount <= 0xffff;
  buffer.begin();
  for (const std::uint32_t index : primitive.triangles) buffer.put(index, isShort ? 2 : 4);
  return buffer.end(isShort ? GlbComponent::unsignedShort : GlbComponent::unsignedInt, "SCALAR",
                    primitive.triangles.size(), GlbTarget::indices);
}

Json putPrimitive(GlbBuffer& buffer, const OutputPart& part) {
  const gltf::Primitive& primitive = *part.primitive;
  Json attributes;
  attributes["POSITION"] = putPositions(buffer, part.positions);
  const std::vector<float> normals = unitNormals(part.normals);
  attributes["NORMAL"] = putVertices(buffer, normals, "VEC3", 3);
  if (!part.tangents.empty() && !primitive.triangles.empty()) {
    attributes["TANGENT"] = putVertices(buffer, unitTangents(part.tangents, normals), "VEC4", 4);
  }
  for (std::size_t set = 0; set < primitive.texcoords.size(); ++set) {
    attributes["TEXCOORD_" + std::to_string(set)] =
        putVertices(buffer, finiteTexcoords(primitive.texcoords[set]), "VEC2", 2);
  }
  if (!primitive.colors.empty()) {
    attributes["COLOR_0"] = putVertices(buffer, clampedColors(primitive.colors), "VEC4", 4);
  }
  Json json;
  json["attributes"] = attributes;
  if (!primitive.triangles.empty()) json["indices"] = putIndices(buffer, primitive);
  json["mode"] = primitive.triangles.empty() ? pointsMode : trianglesMode;
  return json;
}

/// The shortest decimal number that reads back as this float: 0.8, not 0.800000011920929.
double shortest(float value) {
  std::array<char, 32> digits{};
  std::to_chars(digits.begin(), digits.end() - 1, value);
  // libc++ 16 has no std::from_chars for double. Programs begin in the locale "C".
  return std::strtod(digits.data(), nullptr);
}

template <std::size_t size>
Json factors(const std::array<float, size>& values) {
  Json json = Json::array();
  for (const float value : values) json.push_back(shortest(clamped(value)));
  return json;
}

Json describeMaterial(const gltf::Material& material) {
  Json json;
  if (!material.name.empty()) json["name"] = material.name;
  json["pbrMetallicRoughness"] = {{"baseColorFactor", factors(material.baseColor)},
                                  {"metallicFactor", shortest(clamped(material.metallic))},
                                  {"roughnessFactor", shortest(clamped(material.roughness))}};
  json["emissiveFactor"] = factors(material.emissive);
  switch (material.alphaMode) {
    case gltf::Material::AlphaMode::opaque:
      json["alphaMode"] = "OPAQUE";
      break;
    case gltf::Material::AlphaMode::mask:
      json["alphaMode"] = "MASK";
      json["alphaCutoff"] = shortest(std::max(material.alphaCutoff, 0.0f));
      break;
    case gltf::Material::AlphaMode::blend:
      json["alphaMode"] = "BLEND";
      break;
  }
  json["doubleSided"] = material.doubleSided;
  return json;
}

/// The materials in use, without duplicates, in the order of their first use.
class MaterialList {
 public:
  explicit MaterialList(std::span<const gltf::Material> materials) : materials_(materials) {}

  std::size_t add(std::uint32_t material) {
    const auto [place, isNew] = places_.emplace(material, list_.size());
    if (isNew) list_.push_back(describeMaterial(materials_[material]));
    return place->second;
  }

  const Json& list() const { return list_; }

 private:
  std::span<const gltf::Material> materials_;
  std::map<std::uint32_t, std::size_t> places_;
  Json list_ = Json::array();
};

}  // namespace

std::vector<std::byte> glbFile(const OutputMesh& mesh) {
  GlbBuffer buffer;
  MaterialList materials(mesh.materials);
  Json nodes = Json::array(), meshes = Json::array(), roots = Json::array();
  for (const OutputPart& part : mesh.parts) {
    Json primitive = putPrimitive(buffer, part);
    if (part.primitive->material != noIndex) {
      primitive["material"] = materials.add(part.primitive->material);
    }
    roots.push_back(nodes.size());
    nodes.push_back({{"name", part.name}, {"mesh", meshes.size()}});
    meshes.push_back({{"name", part.name}, {"primitives", Json::array({primitive})}});
  }

  Json document;
  document["asset"] = {{"version", "2.0"}, {"generator", "dermis"}};
  document["scene"] = 0;
  document["scenes"] = Json::array({{{"nodes", roots}}});
  document["nodes"] = nodes;
  document["meshes"] = meshes;
  if (!materials.list().empty()) document["materials"] = materials.list();
  return glbContainer(std::move(document), buffer);
}

}  // namespace dermis::cli
