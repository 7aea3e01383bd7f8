// The accuracy contract: the bounds of TRUTHS.md, and a comparison that misses nothing.

#include "dermis/verify.h"

#include <gtest/gtest.h>

#include <array>
#include <cmath>
#include <cstdint>
#include <cstring>
#include <limits>
#include <string>
#include <string_view>
#include <vector>

#include "random_rig.h"
#include "verify/conditioning.h"

namespace dermis::test {
namespace {

constexpr double u = 1.0 / 16777216.0;  // 2^-24
constexpr double nan = std::numeric_limits<double>::quiet_NaN();

struct Accuracy : public ::testing::Test {
  reference::Conditioning conditioning;
};

TEST_F(Accuracy, TheUnitIsTwoToTheMinus24) {
  EXPECT_EQ(floatRounding, u);
}

TEST_F(Accuracy, Truth16_PositionBounds) {
  conditioning.scale = 2.5;
  conditioning.distance = 3;
  EXPECT_DOUBLE_EQ(positionBound(Method::linear, conditioning), 6 * u * 2.5);
  EXPECT_DOUBLE_EQ(positionBound(Method::dualQuaternion, conditioning), 24 * u * 2.5);
  // At 10,000 units from the origin: joints as far away as the point.
  conditioning.scale = 10000;
  EXPECT_NEAR(positionBound(Method::linear, conditioning), 3.6e-3, 1e-4);
}

TEST_F(Accuracy, JointsTakenForRigidAddTheirStretchOfTheDistance) {
  conditioning.scale = 1;
  conditioning.distance = 3;
  conditioning.rigidShortcut = 1e-6;
  EXPECT_DOUBLE_EQ(positionBound(Method::linear, conditioning), 6 * u);
  EXPECT_DOUBLE_EQ(positionBound(Method::dualQuaternion, conditioning), 24 * u + 3e-6);
  conditioning.leverage = 2;
  EXPECT_DOUBLE_EQ(positionBound(Method::dualQuaternion, conditioning), 72 * u + 3e-6);
}

TEST_F(Accuracy, QuaternionsThatCancelByMoreThanAQuarterAreLessCertain) {
  conditioning.scale = 1;
  for (const double length : {1.0, 0.25}) {
    conditioning.blendLength = length;
    EXPECT_DOUBLE_EQ(positionBound(Method::dualQuaternion, conditioning), 24 * u);
    EXPECT_DOUBLE_EQ(normalBound(Method::dualQuaternion, conditioning), 1.5e-6);
  }
  conditioning.blendLength = 1.0 / 64;
  EXPECT_DOUBLE_EQ(positionBound(Method::dualQuaternion, conditioning), 24 * u * 256);
  EXPECT_DOUBLE_EQ(normalBound(Method::dualQuaternion, conditioning), 1.5e-6 * 16);
  EXPECT_DOUBLE_EQ(positionBound(Method::linear, conditioning), 6 * u);
  EXPECT_DOUBLE_EQ(normalBound(Method::linear, conditioning), 8 * u);
}

TEST_F(Accuracy, WhatAGpuMayFlushToZeroCounts) {
  conditioning.distance = 3;
  conditioning.stretch = 4;
  EXPECT_EQ(positionBound(Method::linear, conditioning), 0x1p-113);
  EXPECT_EQ(positionBound(Method::dualQuaternion, conditioning), 0x1p-113);
  conditioning.stretch = 0x1p-106;  // 2^-10 of M
  EXPECT_NEAR(normalBound(Method::linear, conditioning), 0x1p-10, 1e-6);
  conditioning.stretch = 0x1p-112;
  EXPECT_LT(tangentBound(Method::linear, conditioning), 0) << "more than a twentieth";
}

TEST_F(Accuracy, Truth16_NormalBounds) {
  EXPECT_DOUBLE_EQ(normalBound(Method::dualQuaternion, conditioning), 1.5e-6);
  conditioning.rigidShortcut = 2e-6;
  EXPECT_DOUBLE_EQ(normalBound(Method::dualQuaternion, conditioning), 3.5e-6);
  EXPECT_DOUBLE_EQ(normalBound(Method::linear, conditioning), 8 * u);
  conditioning.normalAlignment = 0.25;
  EXPECT_DOUBLE_EQ(normalBound(Method::dualQuaternion, conditioning), 3.5e-6) << "only rotated";
  conditioning.normalRotatedOnly = false;
  conditioning.rigidShortcut = 0;
  EXPECT_DOUBLE_EQ(normalBound(Method::linear, conditioning), 26 * u);
  EXPECT_DOUBLE_EQ(normalBound(Method::dualQuaternion, conditioning), 24 * u + 1.5e-6);
  conditioning.normalAlignment = 1e-3;
  EXPECT_GT(normalBound(Method::linear, conditioning), 0);
  conditioning.normalAlignment = 0.9999e-3;
  EXPECT_LT(normalBound(Method::linear, conditioning), 0);
  EXPECT_LT(normalBound(Method::dualQuaternion, conditioning), 0);
}

TEST_F(Accuracy, TangentBoundsAreThoseOfNormalsWithTheirOwnAlignment) {
  conditioning.normalAlignment = 0.5;
  conditioning.tangentAlignment = 0.25;
  conditioning.rigidShortcut = 2e-6;
  EXPECT_DOUBLE_EQ(tangentBound(Method::dualQuaternion, conditioning), 3.5e-6);
  EXPECT_DOUBLE_EQ(tangentBound(Method::linear, conditioning), 26 * u);
  conditioning.normalRotatedOnly = false;
  // What M leaves out counts once for tangents and twice for normals, and a enlarges it.
  EXPECT_DOUBLE_EQ(tangentBound(Method::dualQuaternion, conditioning), 24 * u + 9.5e-6);
  EXPECT_DOUBLE_EQ(normalBound(Method::dualQuaternion, conditioning), 12 * u + 9.5e-6);
  conditioning.tangentAlignment = 0.9999e-3;
  EXPECT_LT(tangentBound(Method::linear, conditioning), 0);
  EXPECT_LT(tangentBound(Method::dualQuaternion, conditioning), 0);
}

TEST_F(Accuracy, ALeverageCountsAsTheScaleDoesButForLinear) {
  for (const Method method : allMethods) {
    conditioning = {};
    conditioning.scale = 2;
    conditioning.distance = 3;
    const double without = positionBound(method, conditioning);
    EXPECT_DOUBLE_EQ(without, (method == Method::linear ? 12 : 48) * u) << methodName(method);
    conditioning.leverage = 5;
    const double with = positionBound(method, conditioning);
    if (method == Method::linear) {
      EXPECT_EQ(with, without);
      continue;
    }
    EXPECT_DOUBLE_EQ(with, 24 * u * 7) << methodName(method);
    conditioning.rigidShortcut = 1e-6;
    EXPECT_DOUBLE_EQ(positionBound(method, conditioning), 24 * u * 7 + 3e-6);
  }
}

TEST_F(Accuracy, StepsThatShrinkSlowlyMultiplyWhatTurnsADirection) {
  conditioning.turning = 4;
  conditioning.rigidShortcut = 0.5e-6;
  EXPECT_DOUBLE_EQ(normalBound(Method::dualQuaternionIterative, conditioning), 6.5e-6);
  EXPECT_DOUBLE_EQ(tangentBound(Method::dualQuaternionIterative, conditioning), 6.5e-6);
  EXPECT_DOUBLE_EQ(normalBound(Method::linear, conditioning), 8 * u);
  conditioning.normalRotatedOnly = false;
  EXPECT_DOUBLE_EQ(normalBound(Method::dualQuaternionIterative, conditioning), 7e-6 + 6 * u);
}

TEST_F(Accuracy, DirectionsThatCancelInABlendAreTheLessCertain) {
  conditioning.normalRotatedOnly = false;
  conditioning.normalLength = 0.5;
  conditioning.tangentLength = 0.25;
  EXPECT_DOUBLE_EQ(normalBound(Method::blended, conditioning), 2 * (6 * u + 1.5e-6));
  EXPECT_DOUBLE_EQ(tangentBound(Method::blended, conditioning), 4 * (6 * u + 1.5e-6));
  conditioning.normalAlignment = conditioning.tangentAlignment = 0.003;
  EXPECT_GT(normalBound(Method::blended, conditioning), 0);
  EXPECT_LT(tangentBound(Method::blended, conditioning), 0) << "0.00075 is less than 1e-3";
}

TEST_F(Accuracy, WhatTheBindPoseIsOffByIsStretchedAndDividedByTheAlignment) {
  conditioning.positionRounding = 10;
  conditioning.stretch = 3;
  EXPECT_DOUBLE_EQ(positionBound(Method::linear, conditioning), 30 * u);
  EXPECT_DOUBLE_EQ(positionBound(Method::dualQuaternion, conditioning), 30 * u);
  conditioning.normalRounding = 2;
  conditioning.tangentRounding = 5;
  EXPECT_DOUBLE_EQ(normalBound(Method::dualQuaternion, conditioning), 1.5e-6 + 2 * u);
  EXPECT_DOUBLE_EQ(tangentBound(Method::dualQuaternion, conditioning), 1.5e-6 + 5 * u);
  conditioning.normalAlignment = conditioning.tangentAlignment = 0.5;
  EXPECT_DOUBLE_EQ(normalBound(Method::linear, conditioning), 18 * u);
  EXPECT_DOUBLE_EQ(tangentBound(Method::linear, conditioning), 24 * u);
  conditioning.tangentRounding = 0.026 / u;
  EXPECT_LT(tangentBound(Method::linear, conditioning), 0);
  EXPECT_GT(tangentBound(Method::dualQuaternion, conditioning), 0.026);
  conditioning.tangentRounding = 0.051 / u;
  EXPECT_LT(tangentBound(Method::dualQuaternion, conditioning), 0);
}

/// Twenty vertices around 1 with unit normals, and the same in float.
struct CompareTest : public ::testing::Test {
  CompareTest() {
    for (std::size_t vertex = 0; vertex < count; ++vertex) {
      const float x = 1 + static_cast<float>(vertex) / 64;
      expected.positions.push_back({x, 0.5, -0.25});
      expected.normals.push_back({0, 0.6, 0.8});
      reference::Conditioning conditioning;
      conditioning.scale = 2;
      expected.conditioning.push_back(conditioning);
      expected.tangents.push_back({1, 0, 0, vertex % 2 == 0 ? 1.0 : -1.0});
      positions.insert(positions.end(), {x, 0.5f, -0.25f});
      normals.insert(normals.end(), {0.0f, 0.6f, 0.8f});
      tangents.insert(tangents.end(), {1.0f, 0.0f, 0.0f, vertex % 2 == 0 ? 1.0f : -1.0f});
    }
  }

  SkinnedView view() const {
    SkinnedView skinned;
    skinned.positions = {positions.data(), count, 12, VertexFormat::float32x3};
    skinned.normals = {normals.data(), count, 12, VertexFormat::float32x3};
    skinned.tangents = {tangents.data(), count, 16, VertexFormat::float32x4};
    return skinned;
  }
  /// What is expected, with the bounds that a method has by its conditioning.
  reference::SkinnedMesh bounded(Method method) const {
    reference::SkinnedMesh mesh = expected;
    for (const reference::Conditioning& vertex : expected.conditioning) {
      mesh.bounds.push_back(boundsOf(method, vertex));
    }
    return mesh;
  }
  Comparison compared(Method method = Method::dualQuaternion,
                      const Exemptions& exemptions = {}) const {
    const Result<Comparison> result = compareWithReference(bounded(method), view(), exemptions);
    EXPECT_TRUE(result.ok()) << (result ? "" : result.error().message);
    return result ? *result : Comparison{};
  }
  void expectOneFailure(std::uint32_t vertex, Method method = Method::dualQuaternion) {
    const Comparison comparison = compared(method);
    EXPECT_FALSE(comparison.passed());
    EXPECT_EQ(comparison.failures, 1u);
    EXPECT_EQ(comparison.firstFailure, vertex);
  }

  /// Fewer vertices compared than the caller expected are a failure, and more are.
  void expectOtherExemptionsToFail(const Exemptions& right,
                                   Method method = Method::dualQuaternion) const {
    for (std::uint64_t onlyFinite = 0; onlyFinite < 3; ++onlyFinite) {
      for (std::uint64_t skipped = 0; skipped < 3; ++skipped) {
        const Exemptions wanted{onlyFinite, skipped};
        EXPECT_EQ(compared(method, wanted).passed(), wanted == right);
        EXPECT_EQ(compared(method, wanted).failures, 0u);
      }
    }
  }

  static constexpr std::uint32_t count = 20;
  reference::AnalyzedMesh expected;  ///< without bounds
  std::vector<float> positions, normals, tangents;
};

TEST_F(CompareTest, TheSamePasses) {
  for (auto& normal : expected.normals) normal = {0, 0.6f, 0.8f};
  for (const Method method : allMethods) {
    const Comparison comparison = compared(method);
    EXPECT_TRUE(comparison.passed());
    EXPECT_EQ(comparison.compared, count);
    EXPECT_EQ(comparison.exempt, Exemptions{});
    EXPECT_EQ(comparison.onlyUnitNormals, 0u);
    EXPECT_EQ(comparison.onlyUnitTangents, 0u);
    EXPECT_EQ(comparison.worstPosition, 0);
    EXPECT_EQ(comparison.worstNormal, 0);
    EXPECT_EQ(comparison.worstTangent, 0);
    EXPECT_EQ(comparison.largestPositionError, 0);
  }
}

TEST_F(CompareTest, OneWrongPositionIsFound) {
  for (const Method method : allMethods) {
    const double bound = (method == Method::linear ? 6 : 24) * u * 2;
    for (int component = 0; component < 3; ++component) {
      for (const double share : {-1.01, -0.99, 0.99, 1.01}) {
        auto& coordinate = expected.positions[13][static_cast<std::size_t>(component)];
        const double before = coordinate;
        coordinate += share * bound;
        const Comparison comparison = compared(method);
        EXPECT_EQ(comparison.passed(), std::abs(share) < 1);
        EXPECT_NEAR(comparison.worstPosition, std::abs(share), 1e-6);
        EXPECT_EQ(comparison.worstPositionVertex, 13u);
        EXPECT_NEAR(comparison.largestPositionError, std::abs(share) * bound, 1e-15);
        if (std::abs(share) > 1) expectOneFailure(13, method);
        coordinate = before;
      }
    }
  }
}

TEST_F(CompareTest, DistancesCountNotComponents) {
  // 0.7 of the bound in each direction is 1.21 of it together.
  for (double& coordinate : expected.positions[4]) coordinate += 0.7 * 24 * u * 2;
  expectOneFailure(4);
}

TEST_F(CompareTest, EachVertexIsHeldAgainstItsOwnBound) {
  positions[3 * 3] += 1e-3f;
  expected.conditioning[3].scale = 1000;
  EXPECT_TRUE(compared().passed());
  positions[2 * 3] += 1e-3f;
  expectOneFailure(2);
}

TEST_F(CompareTest, AVertexAtTheOriginMayHaveNoErrorAtAll) {
  expected.conditioning[7].scale = 0;
  EXPECT_TRUE(compared().passed());
  expected.positions[7][2] += 1e-12;
  expectOneFailure(7);
}

TEST_F(CompareTest, OneWrongNormalIsFound) {
  for (const double error : {1.4e-6, 1.7e-6}) {
    expected.normals[19] = {error, 0.6f, 0.8f};
    const Comparison comparison = compared();
    EXPECT_EQ(comparison.passed(), error < 1.5e-6);
    EXPECT_EQ(comparison.worstNormalVertex, 19u);
    EXPECT_NEAR(comparison.worstNormal, error / 1.5e-6, 1e-6);
  }
  expectOneFailure(19);
  normals[19 * 3 + 2] = -0.8f;
  expectOneFailure(19);
}

TEST_F(CompareTest, NumbersThatAreNotFiniteFail) {
  const float infinity = std::numeric_limits<float>::infinity();
  for (const float bad : {std::numeric_limits<float>::quiet_NaN(), infinity, -infinity}) {
    for (std::vector<float>* values : {&positions, &normals, &tangents}) {
      const std::size_t components = values->size() / count;
      for (std::size_t component = 0; component < components; ++component) {
        float& value = (*values)[11 * components + component];
        const float before = value;
        value = bad;
        expectOneFailure(11);
        expectOneFailure(11, Method::linear);
        for (bool reference::Conditioning::*excuse :
             {&reference::Conditioning::signAmbiguous, &reference::Conditioning::degenerate}) {
          expected.conditioning[11].*excuse = true;
          expectOneFailure(11);
          expected.conditioning[11].*excuse = false;
        }
        value = before;
      }
    }
  }
}

TEST_F(CompareTest, SeveralFailuresAreCounted) {
  for (const std::size_t vertex : {5u, 9u, 17u}) positions[vertex * 3 + 1] += 1;
  positions[9 * 3] += 3;
  const Comparison comparison = compared();
  EXPECT_EQ(comparison.failures, 3u);
  EXPECT_EQ(comparison.firstFailure, 5u);
  EXPECT_EQ(comparison.worstPositionVertex, 9u);
  EXPECT_NEAR(comparison.largestPositionError, std::hypot(1, 3), 1e-6);
}

TEST_F(CompareTest, WhatIsAMatterOfRoundingNeedOnlyBeFinite) {
  for (bool reference::Conditioning::*excuse :
       {&reference::Conditioning::signAmbiguous, &reference::Conditioning::degenerate}) {
    expected.conditioning[6].*excuse = true;
    positions[6 * 3] += 10;
    const Comparison comparison = compared(Method::dualQuaternion, {1, 0});
    EXPECT_TRUE(comparison.passed());
    EXPECT_EQ(comparison.exempt, (Exemptions{1, 0}));
    EXPECT_EQ(comparison.exempt, exemptionsOf(bounded(Method::dualQuaternion)));
    EXPECT_EQ(comparison.compared, count - 1);
    expectOtherExemptionsToFail({1, 0});
    // Linear blending knows neither signs nor rotations.
    expectOneFailure(6, Method::linear);
    positions[6 * 3] -= 10;
    expected.conditioning[6].*excuse = false;
  }
}

TEST_F(CompareTest, VerticesWithoutAnAnswerAreNotLookedAt) {
  for (const Method method : allMethods) {
    expected.positions[6][1] = nan;
    expected.conditioning[6].undefined = true;
    positions[6 * 3] = std::numeric_limits<float>::infinity();
    const Comparison comparison = compared(method, {0, 1});
    EXPECT_TRUE(comparison.passed());
    EXPECT_EQ(comparison.exempt, (Exemptions{0, 1}));
    EXPECT_EQ(comparison.exempt, exemptionsOf(bounded(method)));
    EXPECT_EQ(comparison.compared, count - 1);
    expectOtherExemptionsToFail({0, 1}, method);
  }
}

TEST_F(CompareTest, VerticesOutOfRangeAreCounted) {
  positions[6 * 3] = std::numeric_limits<float>::infinity();
  for (const Method method : allMethods) {
    for (double reference::Conditioning::*number :
         {&reference::Conditioning::scale, &reference::Conditioning::distance,
          &reference::Conditioning::stretch, &reference::Conditioning::positionRounding}) {
      const double before = expected.conditioning[6].*number;
      expected.conditioning[6].*number = 0x1p100;
      expectOneFailure(6, method);
      expected.conditioning[6].*number = 1.001 * 0x1p100;
      EXPECT_TRUE(compared(method, {0, 0, 1}).passed());
      EXPECT_EQ(compared(method).exempt, (Exemptions{0, 0, 1}));
      EXPECT_EQ(compared(method).exempt, exemptionsOf(bounded(method)));
      EXPECT_EQ(compared(method).compared, count - 1);
      EXPECT_FALSE(compared(method).passed());
      EXPECT_FALSE(compared(method, {0, 1}).passed());
      expected.conditioning[6].*number = before;
    }
    expected.conditioning[6].directionOutOfRange = true;
    EXPECT_TRUE(compared(method, {0, 0, 1}).passed());
    expected.conditioning[6].directionOutOfRange = false;
  }
}

// A reference that is broken excuses nothing: not what it computed, nor what that is held against.
TEST_F(CompareTest, AReferenceThatIsNotFiniteFails) {
  const reference::AnalyzedMesh good = expected;
  const auto expectFailureOf = [&](auto spoil) {
    for (const Method method : allMethods) {
      expected = good;
      spoil(expected);
      expectOneFailure(6, method);
    }
  };
  for (const double bad : {nan, HUGE_VAL, -HUGE_VAL}) {
    expectFailureOf([bad](reference::AnalyzedMesh& mesh) { mesh.positions[6][2] = bad; });
    expectFailureOf([bad](reference::AnalyzedMesh& mesh) { mesh.normals[6][0] = bad; });
    expectFailureOf([bad](reference::AnalyzedMesh& mesh) { mesh.tangents[6][1] = bad; });
    expectFailureOf([bad](reference::AnalyzedMesh& mesh) { mesh.tangents[6][3] = bad; });
    // Where a direction is only asked to be of unit length, too.
    expectFailureOf([bad](reference::AnalyzedMesh& mesh) {
      mesh.normals[6][0] = bad;
      mesh.conditioning[6].normalRounding = HUGE_VAL;
    });
  }
  // Nor is a bound that is none.
  for (const double bad : {nan, HUGE_VAL})
    expectFailureOf([bad](reference::AnalyzedMesh& mesh) { mesh.conditioning[6].scale = bad; });
  expected = good;
  expected.conditioning[6].turning = HUGE_VAL;
  expectOneFailure(6, Method::dualQuaternionIterative);
}

TEST_F(CompareTest, AReferenceOfNothingButNaNsFails) {
  for (auto& position : expected.positions) position = {nan, nan, nan};
  positions.assign(positions.size(), 1e9f);
  for (const Method method : allMethods) {
    const Comparison comparison = compared(method);
    EXPECT_FALSE(comparison.passed());
    EXPECT_EQ(comparison.failures, count);
    EXPECT_EQ(comparison.compared, 0u);
    EXPECT_FALSE(compared(method, {0, count}).passed()) << "whatever the caller says";
  }
  // One that calls all of it undefined, or arbitrary, passes where the caller expected that alone.
  for (bool reference::Conditioning::*excuse :
       {&reference::Conditioning::undefined, &reference::Conditioning::signAmbiguous,
        &reference::Conditioning::degenerate}) {
    for (auto& conditioning : expected.conditioning) conditioning.*excuse = true;
    EXPECT_FALSE(compared().passed());
    EXPECT_EQ(compared().compared, 0u);
    for (auto& conditioning : expected.conditioning) conditioning.*excuse = false;
  }
}

TEST_F(CompareTest, Truth16_ABadlyAlignedNormalNeedOnlyBeOfUnitLength) {
  for (reference::Conditioning& conditioning : expected.conditioning) {
    conditioning.normalRotatedOnly = false;
  }
  expected.conditioning[8].normalAlignment = 0.5e-3;
  normals[8 * 3 + 2] = -0.8f;
  for (const Method method : {Method::dualQuaternion, Method::linear}) {
    EXPECT_TRUE(compared(method).passed());
    EXPECT_EQ(compared(method).onlyUnitNormals, 1u);
    EXPECT_EQ(compared(method).onlyUnitTangents, 0u);
    EXPECT_EQ(compared(method).compared, count);
  }
  expected.conditioning[3].tangentAlignment = expected.conditioning[5].tangentAlignment = 0.5e-3;
  EXPECT_EQ(compared().onlyUnitTangents, 2u);
  normals[8 * 3 + 2] = -0.81f;
  expectOneFailure(8);
  expectOneFailure(8, Method::linear);
}

TEST_F(CompareTest, AZeroNormalThatBecameOneIsFound) {
  expected.normals[8] = {0, 0, 0};
  expectOneFailure(8);
  expectOneFailure(8, Method::linear);
  for (std::size_t i = 0; i < 3; ++i) normals[8 * 3 + i] = 0;
  EXPECT_TRUE(compared().passed());
  expected.normals[8] = {0, 0.6, 0.8};
  expectOneFailure(8);
}

// The same with what the reference itself says of a mesh whose normal is zero.
TEST(Compare, AZeroNormalMustStayZero) {
  OwnedMesh mesh;
  mesh.influencesPerVertex = 1;
  mesh.positions = {1, 0, 0, 0, 1, 0};
  mesh.normals = {0, 0, 0, 0, 0, 1};
  mesh.centersOfRotation = {1, 2, 3, 0, 0, 0};
  mesh.joints = {0, 0};
  mesh.weights = {1, 1};
  for (const float scale : {1.0f, 2.0f}) {
    JointMatrix joint;
    for (int i = 0; i < 3; ++i) joint.m[i][i] = scale;
    for (const Method method : allMethods) {
      const Result<reference::SkinnedMesh> expected =
          reference::skin(mesh.view(), {&joint, 1}, method);
      ASSERT_TRUE(expected.ok());
      std::vector<float> positions, normals{0, 0, 0, 0, 0, 1};
      for (const float coordinate : mesh.positions) positions.push_back(coordinate * scale);
      const auto passes = [&] {
        SkinnedView actual;
        actual.positions = {positions.data(), 2, 12, VertexFormat::float32x3};
        actual.normals = {normals.data(), 2, 12, VertexFormat::float32x3};
        return compareWithReference(*expected, actual)->passed();
      };
      EXPECT_TRUE(passes()) << methodName(method) << ", scale " << scale;
      normals[0] = 1;
      EXPECT_FALSE(passes()) << methodName(method) << ", scale " << scale;
    }
  }
}

TEST_F(CompareTest, DirectionsAreComparedWhereBothHaveThem) {
  const std::vector<float> normalsBefore = normals, tangentsBefore = tangents;
  normals.assign(normals.size(), 5.0f);
  EXPECT_FALSE(compared().passed());
  SkinnedView without = view();
  without.normals = {};
  EXPECT_TRUE(compareWithReference(bounded(Method::linear), without)->passed());
  normals = normalsBefore;
  tangents.assign(tangents.size(), 5.0f);
  EXPECT_FALSE(compared().passed());
  without = view();
  without.tangents = {};
  EXPECT_TRUE(compareWithReference(bounded(Method::linear), without)->passed());
  normals.assign(normals.size(), 5.0f);
  expected.normals.clear();
  expected.tangents.clear();
  EXPECT_TRUE(compared().passed());
}

TEST_F(CompareTest, ReadsWithStrides) {
  constexpr std::uint32_t stride = 47;
  std::vector<unsigned char> bytes(1 + count * stride, 0xff);
  for (std::size_t vertex = 0; vertex < count; ++vertex) {
    std::memcpy(&bytes[1 + vertex * stride], &positions[vertex * 3], 12);
    std::memcpy(&bytes[14 + vertex * stride], &normals[vertex * 3], 12);
    std::memcpy(&bytes[27 + vertex * stride], &tangents[vertex * 4], 16);
  }
  SkinnedView strided;
  strided.positions = {&bytes[1], count, stride, VertexFormat::float32x3};
  strided.normals = {&bytes[14], count, stride, VertexFormat::float32x3};
  strided.tangents = {&bytes[27], count, stride, VertexFormat::float32x4};
  EXPECT_TRUE(compareWithReference(bounded(Method::linear), strided)->passed());
  for (const std::size_t lastOfAttribute : {1u + 3, 14u + 11, 27u + 15}) {
    unsigned char& byte = bytes[lastOfAttribute + 19 * stride];
    byte ^= 0x80;
    EXPECT_EQ(compareWithReference(bounded(Method::linear), strided)->firstFailure, 19u);
    byte ^= 0x80;
  }
}

TEST_F(CompareTest, CountsAndFormatsThatDisagreeAreRefused) {
  for (SkinnedAttribute SkinnedView::*attribute :
       {&SkinnedView::positions, &SkinnedView::normals, &SkinnedView::tangents}) {
    const auto refused = [&](const SkinnedAttribute& bad, std::string_view part) {
      SkinnedView skinned = view();
      skinned.*attribute = bad;
      const Result<Comparison> result = compareWithReference(bounded(Method::linear), skinned);
      ASSERT_FALSE(result.ok()) << part;
      EXPECT_EQ(result.error().code, ErrorCode::invalidArgument);
      EXPECT_NE(result.error().message.find(part), std::string::npos) << result.error().message;
    };
    const SkinnedAttribute good = view().*attribute;
    SkinnedAttribute bad = good;
    bad.count = count - 1;
    refused(bad, "19");
    bad.count = count + 1;
    refused(bad, "for 20");
    bad = good;
    bad.stride = formatSize(good.format) - 1;
    refused(bad, "stride");
    bad = good;
    bad.format = VertexFormat::none;
    refused(bad, "none");
  }
  SkinnedView skinned = view();
  skinned.positions.format = VertexFormat::octahedral16x2;
  EXPECT_FALSE(compareWithReference(bounded(Method::linear), skinned).ok());
  skinned = view();
  skinned.tangents.format = VertexFormat::float32x3;
  EXPECT_FALSE(compareWithReference(bounded(Method::linear), skinned).ok());
  reference::SkinnedMesh tooFewBounds = bounded(Method::linear);
  tooFewBounds.bounds.pop_back();
  EXPECT_FALSE(compareWithReference(tooFewBounds, view()).ok());
  skinned = view();
  skinned.positions = {};
  EXPECT_FALSE(compareWithReference(bounded(Method::linear), skinned).ok());
}

TEST_F(CompareTest, OneWrongTangentIsFound) {
  for (const double error : {1.4e-6, 1.7e-6}) {
    expected.tangents[19] = {1, error, 0, -1};
    const Comparison comparison = compared();
    EXPECT_EQ(comparison.passed(), error < 1.5e-6);
    EXPECT_EQ(comparison.worstTangentVertex, 19u);
    EXPECT_NEAR(comparison.worstTangent, error / 1.5e-6, 1e-6);
  }
  expectOneFailure(19);
}

TEST_F(CompareTest, AHandednessMustBeExact) {
  for (const float wrong : {1.0f, 0.0f, -0.9999999f, -1.0000001f, 5.0f}) {
    tangents[13 * 4 + 3] = wrong;
    expectOneFailure(13);
    EXPECT_GT(compared().worstTangent, 1e5);
    EXPECT_EQ(compared().worstTangentVertex, 13u);
  }
}

TEST_F(CompareTest, AHandednessThatIsAMatterOfRoundingMayBeEither) {
  expected.conditioning[13].handednessAmbiguous = true;
  for (const float either : {1.0f, -1.0f}) {
    tangents[13 * 4 + 3] = either;
    EXPECT_TRUE(compared().passed());
  }
  for (const float wrong : {0.0f, 0.9999999f}) {
    tangents[13 * 4 + 3] = wrong;
    expectOneFailure(13);
  }
}

TEST_F(CompareTest, ABadlyAlignedTangentNeedOnlyBeOfUnitLength) {
  for (reference::Conditioning& conditioning : expected.conditioning) {
    conditioning.normalRotatedOnly = false;
  }
  expected.conditioning[8].tangentAlignment = 0.5e-3;
  tangents[8 * 4] = -1;
  EXPECT_TRUE(compared().passed());
  tangents[8 * 4 + 3] = -1;
  expectOneFailure(8);
  tangents[8 * 4 + 3] = 1;
  tangents[8 * 4] = 1.00001f;
  expectOneFailure(8);
  tangents[8 * 4] = 0;
  expectOneFailure(8, Method::linear);
}

TEST_F(CompareTest, AZeroTangentStaysZeroAndKeepsItsHandedness) {
  expected.tangents[8] = {0, 0, 0, 1};
  expectOneFailure(8);
  tangents[8 * 4] = 0;
  EXPECT_TRUE(compared().passed());
  tangents[8 * 4 + 3] = -1;
  expectOneFailure(8);
}

TEST_F(CompareTest, WhereDisplacementsCancelADirectionItIsZeroOrOfUnitLength) {
  reference::Conditioning& conditioning = expected.conditioning[4];
  const auto passesWithLength = [&](float length) {
    for (std::size_t i = 0; i < 3; ++i) {
      normals[4 * 3 + i] = i == 0 ? length : 0;
      tangents[4 * 4 + i] = i == 1 ? length : 0;
    }
    const bool passes = compared().passed();
    EXPECT_EQ(compared(Method::linear).passed(), passes);
    return passes;
  };
  // Off by a twentieth: any unit vector. By all of its length: also zero.
  conditioning.normalRounding = conditioning.tangentRounding = 0.051 / u;
  EXPECT_TRUE(passesWithLength(1));
  EXPECT_FALSE(passesWithLength(0));
  conditioning.normalRounding = conditioning.tangentRounding = 1.001 / u;
  EXPECT_TRUE(passesWithLength(0));
  EXPECT_FALSE(passesWithLength(0.5f));
  expected.normals[4] = {0, 0, 0};
  expected.tangents[4] = {0, 0, 0, 1};
  conditioning.normalRounding = conditioning.tangentRounding = HUGE_VAL;
  EXPECT_TRUE(passesWithLength(1));
  EXPECT_TRUE(passesWithLength(0));
  EXPECT_FALSE(passesWithLength(0.5f));
}

}  // namespace
}  // namespace dermis::test
