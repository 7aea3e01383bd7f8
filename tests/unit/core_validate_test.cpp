// validate: every kind of problem, with its count, its first place and a sentence that names it.

#include "dermis/mesh.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <set>
#include <string>
#include <vector>

#include "random_rig.h"

namespace dermis::test {
namespace {

constexpr float nan = std::numeric_limits<float>::quiet_NaN();
constexpr float infinity = std::numeric_limits<float>::infinity();
constexpr std::uint32_t vertexCount = 10;
constexpr std::uint32_t jointCount = 24;

/// A good mesh of ten vertices and four slots, named 'Fox'; a test breaks what it wants to.
struct ValidateTest : public ::testing::Test {
  ValidateTest() {
    mesh.name = "Fox";
    for (std::uint32_t vertex = 0; vertex < vertexCount; ++vertex) {
      for (int i = 0; i < 3; ++i) mesh.positions.push_back(static_cast<float>(vertex));
      mesh.normals.insert(mesh.normals.end(), {0.0f, 0.0f, 1.0f});
      mesh.joints.insert(mesh.joints.end(), {vertex, vertex + 1, 0, 0});
      mesh.weights.insert(mesh.weights.end(), {0.75f, 0.25f, 0.0f, 0.0f});
      tangents.insert(tangents.end(), {1.0f, 0.0f, 0.0f, 1.0f});
      mesh.centersOfRotation.insert(mesh.centersOfRotation.end(), {0.0f, 1.0f, 2.0f});
      mesh.dualQuaternionWeights.push_back(static_cast<float>(vertex) / 9);
      mesh.bulgeStrengths.push_back(1 - static_cast<float>(vertex) / 9);
    }
    view = mesh.view();
    view.tangents = attributeView(tangents.data(), vertexCount, 4);
    set = mesh.set;
    view.influenceSets = {&set, 1};
  }

  /// One finding, of this kind; returns its sentence.
  std::string onlyFinding(MeshProblem problem, std::uint64_t count, std::uint32_t firstVertex) {
    const MeshReport report = validate(view, jointCount);
    EXPECT_EQ(report.findings.size(), 1u);
    for (const MeshReport::Finding& finding : report.findings) {
      EXPECT_EQ(finding.problem, problem) << finding.message;
    }
    const MeshReport::Finding* finding = report.find(problem);
    EXPECT_NE(finding, nullptr);
    if (finding == nullptr) return "";
    EXPECT_EQ(finding->count, count);
    EXPECT_EQ(finding->firstVertex, firstVertex);
    EXPECT_EQ(report.packable(), problem >= MeshProblem::weightsNotNormalized);
    EXPECT_EQ(report.repairable(), problem > MeshProblem::morphVertices);
    return finding->message;
  }

  bool findsNothing() const { return validate(view, jointCount).findings.empty(); }

  OwnedMesh mesh;
  std::vector<float> tangents;
  MeshView view;
  InfluenceSet set;

  using Type = ComponentType;
  struct Attribute {
    AttributeView* view;
    std::string name;
    std::uint32_t size;  ///< of an element of the good mesh
    std::set<ComponentType> types;
    std::set<std::uint32_t> components = {};  ///< if they do not depend on the other's
  };
  const std::vector<Attribute> attributes{
      {&view.positions,
       "positions",
       12,
       {Type::float32, Type::float16, Type::snorm16, Type::unorm16},
       {3, 4}},
      {&view.normals,
       "normals",
       12,
       {Type::float32, Type::float16, Type::snorm8, Type::snorm16},
       {3, 4}},
      {&view.tangents,
       "tangents",
       16,
       {Type::float32, Type::float16, Type::snorm8, Type::snorm16},
       {4}},
      {&view.dualQuaternionWeights,
       "dual-quaternion weights",
       4,
       {Type::float32, Type::unorm8, Type::unorm16},
       {1}},
      {&view.bulgeStrengths,
       "bulge strengths",
       4,
       {Type::float32, Type::unorm8, Type::unorm16},
       {1}},
      {&view.centersOfRotation, "centers of rotation", 12, {Type::float32}, {3}},
      {&set.joints, "joints", 16, {Type::float32, Type::uint8, Type::uint16, Type::uint32}},
      {&set.weights, "weights", 16, {Type::float32, Type::unorm8, Type::unorm16}}};
};

TEST_F(ValidateTest, FindsNothingInAGoodMesh) {
  const MeshReport report = validate(view, jointCount);
  EXPECT_TRUE(report.findings.empty());
  EXPECT_TRUE(report.packable());
  EXPECT_TRUE(report.repairable());
  EXPECT_EQ(report.find(MeshProblem::emptyMesh), nullptr);
  view.normals = {};
  view.tangents = {};
  view.centersOfRotation = view.dualQuaternionWeights = view.bulgeStrengths = {};
  EXPECT_TRUE(findsNothing());
}

// ---- The views

TEST_F(ValidateTest, NoVertices) {
  view.vertexCount = 0;
  EXPECT_EQ(onlyFinding(MeshProblem::emptyMesh, 1, 0), "mesh 'Fox': it has no vertices");
  view = {};
  view.name = "Fox";
  EXPECT_EQ(onlyFinding(MeshProblem::emptyMesh, 1, 0), "mesh 'Fox': it has no vertices");
}

TEST_F(ValidateTest, NoPositions) {
  view.positions = {};
  EXPECT_EQ(onlyFinding(MeshProblem::emptyMesh, 1, 0), "mesh 'Fox': it has no positions");
}

TEST_F(ValidateTest, NoInfluenceSets) {
  view.influenceSets = {};
  EXPECT_EQ(onlyFinding(MeshProblem::noInfluenceSets, 1, 0),
            "mesh 'Fox': it has no joints and weights");
}

TEST_F(ValidateTest, ASetWithoutJointsOrWeights) {
  InfluenceSet sets[] = {set, set};
  view.influenceSets = sets;
  sets[1].joints = {};
  EXPECT_NE(onlyFinding(MeshProblem::noInfluenceSets, 1, 0).find("mesh 'Fox'"), std::string::npos);
  sets[1] = set;
  sets[1].weights = {};
  EXPECT_NE(onlyFinding(MeshProblem::noInfluenceSets, 1, 0).find("mesh 'Fox'"), std::string::npos);
}

TEST_F(ValidateTest, CountsThatDisagree) {
  for (const Attribute& attribute : attributes) {
    for (const std::uint32_t count : {9u, 11u, 0u}) {
      attribute.view->count = count;
      EXPECT_EQ(onlyFinding(MeshProblem::countMismatch, 1, 0),
                "mesh 'Fox': there are " + std::to_string(count) + " " + attribute.name +
                    " for 10 vertices");
    }
    attribute.view->count = vertexCount;
  }
  view.normals.count = 9;
  view.tangents.count = 8;
  EXPECT_EQ(onlyFinding(MeshProblem::countMismatch, 2, 0),
            "mesh 'Fox': there are 9 normals for 10 vertices");
}

TEST_F(ValidateTest, StridesThatAreTooSmall) {
  for (const auto& [attribute, name, size, types, components] : attributes) {
    EXPECT_EQ(attribute->stride, size) << name;
    for (const std::uint32_t stride : {size - 1, 0u}) {
      attribute->stride = stride;
      EXPECT_EQ(onlyFinding(MeshProblem::strideTooSmall, 1, 0),
                "mesh 'Fox': the stride of the " + name + " is " + std::to_string(stride) +
                    " bytes, but an element has " + std::to_string(size));
    }
    attribute->stride = size;
  }
}

TEST_F(ValidateTest, ComponentsWhoseSizeOverflows32BitsDoNotFitAnyStride) {
  set.joints.components = set.weights.components = 0x40000001u;  // times 4 is 4 in 32 bits
  onlyFinding(MeshProblem::strideTooSmall, 2, 0);
}

constexpr ComponentType allTypes[] = {
    ComponentType::float32, ComponentType::float16, ComponentType::snorm8,
    ComponentType::snorm16, ComponentType::unorm8,  ComponentType::unorm16,
    ComponentType::uint8,   ComponentType::uint16,  ComponentType::uint32};

TEST_F(ValidateTest, TypesThatAnAttributeMayHave) {
  for (const Attribute& attribute : attributes) {
    const AttributeView good = *attribute.view;
    for (const ComponentType type : allTypes) {
      SCOPED_TRACE(attribute.name + " of type " + std::to_string(static_cast<int>(type)));
      attribute.view->type = type;
      if (attribute.types.contains(type)) {
        // What the bytes of float32 stand for in this type is no matter here.
        EXPECT_TRUE(validate(view, jointCount).repairable());
        continue;
      }
      const std::string message = onlyFinding(MeshProblem::wrongFormat, 1, 0);
      EXPECT_NE(message.find(attribute.name), std::string::npos) << message;
      EXPECT_NE(message.find("mesh 'Fox'"), std::string::npos) << message;
    }
    *attribute.view = good;
  }
}

TEST_F(ValidateTest, ComponentsThatAnAttributeMayHave) {
  for (const Attribute& attribute : attributes) {
    if (attribute.components.empty()) continue;
    const AttributeView good = *attribute.view;
    const bool asHalves = attribute.types.contains(Type::float16);
    if (asHalves) {
      attribute.view->stride = 8;  // of five halves 10 are needed, of four enough
      attribute.view->type = Type::float16;
    }
    for (const std::uint32_t components : {0u, 1u, 2u, 3u, 4u, 5u, 0xffffffffu}) {
      SCOPED_TRACE(std::to_string(components) + " " + attribute.name);
      attribute.view->components = components;
      if (attribute.components.contains(components)) {
        EXPECT_TRUE(asHalves ? validate(view, jointCount).repairable() : findsNothing());
      } else {
        EXPECT_NE(onlyFinding(MeshProblem::wrongFormat, 1, 0).find(attribute.name),
                  std::string::npos);
      }
    }
    *attribute.view = good;
  }
}

TEST_F(ValidateTest, StridesAreHeldAgainstTheTypesSize) {
  const auto expectLeast = [&](AttributeView& attribute, ComponentType type, std::uint32_t stride,
                               const std::string& sentence) {
    attribute.type = type;
    attribute.stride = stride;
    EXPECT_TRUE(validate(view, jointCount).packable()) << sentence;
    attribute.stride = stride - 1;
    EXPECT_EQ(onlyFinding(MeshProblem::strideTooSmall, 1, 0), "mesh 'Fox': the " + sentence);
  };
  expectLeast(view.positions, ComponentType::snorm16, 6,
              "stride of the positions is 5 bytes, but an element has 6");
  view.positions = mesh.view().positions;
  expectLeast(view.tangents, ComponentType::snorm8, 4,
              "stride of the tangents is 3 bytes, but an element has 4");
}

TEST_F(ValidateTest, JointsAndWeightsOfDifferentNumber) {
  set.joints.components = 3;
  EXPECT_EQ(onlyFinding(MeshProblem::wrongFormat, 1, 0),
            "mesh 'Fox': an influence set has 3 joints but 4 weights per vertex");
  set.joints.components = 0;
  onlyFinding(MeshProblem::wrongFormat, 2, 0);
}

TEST_F(ValidateTest, WhatIsAllowedIsListed) {
  set.joints.type = Type::unorm8;
  EXPECT_EQ(onlyFinding(MeshProblem::wrongFormat, 1, 0),
            "mesh 'Fox': the joints must have 1 or more components of type float32, uint8, uint16 "
            "or uint32");
  set = mesh.set;
  view.tangents.components = 3;
  EXPECT_EQ(onlyFinding(MeshProblem::wrongFormat, 1, 0),
            "mesh 'Fox': the tangents must have 4 components of type float32, float16, snorm8 or "
            "snorm16");
  view.tangents.components = 4;
  view.positions.components = 2;
  EXPECT_EQ(onlyFinding(MeshProblem::wrongFormat, 1, 0),
            "mesh 'Fox': the positions must have 3 or 4 components of type float32, float16, "
            "snorm16 or unorm16");
  view.positions.components = 3;
  view.bulgeStrengths.type = Type::float16;
  EXPECT_EQ(onlyFinding(MeshProblem::wrongFormat, 1, 0),
            "mesh 'Fox': the bulge strengths must have 1 component of type float32, unorm8 or "
            "unorm16");
  view.bulgeStrengths.type = Type::float32;
  view.centersOfRotation.components = 4;
  EXPECT_EQ(onlyFinding(MeshProblem::wrongFormat, 1, 0),
            "mesh 'Fox': the centers of rotation must have 3 components of type float32");
}

TEST_F(ValidateTest, BadViewsAreNotRead) {
  // Were the values looked at, this would be found as well (or crash).
  view.positions.count = 11;
  mesh.weights[0] = nan;
  onlyFinding(MeshProblem::countMismatch, 1, 0);
}

// ---- The values

TEST_F(ValidateTest, NonFiniteAttributes) {
  const struct {
    MeshProblem problem;
    std::vector<float>* values;
    std::size_t components;
    const char* name;
  } cases[] = {{MeshProblem::nonFinitePosition, &mesh.positions, 3, "position"},
               {MeshProblem::nonFiniteNormal, &mesh.normals, 3, "normal"},
               {MeshProblem::nonFiniteTangent, &tangents, 4, "tangent"},
               {MeshProblem::nonFiniteCenter, &mesh.centersOfRotation, 3, "center of rotation"}};
  for (const auto& [problem, values, components, name] : cases) {
    const std::vector<float> good = *values;
    for (std::size_t component = 0; component < components; ++component) {
      for (const float bad : {nan, infinity, -infinity}) {
        std::copy(good.begin(), good.end(), values->begin());
        (*values)[7 * components + component] = bad;
        EXPECT_EQ(onlyFinding(problem, 1, 7),
                  "mesh 'Fox', vertex 7: the " + std::string(name) + " is not finite");
      }
    }
    (*values)[9 * components] = nan;
    (*values)[9 * components + 1] = nan;
    onlyFinding(problem, 2, 7);
    std::copy(good.begin(), good.end(), values->begin());
  }
}

TEST_F(ValidateTest, SharesThatAreNotFrom0To1) {
  const struct {
    std::vector<float>* values;
    AttributeView* attribute;
    float* whole;
    const char* name;
  } cases[] = {{&mesh.dualQuaternionWeights, &view.dualQuaternionWeights,
                &view.dualQuaternionWeight, "dual-quaternion weight"},
               {&mesh.bulgeStrengths, &view.bulgeStrengths, &view.bulgeStrength, "bulge strength"}};
  const float below = std::nextafter(0.0f, -1.0f), above = std::nextafter(1.0f, 2.0f);
  for (const auto& [values, attribute, whole, name] : cases) {
    const std::vector<float> good = *values;
    const AttributeView goodView = *attribute;
    const float goodWhole = *whole;
    const std::string rest = std::string(name) + " is ";
    const auto expectSentence = [](const std::string& message, const std::string& begin) {
      EXPECT_TRUE(message.starts_with(begin) && message.ends_with(", not from 0 to 1")) << message;
    };
    for (const float bad : {below, -1.0f, above, 7.0f, nan, infinity, -infinity}) {
      (*values)[4] = bad;
      expectSentence(onlyFinding(MeshProblem::methodWeightOutOfRange, 1, 4),
                     "mesh 'Fox', vertex 4: the " + rest);
      (*values)[8] = bad;
      onlyFinding(MeshProblem::methodWeightOutOfRange, 2, 4);
      std::copy(good.begin(), good.end(), values->begin());
      // The mesh's own, which counts where the vertices have none.
      *whole = bad;
      EXPECT_TRUE(findsNothing());
      *attribute = {};
      expectSentence(onlyFinding(MeshProblem::methodWeightOutOfRange, 1, 0),
                     "mesh 'Fox': its " + rest);
      *attribute = goodView;
      *whole = goodWhole;
    }
    for (const float share : {0.0f, -0.0f, 1e-45f, 1.0f}) {
      (*values)[4] = share;
      EXPECT_TRUE(findsNothing()) << share;
    }
    std::copy(good.begin(), good.end(), values->begin());
  }
  // Vertices are counted.
  mesh.dualQuaternionWeights[3] = mesh.bulgeStrengths[3] = 2;
  onlyFinding(MeshProblem::methodWeightOutOfRange, 1, 3);
}

TEST_F(ValidateTest, HalvesMayBeInfiniteOrNoNumber) {
  using Halves = std::initializer_list<std::uint16_t>;
  const std::uint16_t good[] = {0x3c00, 0, 0, 0x3c00};  // 1 0 0 1
  std::vector<std::uint16_t> halves;
  for (std::size_t vertex = 0; vertex < vertexCount; ++vertex)
    halves.insert(halves.end(), std::begin(good), std::end(good));
  const AttributeView view16{halves.data(), vertexCount, 8, ComponentType::float16, 4};
  view.positions = view.normals = view.tangents = view16;
  EXPECT_TRUE(findsNothing());
  for (const std::uint16_t bad : Halves{0x7c00, 0xfc00, 0x7c01, 0x7e00, 0xffff}) {
    for (const std::size_t component : {0u, 1u, 2u, 3u}) {
      halves[6 * 4 + component] = bad;
      const MeshReport report = validate(view, jointCount);
      // The fourth is read of tangents only.
      EXPECT_EQ(report.findings.size(), component == 3 ? 1u : 3u);
      for (const MeshReport::Finding& finding : report.findings) EXPECT_EQ(finding.firstVertex, 6u);
      EXPECT_NE(report.find(MeshProblem::nonFiniteTangent), nullptr);
      EXPECT_EQ(report.find(MeshProblem::nonFinitePosition) != nullptr, component != 3);
      EXPECT_EQ(report.find(MeshProblem::nonFiniteNormal) != nullptr, component != 3);
      halves[6 * 4 + component] = good[component];
    }
  }
  view.normals = view.tangents = {};
  for (const std::uint16_t value : Halves{0x7bff, 0xfbff, 0x0001, 0x8000}) {
    halves[6 * 4] = value;
    EXPECT_TRUE(findsNothing());
  }
}

TEST_F(ValidateTest, AFourthComponentThatIsNotReadMayBeAnything) {
  std::vector<float> values;
  for (std::size_t vertex = 0; vertex < vertexCount; ++vertex)
    values.insert(values.end(), {0, 1, 0, nan});
  view.positions = attributeView(values.data(), vertexCount, 4);
  EXPECT_TRUE(findsNothing());
  view.normals = view.positions;
  EXPECT_TRUE(findsNothing());
  view.tangents = view.positions;
  onlyFinding(MeshProblem::nonFiniteTangent, vertexCount, 0);
}

TEST_F(ValidateTest, PositionsThatOverflowByTheirScaleOrOffset) {
  mesh.positions[4 * 3 + 1] = 3e38f;
  EXPECT_TRUE(findsNothing());
  view.positionScale = {1, 2, 1};
  EXPECT_EQ(onlyFinding(MeshProblem::nonFinitePosition, 1, 4),
            "mesh 'Fox', vertex 4: the position is not finite");
  view.positionScale = {2, 1, 2};
  EXPECT_TRUE(findsNothing());
  view.positionOffset = {0, 1e38f, 0};
  onlyFinding(MeshProblem::nonFinitePosition, 1, 4);
  view.positionOffset = {0, -1e38f, 0};
  EXPECT_TRUE(findsNothing());
  // Every vertex is as bad as its scale.
  for (const float bad : {nan, infinity}) {
    view.positionOffset = {0, 0, bad};
    onlyFinding(MeshProblem::nonFinitePosition, vertexCount, 0);
  }
  view.positionOffset = {0, 0, 0};
  view.positionScale = {nan, 1, 1};
  onlyFinding(MeshProblem::nonFinitePosition, vertexCount, 0);
}

TEST_F(ValidateTest, NonFiniteWeights) {
  for (const float bad : {nan, infinity, -infinity}) {
    mesh.weights[4 * 4 + 1] = bad;
    EXPECT_EQ(onlyFinding(MeshProblem::nonFiniteWeight, 1, 4),
              "mesh 'Fox', vertex 4: the weight of joint 5 is not finite");
  }
  mesh.weights[4 * 4 + 2] = nan;  // the same vertex counts once
  mesh.weights[8 * 4 + 3] = nan;
  onlyFinding(MeshProblem::nonFiniteWeight, 2, 4);
}

TEST_F(ValidateTest, NegativeWeights) {
  mesh.weights[4 * 4 + 1] = -1e-30f;
  mesh.weights[5 * 4 + 0] = -0.75f;
  EXPECT_EQ(onlyFinding(MeshProblem::negativeWeight, 2, 4),
            "mesh 'Fox', vertex 4: the weight of joint 5 is negative");
}

TEST_F(ValidateTest, NegativeZeroIsZero) {
  mesh.weights[4 * 4 + 2] = -0.0f;
  EXPECT_TRUE(findsNothing());
}

TEST_F(ValidateTest, JointsOutsideThePose) {
  mesh.joints[7 * 4 + 1] = jointCount - 1;
  EXPECT_TRUE(findsNothing());
  mesh.joints[7 * 4 + 1] = 31;
  EXPECT_EQ(onlyFinding(MeshProblem::jointOutOfRange, 1, 7),
            "mesh 'Fox', vertex 7: joint 31 is outside the pose of 24 joints");
  mesh.joints[6 * 4] = jointCount;
  mesh.joints[9 * 4] = 0xffffffffu;
  EXPECT_EQ(onlyFinding(MeshProblem::jointOutOfRange, 3, 6),
            "mesh 'Fox', vertex 6: joint 24 is outside the pose of 24 joints");
}

TEST_F(ValidateTest, Truth14_JointsOfSlotsWithoutWeightMayBeAnything) {
  mesh.joints[7 * 4 + 2] = 24;
  mesh.joints[7 * 4 + 3] = 24;  // nor are they duplicates
  EXPECT_EQ(onlyFinding(MeshProblem::unusedJointOutOfRange, 1, 7),
            "mesh 'Fox', vertex 7: joint 24, with weight 0, is outside the pose of 24 joints");
  mesh.joints[7 * 4 + 3] = 0xffffffffu;
  mesh.joints[2 * 4 + 3] = 0xffffffffu;
  onlyFinding(MeshProblem::unusedJointOutOfRange, 2, 2);
}

TEST_F(ValidateTest, JointsEndWithTheLargestPose) {
  mesh.joints[0] = 65535;
  EXPECT_TRUE(validate(view, maxPoseJoints).findings.empty());
  mesh.joints[0] = 65536;
  EXPECT_EQ(validate(view, maxPoseJoints).findings.size(), 1u);
  EXPECT_EQ(validate(view, 0xffffffffu).findings.size(), 1u) << "joint indices have 16 bits";
  EXPECT_NE(validate(view, 0).find(MeshProblem::jointOutOfRange), nullptr);
}

TEST_F(ValidateTest, JointsMayBeFloatsIfTheyAreWholeNumbers) {
  std::vector<float> joints(mesh.joints.begin(), mesh.joints.end());
  set.joints = attributeView(joints.data(), vertexCount, 4);
  EXPECT_TRUE(findsNothing());
  joints[6 * 4] = -0.0f;
  EXPECT_TRUE(findsNothing());
  const auto expectRefused = [&](float joint, const std::string& sentence) {
    joints[7 * 4 + 1] = joint;
    EXPECT_EQ(onlyFinding(MeshProblem::jointOutOfRange, 1, 7),
              "mesh 'Fox', vertex 7: joint " + sentence);
  };
  expectRefused(24, "24 is outside the pose of 24 joints");
  expectRefused(-1, "-1 is outside the pose of 24 joints");
  expectRefused(65536, "65536 is outside the pose of 24 joints");
  expectRefused(-infinity, "-inf is outside the pose of 24 joints");
  expectRefused(2.5f, "2.5 is not a whole number");
  expectRefused(23.99999f, "23.9999905 is not a whole number");
  expectRefused(-0.5f, "-0.5 is not a whole number");
  expectRefused(nan, "nan is not a whole number");
  joints[7 * 4 + 1] = 8;
  joints[7 * 4 + 3] = 0.5f;  // with weight 0
  EXPECT_EQ(onlyFinding(MeshProblem::unusedJointOutOfRange, 1, 7),
            "mesh 'Fox', vertex 7: joint 0.5, with weight 0, is not a whole number");
  joints[0] = 65535;
  EXPECT_TRUE(validate(view, maxPoseJoints).packable());
}

// ---- Sums: 2e-7 for each weight that is not 0, or 255 and 65535 exactly

TEST_F(ValidateTest, Truth18_FloatSumsWithinTheToleranceOfTheGltfValidator) {
  // With two weights 4e-7 are allowed; above 1 a step of float is 1.2e-7, below half of it.
  const auto sumOf = [&](double difference) {
    mesh.weights[3 * 4 + 0] = 0.75f;
    mesh.weights[3 * 4 + 1] = static_cast<float>(0.25 + difference);
    return std::abs(static_cast<double>(mesh.weights[3 * 4 + 1]) - 0.25 - difference) < 2e-8;
  };
  for (const double difference : {3.8e-7, -3.8e-7, 1e-7, -1e-7}) {
    ASSERT_TRUE(sumOf(difference));
    EXPECT_TRUE(findsNothing()) << difference;
  }
  for (const double difference : {4.3e-7, -4.3e-7, 1e-6, 0.5, -0.1}) {
    ASSERT_TRUE(sumOf(difference));
    EXPECT_NE(onlyFinding(MeshProblem::weightsNotNormalized, 1, 3).find("mesh 'Fox', vertex 3"),
              std::string::npos);
  }
}

TEST_F(ValidateTest, Truth18_TheToleranceGrowsWithTheWeightsThatAreNotZero) {
  const double difference = 7e-7;
  for (std::uint32_t used = 1; used <= 4; ++used) {
    for (std::uint32_t slot = 0; slot < 4; ++slot) {
      mesh.joints[slot] = slot;
      mesh.weights[slot] = slot < used ? 1.0f / static_cast<float>(used) : 0.0f;
    }
    mesh.weights[0] += static_cast<float>(difference);
    EXPECT_EQ(validate(view, jointCount).findings.empty(), used == 4) << used;
  }
}

TEST_F(ValidateTest, TheSumIsOverAllSetsTogether) {
  std::vector<float> half(vertexCount * 4, 0.0f);
  std::vector<std::uint32_t> joints(vertexCount * 4, 20);
  const InfluenceSet sets[] = {set,
                               {{joints.data(), vertexCount, 16, ComponentType::uint32, 4},
                                attributeView(half.data(), vertexCount, 4)}};
  view.influenceSets = sets;
  EXPECT_TRUE(findsNothing());
  half[6 * 4] = 0.5f;
  const std::string message = onlyFinding(MeshProblem::weightsNotNormalized, 1, 6);
  EXPECT_EQ(message.find("mesh 'Fox', vertex 6: the weights sum to 1.5"), 0u) << message;
  mesh.weights[6 * 4] = 0.25f;
  EXPECT_TRUE(findsNothing());
}

// A sum that is printed as 1.000000 does not say what is wrong with it.
TEST_F(ValidateTest, TheSentenceShowsThatTheSumIsNotOne) {
  mesh.weights[3 * 4 + 1] = 0.25000045f;
  const std::string message = onlyFinding(MeshProblem::weightsNotNormalized, 1, 3);
  EXPECT_EQ(message.find("1.000000,"), std::string::npos) << message;
  mesh.weights[3 * 4 + 1] = 0.25f;
  for (std::size_t slot = 0; slot < 4; ++slot) mesh.weights[8 * 4 + slot] *= 1e-9f;
  const std::string tiny = onlyFinding(MeshProblem::weightsNotNormalized, 1, 8);
  EXPECT_EQ(tiny.find(" 0.000000,"), std::string::npos) << tiny;
}

template <typename T>
void expectExactSums(MeshView view, ComponentType type, const OwnedMesh& mesh) {
  const auto largest = std::numeric_limits<T>::max();
  std::vector<T> weights(vertexCount * 4, T{0});
  for (std::uint32_t vertex = 0; vertex < vertexCount; ++vertex) {
    weights[vertex * 4] = static_cast<T>(largest - vertex * 7);
    weights[vertex * 4 + 1] = static_cast<T>(vertex * 7);
  }
  const InfluenceSet set{mesh.set.joints, {weights.data(), vertexCount, 4 * sizeof(T), type, 4}};
  view.influenceSets = {&set, 1};
  EXPECT_TRUE(validate(view, jointCount).findings.empty());
  for (const int off : {-1, 1}) {
    weights[5 * 4] = static_cast<T>(largest - 5 * 7 + off);
    const MeshReport report = validate(view, jointCount);
    ASSERT_EQ(report.findings.size(), 1u);
    EXPECT_EQ(report.findings[0].problem, MeshProblem::weightsNotNormalized);
    EXPECT_EQ(report.findings[0].count, 1u);
    EXPECT_EQ(report.findings[0].firstVertex, 5u);
  }
}

TEST_F(ValidateTest, Truth18_BytesMustSumTo255ShortsTo65535) {
  expectExactSums<std::uint8_t>(view, ComponentType::unorm8, mesh);
  expectExactSums<std::uint16_t>(view, ComponentType::unorm16, mesh);
}

TEST_F(ValidateTest, DuplicateJoints) {
  mesh.joints[2 * 4 + 1] = mesh.joints[2 * 4];
  mesh.joints[5 * 4 + 1] = mesh.joints[5 * 4];
  EXPECT_EQ(onlyFinding(MeshProblem::duplicateJoint, 2, 2),
            "mesh 'Fox', vertex 2: joint 2 occurs twice");
}

TEST_F(ValidateTest, DuplicatesNeedNotBeNeighbors) {
  const std::uint32_t joints[] = {9, 4, 9, 1};
  const float weights[] = {0.25f, 0.25f, 0.25f, 0.25f};
  for (std::size_t slot = 0; slot < 4; ++slot) {
    mesh.joints[8 * 4 + slot] = joints[slot];
    mesh.weights[8 * 4 + slot] = weights[slot];
  }
  EXPECT_EQ(onlyFinding(MeshProblem::duplicateJoint, 1, 8),
            "mesh 'Fox', vertex 8: joint 9 occurs twice");
}

TEST_F(ValidateTest, DuplicatesAcrossSets) {
  std::vector<float> none(vertexCount, 0.0f);
  std::vector<std::uint8_t> joints(vertexCount, 0);
  const InfluenceSet sets[] = {set,
                               {{joints.data(), vertexCount, 1, ComponentType::uint8, 1},
                                attributeView(none.data(), vertexCount, 1)}};
  view.influenceSets = sets;
  EXPECT_TRUE(findsNothing());
  joints[6] = 7;
  none[6] = 0.25f;
  mesh.weights[6 * 4] = 0.5f;
  onlyFinding(MeshProblem::duplicateJoint, 1, 6);
}

TEST_F(ValidateTest, VerticesWithoutWeight) {
  for (const std::size_t vertex : {3u, 8u}) {
    for (std::size_t slot = 0; slot < 4; ++slot) mesh.weights[vertex * 4 + slot] = 0;
  }
  EXPECT_EQ(onlyFinding(MeshProblem::vertexWithoutWeight, 2, 3),
            "mesh 'Fox', vertex 3: no joint has a weight; the vertex stays in bind pose");
}

// The tolerance is that of the official validator, in which lengths of bytes count as 1.
TEST_F(ValidateTest, DirectionsOfAnotherLength) {
  for (const float good : {0.9933f, 1.0067f}) {
    mesh.normals[4 * 3 + 2] = tangents[5 * 4] = good;
    EXPECT_TRUE(findsNothing()) << good;
  }
  for (const float bad : {0.9932f, 1.0068f, 0.0f}) {
    mesh.normals[4 * 3 + 2] = bad;
    tangents[5 * 4] = 1;
    onlyFinding(MeshProblem::normalLength, 1, 4);
    mesh.normals[4 * 3 + 2] = 1;
    tangents[5 * 4] = bad;
    onlyFinding(MeshProblem::tangentLength, 1, 5);
  }
  EXPECT_EQ(validate(view, jointCount).findings[0].message,
            "mesh 'Fox', vertex 5: the tangent has a length of 0, not 1");
}

TEST_F(ValidateTest, TangentsWithoutAHandedness) {
  tangents[3 * 4 + 3] = -1;
  EXPECT_TRUE(findsNothing());
  tangents[3 * 4 + 3] = 0.5f;
  EXPECT_EQ(onlyFinding(MeshProblem::tangentSign, 1, 3),
            "mesh 'Fox', vertex 3: the handedness of the tangent is 0.5, not 1 or -1");
}

TEST_F(ValidateTest, FindingsStandInTheOrderOfTheirKinds) {
  mesh.weights[0] = nan;
  mesh.weights[1 * 4] = -1;
  mesh.joints[2 * 4] = 99;
  mesh.weights[3 * 4] = 0.5f;
  mesh.joints[4 * 4] = mesh.joints[4 * 4 + 1];
  mesh.weights[5 * 4] = mesh.weights[5 * 4 + 1] = 0;
  mesh.positions[6 * 3] = nan;
  mesh.normals[7 * 3] = nan;
  tangents[8 * 4] = nan;
  const MeshReport report = validate(view, jointCount);
  const MeshProblem expected[] = {MeshProblem::nonFinitePosition,    MeshProblem::nonFiniteNormal,
                                  MeshProblem::nonFiniteTangent,     MeshProblem::nonFiniteWeight,
                                  MeshProblem::negativeWeight,       MeshProblem::jointOutOfRange,
                                  MeshProblem::weightsNotNormalized, MeshProblem::duplicateJoint,
                                  MeshProblem::vertexWithoutWeight};
  const std::uint32_t vertices[] = {6, 7, 8, 0, 1, 2, 3, 4, 5};
  ASSERT_EQ(report.findings.size(), std::size(expected));
  for (std::size_t i = 0; i < std::size(expected); ++i) {
    EXPECT_EQ(report.findings[i].problem, expected[i]);
    EXPECT_EQ(report.findings[i].firstVertex, vertices[i]);
    EXPECT_EQ(report.findings[i].count, 1u);
  }
}

TEST(Validate, EveryKindHasANameAndAConsequence) {
  std::set<std::string> names;
  for (int kind = 0; kind <= static_cast<int>(MeshProblem::tangentSign); ++kind) {
    const auto problem = static_cast<MeshProblem>(kind);
    names.insert(meshProblemName(problem));
    EXPECT_EQ(refusedByPack(problem), kind <= static_cast<int>(MeshProblem::jointOutOfRange));
  }
  EXPECT_EQ(names.size(), static_cast<std::size_t>(MeshProblem::tangentSign) + 1);
  EXPECT_STREQ(meshProblemName(MeshProblem::jointOutOfRange), "joint out of range");
  EXPECT_STREQ(meshProblemName(static_cast<MeshProblem>(99)), "unknown");
}

}  // namespace
}  // namespace dermis::test
