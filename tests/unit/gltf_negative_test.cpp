// The glTF validator's own broken files, file by file: refused with a sentence that names the
// fault, used with such a sentence as a note and refused where strict, or accepted for a reason
// that stands here. Most of them skin nothing, so that most faults are of things that nothing uses.
#include <algorithm>
#include <map>

#include "gltf_builder.h"
#include "test_data.h"

namespace dermis::test {
namespace {

struct Decision {
  enum { refused, noted, accepted } verdict;
  const char* text;  ///< What the sentence must contain, or why the file is accepted.
};

Decision refuse(const char* sentence) {
  return {Decision::refused, sentence};
}
Decision note(const char* sentence) {
  return {Decision::noted, sentence};
}
Decision accept(const char* reason) {
  return {Decision::accepted, reason};
}

const std::map<std::string, Decision>& decisions() {
  static const std::map<std::string, Decision> table = {
      {"mesh_data/joints_no_weights.gltf",
       refuse("accessor 2: bytes 16 to 32 are outside bufferView 0 of 16 bytes")},
      {"mesh_data/joints_weights_complex.gltf",
       accept("what is wrong is wrong in single vertices: `validate` finds it")},
      {"node/node_skin_without_skinned_mesh.gltf",
       note("node 0: it has a skin, but mesh 0 has no joints")},
      {"node/node_skinned_mesh_without_skin.gltf",
       accept("a warning to the validator; without a skin the mesh is not skinned, and left out")},
      {"node/node_weights_invalid.gltf", note("node 0: it has 2 weights for 1 morph targets")},
      {"node/node_weights_override.gltf", accept("the validator finds no error in it")},
      {"node/skin_with_no_mesh.gltf", note("node 0: it has skin but no mesh")},
      {"node/unresolved_skin.gltf", note("node 0: it has skin but no mesh")},
      {"node/weights_with_no_mesh.gltf", note("node 0: it has weights but no mesh")},
      {"skin/buffer_view_bytestride.gltf",
       note("accessor 0: it is invalid, or its data is missing; ignored, since nothing skinned or "
            "animated uses it")},
      {"skin/custom_property.gltf",
       accept("a warning to the validator; properties that are not known are not read")},
      {"skin/empty_array.gltf", note("'skins' is an empty array")},
      {"skin/empty_joints_array.gltf", note("skin 0: joints is an empty array")},
      {"skin/empty_object.gltf", note("skin 0: it has no joints")},
      {"skin/ibm_invalid_count.gltf",
       note("skin 2 inverseBindMatrices: accessor 0 has 2 matrices for 3 joints")},
      {"skin/ibm_invalid_format.gltf",
       note("skin 0 inverseBindMatrices: accessor 0 is MAT3 of float, not MAT4 of float")},
      {"skin/ignored_animated_transform.gltf",
       accept("a warning to the validator; the skinned node's transform has no effect")},
      {"skin/ignored_local_transform.gltf",
       accept("a warning to the validator; the skinned node's transform has no effect")},
      {"skin/ignored_parent_transform.gltf",
       accept("a warning to the validator; the skinned node's transform has no effect")},
      {"skin/no_common_root.gltf", note("skin 0: its joints have no common root")},
      {"skin/no_joints_in_scene.gltf", note("node 2: its skin, 0, has joints outside the scene")},
      {"skin/skeleton_invalid.gltf",
       note("skin 0: its skeleton, node 2, is not a common root of its joints")},
      {"skin/unresolved_ibm.gltf",
       note("skin 0: inverseBindMatrices is 0, and the file has 0 accessors")},
      {"skin/unresolved_joint.gltf",
       note("skin 0: an entry of joints is 0, and the file has 0 nodes")},
      {"skin/unresolved_skeleton.gltf", note("skin 0: skeleton is 1, and the file has 1 nodes")},
      {"skin/valid.gltf", accept("the validator finds no error in it")},
      {"skin_data/invalid_ibm.gltf",
       note("skin 0: inverse bind matrix 1: its fourth row is not 0 0 0 1")},
  };
  return table;
}

TEST(GltfNegative, EveryBrokenFileIsRefusedOrAcceptedForAReason) {
  const auto data = testDataFolder();
  if (!data) GTEST_SKIP() << noTestData;
  std::size_t decided = 0;
  for (const auto& entry : std::filesystem::directory_iterator(*data / "models")) {
    if (!entry.path().filename().string().starts_with("negative_")) continue;
    for (const auto& file : std::filesystem::recursive_directory_iterator(entry.path())) {
      const std::string extension = file.path().extension().string();
      if (extension != ".gltf" && extension != ".glb") continue;
      const std::string name =
          std::filesystem::relative(file.path(), entry.path()).generic_string();
      SCOPED_TRACE(name);
      const auto found = decisions().find(name);
      ASSERT_NE(found, decisions().end()) << "nothing has been decided for this file";
      ++decided;
      const auto result = gltf::load(file.path());
      const auto strict = gltf::load(file.path(), {.strict = true});
      if (found->second.verdict == Decision::refused) {
        expectError(result, ErrorCode::invalidData, found->second.text);
      } else if (found->second.verdict == Decision::noted) {
        EXPECT_TRUE(hasNote(loaded(result), found->second.text))
            << testing::PrintToString(loaded(result).notes);
        const std::string sentence = found->second.text;
        expectError(strict, ErrorCode::invalidData, sentence.substr(0, sentence.find(';')));
      } else {
        EXPECT_TRUE(strict.ok()) << (strict.ok() ? "" : strict.error().message);
        EXPECT_TRUE(result.ok()) << (result.ok() ? "" : result.error().message) << "\naccepted, as "
                                 << found->second.text;
      }
    }
  }
  EXPECT_EQ(decided, decisions().size());
}

}  // namespace
}  // namespace dermis::test
