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

Json& accessor(FileBuilder& file, std::size_t index) {
  return file.json["accessors"][index];
}
Json& view(FileBuilder& file, std::size_t index) {
  return file.json["bufferViews"][index];
}
Json& node(FileBuilder& file, std::size_t index) {
  return file.json["nodes"][index];
}
Json& sampler(FileBuilder& file, std::size_t index) {
  return file.json["animations"][0]["samplers"][index];
}
Json& mesh(FileBuilder& file) {
  return file.json["meshes"][0];
}
Json& skin(FileBuilder& file) {
  return file.json["skins"][0];
}

/// Stores an accessor's values in another way.
template <typename T>
void store(FileBuilder& file, std::size_t index, const std::vector<T>& values, int componentType,
           bool normalized = false) {
  accessor(file, index)["bufferView"] = file.addView(bytesOf(values));
  accessor(file, index)["componentType"] = componentType;
  if (normalized) accessor(file, index)["normalized"] = true;
}

/// Moves the elements of an accessor apart, or to another place.
void spread(FileBuilder& file, std::size_t index, std::size_t size, std::size_t stride,
            std::size_t start = 0) {
  const std::size_t from = view(file, index)["byteOffset"].get<std::size_t>();
  const std::size_t count = accessor(file, index)["count"].get<std::size_t>();
  std::vector<std::byte> bytes(start + stride * count, std::byte{0x7b});
  for (std::size_t i = 0; i < count; ++i)
    for (std::size_t j = 0; j < size; ++j)
      bytes[start + i * stride + j] = file.binary[from + i * size + j];
  const std::size_t moved = file.addView(bytes);
  if (stride != size) view(file, moved)["byteStride"] = stride;
  accessor(file, index)["bufferView"] = moved;
  if (start != 0) accessor(file, index)["byteOffset"] = start;
}

/// Sparse values in place of some displacements; the rest stays as it is.
void makeSparse(FileBuilder& file, const Bytes& elements, const Floats& values) {
  accessor(file, displacements)["sparse"] = {
      {"count", elements.size()},
      {"indices",
       {{"bufferView", file.addView(bytesOf(elements))}, {"componentType", unsignedByteType}}},
      {"values", {{"bufferView", file.addView(bytesOf(values))}}}};
}

std::size_t addChannel(FileBuilder& file, std::size_t input, std::size_t output,
                       const Json& target) {
  Json& animation = file.json["animations"][0];
  animation["samplers"].push_back({{"input", input}, {"output", output}});
  animation["channels"].push_back(
      {{"sampler", animation["samplers"].size() - 1}, {"target", target}});
  return animation["samplers"].size() - 1;
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

using File = FileBuilder;

void addStrides(std::vector<Violation>& table) {
  const auto noted = Verdict::noted;
  // three.js ignores a stride on what is no vertex attribute. Blender and Godot use it.
  table.insert(
      table.end(),
      {
          {"stride_of_matrices_64", noted, Three::loads,
           "skin 0 inverseBindMatrices: bufferView 5 of accessor 5 has a byteStride of 64",
           [](File& f) { view(f, matrices)["byteStride"] = 64; }},
          {"stride_of_matrices_80", noted, Three::misreads,
           "has a byteStride of 80, which only vertex attributes may have",
           [](File& f) { spread(f, matrices, 64, 80); }},
          {"stride_of_rotations_16", noted, Three::loads,
           "animation 0 channel 1 output: bufferView 8 of accessor 8 has a byteStride of 16",
           [](File& f) { view(f, rotations)["byteStride"] = 16; }},
          {"stride_of_translations_16", noted, Three::loads,
           "animation 0 channel 0 output: bufferView 10 of accessor 7 has a byteStride of 16",
           [](File& f) { spread(f, translations, 12, 16); }},
          {"stride_of_times_4", noted, Three::loads,
           "animation 0 channel 0 input: bufferView 6 of accessor 6 has a byteStride of 4",
           [](File& f) { view(f, times)["byteStride"] = 4; }},
          {"stride_of_indices_4", noted, Three::loads,
           "mesh 0 primitive 0 indices: bufferView 10 of accessor 3 has a byteStride of 4",
           [](File& f) { spread(f, indices, 2, 4); }},
          {"stride_0", noted, Three::loads,
           "bufferView 0: byteStride 0 is not a multiple of 4 from 4 to 252",
           [](File& f) { view(f, positions)["byteStride"] = 0; }},
          {"stride_256", noted, Three::loads,
           "bufferView 10: byteStride 256 is not a multiple of 4 from 4 to 252",
           [](File& f) { spread(f, positions, 12, 256); }},
          {"stride_6", noted, Three::loads,
           "bufferView 10: byteStride 6 is not a multiple of 4 from 4 to 252",
           [](File& f) { spread(f, joints, 4, 6); }},
          {"stride_too_small", Verdict::refused, Three::misreads,
           "accessor 0: its elements of 12 bytes do not fit the byteStride 8 of bufferView 0",
           [](File& f) { view(f, positions)["byteStride"] = 8; }},
          {"stride_of_sparse_values_12", noted, Three::loads,
           "accessor 4 sparse: bufferView 11 has a byteStride",
           [](File& f) {
             makeSparse(f, {1}, {4, 5, 6});
             view(f, 11)["byteStride"] = 12;
           }},
          {"stride_of_sparse_values_16", Verdict::refused, Three::misreads,
           "accessor 4 sparse: bufferView 11 has a byteStride",
           [](File& f) {
             makeSparse(f, {1, 2}, {4, 5, 6, -1, 7, 8, 9});
             view(f, 11)["byteStride"] = 16;
           }},
          {"accessor_not_aligned", noted, Three::refuses,
           "accessor 0: byte 342 of the buffer is not aligned to its components of 4 bytes",
           [](File& f) { spread(f, positions, 12, 12, 2); }},
          {"view_not_aligned", noted, Three::loads,
           "of the buffer is not aligned to its components of 4 bytes",
           [](File& f) {
             spread(f, times, 4, 4, 2);
             accessor(f, times).erase("byteOffset");
             view(f, 10)["byteOffset"] = view(f, 10)["byteOffset"].get<int>() + 2;
             view(f, 10)["byteLength"] = 8;
           }},
          {"attribute_not_aligned", noted, Three::loads,
           "JOINTS_0: accessor 1 starts at byte 1 with a stride of 4: vertex attributes must be "
           "aligned to 4 bytes",
           [](File& f) { spread(f, joints, 4, 4, 1); }},
      });
}

void addBuffers(std::vector<Violation>& table) {
  const auto noted = Verdict::noted;
  const auto refused = Verdict::refused;
  const auto withBuffer = [](File& f, std::size_t length) {
    f.json["buffers"] = {
        {{"byteLength", length},
         {"uri", "data:application/octet-stream;base64," + encodeBase64(f.binary)}}};
  };
  table.insert(
      table.end(),
      {
          {"buffer_shorter_than_it_says", noted, Three::loads,
           "buffer 0: byteLength is 343, but there are only 340 bytes",
           [withBuffer](File& f) { withBuffer(f, f.binary.size() + 3); }},
          {"buffer_too_short", refused, Three::refuses, "are outside bufferView 9 of 4 bytes",
           [withBuffer](File& f) {
             f.binary.resize(f.binary.size() - 4);
             withBuffer(f, f.binary.size());
           }},
          {"view_longer_than_the_buffer", noted, Three::loads,
           "bufferView 9: bytes 332 to 342 are outside buffer 0 of 340 bytes",
           [](File& f) { view(f, morphKeys)["byteLength"] = 10; }},
          {"view_of_length_0", noted, Three::loads, "bufferView 10: byteLength is 0",
           [](File& f) {
             f.json["bufferViews"].push_back({{"buffer", 0}, {"byteLength", 0}});
           }},
          {"view_without_target", Verdict::used, Three::loads, "",
           [](File& f) { view(f, positions).erase("target"); }},
          {"view_with_wrong_target", Verdict::used, Three::loads, "",
           [](File& f) { view(f, indices)["target"] = 34962; }},
          {"accessor_beyond_its_view", refused, Three::refuses,
           "accessor 0: bytes 0 to 48 are outside bufferView 0 of 36 bytes",
           [](File& f) {
             accessor(f, positions)["count"] = 4;
             accessor(f, joints)["count"] = 4;
           }},
          {"unused_buffer_is_missing", noted, Three::loads,
           "buffer 1: 'missing.bin' cannot be read: the model was loaded from memory, without a "
           "folder",
           [withBuffer](File& f) {
             withBuffer(f, f.binary.size());
             f.json["buffers"].push_back({{"byteLength", 4}, {"uri", "missing.bin"}});
           }},
          {"unused_view_of_no_buffer", noted, Three::loads,
           "bufferView 10: buffer is 7, and the file has 1 buffers",
           [](File& f) {
             f.json["bufferViews"].push_back({{"buffer", 7}, {"byteLength", 4}});
           }},
          {"unused_accessor_beyond_its_view", noted, Three::loads,
           "accessor 10: bytes 0 to 4000 are outside bufferView 0 of 36 bytes",
           [](File& f) {
             f.addAccessor({{"bufferView", 0},
                            {"componentType", floatType},
                            {"count", 1000},
                            {"type", "SCALAR"}});
           }},
          {"unused_accessor_of_no_type", noted, Three::loads, "accessor 10: type is 'VEC5'",
           [](File& f) {
             f.addAccessor(
                 {{"bufferView", 0}, {"componentType", floatType}, {"count", 1}, {"type", "VEC5"}});
           }},
          {"accessor_of_no_type", refused, Three::misreads, "accessor 0: type is 'VEC5'",
           [](File& f) { accessor(f, positions)["type"] = "VEC5"; }},
          {"offset_without_view", noted, Three::loads,
           "accessor 10: it has a byteOffset but no bufferView",
           [](File& f) {
             f.addAccessor(
                 {{"byteOffset", 4}, {"componentType", floatType}, {"count", 3}, {"type", "VEC3"}});
           }},
          {"floats_normalized", noted, Three::refuses, "accessor 0: float may not be normalized",
           [](File& f) { accessor(f, positions)["normalized"] = true; }},
          {"count_0", noted, Three::refuses, "accessor 10: count is 0",
           [](File& f) {
             addChannel(f,
                        f.addAccessor({{"bufferView", 6},
                                       {"componentType", floatType},
                                       {"count", 0},
                                       {"type", "SCALAR"}}),
                        rotations, {{"node", 1}, {"path", "rotation"}});
           }},
          {"minimum_missing", Verdict::used, Three::loads, "",
           [](File& f) {
             accessor(f, positions).erase("min");
             accessor(f, times).erase("max");
           }},
          {"minimum_wrong", Verdict::used, Three::loads, "",
           [](File& f) {
             accessor(f, positions)["min"] = {5, 5, 5};
             accessor(f, times)["max"] = {0.25};
           }},
          {"sparse_indices_that_fall", noted, Three::loads,
           "accessor 4: sparse index 1 is 1 after 2: they must ascend",
           [](File& f) {
             makeSparse(f, {2, 1}, {7, 8, 9, 4, 5, 6});
           }},
          {"sparse_index_twice", noted, Three::loads,
           "accessor 4: sparse index 1 is 1 after 1: they must ascend",
           [](File& f) {
             makeSparse(f, {1, 1}, {0, 0, 0, 4, 5, 6});
           }},
          {"sparse_count_0", noted, Three::loads, "accessor 4: sparse: count is 0",
           [](File& f) {
             makeSparse(f, {1}, {4, 5, 6});
             accessor(f, displacements)["sparse"]["count"] = 0;
           }},
          {"sparse_index_outside", refused, Three::loads,
           "accessor 4: sparse index 0 is 3 | its value has no place: something else is wrong",
           [](File& f) {
             makeSparse(f, {3}, {4, 5, 6});
           }},
      });
}

void addMeshes(std::vector<Violation>& table) {
  const auto noted = Verdict::noted;
  const auto refused = Verdict::refused;
  table.insert(
      table.end(),
      {
          {"joints_of_float", noted, Three::loads,
           "JOINTS_0: accessor 1 is VEC4 of float, not VEC4 of unsigned byte or unsigned short",
           [](File& f) {
             store(f, joints, Floats{0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 0}, floatType);
           }},
          {"joints_of_unsigned_int", noted, Three::loads,
           "JOINTS_0: accessor 1 is VEC4 of unsigned int",
           [](File& f) {
             store(f, joints, std::vector<std::uint32_t>{0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 0},
                   unsignedIntType);
           }},
          {"joints_of_byte", noted, Three::loads, "JOINTS_0: accessor 1 is VEC4 of byte",
           [](File& f) {
             store(f, joints, std::vector<std::int8_t>{0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 0},
                   byteType);
           }},
          {"joints_normalized", noted, Three::refuses,
           "JOINTS_0: accessor 1 is VEC4 of normalized unsigned byte",
           [](File& f) { accessor(f, joints)["normalized"] = true; }},
          {"joints_with_a_fraction", refused, Three::refuses,
           "JOINTS_0: component 1 of vertex 2 is 0.5, which is not a joint",
           [](File& f) {
             store(f, joints, Floats{0, 0, 0, 0, 1, 0, 0, 0, 0, 0.5f, 0, 0}, floatType);
           }},
          {"weights_not_normalized", noted, Three::misreads,
           "WEIGHTS_0: accessor 2 is VEC4 of unsigned byte",
           [](File& f) {
             store(f, weights, Bytes{255, 0, 0, 0, 255, 0, 0, 0, 51, 204, 0, 0}, unsignedByteType);
           }},
          {"weights_of_short", noted, Three::loads,
           "WEIGHTS_0: accessor 2 is VEC4 of normalized short",
           [](File& f) {
             store(f, weights,
                   std::vector<std::int16_t>{32767, 0, 0, 0, 32767, 0, 0, 0, 6553, 26214, 0, 0},
                   shortType, true);
           }},
          {"positions_quantized_without_saying_so", noted, Three::loads,
           "POSITION: accessor 0 is VEC3 of short, not VEC3 of float",
           [](File& f) {
             store(f, positions, std::vector<std::int16_t>{0, 0, 0, 1, 0, 0, 0, 2, 0}, shortType);
           }},
          {"indices_normalized", noted, Three::misreads,
           "indices: accessor 3 is SCALAR of normalized unsigned short",
           [](File& f) { accessor(f, indices)["normalized"] = true; }},
          {"indices_left_over", noted, Three::loads,
           "mesh 0 primitive 0: the last 1 indices do not form a triangle and are left out",
           [](File& f) {
             store(f, indices, Shorts{0, 1, 2, 0}, unsignedShortType);
             accessor(f, indices)["count"] = 4;
           }},
          {"index_outside", refused, Three::loads,
           "index 2 of accessor 3 is 3, and there are 3 vertices | the GPU would read what is not "
           "there",
           [](File& f) {
             store(f, indices, Shorts{0, 1, 3}, unsignedShortType);
           },
           false},
          {"texcoords_of_three", noted, Three::loads,
           "TEXCOORD_0: accessor 0 is VEC3 of float, not VEC2 of float or normalized unsigned "
           "byte or normalized unsigned short",
           [](File& f) { f.attributes()["TEXCOORD_0"] = positions; }},
          {"texcoords_of_another_count", noted, Three::loads,
           "TEXCOORD_0: accessor 10 has 2 elements, but POSITION has 3",
           [](File& f) {
             f.attributes()["TEXCOORD_0"] = f.addFloats({0, 0, 1, 1}, "VEC2");
           }},
          {"colors_not_normalized", noted, Three::loads,
           "COLOR_0: accessor 1 is VEC4 of unsigned byte",
           [](File& f) { f.attributes()["COLOR_0"] = joints; }},
          {"attribute_of_no_accessor", noted, Three::refuses,
           "mesh 0 primitive 0 attributes: '_LEVEL' is 99, and the file has 10 accessors",
           [](File& f) { f.attributes()["_LEVEL"] = 99; }},
          {"normals_of_another_count", refused, Three::loads,
           "NORMAL: accessor 10 has 2 elements, but POSITION has 3 | which vertex has none is not "
           "said",
           [](File& f) {
             f.attributes()["NORMAL"] = f.addFloats({0, 0, 1, 0, 0, 1}, "VEC3");
           }},
          {"tangents_of_three", refused, Three::loads,
           "TANGENT: accessor 0 is VEC3 of float, not VEC4 | the handedness is missing",
           [](File& f) { f.attributes()["TANGENT"] = positions; }},
          {"joints_without_weights", refused, Three::misreads,
           "mesh 0 primitive 0: JOINTS_0 has no WEIGHTS_0",
           [](File& f) { f.attributes().erase("WEIGHTS_0"); }},
          {"weights_without_joints", refused, Three::misreads,
           "mesh 0 primitive 0: WEIGHTS_0 has no JOINTS_0",
           [](File& f) { f.attributes().erase("JOINTS_0"); }},
          {"second_joints_without_weights", noted, Three::loads,
           "mesh 0 primitive 0: JOINTS_1 has no WEIGHTS_1",
           [](File& f) { f.attributes()["JOINTS_1"] = joints; }},
          {"second_weights_without_joints", refused, Three::loads,
           "mesh 0 primitive 0: WEIGHTS_1 has no JOINTS_1 | what these weights move is not said; "
           "three.js has four influences only",
           [](File& f) { f.attributes()["WEIGHTS_1"] = weights; }},
          {"targets_differ", noted, Three::loads,
           "mesh 0 primitive 1: it has 0 morph targets, but primitive 0 has 1",
           [](File& f) {
             Json second = f.primitive();
             second.erase("targets");
             mesh(f)["primitives"].push_back(second);
           }},
          {"too_many_weights_of_a_mesh", noted, Three::loads,
           "mesh 0: it has 3 weights for 1 morph targets",
           [](File& f) {
             mesh(f)["weights"] = {0.5, 1, 1};
           }},
          {"too_many_weights_of_a_node", noted, Three::loads,
           "node 0: it has 2 weights for 1 morph targets",
           [](File& f) {
             node(f, 0)["weights"] = {0.5, 1};
           }},
          {"too_few_weights_of_a_mesh", noted, Three::loads,
           "mesh 0: it has 1 weights for 2 morph targets",
           [](File& f) {
             f.json["animations"][0]["channels"].erase(2);
             f.primitive()["targets"].push_back({{"POSITION", displacements}});
           },
           false},
          {"too_few_weights_of_a_node", refused, Three::loads,
           "node 0: it has 1 weights for 2 morph targets, but its mesh has more weights | three.js "
           "keeps the mesh's for the rest, the specification has the node override them",
           [](File& f) {
             f.json["animations"][0]["channels"].erase(2);
             f.primitive()["targets"].push_back({{"POSITION", displacements}});
             mesh(f)["weights"] = {0.5, 1};
             node(f, 0)["weights"] = {0.25};
           },
           false},
          {"material_of_no_number", noted, Three::refuses,
           "mesh 0 primitive 0: material is 3, and the file has 0 materials",
           [](File& f) { f.primitive()["material"] = 3; }},
          {"material_value_of_no_kind", noted, Three::loads,
           "material 0: alphaMode is 'SOME', which the specification does not define",
           [](File& f) {
             f.json["materials"] = {{{"alphaMode", "SOME"}}};
             f.primitive()["material"] = 0;
           }},
          {"unused_mesh_is_broken", noted, Three::loads,
           "mesh 1 primitive 0 attributes: 'POSITION' is 99",
           [](File& f) {
             f.json["meshes"].push_back({{"primitives", {{{"attributes", {{"POSITION", 99}}}}}}});
           }},
      });
}

void addNodes(std::vector<Violation>& table) {
  const auto noted = Verdict::noted;
  const auto refused = Verdict::refused;
  table.insert(
      table.end(),
      {
          {"scene_lists_a_node_twice", noted, Three::loads, "scene 0: nodes lists 1 twice",
           [](File& f) {
             f.json["scenes"][0]["nodes"] = {0, 1, 1};
           }},
          {"scene_lists_a_child", noted, Three::loads,
           "scene 0: node 2 is not a root but a child of node 1",
           [](File& f) {
             f.json["scenes"][0]["nodes"] = {0, 1, 2};
           }},
          {"scene_lists_a_child_alone", refused, Three::misreads,
           "scene 0: node 2 is not a root but a child of node 1",
           [](File& f) {
             f.json["scenes"][0]["nodes"] = {0, 2};
           }},
          {"scene_of_no_number", refused, Three::misreads,
           "the file: scene is 4, and the file has 1 scenes", [](File& f) { f.json["scene"] = 4; }},
          {"child_twice", noted, Three::loads, "node 1: children lists 2 twice",
           [](File& f) {
             node(f, 1)["children"] = {2, 2};
           }},
          {"child_of_two", refused, Three::misreads,
           "node 2: it is a child of both node 1 and node 3",
           [](File& f) {
             f.json["nodes"].push_back({{"children", {2}}, {"translation", {9, 9, 9}}});
             f.json["scenes"][0]["nodes"].push_back(3);
           }},
          {"cycle", refused, Three::refuses, "node 1: it is part of, or below, a cycle of nodes",
           [](File& f) { node(f, 2)["children"] = {1}; }},
          {"joint_twice", noted, Three::loads, "skin 0: joints lists 2 twice",
           [](File& f) {
             skin(f)["joints"] = {1, 2, 2};
             store(f, matrices,
                   Floats{1, 0, 0, 0, 0, 1,  0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 1, 0, 0, 0, 0, 1,  0, 0,
                          0, 0, 1, 0, 0, -1, 0, 1, 1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 0, -1, 0, 1},
                   floatType);
             accessor(f, matrices)["count"] = 3;
           }},
          {"joint_of_no_number", refused, Three::refuses,
           "skin 0: an entry of joints is 7, and the file has 3 nodes",
           [](File& f) {
             skin(f)["joints"] = {1, 7};
           }},
          {"joints_without_a_common_root", noted, Three::loads,
           "skin 0: its joints have no common root",
           [](File& f) {
             node(f, 1).erase("children");
             f.json["scenes"][0]["nodes"] = {0, 1, 2};
           },
           false},
          {"skeleton_of_no_number", noted, Three::loads,
           "skin 0: skeleton is 9, and the file has 3 nodes",
           [](File& f) { skin(f)["skeleton"] = 9; }},
          {"skeleton_is_no_common_root", Verdict::used, Three::loads, "",
           [](File& f) { skin(f)["skeleton"] = 2; }},
          {"matrices_too_few", refused, Three::misreads,
           "skin 0 inverseBindMatrices: accessor 5 has 1 matrices for 2 joints",
           [](File& f) { accessor(f, matrices)["count"] = 1; }},
          {"matrix_with_a_fourth_row", refused, Three::misreads,
           "skin 0: inverse bind matrix 0: its fourth row is not 0 0 0 1",
           [](File& f) {
             store(f, matrices, Floats{1, 0, 0, 0.5f, 0, 1, 0, 0, 0, 0, 1, 0, 0, 0,  0, 1,
                                       1, 0, 0, 0,    0, 1, 0, 0, 0, 0, 1, 0, 0, -1, 0, 1},
                   floatType);
           }},
          {"skin_without_a_mesh", noted, Three::loads, "node 1: it has skin but no mesh",
           [](File& f) { node(f, 1)["skin"] = 0; }},
          {"weights_without_a_mesh", noted, Three::loads, "node 1: it has weights but no mesh",
           [](File& f) { node(f, 1)["weights"] = {1}; }},
          {"unused_skin_is_broken", noted, Three::loads, "skin 1: joints is an empty array",
           [](File& f) {
             f.json["skins"].push_back({{"joints", Json::array()}});
           }},
          {"matrix_and_translation", noted, Three::loads,
           "node 0: it has both matrix and translation; the matrix is used",
           [](File& f) {
             node(f, 0)["matrix"] = {1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1};
             node(f, 0)["translation"] = {4, 5, 6};
           }},
          {"node_matrix_with_a_fourth_row", noted, Three::loads,
           "node 3: the fourth row of its matrix is not 0 0 0 1",
           [](File& f) {
             f.json["nodes"].push_back(
                 {{"children", {1}}, {"matrix", {1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 5}}});
             f.json["scenes"][0]["nodes"] = {0, 3};
           }},
          {"matrix_of_an_animated_node", noted, Three::loads,
           "animation 0 channel 1: node 2 has a matrix, which has been decomposed for the "
           "animation",
           [](File& f) {
             node(f, 2).erase("translation");
             node(f, 2)["matrix"] = {1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 0, 1, 0, 1};
           }},
          {"camera_of_no_number", noted, Three::refuses,
           "node 0: camera is 2, and the file has 0 cameras",
           [](File& f) { node(f, 0)["camera"] = 2; }},
          {"empty_arrays", noted, Three::loads, "node 2: children is an empty array",
           [](File& f) {
             f.json["cameras"] = Json::array();
             node(f, 2)["children"] = Json::array();
           }},
          {"null_for_nothing", noted, Three::refuses, "node 1: 'mesh' is null",
           [](File& f) { node(f, 1)["mesh"] = nullptr; }},
          {"name_is_a_number", noted, Three::refuses, "mesh 0: its name is not a string",
           [](File& f) { mesh(f)["name"] = 5; }},
          {"properties_unknown", Verdict::used, Three::loads, "",
           [](File& f) {
             node(f, 1)["color"] = "red";
             f.json["author"] = 3;
           }},
          {"extension_not_declared", Verdict::used, Three::loads, "",
           [](File& f) {
             node(f, 1)["extensions"] = {{"ACME_thing", {{"a", 1}}}};
           }},
          {"extension_declared_and_unknown", Verdict::used, Three::loads, "",
           [](File& f) { f.json["extensionsUsed"] = {"ACME_thing"}; }},
          {"extension_required_but_not_used", noted, Three::loads,
           "extensionsRequired names 'KHR_mesh_quantization', which extensionsUsed does not",
           [](File& f) { f.json["extensionsRequired"] = {"KHR_mesh_quantization"}; }},
          {"extensions_are_no_list", noted, Three::loads, "extensionsUsed is not an array",
           [](File& f) { f.json["extensionsUsed"] = Json::object(); }},
          {"version_is_a_number", noted, Three::loads, "asset: version is not written as '2.0'",
           [](File& f) { f.json["asset"]["version"] = 2; }},
          {"version_is_missing", refused, Three::refuses, "asset: it has no version",
           [](File& f) { f.json["asset"] = Json::object(); }},
      });
}

void addAnimations(std::vector<Violation>& table) {
  const auto noted = Verdict::noted;
  const auto refused = Verdict::refused;
  const auto retime = [](File& f, const Floats& values) {
    sampler(f, 0)["input"] = f.addFloats(values, "SCALAR");
    sampler(f, 0)["output"] = f.addFloats({0, 0, 0, 1, 0, 0, 2, 0, 0}, "VEC3");
  };
  table.insert(
      table.end(),
      {
          {"times_negative", noted, Three::loads,
           "input: key 0 of accessor 10 is at -0.5 seconds, which is negative",
           [retime](File& f) {
             retime(f, {-0.5f, 0.5f, 1.5f});
           },
           false},
          {"times_equal", noted, Three::loads,
           "input: key 1 of accessor 10 is at 0 seconds after 0: times must ascend",
           [retime](File& f) {
             retime(f, {0, 0, 1});
           },
           false},
          {"times_that_fall", refused, Three::loads,
           "input: key 2 of accessor 10 is at 0.25 seconds after 1: times must ascend | three.js "
           "searches them as they stand, others sort them",
           [retime](File& f) {
             retime(f, {0, 1, 0.25f});
           },
           false},
          {"times_not_finite", refused, Three::loads,
           "input: key 2 of accessor 10 is at inf, which is not finite | the clip has no end",
           [retime](File& f) {
             retime(f, {0, 1, std::numeric_limits<float>::infinity()});
           },
           false},
          {"spline_of_one_key", noted, Three::loads,
           "animation 0 channel 0: a CUBICSPLINE needs at least two keys",
           [](File& f) {
             sampler(f, 0) = {{"input", f.addFloats({0}, "SCALAR")},
                              {"output", f.addFloats({9, 9, 9, 0.5f, 0, 0, 9, 9, 9}, "VEC3")},
                              {"interpolation", "CUBICSPLINE"}};
           }},
          {"interpolation_unknown", refused, Three::loads,
           "animation 0 sampler 0: interpolation is 'SMOOTH' | what lies between two keys is not "
           "said",
           [](File& f) { sampler(f, 0)["interpolation"] = "SMOOTH"; }},
          {"keys_of_another_count", refused, Three::misreads,
           "output: accessor 10 has 3 elements, but there must be 2 for 2 keys",
           [](File& f) {
             sampler(f, 0)["output"] = f.addFloats({0, 0, 0, 1, 0, 0, 2, 0, 0}, "VEC3");
           }},
          {"translations_of_short", noted, Three::loads,
           "output: accessor 7 is VEC3 of short, not VEC3 of float",
           [](File& f) {
             store(f, translations, std::vector<std::int16_t>{0, 0, 0, 1, 0, 0}, shortType);
           }},
          {"rotations_not_normalized", refused, Three::misreads,
           "output: accessor 8 is VEC4 of byte, not VEC4 of float or normalized byte",
           [](File& f) {
             store(f, rotations, std::vector<std::int8_t>{0, 0, 0, 127, 0, 0, 90, 90}, byteType);
           }},
          {"channel_twice", noted, Three::loads,
           "animation 0 channel 3: another channel already animates the translation of node 1 "
           "with the same sampler",
           [](File& f) {
             Json& channels = f.json["animations"][0]["channels"];
             channels.push_back(Json(channels[0]));
           }},
          {"channel_contradicts_another", refused, Three::misreads,
           "animation 0 channel 3: another channel already animates the translation of node 1",
           [](File& f) {
             addChannel(f, times, f.addFloats({5, 5, 5, 6, 6, 6}, "VEC3"),
                        {{"node", 1}, {"path", "translation"}});
           }},
          {"weights_of_no_mesh_move", noted, Three::loads,
           "animation 0 channel 3: node 1 has no mesh, so there are no weights to animate",
           [](File& f) {
             addChannel(f, times, morphKeys, {{"node", 1}, {"path", "weights"}});
           }},
          {"unused_sampler_is_broken", noted, Three::loads,
           "animation 0 sampler 3: input is 99, and the file has 10 accessors",
           [](File& f) {
             f.json["animations"][0]["samplers"].push_back({{"input", 99}, {"output", 99}});
           }},
          {"sampler_of_no_number", refused, Three::refuses, "animation 0 channel 0: sampler is 9",
           [](File& f) { f.json["animations"][0]["channels"][0]["sampler"] = 9; }},
      });
}

void addContainers(std::vector<Violation>& table) {
  const auto noted = Verdict::noted;
  const auto glb = [](auto change) { return std::function<void(std::vector<std::byte>&)>(change); };
  using Glb = std::vector<std::byte>;
  const auto nothing = [](File&) {};
  table.insert(
      table.end(),
      {
          {"glb_followed_by_more", noted, Three::loads, "the GLB header says", nothing, true,
           glb([](Glb& b) { b.resize(b.size() + 6); })},
          {"glb_cut_off", Verdict::refused, Three::refuses, "the GLB header says", nothing, true,
           glb([](Glb& b) { b.resize(b.size() - 6); })},
          {"glb_binary_first", noted, Three::loads,
           "GLB chunk 0 is binary data, which only the second chunk may be", nothing, true,
           glb([](Glb& b) {
             const std::size_t json = 8 + word(b, 12);
             std::rotate(b.begin() + 12, b.begin() + 12 + static_cast<std::ptrdiff_t>(json),
                         b.end());
           })},
          {"glb_chunk_of_odd_length", noted, Three::loads, "the length of GLB chunk 0, ", nothing,
           true, glb([](Glb& b) {
             b.insert(b.begin() + 20 + static_cast<std::ptrdiff_t>(word(b, 12)), std::byte{' '});
             setWord(b, 12, word(b, 12) + 1);
             setWord(b, 8, b.size());
           })},
          {"glb_text_padded_with_zeros", noted, Three::refuses,
           "the JSON text is padded with zero bytes, not with spaces", nothing, true,
           glb([](Glb& b) {
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
      });
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
    view(file, attribute)["target"] = 34962;
  view(file, indices)["target"] = 34963;
  accessor(file, positions)["min"] = {0, 0, 0};
  accessor(file, positions)["max"] = {1, 2, 0};
  accessor(file, displacements)["min"] = {1, 2, 3};
  accessor(file, displacements)["max"] = {7, 8, 9};
  accessor(file, times)["min"] = {0};
  accessor(file, times)["max"] = {1};
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
  addStrides(table);
  addBuffers(table);
  addMeshes(table);
  addNodes(table);
  addAnimations(table);
  addContainers(table);
  return table;
}

}  // namespace dermis::test
