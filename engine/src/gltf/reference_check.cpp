// Finds everything that can be wrong with a file's JSON without reading a buffer: missing or
// mistyped properties, and indices of objects that do not exist. tinygltf replaces most of these by
// defaults, or wraps the numbers.
//
// A fault with only one possible meaning is repaired, with a note. A fault in an object that
// nothing skinned or animated uses gives a note, and a placeholder replaces the object. Therefore
// users are checked before what they use.
#include <algorithm>
#include <array>
#include <cstddef>
#include <cstdint>
#include <limits>
#include <map>
#include <string>
#include <string_view>
#include <unordered_set>
#include <utility>
#include <vector>

#include "dermis/gltf.h"
#include "gltf/buffers.h"
#include "gltf/compression.h"
#include "gltf/document.h"
#include "gltf/failure.h"
#include "gltf/notes.h"
#include "gltf/properties.h"
#include "strict_floating_point.h"

namespace dermis::gltf {
namespace {

// "{}," takes three bytes in a file, but hundreds in the structs made from it (tinygltf's and
// Dermis'), which are in growing vectors.
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
// In a map, including its name, and in the map of decoded data.
constexpr std::uint64_t bytesPerAttribute = 256;
constexpr std::uint64_t bytesPerSampler = 2 * sizeof(tinygltf::AnimationSampler);
constexpr std::uint64_t bytesPerChannel = sizeof(tinygltf::AnimationChannel) + sizeof(Channel);

class ReferenceCheck {
 public:
  ReferenceCheck(json& root, MemoryBudget& budget, Notes& notes)
      : root_(root), budget_(budget), notes_(notes) {}

  Usage run() {
    checkSections();
    usage_.meshes.resize(sizeOf("meshes"));
    usage_.skins.resize(sizeOf("skins"));
    usage_.accessors.resize(sizeOf("accessors"));
    usage_.views.resize(sizeOf("bufferViews"));
    usage_.buffers.resize(sizeOf("buffers"));
    usage_.strides.resize(sizeOf("bufferViews"));
    forEach("scenes", [&](json& scene, const std::string& where, std::size_t) {
      references(scene, "nodes", "nodes", where);
    });
    reference(root_, "scene", "scenes", "the file");
    forEach("nodes",
            [&](json& node, const std::string& where, std::size_t) { checkNode(node, where); });
    forEach("materials", [&](json& material, const std::string& where, std::size_t) {
      checkMaterial(material, where);
    });
    checkUsed(
        "meshes", usage_.meshes, {{"primitives", json::array()}},
        [&](json& mesh, const std::string& where, std::size_t i) { checkMesh(mesh, where, i); });
    forEach("nodes", [&](json& node, const std::string& where, std::size_t) {
      checkNodeWeights(node, where);
    });
    checkUsed("skins", usage_.skins, {{"joints", json::array()}},
              [&](json& skin, const std::string& where, std::size_t i) {
                checkSkin(skin, where, usage_.skins[i]);
              });
    forEach("animations", [&](json& animation, const std::string& where, std::size_t) {
      checkAnimation(animation, where);
    });
    checkUsed("accessors", usage_.accessors,
              {{"componentType", 5121}, {"type", "SCALAR"}, {"count", 1}},
              [&](json& accessor, const std::string& where, std::size_t i) {
                checkAccessor(accessor, where, usage_.accessors[i]);
              });
    // The placeholder names a buffer that does not exist, so that reading it is an error.
    checkUsed(
        "bufferViews", usage_.views,
        {{"buffer", std::numeric_limits<std::int32_t>::max()}, {"byteLength", 0}},
        [&](json& view, const std::string& where, std::size_t i) { checkView(view, where, i); });
    checkUsed("buffers", usage_.buffers, {{"byteLength", 0}},
              [&](json& buffer, const std::string& where, std::size_t i) {
                checkBuffer(buffer, where, i);
              });
    return std::move(usage_);
  }

 private:
  // Calls `check` for each item of a section. A faulty item that is not used gives a note and is
  // replaced by the placeholder.
  template <typename Check>
  void checkUsed(const char* section, const std::vector<bool>& used, const json& placeholder,
                 Check check) {
    forEach(section, [&](json& item, const std::string& where, std::size_t i) {
      if (!notes_.tolerateUnlessUsed(used[i], [&] { check(item, where, i); })) item = placeholder;
    });
  }

  // The kind of object in a section: "mesh" for "meshes".
  static std::string kindOf(std::string_view section) {
    return std::string(section == "meshes" ? "mesh" : section.substr(0, section.size() - 1));
  }

  void checkSections() {
    for (const auto& [name, bytesEach] : sections) {
      const auto section = root_.find(name);
      if (section == root_.end()) continue;
      if (section->is_null() || (section->is_array() && section->empty())) {
        notes_.broken(section->is_null() ? NoteKind::nullProperty : NoteKind::emptyArray,
                      inQuotes(name), " is ", section->is_null() ? "null" : "an empty array",
                      ", which the specification forbids");
        root_.erase(section);
        continue;
      }
      if (!section->is_array()) failInvalid(inQuotes(name), " is not an array");
      spend(budget_, section->size(), bytesEach, join(section->size(), " ", name));
      for (std::size_t i = 0; i < section->size(); ++i) {
        const std::string where = join(kindOf(name), " ", i);
        if (!(*section)[i].is_object()) failInvalid(where, " is not an object");
        tidy((*section)[i], where);
      }
    }
    const auto scene = root_.find("scene");
    if (scene != root_.end() && scene->is_null()) {
      notes_.broken(NoteKind::nullProperty, "the file: 'scene' is null");
      root_.erase(scene);
    }
  }

  // Removes members without a meaning: nulls, and empty lists of kinds that may be absent but not
  // empty. The recursion is limited by `deepestNesting`.
  void tidy(json& value, const std::string& where) {
    if (value.is_array()) {
      for (json& child : value) tidy(child, where);
    }
    if (!value.is_object()) return;
    for (auto member = value.begin(); member != value.end();) {
      const std::string& key = member.key();
      const bool isList =
          key == "children" || key == "nodes" || key == "weights" || key == "targets";
      if (key == "extensions" || key == "extras") {
        ++member;
      } else if (member->is_null()) {
        notes_.broken(NoteKind::nullProperty, where, ": ", inQuotes(key), " is null");
        member = value.erase(member);
      } else if (isList && member->is_array() && member->empty()) {
        notes_.broken(NoteKind::emptyArray, where, ": ", key, " is an empty array");
        member = value.erase(member);
      } else {
        tidy(*member++, where);
      }
    }
  }

  template <typename Function>
  void forEach(const char* section, Function function) {
    const auto list = root_.find(section);
    if (list == root_.end()) return;
    for (std::size_t i = 0; i < list->size(); ++i) {
      json& item = (*list)[i];
      const std::string where = join(kindOf(section), " ", i);
      name(item, where);
      function(item, where, i);
    }
  }

  void name(json& item, const std::string& where) const {
    const auto found = item.find("name");
    if (found == item.end() || found->is_string()) return;
    notes_.broken(NoteKind::name, where, ": its name is not a string");
    item.erase(found);
  }

  std::size_t sizeOf(const char* section) const {
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

  // The same for a reference that is not read: removed if it is wrong.
  void idleReference(json& object, const char* property, const char* section,
                     const std::string& where) const {
    const bool good = notes_.tolerate(NoteKind::reference, "; it is left out",
                                      [&] { reference(object, property, section, where); });
    if (!good) object.erase(property);
  }

  // Checks a list of indices and removes duplicates.
  void references(json& object, const char* property, const char* section,
                  const std::string& where) const {
    if (!object.contains(property)) return;
    json& list = requireArray(object, property, where);
    std::unordered_set<std::uint64_t> seen;
    const auto isAgain = [&](json& item) {
      const std::uint64_t index = inRange(item, section, join(where, ": an entry of ", property));
      if (seen.insert(index).second) return false;
      notes_.broken(NoteKind::duplicate, where, ": ", property, " lists ", index, " twice");
      return true;
    };
    json::array_t& items = list.get_ref<json::array_t&>();
    items.erase(std::remove_if(items.begin(), items.end(), isAgain), items.end());
  }

  // Whether an attribute gives the position or direction of vertices, or what moves them.
  static bool isEssential(std::string_view name) {
    return name == "POSITION" || name == "NORMAL" || name == "TANGENT" ||
           name.starts_with("JOINTS_") || name.starts_with("WEIGHTS_");
  }

  // Checks attributes or a morph target: names with accessors. `used`: whether they are read.
  void attributes(json& object, const std::string& where, bool used) {
    if (!object.is_object()) failInvalid(where, " is not an object");
    spend(budget_, object.size(), bytesPerAttribute, where);
    for (auto entry = object.begin(); entry != object.end();) {
      const auto check = [&] {
        inRange(entry.value(), "accessors", join(where, ": ", inQuotes(entry.key())));
      };
      if (isEssential(entry.key())) {
        check();
        if (used) usage_.accessors[entry->get<std::size_t>()] = true;
      } else if (!notes_.tolerate(NoteKind::attribute, "; it is left out", check)) {
        entry = object.erase(entry);
        continue;
      }
      ++entry;
    }
  }

  // Marks the accessor that a property names as used. The index must have been checked.
  void use(const json& object, const char* property) {
    if (object.contains(property)) usage_.accessors[object[property].get<std::size_t>()] = true;
  }

  void checkBuffer(json& buffer, const std::string& where, std::size_t index) const {
    if (requireInteger(buffer, "byteLength", where) == 0)
      notes_.broken(NoteKind::bufferLength, where, ": byteLength is 0");
    const auto uri = buffer.find("uri");
    if (uri != buffer.end() && !uri->is_string()) failInvalid(where, ": uri is not a string");
    // What a meshopt extension decodes to need not be there.
    if (!decodesMeshopt || usage_.buffers[index]) return;
    for (const std::string_view name : meshoptExtensions) {
      const json* from = extension(buffer, name, where);
      if (from != nullptr && from->contains("fallback")) buffer.erase("uri");
    }
  }

  void checkView(json& view, const std::string& where, std::size_t index) {
    requireReference(view, "buffer", "buffers", where);
    byteCount(view, "byteOffset", where, 0);
    require(view, "byteLength", where);
    if (byteCount(view, "byteLength", where, 0) == 0)
      notes_.broken(NoteKind::viewLength, where, ": byteLength is 0");
    const bool isDecoded = checkMeshopt(view, where, index) && decodesMeshopt;
    if (usage_.views[index]) {
      usage_.buffers[isDecoded ? usage_.compressedViews.back().buffer
                               : view["buffer"].get<std::size_t>()] = true;
    }
    const std::uint64_t stride = integer(view, "byteStride", where, 4);
    if (stride > std::numeric_limits<std::int32_t>::max())
      failInvalid(where, ": byteStride is ", stride, ", more than 2 GiB");
    if (stride < 4 || stride > 252 || stride % 4 != 0) {
      notes_.broken(NoteKind::stride, where, ": byteStride ", stride,
                    " is not a multiple of 4 from 4 to 252");
    }
    // tinygltf refuses strides that break the rule.
    if (view.contains("byteStride")) usage_.strides[index] = static_cast<std::uint32_t>(stride);
    view.erase("byteStride");
  }

  // Returns whether the view is compressed. The extension's rules are those of
  // EXT_meshopt_compression.
  bool checkMeshopt(json& view, const std::string& viewPlace, std::size_t index) {
    using Mode = CompressedView::Mode;
    using Filter = CompressedView::Filter;
    CompressedView compressed;
    json* from = nullptr;
    for (const std::string_view name : meshoptExtensions) {
      if (from == nullptr) from = extension(view, name, viewPlace);
      if (from != nullptr && compressed.extension.empty()) compressed.extension = name;
    }
    if (from == nullptr) return false;
    const std::string where = join(viewPlace, " ", compressed.extension);
    compressed.view = index;
    requireReference(*from, "buffer", "buffers", where);
    compressed.buffer = (*from)["buffer"].get<std::size_t>();
    compressed.byteOffset = byteCount(*from, "byteOffset", where, 0);
    require(*from, "byteLength", where);
    compressed.byteLength = byteCount(*from, "byteLength", where, 0);
    compressed.count = requireInteger(*from, "count", where);
    if (compressed.count == 0) failInvalid(where, ": count is 0");
    compressed.mode = valueOf<Mode>(*from, "mode", where,
                                    {{"ATTRIBUTES", Mode::attributes},
                                     {"TRIANGLES", Mode::triangles},
                                     {"INDICES", Mode::indices}});
    if (from->contains("filter")) {
      compressed.filter = valueOf<Filter>(*from, "filter", where,
                                          {{"NONE", Filter::unfiltered},
                                           {"OCTAHEDRAL", Filter::octahedral},
                                           {"QUATERNION", Filter::quaternion},
                                           {"EXPONENTIAL", Filter::exponential}});
    }
    const std::uint64_t stride = requireInteger(*from, "byteStride", where);
    const bool isVertices = compressed.mode == Mode::attributes;
    const bool isAllowed =
        (isVertices ? stride % 4 == 0 && stride >= 4 && stride <= 256
                    : stride == 2 || stride == 4) &&
        (compressed.filter != Filter::octahedral || stride == 4 || stride == 8) &&
        (compressed.filter != Filter::quaternion || stride == 8);
    if (!isAllowed) failInvalid(where, ": its mode and filter do not allow byteStride ", stride);
    if (integer(view, "byteStride", viewPlace, stride) != stride)
      failInvalid(where, ": byteStride is ", stride, ", but that of the bufferView is not");
    compressed.stride = static_cast<std::uint32_t>(stride);
    if (!isVertices && compressed.filter != Filter::unfiltered)
      failInvalid(where, ": only mode ATTRIBUTES may have a filter");
    if (compressed.mode == Mode::triangles && compressed.count % 3 != 0)
      failInvalid(where, ": count ", compressed.count, " is not a multiple of 3");
    if (view["byteLength"] != compressed.count * stride) {
      notes_.broken(NoteKind::viewLength, where, ": ", compressed.count, " elements of ", stride,
                    " bytes are not the byteLength of the bufferView");
    }
    spend(budget_, 2, sizeof compressed, where);
    usage_.compressedViews.push_back(compressed);
    return true;
  }

  void checkAccessor(json& accessor, const std::string& where, bool used) {
    reference(accessor, "bufferView", "bufferViews", where);
    const std::uint64_t byteOffset = byteCount(accessor, "byteOffset", where, 0);
    if (byteOffset != 0 && !accessor.contains("bufferView")) {
      notes_.broken(NoteKind::accessor, where, ": it has a byteOffset but no bufferView");
      accessor.erase("byteOffset");
    }
    requireInteger(accessor, "componentType", where);
    oneOf(accessor["componentType"], {5120, 5121, 5122, 5123, 5125, 5126},
          join(where, ": componentType"));
    oneOf(require(accessor, "type", where),
          {"SCALAR", "VEC2", "VEC3", "VEC4", "MAT2", "MAT3", "MAT4"}, join(where, ": type"));
    boolean(accessor, "normalized", where);
    if (accessor["componentType"] == 5126 && accessor.value("normalized", false)) {
      notes_.broken(NoteKind::accessor, where, ": float may not be normalized");
      accessor.erase("normalized");
    }
    const std::uint64_t count = requireInteger(accessor, "count", where);
    if (count == 0) notes_.broken(NoteKind::accessor, where, ": count is 0");
    if (count > std::numeric_limits<std::uint32_t>::max()) {
      fail(ErrorCode::limitExceeded,
           join(where, ": a count of ", count, " does not fit in 32 bits"));
    }
    if (accessor.contains("sparse")) checkSparse(accessor, count, where, used);
    if (used && accessor.contains("bufferView"))
      usage_.views[accessor["bufferView"].get<std::size_t>()] = true;
  }

  void checkSparse(json& accessor, std::uint64_t count, const std::string& where, bool used) {
    json& sparse = requireObject(accessor, "sparse", where);
    const std::string inside = where + ": sparse";
    const std::uint64_t sparseCount = requireInteger(sparse, "count", inside);
    if (sparseCount == 0) {
      notes_.broken(NoteKind::sparse, inside, ": count is 0");
      accessor.erase("sparse");
      return;
    }
    if (sparseCount > count) {
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
      if (used) usage_.views[(*part)["bufferView"].get<std::size_t>()] = true;
    }
  }

  // Keeps the properties of a material that Dermis reads. No fault in them affects skinning.
  void checkMaterial(json& material, const std::string& where) const {
    json lean = json::object();
    const auto keep = [&](const json& from, json& to, const char* property, auto check) {
      if (!from.contains(property)) return;
      if (notes_.tolerate(NoteKind::material, "; the default is used", check))
        to[property] = from[property];
    };
    keep(material, lean, "name", [] {});
    keep(material, lean, "emissiveFactor", [&] { numbers(material, "emissiveFactor", 3, where); });
    keep(material, lean, "alphaCutoff", [&] { number(material, "alphaCutoff", where); });
    keep(material, lean, "doubleSided", [&] { boolean(material, "doubleSided", where); });
    keep(material, lean, "alphaMode", [&] {
      oneOf(material["alphaMode"], {"OPAQUE", "MASK", "BLEND"}, join(where, ": alphaMode"));
    });
    const char* group = "pbrMetallicRoughness";
    keep(material, lean, group, [&] { requireObject(material, group, where); });
    if (lean.contains(group)) {
      const json& from = material[group];
      json factors = json::object();
      keep(from, factors, "baseColorFactor", [&] { numbers(from, "baseColorFactor", 4, where); });
      keep(from, factors, "metallicFactor", [&] { number(from, "metallicFactor", where); });
      keep(from, factors, "roughnessFactor", [&] { number(from, "roughnessFactor", where); });
      lean[group] = std::move(factors);
    }
    // This check ignores textures and extensions.
    material = std::move(lean);
  }

  void checkMesh(json& mesh, const std::string& where, std::size_t index) {
    const bool used = usage_.meshes[index];
    json& primitives = requireArray(mesh, "primitives", where);
    if (primitives.empty())
      notes_.broken(NoteKind::emptyArray, where, ": primitives is an empty array");
    spend(budget_, primitives.size(), bytesPerPrimitive, where);
    for (std::size_t i = 0; i < primitives.size(); ++i) {
      json& primitive = primitives[i];
      const std::string place = join(where, " primitive ", i);
      if (!primitive.is_object()) failInvalid(place, " is not an object");
      attributes(requireObject(primitive, "attributes", place), place + " attributes", used);
      reference(primitive, "indices", "accessors", place);
      if (used) use(primitive, "indices");
      checkDraco(primitive, place, {index, i});
      idleReference(primitive, "material", "materials", place);
      if (integer(primitive, "mode", place, 4) > 6) {
        failInvalid(place, ": mode is not from 0 to 6");
      }
      if (primitive.contains("targets")) {
        json& targets = requireArray(primitive, "targets", place);
        spend(budget_, targets.size(), bytesPerTarget, place);
        for (json& target : targets) {
          attributes(target, place + " targets", used);
        }
      }
      if (targetCount(primitive) != targetCount(primitives[0])) {
        notes_.broken(NoteKind::targetCount, place, ": it has ", targetCount(primitive),
                      " morph targets, but primitive 0 has ", targetCount(primitives[0]));
      }
    }
    checkWeights(mesh, targetsOf(mesh), where);
  }

  void checkDraco(json& primitive, const std::string& place,
                  std::pair<std::size_t, std::size_t> index) {
    json* from = extension(primitive, dracoExtension, place);
    if (from == nullptr) return;
    const std::string where = join(place, " ", dracoExtension);
    requireReference(*from, "bufferView", "bufferViews", where);
    json& attributes = requireObject(*from, "attributes", where);
    spend(budget_, attributes.size() + 1, bytesPerAttribute, where);
    CompressedPrimitive& compressed = usage_.compressedPrimitives[index];
    compressed.view = (*from)["bufferView"].get<std::size_t>();
    if (usage_.meshes[index.first]) usage_.views[compressed.view] = true;
    for (auto entry = attributes.begin(); entry != attributes.end(); ++entry) {
      const std::uint64_t id =
          integer(entry.value(), join(where, ": the id of ", inQuotes(entry.key())));
      if (id >= noIndex) failInvalid(where, ": there is no attribute ", id);
      compressed.attributes.emplace(entry.key(), static_cast<std::uint32_t>(id));
    }
  }

  static std::size_t targetCount(const json& primitive) {
    const auto targets = primitive.find("targets");
    return targets == primitive.end() ? 0 : targets->size();
  }

  // Number of targets of the primitive that has the most.
  static std::size_t targetsOf(const json& mesh) {
    std::size_t most = 0;
    for (const json& primitive : mesh["primitives"]) most = std::max(most, targetCount(primitive));
    return most;
  }

  // Weights without a target have no effect and are removed. Targets without a weight have weight
  // 0, as all do if there are no weights.
  void checkWeights(json& object, std::size_t targets, const std::string& where) const {
    if (!object.contains("weights")) return;
    numbers(object, "weights", 0, where);
    json::array_t& weights = object["weights"].get_ref<json::array_t&>();
    if (weights.size() == targets) return;
    notes_.broken(NoteKind::weightCount, where, ": it has ", weights.size(), " weights for ",
                  targets, " morph targets");
    if (weights.size() > targets) weights.resize(targets);
  }

  void checkSkin(json& skin, const std::string& where, bool used) {
    json& joints = requireArray(skin, "joints", where);
    if (joints.empty()) failInvalid(where, ": joints is an empty array");
    std::unordered_set<std::uint64_t> seen;
    for (json& joint : joints) {
      const std::uint64_t node = inRange(joint, "nodes", where + ": an entry of joints");
      // Each entry of the list has its own inverse bind matrix.
      if (!seen.insert(node).second)
        notes_.broken(NoteKind::duplicate, where, ": joints lists ", node, " twice");
    }
    reference(skin, "inverseBindMatrices", "accessors", where);
    if (used) use(skin, "inverseBindMatrices");
    idleReference(skin, "skeleton", "nodes", where);
  }

  void checkNode(json& node, const std::string& where) {
    references(node, "children", "nodes", where);
    reference(node, "mesh", "meshes", where);
    for (const char* property : {"skin", "weights"}) {
      if (!node.contains(property) || node.contains("mesh")) continue;
      notes_.broken(NoteKind::withoutMesh, where, ": it has ", property, " but no mesh");
      node.erase(property);
    }
    reference(node, "skin", "skins", where);
    idleReference(node, "camera", "cameras", where);
    numbers(node, "matrix", 16, where);
    numbers(node, "translation", 3, where);
    numbers(node, "rotation", 4, where);
    numbers(node, "scale", 3, where);
    for (const char* property : {"translation", "rotation", "scale"}) {
      if (!node.contains("matrix") || !node.contains(property)) continue;
      notes_.broken(NoteKind::matrix, where, ": it has both matrix and ", property,
                    "; the matrix is used");
      node.erase(property);
    }
    if (!node.contains("skin")) return;
    usage_.meshes[node["mesh"].get<std::size_t>()] = true;
    usage_.skins[node["skin"].get<std::size_t>()] = true;
  }

  void checkNodeWeights(json& node, const std::string& where) {
    if (!node.contains("weights")) return;
    const std::size_t index = node["mesh"].get<std::size_t>();
    const json& mesh = root_["meshes"][index];
    const MorphFacts& facts = morphFacts(index, mesh);
    checkWeights(node, facts.targets, where);
    // Programs disagree whether the remaining weights are 0 or the mesh's.
    if (node["weights"].size() < facts.weights) {
      failInvalid(where, ": it has ", node["weights"].size(), " weights for ", facts.targets,
                  " morph targets, but its mesh has more weights");
    }
  }

  struct MorphFacts {
    bool known = false;
    std::size_t targets = 0;
    std::size_t weights = 0;  // up to the last that is not 0
  };

  // Cached, because many nodes may name one mesh with many targets.
  const MorphFacts& morphFacts(std::size_t index, const json& mesh) {
    morphFacts_.resize(sizeOf("meshes"));
    MorphFacts& facts = morphFacts_[index];
    if (facts.known) return facts;
    facts.known = true;
    facts.targets = targetsOf(mesh);
    if (!mesh.contains("weights")) return facts;
    const json& weights = mesh["weights"];
    for (std::size_t i = 0; i < weights.size(); ++i) {
      if (weights[i].get<double>() != 0) facts.weights = i + 1;
    }
    return facts;
  }

  void checkAnimation(json& animation, const std::string& where) {
    json& samplers = requireArray(animation, "samplers", where);
    json& channels = requireArray(animation, "channels", where);
    spend(budget_, samplers.size(), bytesPerSampler, where);
    spend(budget_, channels.size(), bytesPerChannel, where);
    for (const auto& [property, list] : {std::pair("samplers", &samplers), {"channels", &channels}})
      if (list->empty())
        notes_.broken(NoteKind::emptyArray, where, ": ", property, " is an empty array");
    std::vector<bool> used(samplers.size());
    for (std::size_t i = 0; i < channels.size(); ++i)
      checkChannel(channels[i], used, join(where, " channel ", i));
    for (std::size_t i = 0; i < samplers.size(); ++i) {
      const auto check = [&] { checkSampler(samplers[i], used[i], join(where, " sampler ", i)); };
      if (!notes_.tolerateUnlessUsed(used[i], check)) samplers[i] = {{"input", 0}, {"output", 0}};
    }
  }

  void checkSampler(json& sampler, bool used, const std::string& where) {
    if (!sampler.is_object()) failInvalid(where, " is not an object");
    for (const char* property : {"input", "output"}) {
      requireReference(sampler, property, "accessors", where);
      if (used) use(sampler, property);
    }
    if (sampler.contains("interpolation")) {
      oneOf(sampler["interpolation"], {"LINEAR", "STEP", "CUBICSPLINE"}, where + ": interpolation");
    }
  }

  void checkChannel(json& channel, std::vector<bool>& usedSamplers,
                    const std::string& where) const {
    if (!channel.is_object()) failInvalid(where, " is not an object");
    const std::uint64_t sampler = requireInteger(channel, "sampler", where);
    if (sampler >= usedSamplers.size()) {
      failInvalid(where, ": sampler is ", sampler, ", and the animation has ", usedSamplers.size(),
                  " samplers");
    }
    json& target = requireObject(channel, "target", where);
    reference(target, "node", "nodes", where + " target");
    if (!require(target, "path", where + " target").is_string()) {
      failInvalid(where, " target: path is not a string");
    }
    // A channel of an extension may have no node. tinygltf would drop it and shift the others.
    if (!target.contains("node")) {
      target["node"] = 0;
      target["path"] = unknownPath;
    }
    const std::string& path = target["path"].get_ref<const std::string&>();
    if (path == "translation" || path == "rotation" || path == "scale" || path == "weights")
      usedSamplers[static_cast<std::size_t>(sampler)] = true;
  }

  static constexpr const char* unknownPath = "";

  json& root_;
  MemoryBudget& budget_;
  Notes& notes_;
  Usage usage_;
  std::vector<MorphFacts> morphFacts_;
};

}  // namespace

Usage checkReferences(json& root, MemoryBudget& budget, Notes& notes) {
  return ReferenceCheck(root, budget, notes).run();
}

}  // namespace dermis::gltf
