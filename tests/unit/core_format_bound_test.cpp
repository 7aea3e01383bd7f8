// What each vertex format may add to an error: never less than a format really does, seldom much
// more, and a comparison that holds every vertex to it.

#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <iterator>
#include <limits>
#include <random>
#include <string>
#include <vector>

#include "dermis/verify.h"
#include "few_cases.h"
#include "verify/conditioning.h"
#include "vertex_encoder.h"

namespace dermis::test {
namespace {

using reference::Double3;
using reference::Double4;

constexpr double unitRoundoff = 1.0 / 16777216.0;  // 2^-24

double distance(const Double3& a, const Double3& b) {
  return std::hypot(a[0] - b[0], a[1] - b[1], a[2] - b[2]);
}

Double3 xyz(const Double4& v) {
  return {v[0], v[1], v[2]};
}

class Directions {
 public:
  Double3 next() {
    const Double3 v{normal_(engine_), normal_(engine_), normal_(engine_)};
    const double length = std::hypot(v[0], v[1], v[2]);
    return {v[0] / length, v[1] / length, v[2] / length};
  }

 private:
  std::mt19937_64 engine_{1};
  std::normal_distribution<double> normal_;
};

std::vector<VertexFormat> formatsThat(bool (*are)(VertexFormat)) {
  std::vector<VertexFormat> formats;
  std::copy_if(allVertexFormats.begin(), allVertexFormats.end(), std::back_inserter(formats), are);
  return formats;
}

bool isFloat(VertexFormat format) {
  return formatName(format).starts_with("float32");
}

bool isHalf(VertexFormat format) {
  return formatName(format).starts_with("float16");
}

bool isSnorm(VertexFormat format) {
  return formatName(format).starts_with("snorm");
}

std::string nameOf(const ::testing::TestParamInfo<VertexFormat>& info) {
  return std::string(formatName(info.param));
}

TEST(FormatBounds, FollowFromTheFormats) {
  const double root3 = std::sqrt(3.0);
  for (const auto bound : {normalFormatBound, tangentFormatBound}) {
    EXPECT_EQ(bound(VertexFormat::float32x4), 0);
    EXPECT_NEAR(bound(VertexFormat::float16x4), 1 / 2048.0, 1e-7);
    EXPECT_DOUBLE_EQ(bound(VertexFormat::snorm8x4), root3 * (1 / 254.0 + unitRoundoff));
    EXPECT_DOUBLE_EQ(bound(VertexFormat::snorm16x4), root3 * (1 / 65534.0 + unitRoundoff));
  }
  EXPECT_DOUBLE_EQ(normalFormatBound(VertexFormat::octahedral8x2),
                   std::sqrt(18.0) * (1 / 254.0 + 12 * unitRoundoff));
  EXPECT_DOUBLE_EQ(normalFormatBound(VertexFormat::octahedral16x2),
                   std::sqrt(18.0) * (1 / 65534.0 + 12 * unitRoundoff));
  // (δ, 2δ, 3δ) but for 127 / 126.
  EXPECT_NEAR(tangentFormatBound(VertexFormat::octahedral8x2), std::sqrt(42.0) / 254, 2.5e-4);
  EXPECT_NEAR(tangentFormatBound(VertexFormat::octahedral16x2), std::sqrt(42.0) / 65534, 6e-6);

  const Box box{{-1, 0, 2}, {1, 0, 8}};
  EXPECT_EQ(positionFormatBound(VertexFormat::float32x3, {1, 2, 3}, box), 0);
  EXPECT_NEAR(positionFormatBound(VertexFormat::float16x3, {3, 0, -4}, box), 5 / 2048.0, 1e-12);
  EXPECT_DOUBLE_EQ(positionFormatBound(VertexFormat::float16x4, {0, 0, 0}, box),
                   root3 / 33554432.0);
  EXPECT_DOUBLE_EQ(positionFormatBound(VertexFormat::snorm16x3, {}, box),
                   std::hypot(1 / 65534.0 + 8 * unitRoundoff, 3 / 65534.0 + 44 * unitRoundoff));
}

struct RoundedNormal : public ::testing::TestWithParam<VertexFormat> {};
struct RoundedTangent : public ::testing::TestWithParam<VertexFormat> {};

TEST_P(RoundedNormal, AreInsideTheBoundAndSomeAreNearIt) {
  const VertexFormat format = GetParam();
  Directions directions;
  double worst = 0;
  for (int trial = 0; trial < test::fewer(1000000); ++trial) {
    const Double3 normal = directions.next();
    const EncodedVertex encoded = encodeNormal(format, normal);
    worst = std::max(worst, distance(decodeNormal(format, encoded.data()), normal));
  }
  const double share = worst / normalFormatBound(format);
  RecordProperty("share", std::to_string(share));
  EXPECT_LE(share, 1);
  EXPECT_GT(share, 0.8);
}

TEST_P(RoundedTangent, AreInsideTheBoundAndSomeAreNearIt) {
  const VertexFormat format = GetParam();
  Directions directions;
  double worst = 0;
  for (int trial = 0; trial < test::fewer(1000000); ++trial) {
    const Double3 t = directions.next();
    const double handedness = trial % 2 == 0 ? 1 : -1;
    const EncodedVertex encoded = encodeTangent(format, {t[0], t[1], t[2], handedness});
    const Double4 decoded = decodeTangent(format, encoded.data());
    ASSERT_EQ(decoded[3], handedness);
    worst = std::max(worst, distance(xyz(decoded), t));
  }
  const double share = worst / tangentFormatBound(format);
  RecordProperty("share", std::to_string(share));
  EXPECT_LE(share, 1);
  EXPECT_GT(share, 0.8);
}

bool isRoundedTangent(VertexFormat format) {
  return isTangentFormat(format) && !isFloat(format);
}
INSTANTIATE_TEST_SUITE_P(
    All, RoundedNormal,
    ::testing::ValuesIn(formatsThat([](VertexFormat format) { return !isFloat(format); })), nameOf);
INSTANTIATE_TEST_SUITE_P(All, RoundedTangent, ::testing::ValuesIn(formatsThat(isRoundedTangent)),
                         nameOf);

// As a kernel does it: no intermediate is better than float32.
TEST(FormatBounds, HoldForAnEncoderInFloat) {
  Directions directions;
  double worst = 0;
  for (int trial = 0; trial < test::fewer(1000000); ++trial) {
    const Double3 normal = directions.next();
    float v[3];
    for (std::size_t i = 0; i < 3; ++i) v[i] = static_cast<float>(normal[i]);
    const float sum = std::abs(v[0]) + std::abs(v[1]) + std::abs(v[2]);
    float x = v[0] / sum, y = v[1] / sum;
    if (v[2] < 0) {
      const float foldedX = (1 - std::abs(y)) * (x < 0 ? -1.0f : 1.0f);
      y = (1 - std::abs(x)) * (y < 0 ? -1.0f : 1.0f);
      x = foldedX;
    }
    EncodedVertex encoded;
    for (const float part : {x, y}) {
      appendBits(encoded, static_cast<std::uint32_t>(std::lround(part * 32767)), 2);
    }
    const Double3 rounded{double{v[0]}, double{v[1]}, double{v[2]}};
    worst = std::max(worst,
                     distance(decodeNormal(VertexFormat::octahedral16x2, encoded.data()), rounded));
  }
  EXPECT_LE(worst / normalFormatBound(VertexFormat::octahedral16x2), 1);
}

TEST(FormatBounds, HalvesOfPositionsOfAnySizeAreInsideAndSomeAreNear) {
  std::mt19937_64 random(2);
  std::normal_distribution<double> normal;
  for (const double size : {1e-7, 1e-4, 1.0, 1000.0}) {
    double worst = 0;
    for (int trial = 0; trial < test::fewer(200000); ++trial) {
      const Double3 position{size * normal(random), size * normal(random), size * normal(random)};
      const EncodedVertex encoded = encodePosition(VertexFormat::float16x3, position);
      worst = std::max(
          worst, distance(decodePosition(VertexFormat::float16x3, encoded.data(), {}), position) /
                     positionFormatBound(VertexFormat::float16x3, position, {}));
    }
    EXPECT_LE(worst, 1) << size;
    EXPECT_GT(worst, 0.8) << size;
  }
}

/// In float, as a kernel may: relative to the center, or by a factor and a summand.
float boxed(float position, float low, float high, bool byFactor) {
  const float center = (low + high) / 2, half = (high - low) / 2;
  if (half <= 0) return 0;
  if (!byFactor) return (position - center) / half;
  return position * (1 / half) + -center / half;
}

// From boxes around the origin to one 10,000 units away, whose steps are finer than a float's.
TEST(FormatBounds, PositionsInABoxAreInsideAndSomeAreNear) {
  std::mt19937_64 random(3);
  std::uniform_real_distribution<double> unit(0, 1);
  const struct {
    Box box;
    double least;
  } cases[] = {{{{-1, -1, -1}, {1, 1, 1}}, 0.8},
               {{{-3, 5, -0.01f}, {4, 6.5f, 0.02f}}, 0.8},
               {{{10000.001f, -1, 5}, {10000.9f, 1, 5}}, 0.2}};
  for (const auto& [box, least] : cases) {
    double worst = 0;
    for (int trial = 0; trial < test::fewer(200000); ++trial) {
      Double3 expected;
      EncodedVertex encoded;
      for (std::size_t axis = 0; axis < 3; ++axis) {
        const float low = box.min[axis], high = box.max[axis];
        const auto inside =
            static_cast<float>(double{low} + (double{high} - double{low}) * unit(random));
        const float position = std::clamp(inside, low, high);
        expected[axis] = double{position};
        const float value = std::clamp(boxed(position, low, high, trial % 2 == 0), -1.0f, 1.0f);
        appendBits(encoded, static_cast<std::uint32_t>(std::lround(value * 32767)), 2);
      }
      worst = std::max(
          worst, distance(decodePosition(VertexFormat::snorm16x3, encoded.data(), box), expected));
    }
    const double share = worst / positionFormatBound(VertexFormat::snorm16x3, {}, box);
    EXPECT_LE(share, 1);
    EXPECT_GT(share, least);
  }
}

struct Formats {
  VertexFormat position = VertexFormat::float32x3;
  VertexFormat normal = VertexFormat::float32x3;
  VertexFormat tangent = VertexFormat::float32x4;
};

/// One vertex of each attribute, encoded, and what is expected of it.
struct OneVertex {
  OneVertex() {
    conditioning.scale = 1;
    expected.positions = {{0.3, -0.7, 0.55}};
    expected.normals = {{0.48, -0.6, 0.64}};
    expected.tangents = {{-0.8, -0.36, -0.48, -1}};
  }

  /// Encodes all that is expected.
  void encode(const Formats& wanted) {
    formats = wanted;
    positionBytes = encodePosition(formats.position, expected.positions[0], box);
    normalBytes = encodeNormal(formats.normal, expected.normals[0]);
    tangentBytes = encodeTangent(formats.tangent, expected.tangents[0]);
  }

  Comparison compared(Method method = Method::linear, const Exemptions& exemptions = {}) const {
    reference::SkinnedMesh bounded = expected;
    bounded.bounds = {boundsOf(method, conditioning)};
    SkinnedView view;
    view.positions = {positionBytes.data(), 1, formatSize(formats.position), formats.position};
    view.normals = {normalBytes.data(), 1, formatSize(formats.normal), formats.normal};
    view.tangents = {tangentBytes.data(), 1, formatSize(formats.tangent), formats.tangent};
    view.box = box;
    const Result<Comparison> result = compareWithReference(bounded, view, exemptions);
    EXPECT_TRUE(result.ok()) << (result ? "" : result.error().message);
    return result ? *result : Comparison{};
  }
  bool passes(Method method = Method::linear) const { return compared(method).passed(); }

  reference::SkinnedMesh expected;  ///< without bounds
  reference::Conditioning conditioning;
  Formats formats;
  EncodedVertex positionBytes, normalBytes, tangentBytes;
  Box box{{-1, -1, -1}, {1, 1, 1}};
};

struct ComparePosition : public ::testing::TestWithParam<VertexFormat> {};
struct CompareNormal : public ::testing::TestWithParam<VertexFormat> {};
struct CompareTangent : public ::testing::TestWithParam<VertexFormat> {};
struct CompareFourth : public ::testing::TestWithParam<VertexFormat> {};
struct CompareLength : public ::testing::TestWithParam<VertexFormat> {};
struct CompareFinite : public ::testing::TestWithParam<VertexFormat> {};

/// Moves what is expected to a given share of the bound away from what is stored.
Double3 awayFrom(const Double3& stored, double distanceAway) {
  return {stored[0] + distanceAway * 0.6, stored[1], stored[2] + distanceAway * 0.8};
}

TEST_P(ComparePosition, APositionIsHeldToItsOwnBound) {
  for (const Method method : allMethods) {
    for (const double share : {0.5, 0.999, 1.001, 2.0}) {
      OneVertex vertex;
      vertex.encode({.position = GetParam()});
      const Double3 stored = decodePosition(GetParam(), vertex.positionBytes.data(), vertex.box);
      const double skinning = positionBound(method, vertex.conditioning);
      Double3& expected = vertex.expected.positions[0];
      expected = stored;
      for (int step = 0; step < 5; ++step) {  // float16's bound depends on what is expected
        Double3 reach;
        for (std::size_t i = 0; i < 3; ++i) reach[i] = std::abs(expected[i]) + skinning;
        const double bound = skinning + positionFormatBound(GetParam(), reach, vertex.box);
        expected = awayFrom(stored, share * bound);
      }
      const Comparison comparison = vertex.compared(method);
      EXPECT_EQ(comparison.passed(), share < 1) << share;
      EXPECT_NEAR(comparison.worstPosition, share, 1e-4);
      EXPECT_EQ(comparison.clamped, 0u);
    }
  }
}

TEST_P(CompareNormal, ANormalIsHeldToItsOwnBound) {
  for (const Method method : allMethods) {
    for (const double share : {0.5, 0.999, 1.001, 2.0}) {
      OneVertex vertex;
      vertex.encode({.normal = GetParam()});
      const double bound = normalBound(method, vertex.conditioning) + normalFormatBound(GetParam());
      vertex.expected.normals[0] =
          awayFrom(decodeNormal(GetParam(), vertex.normalBytes.data()), share * bound);
      const Comparison comparison = vertex.compared(method);
      EXPECT_EQ(comparison.passed(), share < 1) << share;
      EXPECT_NEAR(comparison.worstNormal, share, 1e-6);
    }
  }
}

TEST_P(CompareTangent, ATangentIsHeldToItsOwnBound) {
  for (const Method method : allMethods) {
    for (const double share : {0.5, 0.999, 1.001, 2.0}) {
      OneVertex vertex;
      vertex.encode({.tangent = GetParam()});
      const double bound =
          tangentBound(method, vertex.conditioning) + tangentFormatBound(GetParam());
      const Double3 expected =
          awayFrom(xyz(decodeTangent(GetParam(), vertex.tangentBytes.data())), share * bound);
      vertex.expected.tangents[0] = {expected[0], expected[1], expected[2], -1};
      const Comparison comparison = vertex.compared(method);
      EXPECT_EQ(comparison.passed(), share < 1) << share;
      EXPECT_NEAR(comparison.worstTangent, share, 1e-6);
    }
  }
}

TEST_P(CompareTangent, AWrongHandednessIsFound) {
  for (const double handedness : {1.0, -1.0}) {
    OneVertex vertex;
    vertex.expected.tangents[0][3] = handedness;
    vertex.encode({.tangent = GetParam()});
    EXPECT_TRUE(vertex.passes());
    vertex.expected.tangents[0][3] = -handedness;
    EXPECT_FALSE(vertex.passes());
    EXPECT_GT(vertex.compared().worstTangent, 50);
    vertex.conditioning.tangentAlignment = 0;
    EXPECT_FALSE(vertex.passes()) << "its direction does not matter, its handedness does";
    vertex.conditioning.handednessAmbiguous = true;
    EXPECT_TRUE(vertex.passes());
  }
}

// The smallest step that the format has away from ±1.
TEST_P(CompareFourth, AHandednessThatIsNotWholeIsFound) {
  OneVertex vertex;
  vertex.encode({.tangent = GetParam()});
  const std::size_t lastComponent = vertex.tangentBytes.size() / 4 * 3;
  // From -127 to -126, for -128 stands for -1 too; to the next number of a float.
  const unsigned char bits = isSnorm(GetParam()) ? 3 : 1;
  vertex.tangentBytes[lastComponent] ^= bits;
  EXPECT_FALSE(vertex.passes());
  vertex.conditioning.handednessAmbiguous = true;
  EXPECT_FALSE(vertex.passes());
}

TEST_P(CompareFourth, FourthComponentsMustBeFilled) {
  for (const bool ofPosition : {true, false}) {
    if (ofPosition && !isPositionFormat(GetParam())) continue;
    OneVertex vertex;
    vertex.encode({.position = ofPosition ? GetParam() : VertexFormat::float32x3,
                   .normal = ofPosition ? VertexFormat::float32x3 : GetParam()});
    EXPECT_TRUE(vertex.passes());
    EncodedVertex& bytes = ofPosition ? vertex.positionBytes : vertex.normalBytes;
    bytes[bytes.size() / 4 * 3] ^= 2;
    EXPECT_FALSE(vertex.passes());
    EXPECT_FALSE(vertex.passes(Method::dualQuaternion));
  }
}

TEST_P(CompareNormal, AZeroDirectionStaysZeroOrIsUpInAnOctahedron) {
  OneVertex vertex;
  vertex.expected.normals[0] = {0, 0, 0};
  vertex.expected.tangents[0] = {0, 0, 0, 1};
  const VertexFormat tangentFormat =
      isTangentFormat(GetParam()) ? GetParam() : VertexFormat::float32x4;
  vertex.encode({.normal = GetParam(), .tangent = tangentFormat});
  for (const Method method : allMethods) EXPECT_TRUE(vertex.passes(method));
  const EncodedVertex zeroNormal = vertex.normalBytes;
  vertex.normalBytes = encodeNormal(GetParam(), {0, 1, 0});
  EXPECT_FALSE(vertex.passes());
  vertex.normalBytes = zeroNormal;
  vertex.tangentBytes = encodeTangent(tangentFormat, {0, 1, 0, 1});
  EXPECT_FALSE(vertex.passes());
}

TEST_P(CompareLength, WhereOnlyTheLengthCanBeSaidTheFormatIsAllowedFor) {
  OneVertex vertex;
  vertex.conditioning.normalAlignment = 0;
  vertex.conditioning.tangentAlignment = 0;
  const double tolerance = 1e-6 + normalFormatBound(GetParam());
  Directions directions;
  for (int trial = 0; trial < 10000; ++trial) {
    const Double3 any = directions.next();
    const Double4 stored{any[0], any[1], any[2], -1};
    vertex.encode({.normal = GetParam()});
    vertex.normalBytes = encodeNormal(GetParam(), any);
    EXPECT_TRUE(vertex.passes());
    vertex.normalBytes =
        encodeNormal(GetParam(), {any[0] * (1 - 2.1 * tolerance), any[1] * (1 - 2.1 * tolerance),
                                  any[2] * (1 - 2.1 * tolerance)});
    EXPECT_FALSE(vertex.passes());
    if (!isTangentFormat(GetParam())) continue;
    vertex.encode({.tangent = GetParam()});
    vertex.tangentBytes = encodeTangent(GetParam(), stored);
    EXPECT_TRUE(vertex.passes());
  }
}

TEST_P(CompareFinite, NumbersThatAreNotFiniteFail) {
  const double infinity = std::numeric_limits<double>::infinity();
  const Double3 infinite{0, infinity, 0};
  for (const Method method : allMethods) {
    OneVertex vertex;
    const VertexFormat tangentFormat =
        isTangentFormat(GetParam()) ? GetParam() : VertexFormat::float32x4;
    vertex.encode({.position = GetParam(), .normal = GetParam(), .tangent = tangentFormat});
    EXPECT_TRUE(vertex.passes(method));
    const OneVertex good = vertex;
    vertex.positionBytes = encodePosition(GetParam(), infinite);
    EXPECT_FALSE(vertex.passes(method));
    vertex = good;
    vertex.normalBytes = encodeNormal(GetParam(), infinite);
    EXPECT_FALSE(vertex.passes(method));
    vertex = good;
    vertex.tangentBytes = encodeTangent(tangentFormat, {0, 1, infinity, -1});
    EXPECT_FALSE(vertex.passes(method));
    vertex.tangentBytes = encodeTangent(tangentFormat, {0, 1, 0, infinity});
    EXPECT_FALSE(vertex.passes(method));
  }
}

// What is octahedral is of unit length whatever is stored.
bool hasALength(VertexFormat format) {
  return !isOctahedral(format);
}
bool canBeInfinite(VertexFormat format) {
  return isFloat(format) || isHalf(format);
}
INSTANTIATE_TEST_SUITE_P(All, ComparePosition, ::testing::ValuesIn(formatsThat(isPositionFormat)),
                         nameOf);
INSTANTIATE_TEST_SUITE_P(All, CompareNormal, ::testing::ValuesIn(formatsThat(isNormalFormat)),
                         nameOf);
INSTANTIATE_TEST_SUITE_P(All, CompareTangent, ::testing::ValuesIn(formatsThat(isTangentFormat)),
                         nameOf);
INSTANTIATE_TEST_SUITE_P(All, CompareFourth, ::testing::ValuesIn(formatsThat(hasFourComponents)),
                         nameOf);
INSTANTIATE_TEST_SUITE_P(All, CompareLength, ::testing::ValuesIn(formatsThat(hasALength)), nameOf);
INSTANTIATE_TEST_SUITE_P(All, CompareFinite, ::testing::ValuesIn(formatsThat(canBeInfinite)),
                         nameOf);

TEST(CompareHalf, APositionMayOverflowWhereTheReferenceDoes) {
  const double infinity = std::numeric_limits<double>::infinity();
  OneVertex vertex;
  vertex.conditioning.scale = 70000;  // a bound of 0.025
  const auto passes = [&](double expected, double stored) {
    vertex.encode({.position = VertexFormat::float16x3});
    vertex.expected.positions[0] = {1, expected, -2};
    vertex.positionBytes = encodePosition(VertexFormat::float16x3, {1, stored, -2});
    return vertex.passes();
  };
  EXPECT_TRUE(passes(70000, infinity));
  EXPECT_TRUE(passes(-70000, -infinity));
  EXPECT_TRUE(passes(65519.99, infinity));
  EXPECT_TRUE(passes(65519.99, 65504));
  EXPECT_TRUE(passes(65504, 65504));
  EXPECT_FALSE(passes(65519.9, infinity)) << "would be rounded to 65504";
  EXPECT_FALSE(passes(70000, -infinity));
  EXPECT_FALSE(passes(70000, 65504));
  EXPECT_FALSE(passes(70000, std::nan("")));
  EXPECT_FALSE(passes(100, infinity));
  // The other components count all the same.
  EXPECT_TRUE(passes(70000, infinity));
  vertex.positionBytes = encodePosition(VertexFormat::float16x3, {1.05, infinity, -2});
  EXPECT_FALSE(vertex.passes());
}

TEST(CompareHalf, AnArbitraryPositionMayOverflowWhereItIsLarge) {
  OneVertex vertex;
  vertex.encode({.position = VertexFormat::float16x3});
  vertex.positionBytes = encodePosition(VertexFormat::float16x3, {HUGE_VAL, 0, 0});
  vertex.conditioning.signAmbiguous = true;
  EXPECT_FALSE(vertex.compared(Method::dualQuaternion, {1, 0}).passed());
  vertex.conditioning.scale = 60000;
  EXPECT_TRUE(vertex.compared(Method::dualQuaternion, {1, 0}).passed());
  EXPECT_FALSE(vertex.passes(Method::linear));
}

TEST(CompareBox, WhatLiesOutsideIsComparedWithTheNearestPointOfTheBox) {
  for (const VertexFormat format : {VertexFormat::snorm16x3, VertexFormat::snorm16x4}) {
    OneVertex vertex;
    vertex.box = {{-1, 2, 5}, {1, 4, 5}};
    vertex.expected.positions[0] = {3, 2.5, 4};
    vertex.encode({.position = format});
    EXPECT_TRUE(vertex.passes());
    EXPECT_EQ(vertex.compared().clamped, 1u);
    EXPECT_LT(vertex.compared().largestPositionError, 1e-4);
    vertex.positionBytes = encodePosition(format, {0.999, 2.5, 5}, vertex.box);
    EXPECT_FALSE(vertex.passes());
    vertex.expected.positions[0] = {1, 2, 5};
    vertex.encode({.position = format});
    EXPECT_TRUE(vertex.passes());
    EXPECT_EQ(vertex.compared().clamped, 0u) << "its faces belong to the box";
  }
}

TEST(CompareBox, ABoxThatIsNoneIsRefused) {
  const float nan = std::numeric_limits<float>::quiet_NaN();
  const float infinity = std::numeric_limits<float>::infinity();
  OneVertex vertex;
  vertex.expected.bounds.resize(1);
  vertex.encode({.position = VertexFormat::snorm16x3});
  SkinnedView view;
  view.positions = {vertex.positionBytes.data(), 1, 6, VertexFormat::snorm16x3};
  for (const Box& box :
       {Box{{0, 0, 1}, {1, 1, 0}}, Box{{0, nan, 0}, {1, 1, 1}}, Box{{0, 0, 0}, {1, infinity, 1}}}) {
    view.box = box;
    const Result<Comparison> result = compareWithReference(vertex.expected, view);
    ASSERT_FALSE(result.ok());
    EXPECT_EQ(result.error().code, ErrorCode::invalidArgument);
  }
  // Other formats have no use for it.
  vertex.encode({});
  view.positions = {vertex.positionBytes.data(), 1, 12, VertexFormat::float32x3};
  EXPECT_TRUE(compareWithReference(vertex.expected, view).ok());
}

}  // namespace
}  // namespace dermis::test
