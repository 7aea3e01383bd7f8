#include <algorithm>
#include <string_view>
#include <utility>

#include "gltf/failure.h"
#include "gltf/reader.h"

namespace dermis::gltf {
namespace {

// What each attribute may be stored as: glTF 2.0, 3.7.2.1, and the longer lists of
// KHR_mesh_quantization.
constexpr Format float32{TINYGLTF_COMPONENT_TYPE_FLOAT, false};
constexpr Format int8{TINYGLTF_COMPONENT_TYPE_BYTE, false};
constexpr Format snorm8{TINYGLTF_COMPONENT_TYPE_BYTE, true};
constexpr Format uint8{TINYGLTF_COMPONENT_TYPE_UNSIGNED_BYTE, false};
constexpr Format unorm8{TINYGLTF_COMPONENT_TYPE_UNSIGNED_BYTE, true};
constexpr Format int16{TINYGLTF_COMPONENT_TYPE_SHORT, false};
constexpr Format snorm16{TINYGLTF_COMPONENT_TYPE_SHORT, true};
constexpr Format uint16{TINYGLTF_COMPONENT_TYPE_UNSIGNED_SHORT, false};
constexpr Format unorm16{TINYGLTF_COMPONENT_TYPE_UNSIGNED_SHORT, true};
constexpr Format uint32{TINYGLTF_COMPONENT_TYPE_UNSIGNED_INT, false};

constexpr Format floatOnly[] = {float32};
constexpr Format colorFormats[] = {float32, unorm8, unorm16};
constexpr Format weightFormats[] = {float32, unorm8, unorm16};
constexpr Format jointFormats[] = {uint8, uint16};
constexpr Format indexFormats[] = {uint8, uint16, uint32};
constexpr Format texcoordFormats[] = {float32, unorm8, unorm16};
constexpr Format quantizedPositions[] = {float32, int8,    snorm8, uint8,  unorm8,
                                         int16,   snorm16, uint16, unorm16};
constexpr Format quantizedDirections[] = {float32, snorm8, snorm16};
constexpr Format quantizedTexcoords[] = {float32, int8,    snorm8, uint8,  unorm8,
                                         int16,   snorm16, uint16, unorm16};
constexpr Format quantizedTargets[] = {float32, int8, snorm8, int16, snorm16};

// The number in "JOINTS_3" if the name begins with the prefix "JOINTS_".
struct SetName {
  bool matches = false;
  std::uint32_t number = none;  // none: not a number as the specification writes it
};

SetName setName(std::string_view name, std::string_view prefix) {
  if (!name.starts_with(prefix)) return {};
  const std::string_view digits = name.substr(prefix.size());
  const bool decimal = !digits.empty() && digits.size() <= 6 &&
                       digits.find_first_not_of("0123456789") == std::string_view::npos &&
                       (digits.size() == 1 || digits[0] != '0');
  return {true, decimal ? static_cast<std::uint32_t>(std::stoul(std::string(digits))) : none};
}

int findAttribute(const std::map<std::string, int>& attributes, const std::string& name) {
  const auto found = attributes.find(name);
  return found == attributes.end() ? -1 : found->second;
}

// How many sets of an attribute there are; they must be numbered from 0 without a gap.
std::uint32_t countSets(const std::map<std::string, int>& attributes, std::string_view prefix,
                        const std::string& where) {
  std::uint32_t count = 0;
  for (const auto& [name, accessor] : attributes) {
    const SetName set = setName(name, prefix);
    if (!set.matches) continue;
    ++count;
    if (set.number == none) failInvalid(where, ": there is no attribute ", inQuotes(name));
  }
  for (std::uint32_t i = 0; i < count; ++i) {
    if (attributes.contains(join(prefix, i))) continue;
    failInvalid(where, ": it has ", count, " sets of ", prefix, "n, but no ", prefix, i);
  }
  return count;
}

class PrimitiveCheck {
 public:
  PrimitiveCheck(const Source& source, const tinygltf::Primitive& primitive, std::string where)
      : source_(source), primitive_(primitive), where_(std::move(where)) {
    for (const auto& attribute : primitive.attributes) {
      if (first_ == nullptr && attribute.first != indicesAttribute) first_ = &attribute;
    }
  }

  void run() const {
    checkInfluences();
    if (!primitive_.targets.empty() && first_ == nullptr) {
      failInvalid(where_, ": it has morph targets, but no attribute that they could change");
    }
    for (const auto& [name, accessor] : primitive_.attributes) checkAttribute(name, accessor);
    for (std::size_t i = 0; i < primitive_.targets.size(); ++i) {
      for (const auto& [name, accessor] : primitive_.targets[i]) {
        checkTarget(name, accessor, join(where_, " morph target ", i, " ", shortName(name)));
      }
    }
  }

 private:
  void checkInfluences() const {
    const std::uint32_t joints = countSets(primitive_.attributes, "JOINTS_", where_);
    const std::uint32_t weights = countSets(primitive_.attributes, "WEIGHTS_", where_);
    if (joints > weights) failInvalid(where_, ": JOINTS_", weights, " has no WEIGHTS_", weights);
    if (weights > joints) failInvalid(where_, ": WEIGHTS_", joints, " has no JOINTS_", joints);
  }

  void checkAttribute(const std::string& name, int accessor) const {
    const std::string place =
        join(where_, " ", name == indicesAttribute ? "indices" : shortName(name));
    if (name == indicesAttribute) {
      source_.require(accessor, TINYGLTF_TYPE_SCALAR, indexFormats, place);
      source_.requireNoStride(accessor, place);
      return;
    }
    if (name == "POSITION") {
      source_.require(accessor, TINYGLTF_TYPE_VEC3, either(floatOnly, quantizedPositions), place);
    } else if (name == "NORMAL") {
      source_.require(accessor, TINYGLTF_TYPE_VEC3, either(floatOnly, quantizedDirections), place);
    } else if (name == "TANGENT") {
      source_.require(accessor, TINYGLTF_TYPE_VEC4, either(floatOnly, quantizedDirections), place);
    } else if (name.starts_with("TEXCOORD_")) {
      source_.require(accessor, TINYGLTF_TYPE_VEC2, either(texcoordFormats, quantizedTexcoords),
                      place);
    } else if (name.starts_with("COLOR_")) {
      const bool three = source_.components(accessor) == 3;
      source_.require(accessor, three ? TINYGLTF_TYPE_VEC3 : TINYGLTF_TYPE_VEC4, colorFormats,
                      place);
    } else if (name.starts_with("JOINTS_")) {
      source_.require(accessor, TINYGLTF_TYPE_VEC4, jointFormats, place);
    } else if (name.starts_with("WEIGHTS_")) {
      source_.require(accessor, TINYGLTF_TYPE_VEC4, weightFormats, place);
    }
    checkCount(accessor, place);
    source_.requireAttributeAlignment(accessor, place);
  }

  void checkTarget(const std::string& name, int accessor, const std::string& place) const {
    if (name == "POSITION") {
      source_.require(accessor, TINYGLTF_TYPE_VEC3, either(floatOnly, quantizedTargets), place);
    } else if (name == "NORMAL" || name == "TANGENT") {
      source_.require(accessor, TINYGLTF_TYPE_VEC3, either(floatOnly, quantizedDirections), place);
    }
    checkCount(accessor, place);
    source_.requireAttributeAlignment(accessor, place);
  }

  // All attributes of a primitive have one count; which of them gives it does not matter.
  void checkCount(int accessor, const std::string& place) const {
    const auto& [name, first] = *first_;
    if (source_.count(accessor) == source_.count(first)) return;
    failInvalid(place, ": accessor ", accessor, " has ", source_.count(accessor),
                " elements where ", shortName(name), " has ", source_.count(first));
  }

  std::span<const Format> either(std::span<const Format> plain,
                                 std::span<const Format> quantized) const {
    return source_.quantized() ? quantized : plain;
  }

  const Source& source_;
  const tinygltf::Primitive& primitive_;
  std::string where_;
  const std::pair<const std::string, int>* first_ = nullptr;  // null: it has indices at most
};

ComponentType storedType(Format format) {
  switch (format.componentType) {
    case TINYGLTF_COMPONENT_TYPE_UNSIGNED_BYTE:
      return format.normalized ? ComponentType::unorm8 : ComponentType::uint8;
    case TINYGLTF_COMPONENT_TYPE_UNSIGNED_SHORT:
      return format.normalized ? ComponentType::unorm16 : ComponentType::uint16;
    default:
      return ComponentType::float32;
  }
}

std::vector<Influences> readInfluences(Source& source, const std::map<std::string, int>& attributes,
                                       const std::string& where) {
  std::vector<Influences> sets(countSets(attributes, "JOINTS_", where));
  for (std::size_t i = 0; i < sets.size(); ++i) {
    const int joints = attributes.at(join("JOINTS_", i));
    const int weights = attributes.at(join("WEIGHTS_", i));
    sets[i].jointType = storedType(source.format(joints));
    sets[i].weightType = storedType(source.format(weights));
    sets[i].joints = source.stored(joints);
    sets[i].weights = source.stored(weights);
  }
  return sets;
}

std::vector<float> readColors(Source& source, int accessor, const std::string& where) {
  if (accessor < 0) return {};
  std::vector<float> colors = source.floats(accessor);
  if (source.components(accessor) == 4) return colors;
  source.spend(source.count(accessor), 16, where);
  std::vector<float> opaque(colors.size() / 3 * 4, 1.0f);
  for (std::size_t i = 0; i < colors.size(); ++i) opaque[i / 3 * 4 + i % 3] = colors[i];
  return opaque;
}

std::vector<float> readOptional(Source& source, int accessor) {
  return accessor < 0 ? std::vector<float>() : source.floats(accessor);
}

// Sets from 0 up to the first that is missing.
std::vector<std::vector<float>> readTexcoords(Source& source,
                                              const std::map<std::string, int>& attributes) {
  std::vector<std::vector<float>> sets;
  for (;;) {
    const int accessor = findAttribute(attributes, join("TEXCOORD_", sets.size()));
    if (accessor < 0) return sets;
    sets.push_back(source.floats(accessor));
  }
}

MorphTarget readTarget(Source& source, const std::map<std::string, int>& attributes) {
  MorphTarget target;
  target.positions = readOptional(source, findAttribute(attributes, "POSITION"));
  target.normals = readOptional(source, findAttribute(attributes, "NORMAL"));
  target.tangents = readOptional(source, findAttribute(attributes, "TANGENT"));
  return target;
}

std::vector<std::uint32_t> readIndices(Source& source, int accessor, std::uint32_t vertexCount,
                                       const std::string& where) {
  if (accessor >= 0) {
    std::vector<std::uint32_t> indices = source.integers(accessor);
    for (std::size_t i = 0; i < indices.size(); ++i) {
      if (indices[i] < vertexCount) continue;
      failInvalid(where, ": index ", i, " of accessor ", accessor, " is ", indices[i],
                  ", and there are ", vertexCount, " vertices");
    }
    return indices;
  }
  source.spend(vertexCount, 4, where);
  std::vector<std::uint32_t> indices(vertexCount);
  for (std::uint32_t i = 0; i < vertexCount; ++i) indices[i] = i;
  return indices;
}

// glTF 2.0, 3.7.2.1: triangle i of a strip is i, i + 1 + i % 2, i + 2 − i % 2; of a fan i + 1, i +
// 2, 0.
std::vector<std::uint32_t> unroll(const std::vector<std::uint32_t>& indices, int mode) {
  std::vector<std::uint32_t> triangles;
  if (indices.size() < 3) return triangles;
  triangles.reserve(3 * (indices.size() - 2));
  for (std::size_t i = 0; i + 2 < indices.size(); ++i) {
    const std::size_t odd = i % 2;
    if (mode == TINYGLTF_MODE_TRIANGLE_STRIP) {
      triangles.insert(triangles.end(), {indices[i], indices[i + 1 + odd], indices[i + 2 - odd]});
    } else {
      triangles.insert(triangles.end(), {indices[i + 1], indices[i + 2], indices[0]});
    }
  }
  return triangles;
}

std::vector<std::uint32_t> readTriangles(Source& source, const tinygltf::Primitive& from,
                                         std::uint32_t vertexCount, const std::string& where,
                                         std::vector<std::string>& notes) {
  const int accessor = findAttribute(from.attributes, indicesAttribute);
  // Points and lines: their indices are looked at, but make no triangle.
  std::vector<std::uint32_t> indices = readIndices(source, accessor, vertexCount, where);
  switch (from.mode) {
    case TINYGLTF_MODE_TRIANGLES:
      if (indices.size() % 3 != 0) {
        notes.push_back(join(where, ": the last ", indices.size() % 3,
                             " indices make no triangle and are left out"));
        indices.resize(indices.size() - indices.size() % 3);
      }
      return indices;
    case TINYGLTF_MODE_TRIANGLE_STRIP:
    case TINYGLTF_MODE_TRIANGLE_FAN:
      source.spend(indices.size(), 12, where);
      return unroll(indices, from.mode);
    default:
      return {};
  }
}

std::string primitiveName(const tinygltf::Mesh& mesh, std::size_t meshIndex,
                          std::size_t primitive) {
  // Short enough that its number is not cut off by whoever puts it in quotes.
  const std::string name =
      mesh.name.empty() ? join("number ", meshIndex) : shortName(mesh.name, 56);
  return mesh.primitives.size() == 1 ? name : join(name, " primitive ", primitive);
}

}  // namespace

std::string primitivePlace(std::size_t mesh, std::size_t primitive) {
  return join("mesh ", mesh, " primitive ", primitive);
}

void checkPrimitives(const Source& source) {
  const auto& meshes = source.content().meshes;
  for (std::size_t i = 0; i < meshes.size(); ++i) {
    for (std::size_t j = 0; j < meshes[i].primitives.size(); ++j) {
      PrimitiveCheck(source, meshes[i].primitives[j], primitivePlace(i, j)).run();
    }
  }
}

Primitive readPrimitive(Source& source, std::uint32_t meshIndex, std::uint32_t primitiveIndex,
                        std::vector<std::string>& notes) {
  const tinygltf::Mesh& mesh = source.content().meshes[meshIndex];
  const tinygltf::Primitive& from = mesh.primitives[primitiveIndex];
  const std::string where = primitivePlace(meshIndex, primitiveIndex);
  Primitive primitive;
  primitive.name = primitiveName(mesh, meshIndex, primitiveIndex);
  primitive.material = indexOf(from.material);
  const int positions = findAttribute(from.attributes, "POSITION");
  if (positions < 0) {
    notes.push_back(join(where, ": it has no positions and is left out"));
    return primitive;
  }
  primitive.vertexCount = source.count(positions);
  primitive.positions = source.floats(positions);
  primitive.normals = readOptional(source, findAttribute(from.attributes, "NORMAL"));
  primitive.tangents = readOptional(source, findAttribute(from.attributes, "TANGENT"));
  primitive.texcoords = readTexcoords(source, from.attributes);
  primitive.colors = readColors(source, findAttribute(from.attributes, "COLOR_0"), where);
  primitive.influences = readInfluences(source, from.attributes, where);
  primitive.triangles = readTriangles(source, from, primitive.vertexCount, where, notes);
  for (const auto& target : from.targets) {
    primitive.morphTargets.push_back(readTarget(source, target));
  }
  return primitive;
}

}  // namespace dermis::gltf
