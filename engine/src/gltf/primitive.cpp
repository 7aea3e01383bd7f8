#include <algorithm>
#include <array>
#include <charconv>
#include <cmath>
#include <cstring>
#include <map>
#include <string_view>
#include <system_error>
#include <tuple>
#include <utility>

#include "gltf/failure.h"
#include "gltf/reader.h"
#include "strict_floating_point.h"

namespace dermis::gltf {
namespace {

// The formats that each attribute may have: glTF 2.0, 3.7.2.1, and the longer lists of
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

// Formats that are not allowed but have only one meaning. A joint is an integer in any format, and
// weights are from 0 to 1.
constexpr Format clearJoints[] = {unorm8, unorm16, uint32, int8, int16, float32};
constexpr Format clearWeights[] = {uint8, uint16, snorm8, snorm16};
constexpr Format clearIndices[] = {unorm8, unorm16};

// The number in "JOINTS_3" if the name begins with the prefix "JOINTS_".
struct SetName {
  bool matches = false;
  std::uint32_t number = noIndex;  // none if not written as the specification requires
};

SetName setName(std::string_view name, std::string_view prefix) {
  if (!name.starts_with(prefix)) return {};
  const std::string_view digits = name.substr(prefix.size());
  std::uint32_t number = noIndex;
  const char* const end = digits.data() + digits.size();
  const auto [stop, error] = std::from_chars(digits.data(), end, number);
  const bool isDecimal = error == std::errc() && stop == end && digits.size() <= 6 &&
                         (digits.size() == 1 || digits[0] != '0');
  return {true, isDecimal ? number : noIndex};
}

int findAttribute(const std::map<std::string, int>& attributes, const std::string& name) {
  const auto found = attributes.find(name);
  return found == attributes.end() ? -1 : found->second;
}

// Number of sets of an attribute. They must be numbered from 0 without a gap.
std::uint32_t countSets(const std::map<std::string, int>& attributes, std::string_view prefix,
                        const std::string& where) {
  std::uint32_t count = 0;
  for (const auto& [name, accessor] : attributes) {
    const SetName set = setName(name, prefix);
    if (!set.matches) continue;
    ++count;
    if (set.number == noIndex) failInvalid(where, ": there is no attribute ", inQuotes(name));
  }
  for (std::uint32_t i = 0; i < count; ++i) {
    if (attributes.contains(join(prefix, i))) continue;
    failInvalid(where, ": it has ", count, " sets of ", prefix, "n, but no ", prefix, i);
  }
  return count;
}

class PrimitiveCheck {
 public:
  PrimitiveCheck(Source& source, std::size_t mesh, std::size_t primitive)
      : source_(source),
        mesh_(mesh),
        index_(primitive),
        primitive_(source.content().meshes[mesh].primitives[primitive]),
        where_(primitivePlace(mesh, primitive)) {}

  void run() {
    if (!primitive_.targets.empty() && hasNoAttribute()) {
      failInvalid(where_, ": it has morph targets, but no attribute that they could displace");
    }
    // Such a primitive is left out.
    if (!primitive_.attributes.contains("POSITION")) return;
    checkInfluences();
    // Iterates over a copy, because attributes may be left out.
    for (const auto& attribute : std::map(primitive_.attributes)) {
      const std::string& name = attribute.first;
      const int accessor = attribute.second;
      const auto check = [&] { checkAttribute(name, accessor); };
      if (!concernsOnlyAppearance(name)) {
        check();
      } else if (!source_.notes().tolerate(NoteKind::attribute, "; it is left out", check)) {
        source_.leaveOut(mesh_, index_, name);
      }
    }
    for (std::size_t i = 0; i < primitive_.targets.size(); ++i) {
      for (const auto& [name, accessor] : primitive_.targets[i]) {
        checkTarget(name, accessor, join(where_, " morph target ", i, " ", placeName(name)));
      }
    }
  }

 private:
  bool hasNoAttribute() const {
    return primitive_.attributes.size() == primitive_.attributes.count(indicesAttribute);
  }

  // Everything except positions, directions, triangles and what moves them.
  static bool concernsOnlyAppearance(std::string_view name) {
    return name != indicesAttribute && name != "POSITION" && name != "NORMAL" &&
           name != "TANGENT" && !name.starts_with("JOINTS_") && !name.starts_with("WEIGHTS_");
  }

  void checkInfluences() {
    std::uint32_t joints = countSets(primitive_.attributes, "JOINTS_", where_);
    const std::uint32_t weights = countSets(primitive_.attributes, "WEIGHTS_", where_);
    // Joints without weights move nothing, but a vertex needs some weights.
    for (; joints > weights; --joints) {
      const std::string sentence =
          join(where_, ": JOINTS_", joints - 1, " has no WEIGHTS_", joints - 1);
      if (weights == 0) failInvalid(sentence);
      source_.notes().broken(NoteKind::influenceSet, sentence, "; it is left out");
      source_.leaveOut(mesh_, index_, join("JOINTS_", joints - 1));
    }
    if (weights > joints) failInvalid(where_, ": WEIGHTS_", joints, " has no JOINTS_", joints);
  }

  void checkAttribute(const std::string& name, int accessor) const {
    const std::string place = join(where_, " ", placeName(name));
    if (name == indicesAttribute) {
      source_.require(accessor, TINYGLTF_TYPE_SCALAR, indexFormats, place, clearIndices);
      source_.noteStride(accessor, place);
      return;
    }
    if (name == "POSITION") {
      requireQuantized(accessor, TINYGLTF_TYPE_VEC3, floatOnly, quantizedPositions, place);
    } else if (name == "NORMAL") {
      requireQuantized(accessor, TINYGLTF_TYPE_VEC3, floatOnly, quantizedDirections, place);
    } else if (name == "TANGENT") {
      requireQuantized(accessor, TINYGLTF_TYPE_VEC4, floatOnly, quantizedDirections, place);
    } else if (name.starts_with("TEXCOORD_")) {
      requireQuantized(accessor, TINYGLTF_TYPE_VEC2, texcoordFormats, quantizedTexcoords, place);
    } else if (name.starts_with("COLOR_")) {
      const bool three = source_.components(accessor) == 3;
      source_.require(accessor, three ? TINYGLTF_TYPE_VEC3 : TINYGLTF_TYPE_VEC4, colorFormats,
                      place);
    } else if (name.starts_with("JOINTS_")) {
      source_.require(accessor, TINYGLTF_TYPE_VEC4, jointFormats, place, clearJoints);
    } else if (name.starts_with("WEIGHTS_")) {
      source_.require(accessor, TINYGLTF_TYPE_VEC4, weightFormats, place, clearWeights);
    }
    checkCount(accessor, place);
    source_.noteAttributeAlignment(accessor, place);
  }

  void checkTarget(const std::string& name, int accessor, const std::string& place) const {
    if (name == "POSITION") {
      requireQuantized(accessor, TINYGLTF_TYPE_VEC3, floatOnly, quantizedTargets, place);
    } else if (name == "NORMAL" || name == "TANGENT") {
      requireQuantized(accessor, TINYGLTF_TYPE_VEC3, floatOnly, quantizedDirections, place);
    } else {
      return;
    }
    checkCount(accessor, place);
    source_.noteAttributeAlignment(accessor, place);
  }

  // The name of an attribute in messages. An application may have chosen it.
  static std::string placeName(const std::string& name) {
    if (name == indicesAttribute) return "indices";
    return name.starts_with("_") || name.size() > 20 ? inQuotes(name) : name;
  }

  // All attributes must have as many elements as there are positions.
  void checkCount(int accessor, const std::string& place) const {
    const std::uint32_t vertices = source_.count(primitive_.attributes.at("POSITION"));
    if (source_.count(accessor) == vertices) return;
    failInvalid(place, ": accessor ", accessor, " has ", source_.count(accessor),
                " elements, but POSITION has ", vertices);
  }

  // Formats of KHR_mesh_quantization are tolerated in a file that does not declare it.
  void requireQuantized(int accessor, int type, std::span<const Format> plain,
                        std::span<const Format> quantized, const std::string& place) const {
    if (source_.quantized()) return source_.require(accessor, type, quantized, place);
    source_.require(accessor, type, plain, place, quantized);
  }

  Source& source_;
  std::size_t mesh_, index_;
  const tinygltf::Primitive& primitive_;
  std::string where_;
};

// The type of joints or weights as they are kept: bytes and shorts as in the file, other formats as
// the type that they are converted to.
ComponentType keptType(const Source& source, int accessor, ComponentType byte,
                       ComponentType sixteen, ComponentType other) {
  switch (source.format(accessor).componentType) {
    case TINYGLTF_COMPONENT_TYPE_UNSIGNED_BYTE:
      return byte;
    case TINYGLTF_COMPONENT_TYPE_UNSIGNED_SHORT:
      return sixteen;
    default:
      return other;
  }
}

bool isByteOrShort(const Source& source, int accessor) {
  const int type = source.format(accessor).componentType;
  return type == TINYGLTF_COMPONENT_TYPE_UNSIGNED_BYTE ||
         type == TINYGLTF_COMPONENT_TYPE_UNSIGNED_SHORT;
}

// Unsigned bytes and shorts are joints whether or not they are marked as normalized. Other formats
// are converted to shorts.
SharedArray<std::byte> decodeJoints(Source& source, int accessor, const std::string& where) {
  if (isByteOrShort(source, accessor)) return source.stored(accessor);
  // Exact up to 2^24; joints above 2^16 are refused.
  const std::vector<float> values = source.floats(accessor);
  source.spend(values.size(), sizeof(std::uint16_t), where);
  std::vector<std::byte> joints(values.size() * sizeof(std::uint16_t));
  for (std::size_t i = 0; i < values.size(); ++i) {
    if (!(values[i] >= 0 && values[i] <= 65535 && values[i] == std::floor(values[i]))) {
      failInvalid(where, ": component ", i % 4, " of vertex ", i / 4, " is ", values[i],
                  ", which is not a joint");
    }
    const auto joint = static_cast<std::uint16_t>(values[i]);
    std::memcpy(&joints[i * sizeof joint], &joint, sizeof joint);
  }
  return joints;
}

// Unsigned bytes and shorts are weights from 0 to 1 whether or not they are marked as normalized.
SharedArray<std::byte> decodeWeights(Source& source, int accessor, const std::string& where) {
  if (isByteOrShort(source, accessor)) return source.stored(accessor);
  const std::vector<float> values = source.floats(accessor);
  source.spend(values.size(), sizeof(float), where);
  std::vector<std::byte> weights(values.size() * sizeof(float));
  if (!values.empty()) std::memcpy(weights.data(), values.data(), weights.size());
  return weights;
}

SharedArray<float> decodeColors(Source& source, int accessor, const std::string& where) {
  std::vector<float> colors = source.floats(accessor);
  if (source.components(accessor) == 4) return colors;
  source.spend(source.count(accessor), 16, where);
  std::vector<float> opaque(colors.size() / 3 * 4, 1.0f);
  for (std::size_t i = 0; i < colors.size(); ++i) opaque[i / 3 * 4 + i % 3] = colors[i];
  return opaque;
}

// The accessors of a morph target, or −1: positions, normals, tangents.
using TargetAccessors = std::array<int, 3>;

TargetAccessors accessorsOf(const Source& source, const std::map<std::string, int>& attributes) {
  TargetAccessors accessors;
  std::size_t next = 0;
  for (const char* name : {"POSITION", "NORMAL", "TANGENT"}) {
    const int accessor = findAttribute(attributes, name);
    // Zeros displace nothing.
    accessors[next++] = accessor >= 0 && source.hasNoData(accessor) ? -1 : accessor;
  }
  return accessors;
}

// A target whose accessors all have only sparse values keeps only those vertices.
MorphTarget decodeSparseTarget(Source& source, const TargetAccessors& accessors) {
  std::array<Source::SparseValues, 3> sparse;
  std::vector<std::uint32_t> vertices;
  for (std::size_t i = 0; i < accessors.size(); ++i) {
    if (accessors[i] < 0) continue;
    sparse[i] = source.sparseFloats(accessors[i]);
    vertices.insert(vertices.end(), sparse[i].elements.begin(), sparse[i].elements.end());
  }
  std::ranges::sort(vertices);
  vertices.erase(std::unique(vertices.begin(), vertices.end()), vertices.end());
  MorphTarget target;
  if (vertices.empty()) return target;
  const std::array arrays{&target.positions, &target.normals, &target.tangents};
  for (std::size_t i = 0; i < accessors.size(); ++i) {
    if (accessors[i] < 0) continue;
    std::vector<float> values(3 * vertices.size());
    const float* from = sparse[i].values.data();
    for (const std::uint32_t element : sparse[i].elements) {
      const auto place = std::ranges::lower_bound(vertices, element) - vertices.begin();
      std::copy_n(from, 3, values.begin() + 3 * place);
      from += 3;
    }
    *arrays[i] = std::move(values);
  }
  target.vertices = std::move(vertices);
  return target;
}

std::vector<std::uint32_t> decodeIndices(Source& source, int accessor, std::uint32_t vertexCount,
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

// glTF 2.0, 3.7.2.1: triangle i of a strip is (i, i + 1 + i % 2, i + 2 − i % 2); triangle i of a
// fan is (i + 1, i + 2, 0).
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

SharedArray<std::uint32_t> decodeTriangles(Source& source, int accessor, int mode,
                                           std::uint32_t vertexCount, const std::string& where) {
  // The indices of points and lines are checked, but form no triangles.
  std::vector<std::uint32_t> indices = decodeIndices(source, accessor, vertexCount, where);
  switch (mode) {
    case TINYGLTF_MODE_TRIANGLES:
      if (indices.size() % 3 != 0) {
        source.notes().remark(NoteKind::restOfTriangles, where, ": the last ", indices.size() % 3,
                              " indices do not form a triangle and are left out");
        indices.resize(indices.size() - indices.size() % 3);
      }
      return indices;
    case TINYGLTF_MODE_TRIANGLE_STRIP:
    case TINYGLTF_MODE_TRIANGLE_FAN:
      source.spend(indices.size(), 12, where);
      return unroll(indices, mode);
    default:
      return {};
  }
}

std::string primitiveName(const tinygltf::Mesh& mesh, std::size_t meshIndex,
                          std::size_t primitive) {
  // Messages cut names off at 80 characters; the number must stay.
  const std::string name =
      mesh.name.empty() ? join("number ", meshIndex) : shortName(mesh.name, 56);
  return mesh.primitives.size() == 1 ? name : join(name, " primitive ", primitive);
}

}  // namespace

std::string primitivePlace(std::size_t mesh, std::size_t primitive) {
  return join("mesh ", mesh, " primitive ", primitive);
}

std::vector<bool> checkPrimitives(Source& source) {
  const auto& meshes = source.content().meshes;
  std::vector<bool> isFaulty(meshes.size());
  for (std::size_t i = 0; i < meshes.size(); ++i) {
    for (std::size_t j = 0; j < meshes[i].primitives.size(); ++j) {
      const bool isGood = source.notes().tolerateUnlessUsed(
          source.usage().meshes[i], [&] { PrimitiveCheck(source, i, j).run(); });
      if (!isGood) isFaulty[i] = true;
    }
  }
  return isFaulty;
}

std::uint32_t morphTargetCount(const tinygltf::Mesh& mesh) {
  std::size_t most = 0;
  for (const tinygltf::Primitive& primitive : mesh.primitives)
    most = std::max(most, primitive.targets.size());
  return static_cast<std::uint32_t>(most);
}

SharedArray<float> PrimitiveReader::floats(int accessor) {
  if (accessor < 0) return {};
  return once(floats_, accessor, [&] { return source_.floats(accessor); });
}

std::vector<Influences> PrimitiveReader::influences(const std::map<std::string, int>& attributes,
                                                    const std::string& where) {
  std::vector<Influences> sets(countSets(attributes, "JOINTS_", where));
  for (std::size_t i = 0; i < sets.size(); ++i) {
    const std::string jointsName = join("JOINTS_", i), weightsName = join("WEIGHTS_", i);
    const int joints = attributes.at(jointsName), weights = attributes.at(weightsName);
    sets[i].jointType = keptType(source_, joints, ComponentType::uint8, ComponentType::uint16,
                                 ComponentType::uint16);
    sets[i].weightType = keptType(source_, weights, ComponentType::unorm8, ComponentType::unorm16,
                                  ComponentType::float32);
    sets[i].joints = once(joints_, joints, [&] {
      return decodeJoints(source_, joints, join(where, " ", jointsName));
    });
    sets[i].weights = once(weights_, weights, [&] {
      return decodeWeights(source_, weights, join(where, " ", weightsName));
    });
  }
  return sets;
}

Influences PrimitiveReader::rigidInfluences(std::uint32_t vertexCount) {
  return once(rigid_, vertexCount, [&] {
    const std::size_t components = 4 * std::size_t{vertexCount};
    source_.spend(components, 2, "the influences of a rigid mesh");
    std::vector<std::byte> joints(components), weights(components);
    for (std::size_t i = 0; i < components; i += 4) weights[i] = std::byte{255};
    return Influences{ComponentType::uint8, ComponentType::unorm8, std::move(joints),
                      std::move(weights)};
  });
}

// Reads sets from 0 up to the first missing one.
std::vector<SharedArray<float>> PrimitiveReader::texcoords(
    const std::map<std::string, int>& attributes) {
  std::vector<SharedArray<float>> sets;
  for (;;) {
    const int accessor = findAttribute(attributes, join("TEXCOORD_", sets.size()));
    if (accessor < 0) return sets;
    sets.push_back(floats(accessor));
  }
}

MorphTarget PrimitiveReader::target(const std::map<std::string, int>& attributes) {
  const TargetAccessors accessors = accessorsOf(source_, attributes);
  const auto isSparse = [&](int accessor) {
    return accessor < 0 || source_.isZeroElsewhere(accessor);
  };
  if (std::ranges::all_of(accessors, isSparse))
    return once(targets_, accessors, [&] { return decodeSparseTarget(source_, accessors); });
  return {{}, floats(accessors[0]), floats(accessors[1]), floats(accessors[2])};
}

Primitive PrimitiveReader::read(std::uint32_t meshIndex, std::uint32_t primitiveIndex) {
  const tinygltf::Mesh& mesh = source_.content().meshes[meshIndex];
  const tinygltf::Primitive& from = mesh.primitives[primitiveIndex];
  const std::map<std::string, int>& attributes = from.attributes;
  const std::string where = primitivePlace(meshIndex, primitiveIndex);
  Primitive primitive;
  primitive.name = primitiveName(mesh, meshIndex, primitiveIndex);
  primitive.material = indexOf(from.material);
  const int positions = findAttribute(attributes, "POSITION");
  if (positions < 0) {
    source_.notes().remark(NoteKind::noPositions, where, ": it has no positions and is left out");
    return primitive;
  }
  source_.decompress(meshIndex, primitiveIndex);
  primitive.vertexCount = source_.count(positions);
  primitive.positions = floats(positions);
  primitive.normals = floats(findAttribute(attributes, "NORMAL"));
  primitive.tangents = floats(findAttribute(attributes, "TANGENT"));
  primitive.texcoords = texcoords(attributes);
  if (const int colors = findAttribute(attributes, "COLOR_0"); colors >= 0)
    primitive.colors = once(colors_, colors, [&] { return decodeColors(source_, colors, where); });
  primitive.influences = influences(attributes, where);
  const int indices = findAttribute(attributes, indicesAttribute);
  primitive.triangles = once(
      triangles_, std::tuple(indices, from.mode, primitive.vertexCount),
      [&] { return decodeTriangles(source_, indices, from.mode, primitive.vertexCount, where); });
  for (const auto& target : from.targets) primitive.morphTargets.push_back(this->target(target));
  addNormals(source_, missingNormals_, where, primitive);
  return primitive;
}

}  // namespace dermis::gltf
