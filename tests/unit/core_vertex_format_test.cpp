// The formats of skinned vertices: what each is called, where it may be used, and what its bytes
// stand for.

#include "dermis/layout.h"

#include <gtest/gtest.h>

#include <array>
#include <cmath>
#include <cstdint>
#include <cstring>
#include <initializer_list>
#include <iterator>
#include <limits>
#include <random>
#include <set>
#include <utility>
#include <vector>

#include "vertex_encoder.h"

namespace dermis::test {
namespace {

using Three = std::array<double, 3>;
using Four = std::array<double, 4>;

EncodedVertex bytesOf(std::initializer_list<int> values, std::uint32_t size) {
  EncodedVertex bytes;
  for (const int value : values) appendBits(bytes, static_cast<std::uint32_t>(value), size);
  return bytes;
}

Three halves(std::initializer_list<int> bits) {
  return decodeNormal(VertexFormat::float16x3, bytesOf(bits, 2).data());
}

double lengthOf(const Three& v) {
  return std::hypot(v[0], v[1], v[2]);
}

void expectNear(const Three& actual, const Three& expected, double tolerance = 1e-15) {
  for (std::size_t i = 0; i < 3; ++i) EXPECT_NEAR(actual[i], expected[i], tolerance) << i;
}

TEST(VertexFormats, HaveASizeANameAndAUse) {
  const struct {
    VertexFormat format;
    std::uint32_t size;
    const char* name;
    bool position, normal, tangent;
  } rows[] = {{VertexFormat::none, 0, "none", false, false, false},
              {VertexFormat::float32x3, 12, "float32x3", true, true, false},
              {VertexFormat::float32x4, 16, "float32x4", true, true, true},
              {VertexFormat::float16x3, 6, "float16x3", true, true, false},
              {VertexFormat::float16x4, 8, "float16x4", true, true, true},
              {VertexFormat::snorm16x3, 6, "snorm16x3", true, true, false},
              {VertexFormat::snorm16x4, 8, "snorm16x4", true, true, true},
              {VertexFormat::snorm8x3, 3, "snorm8x3", false, true, false},
              {VertexFormat::snorm8x4, 4, "snorm8x4", false, true, true},
              {VertexFormat::octahedral16x2, 4, "octahedral16x2", false, true, true},
              {VertexFormat::octahedral8x2, 2, "octahedral8x2", false, true, true}};
  EXPECT_EQ(std::size(rows), allVertexFormats.size() + 1);
  for (const auto& row : rows) {
    EXPECT_EQ(formatSize(row.format), row.size) << row.name;
    EXPECT_EQ(formatName(row.format), row.name);
    EXPECT_EQ(isPositionFormat(row.format), row.position) << row.name;
    EXPECT_EQ(isNormalFormat(row.format), row.normal) << row.name;
    EXPECT_EQ(isTangentFormat(row.format), row.tangent) << row.name;
  }
  std::set<VertexFormat> distinct(allVertexFormats.begin(), allVertexFormats.end());
  EXPECT_EQ(distinct.size(), allVertexFormats.size());
  EXPECT_FALSE(distinct.contains(VertexFormat::none));
}

TEST(VertexFormats, FloatsAreTakenAsTheyAre) {
  const float values[] = {1.5f, -0.0f, 3e38f, -7.25f};
  const std::size_t odd = 1;  // no alignment is needed
  std::vector<unsigned char> bytes(odd + sizeof(values));
  std::memcpy(&bytes[odd], values, sizeof(values));
  EXPECT_EQ(decodePosition(VertexFormat::float32x3, &bytes[odd], {}),
            (Three{1.5, 0, double{values[2]}}));
  EXPECT_TRUE(std::signbit(decodeNormal(VertexFormat::float32x4, &bytes[odd])[1]));
  EXPECT_EQ(decodeTangent(VertexFormat::float32x4, &bytes[odd]),
            (Four{1.5, 0, double{values[2]}, -7.25}));
}

TEST(VertexFormats, HalvesOfTheStandard) {
  // IEEE 754: 1; the number behind 1; the largest; the least normal; the largest and least
  // subnormal.
  EXPECT_EQ(halves({0x3c00, 0x3c01, 0x7bff}), (Three{1, 1 + 1.0 / 1024, 65504}));
  EXPECT_EQ(halves({0x0400, 0x03ff, 0x8001}),
            (Three{std::ldexp(1.0, -14), std::ldexp(1023.0, -24), -std::ldexp(1.0, -24)}));
  EXPECT_EQ(halves({0xc000, 0x3555, 0}), (Three{-2, 1365.0 / 4096, 0}));
  const Three special = halves({0x7c00, 0xfc00, 0x7e01});
  EXPECT_EQ(special[0], std::numeric_limits<double>::infinity());
  EXPECT_EQ(special[1], -std::numeric_limits<double>::infinity());
  EXPECT_TRUE(std::isnan(special[2]));
  EXPECT_TRUE(std::signbit(halves({0x8000, 0, 0})[0]));
}

TEST(VertexFormats, EveryHalfComesBackFromItsValue) {
  for (int bits = 0; bits < 0x10000; ++bits) {
    const double value = halves({bits, 0, 0})[0];
    if (std::isnan(value)) {
      EXPECT_GT(bits & 0x7fff, 0x7c00);
    } else {
      ASSERT_EQ(halfOf(value), static_cast<std::uint32_t>(bits));
    }
  }
}

TEST(VertexFormats, SnormIsDividedByItsLargestAndNotBelowMinusOne) {
  for (int value = -128; value < 128; ++value) {
    const EncodedVertex bytes = bytesOf({value, 0, 127, value}, 1);
    const double expected = value == -128 ? -1 : value / 127.0;
    EXPECT_EQ(decodeNormal(VertexFormat::snorm8x3, bytes.data()), (Three{expected, 0, 1}));
    EXPECT_EQ(decodeTangent(VertexFormat::snorm8x4, bytes.data()),
              (Four{expected, 0, 1, expected}));
  }
  for (int value = -32768; value < 32768; ++value) {
    const EncodedVertex bytes = bytesOf({32767, value, -32767, value}, 2);
    const double expected = value == -32768 ? -1 : value / 32767.0;
    EXPECT_EQ(decodeNormal(VertexFormat::snorm16x4, bytes.data()), (Three{1, expected, -1}));
    EXPECT_EQ(decodeTangent(VertexFormat::snorm16x4, bytes.data())[3], expected);
  }
}

TEST(VertexFormats, PositionsInABoxReachItsCorners) {
  const Box box{{-1, 10, 5}, {3, 10.5f, 5}};
  for (const VertexFormat format : {VertexFormat::snorm16x3, VertexFormat::snorm16x4}) {
    const auto decoded = [&](std::initializer_list<int> values) {
      return decodePosition(format, bytesOf(values, 2).data(), box);
    };
    EXPECT_EQ(decoded({-32767, -32767, -32767, 0}), (Three{-1, 10, 5}));
    EXPECT_EQ(decoded({32767, 32767, 32767, 0}), (Three{3, 10.5, 5}));
    EXPECT_EQ(decoded({0, 0, 0, 0}), (Three{1, 10.25, 5}));
    EXPECT_EQ(decoded({-32768, 1, 9, 0}), (Three{-1, 10.25 + 0.25 / 32767, 5}));
  }
  // The box is for snorm16 alone.
  EXPECT_EQ(decodePosition(VertexFormat::float16x3, bytesOf({0x3c00, 0, 0}, 2).data(), box),
            (Three{1, 0, 0}));
}

TEST(VertexFormats, OctahedralNormalsOfTheAxes) {
  const auto decoded8 = [](int x, int y) {
    return decodeNormal(VertexFormat::octahedral8x2, bytesOf({x, y}, 1).data());
  };
  const auto decoded16 = [](int x, int y) {
    return decodeNormal(VertexFormat::octahedral16x2, bytesOf({x, y}, 2).data());
  };
  expectNear(decoded8(0, 0), {0, 0, 1});
  expectNear(decoded8(127, 0), {1, 0, 0});
  expectNear(decoded8(0, -127), {0, -1, 0});
  expectNear(decoded8(-128, 0), {-1, 0, 0});
  // The four corners are one point.
  for (const int x : {-127, 127}) {
    for (const int y : {-127, 127}) expectNear(decoded8(x, y), {0, 0, -1});
  }
  expectNear(decoded16(32767, 32767), {0, 0, -1});
  // In the upper half x : y : z is as stored; in the lower, folded over the edge.
  const double length = lengthOf({16383, 8191, 32767 - 16383 - 8191});
  expectNear(decoded16(16383, -8191),
             {16383 / length, -8191 / length, (32767 - 16383 - 8191) / length});
  expectNear(decoded16(32767 - 8191, -(32767 - 16383)),
             {16383 / length, -8191 / length, -(32767 - 16383 - 8191) / length});
}

TEST(VertexFormats, EveryOctahedralNormalComesBack) {
  for (int x = -126; x <= 126; ++x) {
    for (int y = -126; y <= 126; ++y) {
      const EncodedVertex bytes = bytesOf({x, y}, 1);
      const Three direction = decodeNormal(VertexFormat::octahedral8x2, bytes.data());
      EXPECT_NEAR(lengthOf(direction), 1, 1e-15);
      ASSERT_EQ(encodeNormal(VertexFormat::octahedral8x2, direction), bytes) << x << " " << y;
    }
  }
  std::mt19937 random(1);
  for (int trial = 0; trial < 100000; ++trial) {
    const auto component = [&] { return std::uniform_int_distribution(-32766, 32766)(random); };
    const EncodedVertex bytes = bytesOf({component(), component()}, 2);
    const Three direction = decodeNormal(VertexFormat::octahedral16x2, bytes.data());
    ASSERT_EQ(encodeNormal(VertexFormat::octahedral16x2, direction), bytes);
  }
}

TEST(VertexFormats, EveryOctahedralTangentComesBackWithItsHandedness) {
  for (int x = -126; x <= 126; ++x) {
    for (int y = 2; y <= 126; ++y) {
      for (const int sign : {-1, 1}) {
        const EncodedVertex bytes = bytesOf({x, sign * y}, 1);
        const Four tangent = decodeTangent(VertexFormat::octahedral8x2, bytes.data());
        EXPECT_EQ(tangent[3], sign);
        EXPECT_NEAR(lengthOf({tangent[0], tangent[1], tangent[2]}), 1, 1e-15);
        ASSERT_EQ(encodeTangent(VertexFormat::octahedral8x2, tangent), bytes) << x << " " << y;
      }
    }
  }
}

TEST(VertexFormats, OctahedralTangentsCountTheirSecondComponentFromOne) {
  const auto decoded = [](VertexFormat format, int x, int y) {
    const std::uint32_t size = format == VertexFormat::octahedral8x2 ? 1 : 2;
    return decodeTangent(format, bytesOf({x, y}, size).data());
  };
  for (const auto& [format, largest] : {std::pair{VertexFormat::octahedral8x2, 127},
                                        std::pair{VertexFormat::octahedral16x2, 32767}}) {
    for (const int sign : {-1, 1}) {
      const auto expectTangent = [&, stored = format](int x, int y, const Three& expected) {
        const Four tangent = decoded(stored, x, sign * y);
        expectNear({tangent[0], tangent[1], tangent[2]}, expected);
        EXPECT_EQ(tangent[3], sign);
      };
      expectTangent(0, (largest + 1) / 2, {0, 0, 1});
      expectTangent(0, largest, {0, 1, 0});
      expectTangent(0, 1, {0, -1, 0});
      expectTangent(-largest, (largest + 1) / 2, {-1, 0, 0});
      expectTangent(largest, 1, {0, 0, -1});
    }
    // What no encoder writes is taken for its neighbor.
    EXPECT_EQ(decoded(format, 9, 0), decoded(format, 9, 1));
    EXPECT_EQ(decoded(format, 0, -largest - 1), decoded(format, 0, -largest));
  }
}

TEST(VertexFormats, AFormatThatAnAttributeMayNotHaveGivesZeros) {
  const EncodedVertex ones(16, 1);
  for (const VertexFormat format : allVertexFormats) {
    const bool position = isPositionFormat(format), tangent = isTangentFormat(format);
    EXPECT_EQ(decodePosition(format, ones.data(), {}) == Three{},
              !position || isSnormPosition(format));
    EXPECT_EQ(decodeTangent(format, ones.data()) == Four{}, !tangent);
    EXPECT_NE(decodeNormal(format, ones.data()), Three{});
  }
  EXPECT_EQ(decodePosition(VertexFormat::none, nullptr, {}), Three{});
  EXPECT_EQ(decodeNormal(VertexFormat::none, nullptr), Three{});
  EXPECT_EQ(decodeTangent(VertexFormat::none, nullptr), Four{});
}

}  // namespace
}  // namespace dermis::test
