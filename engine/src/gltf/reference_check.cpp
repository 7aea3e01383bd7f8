// Everything that can be wrong with a file's JSON without looking at a buffer: missing or mistyped
// properties, and indices of things that do not exist. tinygltf takes most of these for defaults,
// or wraps them to another number.
#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <initializer_list>
#include <limits>
#include <map>
#include <string>
#include <string_view>
#include <unordered_set>

#include "dermis/gltf.h"
#include "gltf/buffers.h"
#include "gltf/document.h"
#include "gltf/failure.h"

namespace dermis::gltf {
namespace {

using nlohmann::json;

// Beyond this a JSON number need not be the integer that was written.
constexpr std::uint64_t largestInteger = (std::uint64_t{1} << 53) - 1;

// "{}," is three bytes in a file, and hundreds in the structs that are made of it, tinygltf's and
// Dermis' own, in vectors that grow.
struct Section {
  const char* name;
  std::uint64_t bytesEach;
};
constexpr std::array sections{Section{"buffers", sizeof(BufferDescription) + sizeof(Buffer)},
                              Section{"bufferViews", 2 * sizeof(tinygltf::BufferView)},
                              Section{"accessors", 2 * sizeof(tinygltf::Accessor)},
                              Section{"materials", sizeof(tinygltf::Material) + sizeof(Material)},
                              Section{"meshes", sizeof(tinygltf::Mesh) + sizeof(Mesh)},
                              Section{"skins", sizeof(tinygltf::Skin) + sizeof(Skin)},
                              Section{"nodes", sizeof(tinygltf::Node) + sizeof(Node)},
                              Section{"animations", sizeof(tinygltf::Animation) + sizeof(Clip)},
                              Section{"scenes", 2 * sizeof(tinygltf::Scene)},
                              Section{"cameras", 0}};
constexpr std::uint64_t bytesPerPrimitive = sizeof(tinygltf::Primitive) + sizeof(Primitive);
constexpr std::uint64_t bytesPerTarget = sizeof(std::map<std::string, int>) + sizeof(MorphTarget);
constexpr std::uint64_t bytesPerAttribute = 128;  // in a map, with its name
constexpr std::uint64_t bytesPerSampler = 2 * sizeof(tinygltf::AnimationSampler);
constexpr std::uint64_t bytesPerChannel = sizeof(tinygltf::AnimationChannel) + sizeof(Channel);

class ReferenceCheck {
 public:
  ReferenceCheck(json& root, MemoryBudget& budget) : root_(root), budget_(budget) {}

  void run() {
    checkSections();
    forEach("buffers", [&](json& buffer, const std::string& where) { checkBuffer(buffer, where); });
    forEach("bufferViews", [&](json& view, const std::string& where) { checkView(view, where); });
    forEach("accessors",
            [&](json& accessor, const std::string& where) { checkAccessor(accessor, where); });
    forEach("materials",
            [&](json& material, const std::string& where) { checkMaterial(material, where); });
    forEach("meshes", [&](json& mesh, const std::string& where) { checkMesh(mesh, where); });
    forEach("skins", [&](json& skin, const std::string& where) { checkSkin(skin, where); });
    forEach("nodes", [&](json& node, const std::string& where) { checkNode(node, where); });
    forEach("animations",
            [&](json& animation, const std::string& where) { checkAnimation(animation, where); });
    forEach("scenes", [&](json& scene, const std::string& where) {
      references(scene, "nodes", "nodes", where);
    });
    reference(root_, "scene", "scenes", "the file");
  }

 private:
  // The kind of thing that a section lists: "mesh" for "meshes".
  static std::string kindOf(std::string_view section) {
    return std::string(section == "meshes" ? "mesh" : section.substr(0, section.size() - 1));
  }

  void checkSections() {
    for (const auto& [name, bytesEach] : sections) {
      const auto section = root_.find(name);
      if (section == root_.end()) continue;
      if (!section->is_array()) failInvalid(inQuotes(name), " is not an array");
      spend(budget_, section->size(), bytesEach, join(section->size(), " ", name));
      for (std::size_t i = 0; i < section->size(); ++i) {
        if (!(*section)[i].is_object()) failInvalid(kindOf(name), " ", i, " is not an object");
      }
    }
    if (root_.contains("skins") && root_["skins"].empty()) {
      failInvalid("'skins' is an empty array, which the specification forbids");
    }
  }

  template <typename Function>
  void forEach(const char* section, Function function) {
    const auto list = root_.find(section);
    if (list == root_.end()) return;
    std::size_t index = 0;
    for (json& item : *list) {
      const std::string where = join(kindOf(section), " ", index++);
      name(item, where);
      function(item, where);
    }
  }

  static void name(const json& item, const std::string& where) {
    const auto found = item.find("name");
    if (found != item.end() && !found->is_string()) failInvalid(where, ": its name is not a text");
  }

  static const json& require(const json& object, const char* property, const std::string& where) {
    const auto found = object.find(property);
    if (found == object.end()) failInvalid(where, ": it has no ", property);
    return *found;
  }

  static json& requireObject(json& object, const char* property, const std::string& where) {
    require(object, property, where);
    if (!object[property].is_object()) failInvalid(where, ": ", property, " is not an object");
    return object[property];
  }

  static json& requireArray(json& object, const char* property, const std::string& where) {
    require(object, property, where);
    if (!object[property].is_array()) failInvalid(where, ": ", property, " is not an array");
    return object[property];
  }

  // JSON knows no integers: 3.0 is one.
  static std::uint64_t integer(json& value, const std::string& what) {
    if (value.is_number_float()) {
      const double number = value.get<double>();
      if (number >= 0 && number <= static_cast<double>(largestInteger) &&
          std::floor(number) == number) {
        value = static_cast<std::uint64_t>(number);
      }
    }
    if (!value.is_number_unsigned() || value.get<std::uint64_t>() > largestInteger) {
      failInvalid(what, " is not a whole number from 0 upwards");
    }
    return value.get<std::uint64_t>();
  }

  static std::uint64_t integer(json& object, const char* property, const std::string& where,
                               std::uint64_t absent) {
    const auto found = object.find(property);
    return found == object.end() ? absent : integer(*found, join(where, ": ", property));
  }

  static std::uint64_t requireInteger(json& object, const char* property,
                                      const std::string& where) {
    require(object, property, where);
    return integer(object, property, where, 0);
  }

  std::uint64_t sizeOf(const char* section) const {
    const auto found = root_.find(section);
    return found == root_.end() ? 0 : found->size();
  }

  std::uint64_t inRange(json& value, const char* section, const std::string& what) const {
    const std::uint64_t index = integer(value, what);
    if (index >= sizeOf(section)) {
      failInvalid(what, " is ", index, ", and the file has ", sizeOf(section), " ", section);
    }
    return index;
  }

  void reference(json& object, const char* property, const char* section,
                 const std::string& where) const {
    const auto found = object.find(property);
    if (found != object.end()) inRange(*found, section, join(where, ": ", property));
  }

  void requireReference(json& object, const char* property, const char* section,
                        const std::string& where) const {
    require(object, property, where);
    reference(object, property, section, where);
  }

  // A list of indices in which none may stand twice.
  void references(json& object, const char* property, const char* section,
                  const std::string& where) const {
    if (!object.contains(property)) return;
    json& list = requireArray(object, property, where);
    std::unordered_set<std::uint64_t> seen;
    for (json& item : list) {
      const std::uint64_t index = inRange(item, section, join(where, ": an entry of ", property));
      if (!seen.insert(index).second) {
        failInvalid(where, ": ", property, " lists ", index, " twice");
      }
    }
  }

  // Attributes or morph targets: a name to an accessor.
  void attributes(json& object, const std::string& where) const {
    if (!object.is_object()) failInvalid(where, " is not an object");
    spend(budget_, object.size(), bytesPerAttribute, where);
    for (const auto& entry : object.items()) {
      inRange(entry.value(), "accessors", join(where, ": ", inQuotes(entry.key())));
    }
  }

  static void numbers(const json& object, const char* property, std::size_t count,
                      const std::string& where) {
    const auto found = object.find(property);
    if (found == object.end()) return;
    if (!found->is_array() || (count != 0 && found->size() != count)) {
      failInvalid(where, ": ", property, " is not an array of ",
                  count != 0 ? join(count, " numbers") : std::string("numbers"));
    }
    for (const json& number : *found) finiteNumber(number, property, where);
  }

  static void number(const json& object, const char* property, const std::string& where) {
    const auto found = object.find(property);
    if (found != object.end()) finiteNumber(*found, property, where);
  }

  // Finite in float32, which is what is made of it in the end.
  static void finiteNumber(const json& value, const char* property, const std::string& where) {
    if (!value.is_number())
      failInvalid(where, ": ", property, " holds something other than numbers");
    const double magnitude = std::abs(value.get<double>());
    if (!(magnitude <= static_cast<double>(std::numeric_limits<float>::max()))) {
      failInvalid(where, ": ", property, " holds a number that float32 cannot hold");
    }
  }

  static void boolean(const json& object, const char* property, const std::string& where) {
    const auto found = object.find(property);
    if (found != object.end() && !found->is_boolean()) {
      failInvalid(where, ": ", property, " is neither true nor false");
    }
  }

  static void oneOf(const json& value, std::initializer_list<json> allowed,
                    const std::string& what) {
    if (std::find(allowed.begin(), allowed.end(), value) != allowed.end()) return;
    failInvalid(what, " is ", inQuotes(value.is_string() ? value.get<std::string>() : value.dump()),
                ", which the specification does not know");
  }

  void checkBuffer(json& buffer, const std::string& where) const {
    if (requireInteger(buffer, "byteLength", where) == 0) failInvalid(where, ": byteLength is 0");
    const auto uri = buffer.find("uri");
    if (uri != buffer.end() && !uri->is_string()) failInvalid(where, ": uri is not a text");
  }

  void checkView(json& view, const std::string& where) const {
    requireReference(view, "buffer", "buffers", where);
    integer(view, "byteOffset", where, 0);
    if (requireInteger(view, "byteLength", where) == 0) failInvalid(where, ": byteLength is 0");
    if (!view.contains("byteStride")) return;
    const std::uint64_t stride = integer(view, "byteStride", where, 0);
    if (stride < 4 || stride > 252 || stride % 4 != 0) {
      failInvalid(where, ": byteStride ", stride, " is not a multiple of 4 from 4 to 252");
    }
  }

  void checkAccessor(json& accessor, const std::string& where) const {
    reference(accessor, "bufferView", "bufferViews", where);
    const std::uint64_t byteOffset = integer(accessor, "byteOffset", where, 0);
    if (byteOffset != 0 && !accessor.contains("bufferView")) {
      failInvalid(where, ": it has a byteOffset but no bufferView");
    }
    requireInteger(accessor, "componentType", where);
    oneOf(accessor["componentType"], {5120, 5121, 5122, 5123, 5125, 5126},
          join(where, ": componentType"));
    oneOf(require(accessor, "type", where),
          {"SCALAR", "VEC2", "VEC3", "VEC4", "MAT2", "MAT3", "MAT4"}, join(where, ": type"));
    boolean(accessor, "normalized", where);
    const std::uint64_t count = requireInteger(accessor, "count", where);
    if (count == 0) failInvalid(where, ": count is 0");
    if (count > std::numeric_limits<std::uint32_t>::max()) {
      fail(ErrorCode::limitExceeded, join(where, ": a count of ", count, " is beyond 32 bits"));
    }
    if (accessor.contains("sparse")) checkSparse(accessor, count, where);
  }

  void checkSparse(json& accessor, std::uint64_t count, const std::string& where) const {
    json& sparse = requireObject(accessor, "sparse", where);
    const std::string inside = where + ": sparse";
    const std::uint64_t sparseCount = requireInteger(sparse, "count", inside);
    if (sparseCount == 0 || sparseCount > count) {
      failInvalid(inside, ": count ", sparseCount, " is not from 1 to the accessor's count ",
                  count);
    }
    json& indices = requireObject(sparse, "indices", inside);
    requireInteger(indices, "componentType", inside + " indices");
    oneOf(indices["componentType"], {5121, 5123, 5125}, inside + " indices: componentType");
    json& values = requireObject(sparse, "values", inside);
    for (json* part : {&indices, &values}) {
      const std::string name = inside + (part == &indices ? " indices" : " values");
      requireReference(*part, "bufferView", "bufferViews", name);
      const std::uint64_t offset = integer(*part, "byteOffset", name, 0);
      // tinygltf 2.7 keeps these in an int.
      if (std::max(offset, sparseCount) > std::numeric_limits<std::int32_t>::max()) {
        fail(ErrorCode::limitExceeded, join(name, ": more than 2 GiB"));
      }
    }
  }

  static void checkMaterial(json& material, const std::string& where) {
    json lean = json::object();
    for (const char* property :
         {"name", "emissiveFactor", "alphaMode", "alphaCutoff", "doubleSided"}) {
      if (material.contains(property)) lean[property] = material[property];
    }
    numbers(lean, "emissiveFactor", 3, where);
    number(lean, "alphaCutoff", where);
    boolean(lean, "doubleSided", where);
    if (lean.contains("alphaMode")) {
      oneOf(lean["alphaMode"], {"OPAQUE", "MASK", "BLEND"}, join(where, ": alphaMode"));
    }
    if (material.contains("pbrMetallicRoughness")) {
      const json& factors = requireObject(material, "pbrMetallicRoughness", where);
      for (const char* property : {"baseColorFactor", "metallicFactor", "roughnessFactor"}) {
        if (factors.contains(property)) lean["pbrMetallicRoughness"][property] = factors[property];
      }
      numbers(factors, "baseColorFactor", 4, where);
      number(factors, "metallicFactor", where);
      number(factors, "roughnessFactor", where);
    }
    // What stays is what Dermis keeps: textures and extensions are none of its business.
    material = std::move(lean);
  }

  void checkMesh(json& mesh, const std::string& where) const {
    json& primitives = requireArray(mesh, "primitives", where);
    if (primitives.empty()) failInvalid(where, ": primitives is an empty array");
    spend(budget_, primitives.size(), bytesPerPrimitive, where);
    std::size_t index = 0;
    for (json& primitive : primitives) {
      const std::string place = join(where, " primitive ", index++);
      if (!primitive.is_object()) failInvalid(place, " is not an object");
      attributes(requireObject(primitive, "attributes", place), place + " attributes");
      reference(primitive, "indices", "accessors", place);
      reference(primitive, "material", "materials", place);
      if (integer(primitive, "mode", place, 4) > 6) {
        failInvalid(place, ": mode is none of 0 to 6");
      }
      if (primitive.contains("targets")) {
        json& targets = requireArray(primitive, "targets", place);
        spend(budget_, targets.size(), bytesPerTarget, place);
        for (json& target : targets) {
          attributes(target, place + " targets");
        }
      }
      if (targetCount(primitive) != targetCount(primitives[0])) {
        failInvalid(place, ": it has ", targetCount(primitive), " morph targets, primitive 0 has ",
                    targetCount(primitives[0]));
      }
    }
    checkWeights(mesh, mesh, where);
  }

  static std::size_t targetCount(const json& primitive) {
    const auto targets = primitive.find("targets");
    return targets == primitive.end() ? 0 : targets->size();
  }

  static void checkWeights(const json& object, const json& mesh, const std::string& where) {
    if (!object.contains("weights")) return;
    numbers(object, "weights", 0, where);
    const std::size_t targets = targetCount(mesh["primitives"][0]);
    if (object["weights"].size() != targets) {
      failInvalid(where, ": it has ", object["weights"].size(), " weights for ", targets,
                  " morph targets");
    }
  }

  void checkSkin(json& skin, const std::string& where) const {
    if (requireArray(skin, "joints", where).empty()) {
      failInvalid(where, ": joints is an empty array");
    }
    references(skin, "joints", "nodes", where);
    reference(skin, "inverseBindMatrices", "accessors", where);
    reference(skin, "skeleton", "nodes", where);
  }

  void checkNode(json& node, const std::string& where) const {
    references(node, "children", "nodes", where);
    reference(node, "mesh", "meshes", where);
    reference(node, "skin", "skins", where);
    reference(node, "camera", "cameras", where);
    for (const char* property : {"skin", "weights"}) {
      if (node.contains(property) && !node.contains("mesh")) {
        failInvalid(where, ": it has ", property, " but no mesh");
      }
    }
    numbers(node, "matrix", 16, where);
    numbers(node, "translation", 3, where);
    numbers(node, "rotation", 4, where);
    numbers(node, "scale", 3, where);
    if (node.contains("matrix")) {
      for (const char* property : {"translation", "rotation", "scale"}) {
        if (node.contains(property)) failInvalid(where, ": it has both matrix and ", property);
      }
    }
    if (node.contains("weights")) {
      checkWeights(node, root_["meshes"][node["mesh"].get<std::size_t>()], where);
    }
  }

  void checkAnimation(json& animation, const std::string& where) const {
    json& samplers = requireArray(animation, "samplers", where);
    spend(budget_, samplers.size(), bytesPerSampler, where);
    std::size_t index = 0;
    for (json& sampler : samplers) {
      const std::string place = join(where, " sampler ", index++);
      if (!sampler.is_object()) failInvalid(place, " is not an object");
      requireReference(sampler, "input", "accessors", place);
      requireReference(sampler, "output", "accessors", place);
      if (sampler.contains("interpolation")) {
        oneOf(sampler["interpolation"], {"LINEAR", "STEP", "CUBICSPLINE"},
              place + ": interpolation");
      }
    }
    json& channels = requireArray(animation, "channels", where);
    spend(budget_, channels.size(), bytesPerChannel, where);
    index = 0;
    for (json& channel : channels) {
      checkChannel(channel, samplers.size(), join(where, " channel ", index++));
    }
  }

  void checkChannel(json& channel, std::size_t samplerCount, const std::string& where) const {
    if (!channel.is_object()) failInvalid(where, " is not an object");
    const std::uint64_t sampler = requireInteger(channel, "sampler", where);
    if (sampler >= samplerCount) {
      failInvalid(where, ": sampler is ", sampler, ", and the animation has ", samplerCount,
                  " samplers");
    }
    json& target = requireObject(channel, "target", where);
    reference(target, "node", "nodes", where + " target");
    if (!require(target, "path", where + " target").is_string()) {
      failInvalid(where, " target: path is not a text");
    }
    // The channels of an extension may have no node. tinygltf would drop them and shift the rest.
    if (!target.contains("node")) {
      target["node"] = 0;
      target["path"] = unknownPath;
    }
  }

  static constexpr const char* unknownPath = "";

  json& root_;
  MemoryBudget& budget_;
};

}  // namespace

void checkReferences(json& root, MemoryBudget& budget) {
  ReferenceCheck(root, budget).run();
}

}  // namespace dermis::gltf
