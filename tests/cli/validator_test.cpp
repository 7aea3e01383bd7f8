// What `dermis info` lists and `--strict` refuses, compared with the errors of the glTF validator
// for the models of the test data and for the files of the test GltfRules.
// tests/gltf_rules/validator has the table of its errors (errors.tsv), and the differences that are
// known, each with a reason (known_differences.tsv). A new difference fails, and so does one that
// no longer exists.
#include <algorithm>
#include <filesystem>
#include <fstream>
#include <map>
#include <set>
#include <string>
#include <string_view>
#include <vector>

#include "dermis/gltf.h"
#include "gltf_rules.h"
#include "skinned_scene.h"
#include "test_data.h"
#include "test_paths.h"

namespace dermis::test {
namespace {

/// Parts of the sentences that say what a code says. Whatever has no entry is listed by none.
const std::multimap<std::string, std::string>& sentences() {
  static const std::multimap<std::string, std::string> table = {
      {"ACCESSOR_ANIMATION_INPUT_NEGATIVE", "seconds, which is negative"},
      {"ACCESSOR_ANIMATION_INPUT_NON_INCREASING", "times must ascend"},
      {"ACCESSOR_ANIMATION_SAMPLER_OUTPUT_NON_NORMALIZED_QUATERNION",
       "output: the rotation of key"},
      {"ACCESSOR_INVALID_FLOAT", "is not finite"},
      {"ACCESSOR_INVALID_IBM", "its fourth row is not"},
      {"ACCESSOR_INVALID_SIGN", "the handedness of the tangent is"},
      {"ACCESSOR_JOINTS_INDEX_DUPLICATE", "occurs twice"},
      {"ACCESSOR_JOINTS_INDEX_OOB", "is outside the pose of"},
      {"ACCESSOR_NORMALIZED_INVALID", "may not be normalized"},
      {"ACCESSOR_OFFSET_ALIGNMENT", "is not aligned to its components"},
      {"ACCESSOR_SPARSE_INDICES_NON_INCREASING", "they must ascend"},
      {"ACCESSOR_TOO_LONG", "are outside bufferView"},
      {"ACCESSOR_TOTAL_OFFSET_ALIGNMENT", "is not aligned to its components"},
      {"ACCESSOR_VECTOR3_NON_UNIT", "the normal has a length of"},
      {"ACCESSOR_VECTOR3_NON_UNIT", "the tangent has a length of"},
      {"ACCESSOR_WEIGHTS_NEGATIVE", "is negative"},
      {"ACCESSOR_WEIGHTS_NON_NORMALIZED", "the weights sum to"},
      {"ACCESSOR_WEIGHTS_NON_NORMALIZED", "no joint has a weight"},
      {"ANIMATION_CHANNEL_TARGET_NODE_MATRIX", "has a matrix, which has been decomposed"},
      {"ANIMATION_CHANNEL_TARGET_NODE_WEIGHTS_NO_MORPHS", "has no mesh, so there are no weights"},
      {"ANIMATION_DUPLICATE_TARGETS", "another channel already animates"},
      {"ANIMATION_SAMPLER_ACCESSOR_WITH_BYTESTRIDE", "which only vertex attributes may have"},
      {"ANIMATION_SAMPLER_INPUT_ACCESSOR_TOO_FEW_ELEMENTS", "needs at least two keys"},
      {"ANIMATION_SAMPLER_OUTPUT_ACCESSOR_INVALID_FORMAT", "output: accessor"},
      {"BUFFER_BYTE_LENGTH_MISMATCH", "but there are only"},
      {"BUFFER_VIEW_INVALID_BYTE_STRIDE", "which sparse data may not have"},
      {"BUFFER_VIEW_TOO_LONG", "are outside buffer "},
      {"DUPLICATE_ELEMENTS", "twice"},
      {"EMPTY_ENTITY", "is an empty array"},
      {"GLB_CHUNK_LENGTH_UNALIGNED", "is not a multiple of 4"},
      {"GLB_UNEXPECTED_FIRST_CHUNK", "is binary data, which only the second chunk may be"},
      {"INVALID_IBM_ACCESSOR_COUNT", "matrices for"},
      {"INVALID_JSON", "the JSON text is padded with zero bytes"},
      {"INVALID_JSON", "the JSON text begins with a byte order mark"},
      {"IO_ERROR", "cannot be read"},
      {"MESH_INVALID_WEIGHTS_COUNT", "weights for"},
      {"MESH_PRIMITIVES_UNEQUAL_TARGETS_COUNT", "morph targets, but primitive 0 has"},
      {"MESH_PRIMITIVE_ACCESSOR_UNALIGNED", "vertex attributes must be aligned"},
      {"MESH_PRIMITIVE_ATTRIBUTES_ACCESSOR_INVALID_FORMAT", ", not VEC"},
      {"MESH_PRIMITIVE_INDICES_ACCESSOR_INVALID_FORMAT", "indices: accessor"},
      {"MESH_PRIMITIVE_INDICES_ACCESSOR_WITH_BYTESTRIDE", "which only vertex attributes may have"},
      {"MESH_PRIMITIVE_JOINTS_WEIGHTS_MISMATCH", "has no WEIGHTS_"},
      {"MESH_PRIMITIVE_UNEQUAL_ACCESSOR_COUNT", "elements, but POSITION has"},
      {"NODE_LOOP", "a cycle of nodes"},
      {"NODE_MATRIX_NON_TRS", "its matrix is not a translation times"},
      {"NODE_MATRIX_NON_TRS", "the fourth row of its matrix"},
      {"NODE_MATRIX_TRS", "it has both matrix and"},
      {"NODE_PARENT_OVERRIDE", "children lists"},
      {"NODE_SKIN_NO_SCENE", "has joints outside the scene"},
      {"NODE_SKIN_WITH_NON_SKINNED_MESH", "it has a skin, but mesh"},
      {"NODE_WEIGHTS_INVALID", "weights for"},
      {"ROTATION_NON_UNIT", "its rotation has a length of"},
      {"SCENE_NON_ROOT_NODE", "is not a root but a child"},
      {"SKIN_IBM_ACCESSOR_WITH_BYTESTRIDE", "which only vertex attributes may have"},
      {"SKIN_IBM_INVALID_FORMAT", "inverseBindMatrices: accessor"},
      {"SKIN_NO_COMMON_ROOT", "its joints have no common root"},
      {"SKIN_SKELETON_INVALID", "is not a common root of its joints"},
      {"TYPE_MISMATCH", "is null"},
      {"TYPE_MISMATCH", "is not an array"},
      {"TYPE_MISMATCH", "is not a string"},
      {"TYPE_MISMATCH", "is not written as '2.0'"},
      {"UNDEFINED_PROPERTY", "it has no"},
      {"UNRESOLVED_REFERENCE", ", and the file has"},
      {"UNSATISFIED_DEPENDENCY", "but no"},
      {"UNSATISFIED_DEPENDENCY", "which extensionsUsed does not"},
      {"VALUE_MULTIPLE_OF", "is not a multiple of 4"},
      {"VALUE_NOT_IN_RANGE", "count is 0"},
      {"VALUE_NOT_IN_RANGE", "which is not from -1 to 1"},
      {"VALUE_NOT_IN_RANGE", "is not a multiple of 4 from 4 to 252"},
      {"VALUE_NOT_IN_RANGE", "byteLength is 0"},
  };
  return table;
}

/// The fields of each line of a table, which are separated by tabs.
std::vector<std::vector<std::string>> linesOf(const std::string& table) {
  const std::string path = std::string(sourceFolder) + "/tests/gltf_rules/validator/" + table;
  std::ifstream stream(path);
  EXPECT_TRUE(stream.is_open()) << path;
  std::vector<std::vector<std::string>> lines;
  for (std::string line; std::getline(stream, line);) {
    if (line.starts_with('#')) continue;
    std::vector<std::string>& fields = lines.emplace_back(1);
    for (const char character : line)
      if (character == '\t')
        fields.emplace_back();
      else
        fields.back() += character;
  }
  return lines;
}

/// What Dermis says of a file.
struct Opinion {
  bool isRefused = false;  ///< even where not strict
  bool isRefusedStrictly = false;
  std::vector<std::string> list;  ///< what `info` lists
};

template <typename Load>
Opinion opinionOf(Load load) {
  Opinion opinion;
  const Result<cli::Scene> scene = load(cli::MeshPreparation{});
  opinion.isRefused = !scene.ok();
  opinion.isRefusedStrictly = !load(cli::MeshPreparation{.strict = true}).ok();
  if (!scene) return opinion;
  opinion.list = scene->notes;
  for (const cli::ScenePart& part : scene->parts) {
    if (part.mesh == nullptr) continue;
    for (const MeshReport::Finding& finding : part.mesh->report().findings)
      opinion.list.push_back(finding.message);
  }
  return opinion;
}

bool lists(const Opinion& opinion, const std::string& code) {
  const auto [first, last] = sentences().equal_range(code);
  return std::any_of(first, last, [&](const auto& entry) {
    return std::ranges::any_of(opinion.list, [&](const std::string& sentence) {
      return sentence.find(entry.second) != std::string::npos;
    });
  });
}

/// Compares one file with its line or lines of the table.
void compare(const std::string& file, const std::vector<std::string>& codes, const Opinion& opinion,
             std::set<std::pair<std::string, std::string>>& differences) {
  if (codes.front() == "exception") return;  // The validator cannot read it.
  if (codes.front() == "none") {
    if (opinion.isRefusedStrictly) differences.emplace(file, "refused");
    return;
  }
  // Of a file that is refused in any case, only the first fault is listed.
  if (opinion.isRefused) return;
  bool isListed = false;
  for (const std::string& code : codes) {
    if (lists(opinion, code))
      isListed = true;
    else
      differences.emplace(file, code);
  }
  EXPECT_TRUE(opinion.isRefusedStrictly || !isListed) << file;
}

/// By file: the codes of its errors.
std::map<std::string, std::vector<std::string>> errorsIn(std::string_view folder) {
  std::map<std::string, std::vector<std::string>> errors;
  for (const std::vector<std::string>& line : linesOf("errors.tsv"))
    if (line.at(0).starts_with(folder)) errors[line[0]].push_back(line.at(1));
  return errors;
}

/// Compares with the known differences of the files in a folder of the table. "*" stands for every
/// file.
void expectKnown(std::set<std::pair<std::string, std::string>> differences,
                 std::string_view folder) {
  std::set<std::pair<std::string, std::string>> known;
  for (const std::vector<std::string>& line : linesOf("known_differences.tsv")) {
    ASSERT_EQ(line.size(), 3u) << line.at(0) << ": a file, a code and a reason";
    EXPECT_FALSE(line[2].empty()) << line[0] << " has no reason";
    if (!line[0].starts_with(folder)) continue;
    const std::size_t matches = std::erase_if(differences, [&](const auto& difference) {
      const bool isFile = line[0].ends_with("/*") || difference.first == line[0];
      return isFile && difference.second == line[1];
    });
    EXPECT_GT(matches, 0u) << line[0] << " " << line[1] << ": no longer differs";
  }
  for (const auto& [file, code] : differences) ADD_FAILURE() << file << '\t' << code;
}

TEST(GltfValidator, FindsWhatIsListedInTheFilesOfTheRules) {
  const auto errors = errorsIn("rules/");
  std::set<std::pair<std::string, std::string>> differences;
  std::size_t compared = 0;
  const auto compareFile = [&](const std::string& name, const std::vector<std::byte>& bytes) {
    const auto found = errors.find("rules/" + name);
    ASSERT_NE(found, errors.end()) << name << ": make_table.sh must be run";
    ++compared;
    compare(found->first, found->second, opinionOf([&](const cli::MeshPreparation& preparation) {
              return cli::loadScene(bytes, name, preparation);
            }),
            differences);
  };
  compareFile("flawless.gltf", bytesOf(flawlessTriangle().text()));
  for (const Violation& violation : violations())
    compareFile(violation.name + (violation.changeGlb ? ".glb" : ".gltf"), bytesOf(violation));
  EXPECT_EQ(compared, errors.size()) << "make_table.sh must be run";
  expectKnown(std::move(differences), "rules/");
}

TEST(GltfValidator, FindsWhatIsListedInTheModels) {
  const auto data = testDataFolder();
  if (!data) GTEST_SKIP() << noTestData;
  std::set<std::pair<std::string, std::string>> differences;
  for (const auto& [file, codes] : errorsIn("models/")) {
    const std::filesystem::path path = *data / file;
    compare(file, codes, opinionOf([&](const cli::MeshPreparation& preparation) {
              return cli::loadScene(path, preparation);
            }),
            differences);
  }
  expectKnown(std::move(differences), "models/");
}

}  // namespace
}  // namespace dermis::test
