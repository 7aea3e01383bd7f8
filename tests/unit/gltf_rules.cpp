#include "gltf_rules.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <utility>

namespace dermis::test {
namespace {

using Floats = std::vector<float>;
using Bytes = std::vector<std::uint8_t>;
using Shorts = std::vector<std::uint16_t>;

// The accessors of the flawless triangle, and their bufferViews.
enum : std::size_t {
  positions,
  joints,
  weights,
  indices,
  displacements,
  matrices,
  times,
  translations,
  rotations,
  morphKeys
};

using File = FileBuilder;
using Change = std::function<void(File&)>;

// Paths in the file.
std::string accessor(std::size_t index) {
  return "/accessors/" + std::to_string(index);
}
std::string view(std::size_t index) {
  return "/bufferViews/" + std::to_string(index);
}
const std::string primitive = "/meshes/0/primitives/0", attributes = primitive + "/attributes",
                  channels = "/animations/0/channels", samplers = "/animations/0/samplers";

Json& at(File& file, const std::string& path) {
  return file.json[Json::json_pointer(path)];
}

// What a file of the table does to the flawless one.
Change set(const std::string& path, const Json& value) {
  return [=](File& file) { at(file, path) = value; };
}
Change push(const std::string& path, const Json& value) {
  return [=](File& file) { at(file, path).push_back(value); };
}
Change erase(const std::string& path) {
  return [=](File& file) {
    const Json::json_pointer pointer(path);
    Json& parent = file.json[pointer.parent_pointer()];
    if (parent.is_array()) {
      parent.erase(std::stoul(pointer.back()));
    } else {
      parent.erase(pointer.back());
    }
  };
}
template <typename... Changes>
Change all(const Changes&... changes) {
  return [=](File& file) { (changes(file), ...); };
}

/// Stores an accessor's values in another way.
template <typename T>
Change store(std::size_t index, const std::vector<T>& values, int componentType,
             bool normalized = false) {
  return [=](File& file) {
    Json& stored = at(file, accessor(index));
    stored["bufferView"] = file.addView(bytesOf(values));
    stored["componentType"] = componentType;
    if (normalized) stored["normalized"] = true;
  };
}

/// Moves the elements of an accessor apart, or to another place.
Change spread(std::size_t index, std::size_t size, std::size_t stride, std::size_t start = 0) {
  return [=](File& file) {
    const std::size_t from = at(file, view(index))["byteOffset"].get<std::size_t>();
    const std::size_t count = at(file, accessor(index))["count"].get<std::size_t>();
    std::vector<std::byte> bytes(start + stride * count, std::byte{0x7b});
    for (std::size_t i = 0; i < count; ++i)
      for (std::size_t j = 0; j < size; ++j)
        bytes[start + i * stride + j] = file.binary[from + i * size + j];
    const std::size_t moved = file.addView(bytes);
    if (stride != size) at(file, view(moved))["byteStride"] = stride;
    at(file, accessor(index))["bufferView"] = moved;
    if (start != 0) at(file, accessor(index))["byteOffset"] = start;
  };
}

/// Sparse values in place of some displacements; the rest stays as it is.
Change makeSparse(const Bytes& elements, const Floats& values) {
  return [=](File& file) {
    at(file, accessor(displacements))["sparse"] = {
        {"count", elements.size()},
        {"indices",
         {{"bufferView", file.addView(bytesOf(elements))}, {"componentType", unsignedByteType}}},
        {"values", {{"bufferView", file.addView(bytesOf(values))}}}};
  };
}

/// Sets a property to the number of a new accessor.
Change setFloats(const std::string& path, const Floats& values, const char* type) {
  return [=](File& file) { at(file, path) = file.addFloats(values, type); };
}

Change addChannel(std::size_t input, std::size_t output, const Json& target) {
  return [=](File& file) {
    at(file, samplers).push_back({{"input", input}, {"output", output}});
    at(file, channels).push_back({{"sampler", at(file, samplers).size() - 1}, {"target", target}});
  };
}

/// The buffer in a URI, with a byteLength that is longer by so much.
Change withBuffer(std::size_t longer = 0) {
  return [=](File& file) {
    file.json["buffers"] = {
        {{"byteLength", file.binary.size() + longer},
         {"uri", "data:application/octet-stream;base64," + encodeBase64(file.binary)}}};
  };
}

/// A root with this matrix above the joints.
Change addRoot(const Json& matrix) {
  return all(push("/nodes", {{"children", {1}}, {"matrix", matrix}}),
             set("/scenes/0/nodes", {0, 3}));
}

/// Three keys for the translation at these times.
Change retime(const Floats& times) {
  return all(setFloats(samplers + "/0/input", times, "SCALAR"),
             setFloats(samplers + "/0/output", {0, 0, 0, 1, 0, 0, 2, 0, 0}, "VEC3"));
}

void setWord(std::vector<std::byte>& bytes, std::size_t offset, std::size_t value) {
  for (std::size_t i = 0; i < 4; ++i)
    bytes[offset + i] = static_cast<std::byte>(value >> (8 * i) & 0xff);
}
std::size_t word(const std::vector<std::byte>& bytes, std::size_t offset) {
  std::size_t value = 0;
  for (std::size_t i = 0; i < 4; ++i)
    value |= std::to_integer<std::size_t>(bytes[offset + i]) << (8 * i);
  return value;
}

std::vector<Violation> rulesOfStrides() {
  const auto noted = Verdict::noted;
  // three.js ignores a stride on what is no vertex attribute. Blender and Godot use it.
  return {
      {"stride_of_matrices_64", noted, Three::loads,
       "skin 0 inverseBindMatrices: bufferView 5 of accessor 5 has a byteStride of 64",
       set(view(matrices) + "/byteStride", 64)},
      {"stride_of_matrices_80", noted, Three::misreads,
       "has a byteStride of 80, which only vertex attributes may have", spread(matrices, 64, 80)},
      {"stride_of_rotations_16", noted, Three::loads,
       "animation 0 channel 1 output: bufferView 8 of accessor 8 has a byteStride of 16",
       set(view(rotations) + "/byteStride", 16)},
      {"stride_of_translations_16", noted, Three::loads,
       "animation 0 channel 0 output: bufferView 10 of accessor 7 has a byteStride of 16",
       spread(translations, 12, 16)},
      {"stride_of_times_4", noted, Three::loads,
       "animation 0 channel 0 input: bufferView 6 of accessor 6 has a byteStride of 4",
       set(view(times) + "/byteStride", 4)},
      {"stride_of_indices_4", noted, Three::loads,
       "mesh 0 primitive 0 indices: bufferView 10 of accessor 3 has a byteStride of 4",
       spread(indices, 2, 4)},
      {"stride_0", noted, Three::loads,
       "bufferView 0: byteStride 0 is not a multiple of 4 from 4 to 252",
       set(view(positions) + "/byteStride", 0)},
      {"stride_256", noted, Three::loads,
       "bufferView 10: byteStride 256 is not a multiple of 4 from 4 to 252",
       spread(positions, 12, 256)},
      {"stride_6", noted, Three::loads,
       "bufferView 10: byteStride 6 is not a multiple of 4 from 4 to 252", spread(joints, 4, 6)},
      {"stride_too_small", Verdict::refused, Three::misreads,
       "accessor 0: its elements of 12 bytes do not fit the byteStride 8 of bufferView 0",
       set(view(positions) + "/byteStride", 8)},
      {"stride_of_sparse_values_12", noted, Three::loads,
       "accessor 4 sparse: bufferView 11 has a byteStride",
       all(makeSparse({1}, {4, 5, 6}), set(view(11) + "/byteStride", 12))},
      {"stride_of_sparse_values_16", Verdict::refused, Three::misreads,
       "accessor 4 sparse: bufferView 11 has a byteStride",
       all(makeSparse({1, 2}, {4, 5, 6, -1, 7, 8, 9}), set(view(11) + "/byteStride", 16))},
      {"accessor_not_aligned", noted, Three::refuses,
       "accessor 0: byte 342 of the buffer is not aligned to its components of 4 bytes",
       spread(positions, 12, 12, 2)},
      {"view_not_aligned", noted, Three::loads,
       "of the buffer is not aligned to its components of 4 bytes",
       all(
           spread(times, 4, 4, 2), erase(accessor(times) + "/byteOffset"),
           [](File& f) {
             at(f, view(10))["byteOffset"] = at(f, view(10))["byteOffset"].get<int>() + 2;
           },
           set(view(10) + "/byteLength", 8))},
      {"attribute_not_aligned", noted, Three::loads,
       "JOINTS_0: accessor 1 starts at byte 1 with a stride of 4: vertex attributes must be "
       "aligned to 4 bytes",
       spread(joints, 4, 4, 1)},
  };
}

std::vector<Violation> rulesOfBuffers() {
  const auto noted = Verdict::noted;
  const auto refused = Verdict::refused;
  return {
      {"buffer_shorter_than_it_says", noted, Three::loads,
       "buffer 0: byteLength is 343, but there are only 340 bytes", withBuffer(3)},
      {"buffer_too_short", refused, Three::refuses, "are outside bufferView 9 of 4 bytes",
       all([](File& f) { f.binary.resize(f.binary.size() - 4); }, withBuffer())},
      {"view_longer_than_the_buffer", noted, Three::loads,
       "bufferView 9: bytes 332 to 342 are outside buffer 0 of 340 bytes",
       set(view(morphKeys) + "/byteLength", 10)},
      {"view_of_length_0", noted, Three::loads, "bufferView 10: byteLength is 0",
       push("/bufferViews", {{"buffer", 0}, {"byteLength", 0}})},
      {"view_without_target", Verdict::used, Three::loads, "", erase(view(positions) + "/target")},
      {"view_with_wrong_target", Verdict::used, Three::loads, "",
       set(view(indices) + "/target", 34962)},
      {"accessor_beyond_its_view", refused, Three::refuses,
       "accessor 0: bytes 0 to 48 are outside bufferView 0 of 36 bytes",
       all(set(accessor(positions) + "/count", 4), set(accessor(joints) + "/count", 4))},
      {"unused_buffer_is_missing", noted, Three::loads,
       "buffer 1: 'missing.bin' cannot be read: the model was loaded from memory, without a "
       "folder",
       all(withBuffer(), push("/buffers", {{"byteLength", 4}, {"uri", "missing.bin"}}))},
      {"unused_view_of_no_buffer", noted, Three::loads,
       "bufferView 10: buffer is 7, and the file has 1 buffers",
       push("/bufferViews", {{"buffer", 7}, {"byteLength", 4}})},
      {"unused_accessor_beyond_its_view", noted, Three::loads,
       "accessor 10: bytes 0 to 4000 are outside bufferView 0 of 36 bytes",
       push(
           "/accessors",
           {{"bufferView", 0}, {"componentType", floatType}, {"count", 1000}, {"type", "SCALAR"}})},
      {"unused_accessor_of_no_type", noted, Three::loads, "accessor 10: type is 'VEC5'",
       push("/accessors",
            {{"bufferView", 0}, {"componentType", floatType}, {"count", 1}, {"type", "VEC5"}})},
      {"accessor_of_no_type", refused, Three::misreads, "accessor 0: type is 'VEC5'",
       set(accessor(positions) + "/type", "VEC5")},
      {"offset_without_view", noted, Three::loads,
       "accessor 10: it has a byteOffset but no bufferView",
       push("/accessors",
            {{"byteOffset", 4}, {"componentType", floatType}, {"count", 3}, {"type", "VEC3"}})},
      {"floats_normalized", noted, Three::refuses, "accessor 0: float may not be normalized",
       set(accessor(positions) + "/normalized", true)},
      {"count_0", noted, Three::refuses, "accessor 10: count is 0",
       all(push(
               "/accessors",
               {{"bufferView", 6}, {"componentType", floatType}, {"count", 0}, {"type", "SCALAR"}}),
           addChannel(10, rotations, {{"node", 1}, {"path", "rotation"}}))},
      {"minimum_missing", Verdict::used, Three::loads, "",
       all(erase(accessor(positions) + "/min"), erase(accessor(times) + "/max"))},
      {"minimum_wrong", Verdict::used, Three::loads, "",
       all(set(accessor(positions) + "/min", {5, 5, 5}), set(accessor(times) + "/max", {0.25}))},
      {"sparse_indices_that_fall", noted, Three::loads,
       "accessor 4: sparse index 1 is 1 after 2: they must ascend",
       makeSparse({2, 1}, {7, 8, 9, 4, 5, 6})},
      {"sparse_index_twice", noted, Three::loads,
       "accessor 4: sparse index 1 is 1 after 1: they must ascend",
       makeSparse({1, 1}, {0, 0, 0, 4, 5, 6})},
      {"sparse_count_0", noted, Three::loads, "accessor 4: sparse: count is 0",
       all(makeSparse({1}, {4, 5, 6}), set(accessor(displacements) + "/sparse/count", 0))},
      {"sparse_index_outside", refused, Three::loads,
       "accessor 4: sparse index 0 is 3 | its value has no place: something else is wrong",
       makeSparse({3}, {4, 5, 6})},
  };
}

std::vector<Violation> rulesOfMeshes() {
  const auto noted = Verdict::noted;
  const auto refused = Verdict::refused;
  return {
      {"joints_of_float", noted, Three::loads,
       "JOINTS_0: accessor 1 is VEC4 of float, not VEC4 of unsigned byte or unsigned short",
       store(joints, Floats{0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 0}, floatType)},
      {"joints_of_unsigned_int", noted, Three::loads,
       "JOINTS_0: accessor 1 is VEC4 of unsigned int",
       store(joints, std::vector<std::uint32_t>{0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 0},
             unsignedIntType)},
      {"joints_of_byte", noted, Three::loads, "JOINTS_0: accessor 1 is VEC4 of byte",
       store(joints, std::vector<std::int8_t>{0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 0}, byteType)},
      {"joints_normalized", noted, Three::refuses,
       "JOINTS_0: accessor 1 is VEC4 of normalized unsigned byte",
       set(accessor(joints) + "/normalized", true)},
      {"joints_with_a_fraction", refused, Three::refuses,
       "JOINTS_0: component 1 of vertex 2 is 0.5, which is not a joint",
       store(joints, Floats{0, 0, 0, 0, 1, 0, 0, 0, 0, 0.5f, 0, 0}, floatType)},
      {"weights_not_normalized", noted, Three::misreads,
       "WEIGHTS_0: accessor 2 is VEC4 of unsigned byte",
       store(weights, Bytes{255, 0, 0, 0, 255, 0, 0, 0, 51, 204, 0, 0}, unsignedByteType)},
      {"weights_of_short", noted, Three::loads, "WEIGHTS_0: accessor 2 is VEC4 of normalized short",
       store(weights, std::vector<std::int16_t>{32767, 0, 0, 0, 32767, 0, 0, 0, 6553, 26214, 0, 0},
             shortType, true)},
      {"positions_quantized_without_saying_so", noted, Three::loads,
       "POSITION: accessor 0 is VEC3 of short, not VEC3 of float",
       store(positions, std::vector<std::int16_t>{0, 0, 0, 1, 0, 0, 0, 2, 0}, shortType)},
      {"indices_normalized", noted, Three::misreads,
       "indices: accessor 3 is SCALAR of normalized unsigned short",
       set(accessor(indices) + "/normalized", true)},
      {"indices_left_over", Verdict::remarked, Three::loads,
       "mesh 0 primitive 0: the last 1 indices do not form a triangle and are left out",
       all(store(indices, Shorts{0, 1, 2, 0}, unsignedShortType),
           set(accessor(indices) + "/count", 4))},
      {"index_outside", refused, Three::loads,
       "index 2 of accessor 3 is 3, and there are 3 vertices | the GPU would read what is not "
       "there",
       store(indices, Shorts{0, 1, 3}, unsignedShortType), false},
      {"texcoords_of_three", noted, Three::loads,
       "TEXCOORD_0: accessor 0 is VEC3 of float, not VEC2 of float or normalized unsigned "
       "byte or normalized unsigned short",
       set(attributes + "/TEXCOORD_0", positions)},
      {"texcoords_of_another_count", noted, Three::loads,
       "TEXCOORD_0: accessor 10 has 2 elements, but POSITION has 3",
       setFloats(attributes + "/TEXCOORD_0", {0, 0, 1, 1}, "VEC2")},
      {"colors_not_normalized", noted, Three::loads, "COLOR_0: accessor 1 is VEC4 of unsigned byte",
       set(attributes + "/COLOR_0", joints)},
      {"attribute_of_no_accessor", noted, Three::refuses,
       "mesh 0 primitive 0 attributes: '_LEVEL' is 99, and the file has 10 accessors",
       set(attributes + "/_LEVEL", 99)},
      {"normals_of_another_count", refused, Three::loads,
       "NORMAL: accessor 10 has 2 elements, but POSITION has 3 | which vertex has none is not "
       "said",
       setFloats(attributes + "/NORMAL", {0, 0, 1, 0, 0, 1}, "VEC3")},
      {"tangents_of_three", refused, Three::loads,
       "TANGENT: accessor 0 is VEC3 of float, not VEC4 | the handedness is missing",
       set(attributes + "/TANGENT", positions)},
      {"joints_without_weights", refused, Three::misreads,
       "mesh 0 primitive 0: JOINTS_0 has no WEIGHTS_0", erase(attributes + "/WEIGHTS_0")},
      {"weights_without_joints", refused, Three::misreads,
       "mesh 0 primitive 0: WEIGHTS_0 has no JOINTS_0", erase(attributes + "/JOINTS_0")},
      {"second_joints_without_weights", noted, Three::loads,
       "mesh 0 primitive 0: JOINTS_1 has no WEIGHTS_1", set(attributes + "/JOINTS_1", joints)},
      {"second_weights_without_joints", refused, Three::loads,
       "mesh 0 primitive 0: WEIGHTS_1 has no JOINTS_1 | what these weights move is not said; "
       "three.js has four influences only",
       set(attributes + "/WEIGHTS_1", weights)},
      {"targets_differ", noted, Three::loads,
       "mesh 0 primitive 1: it has 0 morph targets, but primitive 0 has 1",
       [](File& f) {
         Json second = f.primitive();
         second.erase("targets");
         at(f, "/meshes/0/primitives").push_back(second);
       }},
      {"too_many_weights_of_a_mesh", noted, Three::loads,
       "mesh 0: it has 3 weights for 1 morph targets", set("/meshes/0/weights", {0.5, 1, 1})},
      {"too_many_weights_of_a_node", noted, Three::loads,
       "node 0: it has 2 weights for 1 morph targets", set("/nodes/0/weights", {0.5, 1})},
      {"too_few_weights_of_a_mesh", noted, Three::loads,
       "mesh 0: it has 1 weights for 2 morph targets",
       all(erase(channels + "/2"), push(primitive + "/targets", {{"POSITION", displacements}})),
       false},
      {"too_few_weights_of_a_node", refused, Three::loads,
       "node 0: it has 1 weights for 2 morph targets, but its mesh has more weights | three.js "
       "keeps the mesh's for the rest, the specification has the node override them",
       all(erase(channels + "/2"), push(primitive + "/targets", {{"POSITION", displacements}}),
           set("/meshes/0/weights", {0.5, 1}), set("/nodes/0/weights", {0.25})),
       false},
      {"material_of_no_number", noted, Three::refuses,
       "mesh 0 primitive 0: material is 3, and the file has 0 materials",
       set(primitive + "/material", 3)},
      {"material_value_of_no_kind", noted, Three::loads,
       "material 0: alphaMode is 'SOME', which the specification does not define",
       all(set("/materials", {{{"alphaMode", "SOME"}}}), set(primitive + "/material", 0))},
      {"unused_mesh_is_broken", noted, Three::loads,
       "mesh 1 primitive 0 attributes: 'POSITION' is 99",
       push("/meshes", {{"primitives", {{{"attributes", {{"POSITION", 99}}}}}}})},
  };
}

std::vector<Violation> rulesOfNodes() {
  const auto noted = Verdict::noted;
  const auto refused = Verdict::refused;
  return {
      {"scene_lists_a_node_twice", noted, Three::loads, "scene 0: nodes lists 1 twice",
       set("/scenes/0/nodes", {0, 1, 1})},
      {"scene_lists_a_child", noted, Three::loads,
       "scene 0: node 2 is not a root but a child of node 1", set("/scenes/0/nodes", {0, 1, 2})},
      {"scene_lists_a_child_alone", refused, Three::misreads,
       "scene 0: node 2 is not a root but a child of node 1", set("/scenes/0/nodes", {0, 2})},
      {"scene_of_no_number", refused, Three::misreads,
       "the file: scene is 4, and the file has 1 scenes", set("/scene", 4)},
      {"child_twice", noted, Three::loads, "node 1: children lists 2 twice",
       set("/nodes/1/children", {2, 2})},
      {"child_of_two", refused, Three::misreads, "node 2: it is a child of both node 1 and node 3",
       all(push("/nodes", {{"children", {2}}, {"translation", {9, 9, 9}}}),
           push("/scenes/0/nodes", 3))},
      {"cycle", refused, Three::refuses, "node 1: it is part of, or below, a cycle of nodes",
       set("/nodes/2/children", {1})},
      {"cycle_of_unused_nodes", noted, Three::loads,
       "node 3: it is part of, or below, a cycle of nodes",
       all(push("/nodes", {{"children", {4}}}), push("/nodes", {{"children", {3}}}))},
      {"joint_twice", noted, Three::loads, "skin 0: joints lists 2 twice",
       all(set("/skins/0/joints", {1, 2, 2}),
           store(matrices,
                 Floats{1, 0, 0, 0, 0, 1,  0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 1, 0, 0, 0, 0, 1,  0, 0,
                        0, 0, 1, 0, 0, -1, 0, 1, 1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 0, -1, 0, 1},
                 floatType),
           set(accessor(matrices) + "/count", 3))},
      {"joint_of_no_number", refused, Three::refuses,
       "skin 0: an entry of joints is 7, and the file has 3 nodes", set("/skins/0/joints", {1, 7})},
      {"joints_without_a_common_root", noted, Three::loads,
       "skin 0: its joints have no common root",
       all(erase("/nodes/1/children"), set("/scenes/0/nodes", {0, 1, 2})), false},
      {"skeleton_of_no_number", noted, Three::loads,
       "skin 0: skeleton is 9, and the file has 3 nodes", set("/skins/0/skeleton", 9)},
      {"skeleton_is_no_common_root", noted, Three::loads,
       "skin 0: its skeleton, node 2, is not a common root of its joints",
       set("/skins/0/skeleton", 2)},
      {"joints_outside_the_scene", noted, Three::misreads,
       "node 0: its skin, 0, has joints outside the scene", set("/scenes/0/nodes", {0})},
      {"skinned_mesh_without_joints", noted, Three::misreads,
       "node 0: it has a skin, but mesh 0 has no joints and stays in bind pose",
       all(erase(attributes + "/JOINTS_0"), erase(attributes + "/WEIGHTS_0")), false},
      {"matrices_too_few", refused, Three::misreads,
       "skin 0 inverseBindMatrices: accessor 5 has 1 matrices for 2 joints",
       set(accessor(matrices) + "/count", 1)},
      {"matrix_with_a_fourth_row", refused, Three::misreads,
       "skin 0: inverse bind matrix 0: its fourth row is not 0 0 0 1",
       store(matrices, Floats{1, 0, 0, 0.5f, 0, 1, 0, 0, 0, 0, 1, 0, 0, 0,  0, 1,
                              1, 0, 0, 0,    0, 1, 0, 0, 0, 0, 1, 0, 0, -1, 0, 1},
             floatType)},
      {"matrix_with_an_inexact_fourth_row", noted, Three::loads,
       "skin 0: inverse bind matrix 0: its fourth row is not exactly 0 0 0 1; it is ignored",
       store(matrices, Floats{1, 0, 0, 1e-4f, 0, 1, 0, 0, 0, 0, 1, 0, 0, 0,  0, 1.0001f,
                              1, 0, 0, 0,     0, 1, 0, 0, 0, 0, 1, 0, 0, -1, 0, 1},
             floatType)},
      {"skin_without_a_mesh", noted, Three::loads, "node 1: it has skin but no mesh",
       set("/nodes/1/skin", 0)},
      {"weights_without_a_mesh", noted, Three::loads, "node 1: it has weights but no mesh",
       set("/nodes/1/weights", {1})},
      {"unused_skin_is_broken", noted, Three::loads, "skin 1: joints is an empty array",
       push("/skins", {{"joints", Json::array()}})},
      {"matrix_and_translation", noted, Three::loads,
       "node 0: it has both matrix and translation; the matrix is used",
       all(set("/nodes/0/matrix", {1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1}),
           set("/nodes/0/translation", {4, 5, 6}))},
      {"node_matrix_with_a_fourth_row", noted, Three::loads,
       "node 3: the fourth row of its matrix is not 0 0 0 1",
       all(push("/nodes",
                {{"children", {1}}, {"matrix", {1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 5}}}),
           set("/scenes/0/nodes", {0, 3}))},
      {"node_matrix_with_nearly_a_fourth_row", noted, Three::loads,
       "node 3: the fourth row of its matrix is not 0 0 0 1",
       addRoot({1, 0, 0, 1e-6, 0, 1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1})},
      {"node_matrix_with_shear", noted, Three::loads,
       "node 3: its matrix is not a translation times a rotation times a scale",
       addRoot({1, 0, 0, 0, 0.5, 1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1}), false},
      {"node_matrix_with_shear_and_translation", Verdict::remarked, Three::loads,
       "node 3: its matrix is not a translation times a rotation times a scale",
       addRoot({1, 0, 0, 0, 0.5, 1, 0, 0, 0, 0, 1, 0, 100, 0, 0, 1}), false},
      {"node_matrix_that_is_singular", noted, Three::loads,
       "node 3: its matrix is not a translation times a rotation times a scale",
       addRoot({0, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1}), false},
      {"node_matrix_that_mirrors", Verdict::used, Three::loads, "",
       addRoot({0, -2, 0, 0, -3, 0, 0, 0, 0, 0, 4, 0, 1, 2, 3, 1}), false},
      {"node_rotation_of_half_length", noted, Three::loads,
       "node 1: its rotation has a length of 0.5, not 1", set("/nodes/1/rotation", {0, 0, 0, 0.5})},
      {"node_rotation_of_bytes", Verdict::used, Three::loads, "",
       set("/nodes/1/rotation", {0, 0, 0, 0.9925})},
      {"node_rotation_beyond_1", noted, Three::loads,
       "node 1: its rotation has the component 1.000001, which is not from -1 to 1",
       set("/nodes/1/rotation", {0, 0, 0, 1.000001})},
      {"matrix_of_an_animated_node", noted, Three::loads,
       "animation 0 channel 1: node 2 has a matrix, which has been decomposed for the "
       "animation",
       all(erase("/nodes/2/translation"),
           set("/nodes/2/matrix", {1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 0, 1, 0, 1}))},
      {"camera_of_no_number", noted, Three::refuses,
       "node 0: camera is 2, and the file has 0 cameras", set("/nodes/0/camera", 2)},
      {"empty_arrays", noted, Three::loads, "node 2: children is an empty array",
       all(set("/cameras", Json::array()), set("/nodes/2/children", Json::array()))},
      {"null_for_nothing", noted, Three::refuses, "node 1: 'mesh' is null",
       set("/nodes/1/mesh", nullptr)},
      {"name_is_a_number", noted, Three::refuses, "mesh 0: its name is not a string",
       set("/meshes/0/name", 5)},
      {"properties_unknown", Verdict::used, Three::loads, "",
       all(set("/nodes/1/color", "red"), set("/author", 3))},
      {"extension_not_declared", Verdict::used, Three::loads, "",
       set("/nodes/1/extensions", {{"ACME_thing", {{"a", 1}}}})},
      {"extension_declared_and_unknown", Verdict::used, Three::loads, "",
       set("/extensionsUsed", {"ACME_thing"})},
      {"extension_required_but_not_used", noted, Three::loads,
       "extensionsRequired names 'KHR_mesh_quantization', which extensionsUsed does not",
       set("/extensionsRequired", {"KHR_mesh_quantization"})},
      {"extensions_are_no_list", noted, Three::loads, "extensionsUsed is not an array",
       set("/extensionsUsed", Json::object())},
      {"version_is_a_number", noted, Three::loads, "asset: version is not written as '2.0'",
       set("/asset/version", 2)},
      {"version_is_missing", refused, Three::refuses, "asset: it has no version",
       set("/asset", Json::object())},
  };
}

std::vector<Violation> rulesOfAnimations() {
  const auto noted = Verdict::noted;
  const auto refused = Verdict::refused;
  return {
      {"times_negative", noted, Three::loads,
       "input: key 0 of accessor 10 is at -0.5 seconds, which is negative",
       retime({-0.5f, 0.5f, 1.5f}), false},
      {"times_equal", noted, Three::loads,
       "input: key 1 of accessor 10 is at 0 seconds after 0: times must ascend", retime({0, 0, 1}),
       false},
      {"times_that_fall", refused, Three::loads,
       "input: key 2 of accessor 10 is at 0.25 seconds after 1: times must ascend | three.js "
       "searches them as they stand, others sort them",
       retime({0, 1, 0.25f}), false},
      {"times_not_finite", refused, Three::loads,
       "input: key 2 of accessor 10 is at inf, which is not finite | the clip has no end",
       retime({0, 1, std::numeric_limits<float>::infinity()}), false},
      {"spline_of_one_key", noted, Three::loads,
       "animation 0 channel 0: a CUBICSPLINE needs at least two keys",
       all(setFloats(samplers + "/0/input", {0}, "SCALAR"),
           setFloats(samplers + "/0/output", {9, 9, 9, 0.5f, 0, 0, 9, 9, 9}, "VEC3"),
           set(samplers + "/0/interpolation", "CUBICSPLINE"))},
      {"interpolation_unknown", refused, Three::loads,
       "animation 0 sampler 0: interpolation is 'SMOOTH' | what lies between two keys is not "
       "said",
       set(samplers + "/0/interpolation", "SMOOTH")},
      {"keys_of_another_count", refused, Three::misreads,
       "output: accessor 10 has 3 elements, but there must be 2 for 2 keys",
       setFloats(samplers + "/0/output", {0, 0, 0, 1, 0, 0, 2, 0, 0}, "VEC3")},
      {"rotation_key_of_length_2", noted, Three::misreads,
       "animation 0 channel 1 output: the rotation of key 0 has a length of 2, not 1",
       setFloats(samplers + "/1/output", {0, 0, 0, 2, std::sqrt(0.5f), 0, 0, std::sqrt(0.5f)},
                 "VEC4")},
      {"spline_of_rotations_of_length_2", noted, Three::loads,
       "animation 0 channel 1 output: the rotation of key 1 has a length of 2, not 1",
       all(setFloats(samplers + "/1/output",
                     {9, 9, 9, 9, 0, 0, 0, 1, 0, 0, 0, 0, 0, 0, 0, 0, 2, 0, 0, 0, 9, 9, 9, 9},
                     "VEC4"),
           set(samplers + "/1/interpolation", "CUBICSPLINE")),
       false},
      {"translations_of_short", noted, Three::loads,
       "output: accessor 7 is VEC3 of short, not VEC3 of float",
       store(translations, std::vector<std::int16_t>{0, 0, 0, 1, 0, 0}, shortType)},
      {"rotations_not_normalized", refused, Three::misreads,
       "output: accessor 8 is VEC4 of byte, not VEC4 of float or normalized byte",
       store(rotations, std::vector<std::int8_t>{0, 0, 0, 127, 0, 0, 90, 90}, byteType)},
      {"channel_twice", noted, Three::loads,
       "animation 0 channel 3: another channel already animates the translation of node 1; it is "
       "left out",
       [](File& f) { at(f, channels).push_back(Json(at(f, channels)[0])); }},
      {"channel_contradicts_another", noted, Three::misreads,
       "animation 0 channel 3: another channel already animates the translation of node 1; it is "
       "left out",
       [](File& f) {
         addChannel(times, f.addFloats({5, 5, 5, 6, 6, 6}, "VEC3"),
                    {{"node", 1}, {"path", "translation"}})(f);
       }},
      {"weights_of_no_mesh_move", noted, Three::loads,
       "animation 0 channel 3: node 1 has no mesh, so there are no weights to animate",
       addChannel(times, morphKeys, {{"node", 1}, {"path", "weights"}})},
      {"unused_sampler_is_broken", noted, Three::loads,
       "animation 0 sampler 3: input is 99, and the file has 10 accessors",
       push(samplers, {{"input", 99}, {"output", 99}})},
      {"sampler_of_no_number", refused, Three::refuses, "animation 0 channel 0: sampler is 9",
       set(channels + "/0/sampler", 9)},
  };
}

// Values of vertices, which `load` does not look at.
std::vector<Violation> rulesOfVertices() {
  const auto found = Verdict::found;
  const auto setWeights = [](const Floats& values) {
    return setFloats(attributes + "/WEIGHTS_0", values, "VEC4");
  };
  const Floats normals{0, 0, 1, 0, 0, 1, 0, 0, 1}, tangents{1, 0, 0, 1, 1, 0, 0, 1, 1, 0, 0, 1};
  const auto setDirections = [=](float normal, float tangent, float sign) {
    Floats changedNormals = normals, changedTangents = tangents;
    changedNormals[2] = normal;
    changedTangents[4] = tangent;
    changedTangents[7] = sign;
    return all(setFloats(attributes + "/NORMAL", changedNormals, "VEC3"),
               setFloats(attributes + "/TANGENT", changedTangents, "VEC4"));
  };
  return {
      {"weights_that_sum_to_less", found, Three::loads,
       "mesh 'number 0', vertex 1: the weights sum to 0.980000019, not to 1",
       setWeights({1, 0, 0, 0, 0.98f, 0, 0, 0, 0.2f, 0.8f, 0, 0}), false},
      {"weights_of_bytes_that_sum_to_less", found, Three::loads,
       "mesh 'number 0', vertex 0: the weights sum to 0.996078431, not to 1",
       store(weights, Bytes{254, 0, 0, 0, 255, 0, 0, 0, 51, 204, 0, 0}, unsignedByteType, true),
       false},
      {"weights_that_nearly_sum_to_1", Verdict::used, Three::loads, "",
       setWeights({1, 0, 0, 0, 1, 0, 0, 0, 0.2f, 0.80000037f, 0, 0}), false},
      {"weights_of_nothing", found, Three::loads,
       "mesh 'number 0', vertex 0: no joint has a weight; the vertex stays in bind pose",
       setWeights({0, 0, 0, 0, 1, 0, 0, 0, 0.2f, 0.8f, 0, 0}), false},
      {"weights_negative", found, Three::loads,
       "mesh 'number 0', vertex 2: the weight of joint 0 is negative",
       setWeights({1, 0, 0, 0, 1, 0, 0, 0, -0.25f, 1.25f, 0, 0}), false},
      {"joint_twice_in_a_vertex", found, Three::loads,
       "mesh 'number 0', vertex 2: joint 1 occurs twice",
       store(joints, Bytes{0, 0, 0, 0, 1, 0, 0, 0, 1, 1, 0, 0}, unsignedByteType), false},
      {"joint_twice_without_weight", Verdict::used, Three::loads, "",
       store(joints, Bytes{0, 0, 0, 0, 1, 1, 1, 1, 0, 1, 1, 1}, unsignedByteType), false},
      {"joint_255_without_weight", found, Three::loads,
       "mesh 'number 0', vertex 0: joint 255, with weight 0, is outside the pose of 2 joints",
       store(joints, Bytes{0, 255, 255, 255, 1, 0, 0, 0, 0, 1, 0, 0}, unsignedByteType), false},
      {"joint_255", found, Three::refuses,
       "mesh 'number 0', vertex 1: joint 255 is outside the pose of 2 joints",
       store(joints, Bytes{0, 0, 0, 0, 255, 0, 0, 0, 0, 1, 0, 0}, unsignedByteType), false},
      {"normal_of_length_2", found, Three::loads,
       "mesh 'number 0', vertex 0: the normal has a length of 2, not 1", setDirections(2, 1, 1)},
      {"normal_of_length_0", found, Three::loads,
       "mesh 'number 0', vertex 0: the normal has a length of 0, not 1", setDirections(0, 1, 1)},
      {"normal_of_bytes", Verdict::used, Three::loads, "", setDirections(1.0067f, 0.9933f, -1)},
      {"tangent_of_length_2", found, Three::loads,
       "mesh 'number 0', vertex 1: the tangent has a length of 2, not 1", setDirections(1, 2, 1)},
      {"tangent_without_a_sign", found, Three::loads,
       "mesh 'number 0', vertex 1: the handedness of the tangent is 0, not 1 or -1",
       setDirections(1, 1, 0)},
      {"position_not_a_number", found, Three::misreads,
       "mesh 'number 0', vertex 0: the position is not finite",
       setFloats(attributes + "/POSITION",
                 {std::numeric_limits<float>::quiet_NaN(), 0, 0, 1, 0, 0, 0, 2, 0}, "VEC3"),
       false},
  };
}

std::vector<Violation> rulesOfContainers() {
  const auto noted = Verdict::noted;
  const auto glb = [](auto change) { return std::function<void(std::vector<std::byte>&)>(change); };
  using Glb = std::vector<std::byte>;
  const auto nothing = [](File&) {};
  return {
      {"glb_followed_by_more", Verdict::remarked, Three::loads, "the GLB header says", nothing,
       true, glb([](Glb& b) { b.resize(b.size() + 6); })},
      {"glb_cut_off", Verdict::refused, Three::refuses, "the GLB header says", nothing, true,
       glb([](Glb& b) { b.resize(b.size() - 6); })},
      {"glb_binary_first", noted, Three::loads,
       "GLB chunk 0 is binary data, which only the second chunk may be", nothing, true,
       glb([](Glb& b) {
         const std::size_t json = 8 + word(b, 12);
         std::rotate(b.begin() + 12, b.begin() + 12 + static_cast<std::ptrdiff_t>(json), b.end());
       })},
      {"glb_chunk_of_odd_length", noted, Three::loads, "the length of GLB chunk 0, ", nothing, true,
       glb([](Glb& b) {
         b.insert(b.begin() + 20 + static_cast<std::ptrdiff_t>(word(b, 12)), std::byte{' '});
         setWord(b, 12, word(b, 12) + 1);
         setWord(b, 8, b.size());
       })},
      {"glb_text_padded_with_zeros", noted, Three::refuses,
       "the JSON text is padded with zero bytes, not with spaces", nothing, true, glb([](Glb& b) {
         b.insert(b.begin() + 20 + static_cast<std::ptrdiff_t>(word(b, 12)), 4, std::byte{0});
         setWord(b, 12, word(b, 12) + 4);
         setWord(b, 8, b.size());
       })},
      {"glb_text_with_a_byte_order_mark", noted, Three::loads,
       "the JSON text begins with a byte order mark", nothing, true, glb([](Glb& b) {
         const Glb mark = {std::byte{0xef}, std::byte{0xbb}, std::byte{0xbf}, std::byte{' '}};
         b.insert(b.begin() + 20, mark.begin(), mark.end());
         setWord(b, 12, word(b, 12) + 4);
         setWord(b, 8, b.size());
       })},
  };
}

}  // namespace

FileBuilder flawlessTriangle() {
  FileBuilder file;
  file.addFloats({0, 0, 0, 1, 0, 0, 0, 2, 0}, "VEC3");
  file.add<std::uint8_t>({0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 0}, "VEC4", unsignedByteType);
  file.addFloats({1, 0, 0, 0, 1, 0, 0, 0, 0.2f, 0.8f, 0, 0}, "VEC4");
  file.add<std::uint16_t>({0, 1, 2}, "SCALAR", unsignedShortType);
  file.addFloats({1, 2, 3, 4, 5, 6, 7, 8, 9}, "VEC3");
  file.addFloats({1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 0, 0,  0, 1,
                  1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 0, -1, 0, 1},
                 "MAT4");
  file.addFloats({0, 1}, "SCALAR");
  file.addFloats({0, 0, 0, 1, 0, 0}, "VEC3");
  file.addFloats({0, 0, 0, 1, std::sqrt(0.5f), 0, 0, std::sqrt(0.5f)}, "VEC4");
  file.addFloats({0, 1}, "SCALAR");
  for (const std::size_t attribute : {positions, joints, weights, displacements})
    at(file, view(attribute))["target"] = 34962;
  at(file, view(indices))["target"] = 34963;
  at(file, accessor(positions))["min"] = {0, 0, 0};
  at(file, accessor(positions))["max"] = {1, 2, 0};
  at(file, accessor(displacements))["min"] = {1, 2, 3};
  at(file, accessor(displacements))["max"] = {7, 8, 9};
  at(file, accessor(times))["min"] = {0};
  at(file, accessor(times))["max"] = {1};
  file.json["meshes"] = {
      {{"primitives",
        {{{"attributes", {{"POSITION", positions}, {"JOINTS_0", joints}, {"WEIGHTS_0", weights}}},
          {"indices", indices},
          {"targets", {{{"POSITION", displacements}}}}}}},
       {"weights", {0.5}}}};
  file.json["skins"] = {{{"joints", {1, 2}}, {"inverseBindMatrices", matrices}}};
  file.json["nodes"] = {
      {{"mesh", 0}, {"skin", 0}}, {{"children", {2}}}, {{"translation", {0, 1, 0}}}};
  file.json["scenes"] = {{{"nodes", {0, 1}}}};
  file.json["scene"] = 0;
  file.json["animations"] = {
      {{"samplers",
        {{{"input", times}, {"output", translations}},
         {{"input", times}, {"output", rotations}},
         {{"input", times}, {"output", morphKeys}}}},
       {"channels",
        {{{"sampler", 0}, {"target", {{"node", 1}, {"path", "translation"}}}},
         {{"sampler", 1}, {"target", {{"node", 2}, {"path", "rotation"}}}},
         {{"sampler", 2}, {"target", {{"node", 0}, {"path", "weights"}}}}}}}};
  return file;
}

std::vector<std::byte> bytesOf(const Violation& violation) {
  FileBuilder file = flawlessTriangle();
  violation.change(file);
  if (!violation.changeGlb) return bytesOf(file.text());
  std::vector<std::byte> glb = file.glb();
  violation.changeGlb(glb);
  return glb;
}

std::vector<Violation> violations() {
  std::vector<Violation> table;
  for (const auto& rules : {rulesOfStrides(), rulesOfBuffers(), rulesOfMeshes(), rulesOfNodes(),
                            rulesOfAnimations(), rulesOfVertices(), rulesOfContainers()})
    table.insert(table.end(), rules.begin(), rules.end());
  return table;
}

}  // namespace dermis::test
