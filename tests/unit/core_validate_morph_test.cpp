// validate: what can be wrong with morph targets.

#include <gtest/gtest.h>

#include <limits>
#include <set>
#include <string>
#include <utility>
#include <vector>

#include "dermis/mesh.h"
#include "random_rig.h"

namespace dermis::test {
namespace {

constexpr float nan = std::numeric_limits<float>::quiet_NaN();
constexpr float infinity = std::numeric_limits<float>::infinity();
constexpr std::uint32_t vertexCount = 10;

/// A good mesh of ten vertices, named 'Fox', with a dense target and a sparse one of three
/// vertices.
struct ValidateMorphs : public ::testing::Test {
  ValidateMorphs() {
    mesh.name = "Fox";
    mesh.influencesPerVertex = 1;
    mesh.positions.assign(vertexCount * 3, 1.0f);
    for (std::uint32_t vertex = 0; vertex < vertexCount; ++vertex)
      mesh.normals.insert(mesh.normals.end(), {0.0f, 1.0f, 0.0f});
    mesh.joints.assign(vertexCount, 0);
    mesh.weights.assign(vertexCount, 1.0f);
    view = mesh.view();
    for (std::vector<float>* values : {&positions, &normals, &tangents})
      values->assign(vertexCount * 3, 0.5f);
    for (MorphTargetView& target : targets) {
      const std::uint32_t count = &target == &targets[0] ? vertexCount : 3;
      target.positions = attributeView(positions.data(), count, 3);
      target.normals = attributeView(normals.data(), count, 3);
      target.tangents = attributeView(tangents.data(), count, 3);
    }
    targets[1].vertices = vertices;
    view.morphTargets = targets;
  }

  MeshReport report() const { return validate(view, 1); }

  /// One finding, of this kind; returns its sentence.
  std::string onlyFinding(MeshProblem problem, std::uint64_t count, std::uint32_t firstVertex) {
    const MeshReport found = report();
    EXPECT_EQ(found.findings.size(), 1u);
    const MeshReport::Finding* finding = found.find(problem);
    EXPECT_NE(finding, nullptr);
    if (finding == nullptr) return "";
    EXPECT_EQ(finding->count, count) << finding->message;
    EXPECT_EQ(finding->firstVertex, firstVertex) << finding->message;
    EXPECT_FALSE(found.packable());
    EXPECT_EQ(found.repairable(), problem == MeshProblem::nonFiniteMorph);
    return finding->message;
  }

  OwnedMesh mesh;
  std::vector<float> positions, normals, tangents;
  std::vector<std::uint32_t> vertices{2, 5, 9};
  MorphTargetView targets[2];
  MeshView view;
};

TEST_F(ValidateMorphs, FindNothingInGoodTargets) {
  EXPECT_TRUE(report().findings.empty());
  for (AttributeView MorphTargetView::*attribute :
       {&MorphTargetView::positions, &MorphTargetView::normals, &MorphTargetView::tangents}) {
    targets[0].*attribute = targets[1].*attribute = {};
    EXPECT_TRUE(report().findings.empty());
  }
  targets[0] = targets[1] = {};
  EXPECT_TRUE(report().findings.empty());
}

// ---- The views

TEST_F(ValidateMorphs, VerticesMustRise) {
  for (const std::uint32_t second : {2u, 1u, 0u}) {
    vertices[1] = second;
    EXPECT_EQ(onlyFinding(MeshProblem::morphVertices, 1, 0),
              "mesh 'Fox': morph target 1 lists vertex " + std::to_string(second) +
                  " after vertex 2, but vertices must be in ascending order");
  }
  vertices = {9, 5, 2};
  targets[1].vertices = vertices;
  onlyFinding(MeshProblem::morphVertices, 1, 0);
}

TEST_F(ValidateMorphs, VerticesMustLieInTheMesh) {
  for (const std::uint32_t last : {10u, 11u, 0xffffffffu}) {
    vertices[2] = last;
    EXPECT_NE(onlyFinding(MeshProblem::morphVertices, 1, 0).find("vertex " + std::to_string(last)),
              std::string::npos);
  }
  vertices = {10, 11, 12};
  targets[1].vertices = vertices;
  onlyFinding(MeshProblem::morphVertices, 1, 0);
}

TEST_F(ValidateMorphs, CountsAreThoseOfTheTargetsVertices) {
  for (const auto& [attribute, name] : {std::pair{&MorphTargetView::positions, "position"},
                                        {&MorphTargetView::normals, "normal"},
                                        {&MorphTargetView::tangents, "tangent"}}) {
    for (const std::size_t index : {0u, 1u}) {
      AttributeView& displacements = targets[index].*attribute;
      const std::uint32_t good = displacements.count;
      for (const std::uint32_t count : {0u, good - 1, good + 1}) {
        displacements.count = count;
        EXPECT_EQ(onlyFinding(MeshProblem::countMismatch, 1, 0),
                  "mesh 'Fox': there are " + std::to_string(count) + " " + name +
                      " displacements of morph target " + std::to_string(index) + " for " +
                      std::to_string(good) + " displaced vertices");
      }
      displacements.count = good;
    }
  }
}

TEST_F(ValidateMorphs, TypesThatDisplacementsMayHave) {
  using Type = ComponentType;
  const std::set<Type> positionTypes{Type::float32, Type::float16, Type::snorm16};
  const std::set<Type> directionTypes{Type::float32, Type::float16, Type::snorm8, Type::snorm16};
  for (const auto& [attribute, allowed] : {std::pair{&MorphTargetView::positions, &positionTypes},
                                           {&MorphTargetView::normals, &directionTypes},
                                           {&MorphTargetView::tangents, &directionTypes}}) {
    for (int type = 0; type <= static_cast<int>(Type::uint32); ++type) {
      AttributeView& displacements = targets[1].*attribute;
      displacements.type = static_cast<Type>(type);
      if (allowed->contains(displacements.type)) {
        EXPECT_TRUE(report().repairable()) << type;
      } else {
        EXPECT_NE(onlyFinding(MeshProblem::wrongFormat, 1, 0).find("morph target 1"),
                  std::string::npos);
      }
      displacements.type = Type::float32;
    }
  }
}

TEST_F(ValidateMorphs, ComponentsAndStrides) {
  AttributeView& displacements = targets[0].tangents;
  for (const std::uint32_t components : {0u, 2u, 5u}) {
    displacements.components = components;
    onlyFinding(MeshProblem::wrongFormat, 1, 0);
  }
  displacements.components = 3;
  displacements.stride = 11;
  EXPECT_EQ(onlyFinding(MeshProblem::strideTooSmall, 1, 0),
            "mesh 'Fox': the stride of the tangent displacements of morph target 0 is 11 bytes, "
            "but an element has 12");
}

TEST_F(ValidateMorphs, BadViewsAreNotRead) {
  // Were the values looked at, this would be found as well (or crash).
  positions[0] = nan;
  mesh.weights[0] = nan;
  vertices[2] = 10;
  onlyFinding(MeshProblem::morphVertices, 1, 0);
}

// ---- The values

TEST_F(ValidateMorphs, DisplacementsThatAreNotFinite) {
  targets[1] = {};
  for (std::vector<float>* values : {&positions, &normals, &tangents}) {
    for (const std::size_t component : {0u, 1u, 2u}) {
      for (const float bad : {nan, infinity, -infinity}) {
        (*values)[7 * 3 + component] = bad;
        EXPECT_EQ(onlyFinding(MeshProblem::nonFiniteMorph, 1, 7),
                  "mesh 'Fox', vertex 7: its displacement by morph target 0 is not finite");
        (*values)[7 * 3 + component] = 0.5f;
      }
    }
  }
}

TEST_F(ValidateMorphs, OfSparseTargetsTheVertexIsNamedNotTheElement) {
  targets[0] = {};
  positions[1 * 3] = nan;
  EXPECT_EQ(onlyFinding(MeshProblem::nonFiniteMorph, 1, 5),
            "mesh 'Fox', vertex 5: its displacement by morph target 1 is not finite");
}

TEST_F(ValidateMorphs, EveryDisplacementCounts) {
  // Element 2 is vertex 2 of the first target, vertex 9 of the second.
  positions[2 * 3] = normals[2 * 3] = nan;
  onlyFinding(MeshProblem::nonFiniteMorph, 2, 2);
  // The last displacement of a target and the first of the next, of one vertex.
  positions[2 * 3] = normals[2 * 3] = 0.5f;
  const float bad[] = {nan, 0, 0};
  const std::uint32_t four[] = {4};
  for (MorphTargetView& target : targets) {
    target = {};
    target.vertices = four;
    target.positions = attributeView(bad, 1, 3);
  }
  onlyFinding(MeshProblem::nonFiniteMorph, 2, 4);
}

TEST_F(ValidateMorphs, DisplacementsMayOverflowByTheirScale) {
  targets[1] = {};
  positions[3 * 3 + 1] = 3e38f;
  normals[3 * 3 + 1] = 3e38f;
  targets[0].positionScale = {2, 1, 2};
  EXPECT_TRUE(report().findings.empty());
  targets[0].positionScale = {1, 2, 1};
  onlyFinding(MeshProblem::nonFiniteMorph, 1, 3);
}

TEST_F(ValidateMorphs, HalvesMayBeInfiniteOrNoNumber) {
  targets[1] = {};
  std::vector<std::uint16_t> halves(vertexCount * 3, 0x3c00);
  targets[0].normals = {halves.data(), vertexCount, 6, ComponentType::float16, 3};
  EXPECT_TRUE(report().findings.empty());
  for (const std::uint16_t bad : std::initializer_list<std::uint16_t>{0x7c00, 0xfe00}) {
    halves[8 * 3 + 2] = bad;
    onlyFinding(MeshProblem::nonFiniteMorph, 1, 8);
  }
}

}  // namespace
}  // namespace dermis::test
