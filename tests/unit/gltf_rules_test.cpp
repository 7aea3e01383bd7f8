// What breaks a rule of glTF and leaves the meaning clear is used, with a note; strict, it is
// refused. The table is in gltf_rules.cpp.
//
// With DERMIS_WRITE_RULES=FOLDER the files are written there, for tests/gltf_rules/three.mjs and
// validator.mjs, which show what three.js and the glTF validator make of them.
#include "gltf_rules.h"

#include <dermis/mesh.h>

#include <algorithm>
#include <cmath>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <limits>
#include <set>

namespace dermis::test {
namespace {

std::string nameOf(Three three) {
  switch (three) {
    case Three::loads:
      return "loads";
    case Three::misreads:
      return "misreads";
    case Three::refuses:
      break;
  }
  return "refuses";
}

template <typename T>
void append(std::vector<double>& numbers, const std::vector<T>& values, double scale = 1) {
  for (const T value : values) numbers.push_back(static_cast<double>(value) * scale);
}

/// All numbers that decide where the vertices of the first primitive are, half a second into the
/// clip: positions, triangles, influences, palette, weights of morph targets.
std::vector<double> meaningOf(const gltf::Model& model) {
  std::vector<double> numbers;
  if (model.skinnedPrimitives.empty()) return numbers;
  const gltf::SkinnedPrimitive& skinned = model.skinnedPrimitives[0];
  const gltf::Primitive& primitive = model.meshes[skinned.mesh].primitives[skinned.primitive];
  append(numbers, primitive.positions.values());
  append(numbers, primitive.triangles.values());
  for (const gltf::Influences& set : primitive.influences) {
    if (set.jointType == ComponentType::uint8)
      append(numbers, componentsOf<std::uint8_t>(set.joints));
    else
      append(numbers, componentsOf<std::uint16_t>(set.joints));
    if (set.weightType == ComponentType::unorm8)
      append(numbers, componentsOf<std::uint8_t>(set.weights), 1.0 / 255);
    else if (set.weightType == ComponentType::unorm16)
      append(numbers, componentsOf<std::uint16_t>(set.weights), 1.0 / 65535);
    else
      append(numbers, componentsOf<float>(set.weights));
  }
  for (const gltf::MorphTarget& target : primitive.morphTargets)
    append(numbers, target.positions.values());
  append(numbers, gltf::morphWeights(model, skinned.node, 0, 0.5));
  const auto matrices = gltf::pose(model, skinned.skin, 0, 0.5);
  for (std::size_t joint = 0; joint < 2 && joint < matrices.size(); ++joint) {
    for (const auto& row : matrices[joint].m)
      for (const float value : row) numbers.push_back(static_cast<double>(value));
  }
  return numbers;
}

/// What `validate` finds first in the only mesh.
std::string findingOf(const gltf::Model& model) {
  if (model.skinnedPrimitives.empty() || model.meshes[0].primitives[0].influences.empty())
    return "";
  const gltf::PrimitiveView view(model.meshes[0].primitives[0]);
  const MeshReport report = validate(view.mesh(), 2);
  return report.findings.empty() ? "" : report.findings[0].message;
}

void expectSameMeaning(const gltf::Model& model) {
  const std::vector<double> actual = meaningOf(model);
  const std::vector<double> expected = meaningOf(loaded(flawlessTriangle()));
  ASSERT_EQ(actual.size(), expected.size());
  // Signed 16-bit weights are the least exact of what the table stores otherwise.
  for (std::size_t i = 0; i < actual.size(); ++i) EXPECT_NEAR(actual[i], expected[i], 2e-5) << i;
}

/// Writes all files where DERMIS_WRITE_RULES says.
void writeFiles(const std::vector<Violation>& table) {
  const char* folder = std::getenv("DERMIS_WRITE_RULES");
  if (folder == nullptr) return;
  const std::filesystem::path path = folder;
  std::filesystem::create_directories(path);
  const auto write = [&](const std::string& name, const std::vector<std::byte>& bytes) {
    std::ofstream stream(path / name, std::ios::binary);
    stream.write(reinterpret_cast<const char*>(bytes.data()),
                 static_cast<std::streamsize>(bytes.size()));
    ASSERT_TRUE(stream.good()) << name;
  };
  write("flawless.gltf", test::bytesOf(flawlessTriangle().text()));
  std::string expected;
  for (const Violation& violation : table) {
    const std::string name = violation.name + (violation.changeGlb ? ".glb" : ".gltf");
    write(name, bytesOf(violation));
    expected += name + '\t' + nameOf(violation.three) + '\t' +
                (violation.sameMeaning ? "same" : "other") + '\n';
  }
  write("expected.tsv", test::bytesOf(expected));
}

TEST(GltfRules, TheFlawlessFileHasNoNotes) {
  const Result<gltf::Model> strict = flawlessTriangle().load({}, {.strict = true});
  const gltf::Model model = loaded(strict);
  EXPECT_TRUE(model.notes.empty()) << testing::PrintToString(model.notes);
  // 9 positions, 3 indices, 12 joints, 12 weights, 9 displacements, a weight, two matrices.
  EXPECT_EQ(meaningOf(model).size(), 9u + 3 + 12 + 12 + 9 + 1 + 24);
}

TEST(GltfRules, WhatIsClearIsUsedWithANote) {
  std::set<std::string> names;
  const std::vector<Violation> table = violations();
  writeFiles(table);
  for (const Violation& violation : table) {
    SCOPED_TRACE(violation.name);
    EXPECT_TRUE(names.insert(violation.name).second) << "twice in the table";
    const std::vector<std::byte> bytes = bytesOf(violation);
    const Result<gltf::Model> result = gltf::loadFromMemory(bytes, {});
    const Result<gltf::Model> strict = gltf::loadFromMemory(bytes, {}, {.strict = true});
    const std::string sentence = violation.sentence.substr(0, violation.sentence.find(" | "));
    if (violation.verdict == Verdict::refused) {
      EXPECT_FALSE(result.ok()) << "loaded";
      const std::string message = result.ok() ? std::string() : result.error().message;
      EXPECT_NE(message.find(sentence), std::string::npos) << message;
      EXPECT_FALSE(strict.ok());
      EXPECT_EQ(violation.three == Three::loads, violation.sentence != sentence)
          << "a reason is due where three.js loads it, and only there";
      continue;
    }
    if (violation.verdict == Verdict::noted) {
      ASSERT_FALSE(strict.ok());
      EXPECT_NE(strict.error().message.find(sentence), std::string::npos) << strict.error().message;
    }
    const gltf::Model model = loaded(violation.verdict == Verdict::noted ? result : strict);
    if (violation.verdict == Verdict::noted || violation.verdict == Verdict::remarked) {
      EXPECT_TRUE(hasNote(model, sentence)) << testing::PrintToString(model.notes);
    } else {
      EXPECT_TRUE(model.notes.empty()) << testing::PrintToString(model.notes);
    }
    EXPECT_EQ(findingOf(model), violation.verdict == Verdict::found ? sentence : "");
    if (violation.sameMeaning) expectSameMeaning(model);
  }
  EXPECT_GE(names.size(), 30u);
}

// The notes of a file are counted by kind: a hostile file gets no more of them than a broken one,
// and none is long.
TEST(GltfRules, NotesAreBounded) {
  FileBuilder file = flawlessTriangle();
  const std::string longName(100'000, 'x');
  for (int i = 0; i < 100; ++i) {
    file.json["nodes"].push_back({{"skin", 0}, {"camera", 7}, {"name", 5}, {"mesh", nullptr}});
    file.json["materials"].push_back({{"alphaMode", longName}, {"name", longName}});
  }
  for (int i = 0; i < 20'000; ++i) {
    file.json["nodes"].push_back({{"skin", 0}, {"camera", 7}, {"name", 5}, {"mesh", nullptr}});
    file.json["accessors"].push_back({{"type", "VEC9"}, {"count", 1}, {"componentType", 5126}});
  }
  file.attributes()["_" + longName] = 2'000'000;
  const gltf::Model model = loaded(file);
  EXPECT_LE(model.notes.size(), 20u);
  for (const std::string& note : model.notes) EXPECT_LT(note.size(), 400u) << note;
  EXPECT_TRUE(
      hasNote(model,
              "accessor 10: type is 'VEC9', which the specification does not define; "
              "ignored, since nothing skinned or animated uses it (and 19999 more of this kind)"))
      << testing::PrintToString(model.notes);
  EXPECT_TRUE(hasNote(model, "node 3: it has skin but no mesh (and 20099 more of this kind)"));
}

// The two real files of which these were found: 64 on inverse bind matrices, 16 on animation
// output.
TEST(GltfRules, StridesAreUsed) {
  FileBuilder file = flawlessTriangle();
  for (const auto& [accessor, stride] : {std::pair(5u, 64), std::pair(8u, 16)})
    file.json["bufferViews"][accessor]["byteStride"] = stride;
  gltf::Model model = loaded(file);
  expectSameMeaning(model);
  EXPECT_TRUE(hasNote(model,
                      "skin 0 inverseBindMatrices: bufferView 5 of accessor 5 has a "
                      "byteStride of 64, which only vertex attributes may have (and 1 more"));
  EXPECT_EQ(model.skins[0].inverseBindMatrices[1].m[1][3], -1.0f);
  EXPECT_EQ(model.clips[0].channels[2].values[4], std::sqrt(0.5f));
}

}  // namespace
}  // namespace dermis::test
