#include <algorithm>
#include <array>
#include <charconv>
#include <cmath>
#include <cstdint>
#include <cstdlib>
#include <map>
#include <nlohmann/json.hpp>
#include <span>
#include <string>
#include <utility>

#include "glb_file.h"
#include "mesh_formats.h"

namespace dermis::cli {
namespace {

using Json = nlohmann::ordered_json;
using samples::GlbBuffer;
using samples::GlbComponent;
using samples::GlbTarget;

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
    case gltf::AlphaMode::opaque:
      json["alphaMode"] = "OPAQUE";
      break;
    case gltf::AlphaMode::mask:
      json["alphaMode"] = "MASK";
      json["alphaCutoff"] = shortest(std::max(material.alphaCutoff, 0.0f));
      break;
    case gltf::AlphaMode::blend:
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
    if (part.primitive->material != gltf::none) {
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
  return samples::glbFile(std::move(document), buffer);
}

}  // namespace dermis::cli
