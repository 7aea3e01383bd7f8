// Skinned positions as the input of an acceleration-structure build: formats, alignment, boxes.

#include "dermis/vulkan/drawing.h"

#include <gtest/gtest.h>

#include <array>
#include <cstddef>
#include <cstdint>
#include <limits>
#include <string>

namespace dermis::vulkan {
namespace {

constexpr VkDeviceAddress address = 0x7000'0000'1000;

void expectRefused(const OutputAttribute& positions, std::uint32_t vertexCount,
                   VkDeviceAddress outputAddress, const std::string& part) {
  const auto triangles = buildInput(positions, vertexCount, outputAddress);
  ASSERT_FALSE(triangles.ok()) << part;
  EXPECT_EQ(triangles.error().code, ErrorCode::invalidArgument);
  EXPECT_NE(triangles.error().message.find(part), std::string::npos) << triangles.error().message;
}

TEST(BuildGeometryTest, FormatsThatEveryDeviceReadsAreTold) {
  for (const VertexFormat format : allVertexFormats) {
    SCOPED_TRACE(formatName(format));
    VkFormat expected = VK_FORMAT_UNDEFINED;
    if (format == VertexFormat::float32x3 || format == VertexFormat::float32x4)
      expected = VK_FORMAT_R32G32B32_SFLOAT;
    if (format == VertexFormat::float16x4) expected = VK_FORMAT_R16G16B16A16_SFLOAT;
    if (format == VertexFormat::snorm16x4) expected = VK_FORMAT_R16G16B16A16_SNORM;
    EXPECT_EQ(buildInputFormat(format), expected);
    EXPECT_EQ(buildInput({0, 16, format}, 3, address).ok(), expected != VK_FORMAT_UNDEFINED);
  }
  EXPECT_EQ(buildInputFormat(VertexFormat::none), VK_FORMAT_UNDEFINED);
  expectRefused({0, 6, VertexFormat::float16x3}, 3, address, "float16x3");
}

TEST(BuildGeometryTest, TheVertexPartIsFilled) {
  const auto triangles = buildInput({40, 24, VertexFormat::float32x3}, 1234, address);
  ASSERT_TRUE(triangles.ok()) << triangles.error().message;
  EXPECT_EQ(triangles->sType, VK_STRUCTURE_TYPE_ACCELERATION_STRUCTURE_GEOMETRY_TRIANGLES_DATA_KHR);
  EXPECT_EQ(triangles->pNext, nullptr);
  EXPECT_EQ(triangles->vertexFormat, VK_FORMAT_R32G32B32_SFLOAT);
  EXPECT_EQ(triangles->vertexData.deviceAddress, address + 40);
  EXPECT_EQ(triangles->vertexStride, 24u);
  EXPECT_EQ(triangles->maxVertex, 1233u);
  EXPECT_EQ(triangles->indexType, VK_INDEX_TYPE_NONE_KHR);
  EXPECT_EQ(triangles->indexData.deviceAddress, 0u);
  EXPECT_EQ(triangles->transformData.deviceAddress, 0u);
}

TEST(BuildGeometryTest, AddressAndStrideAreMultiplesOfAComponent) {
  // 2 bytes are enough where a component has 2, whatever the size of the whole.
  EXPECT_TRUE(buildInput({2, 10, VertexFormat::float16x4}, 3, address).ok());
  EXPECT_TRUE(buildInput({2, 10, VertexFormat::snorm16x4}, 3, address).ok());
  expectRefused({1, 10, VertexFormat::float16x4}, 3, address, "offset 1");
  expectRefused({2, 9, VertexFormat::snorm16x4}, 3, address, "stride of 9");
  expectRefused({2, 12, VertexFormat::float32x3}, 3, address, "offset 2");
  expectRefused({0, 14, VertexFormat::float32x3}, 3, address, "stride of 14");
  // It is the sum that counts.
  expectRefused({0, 12, VertexFormat::float32x3}, 3, address + 2, "offset 0");
  EXPECT_TRUE(buildInput({2, 12, VertexFormat::float32x3}, 3, address + 2).ok());
}

TEST(BuildGeometryTest, WhatCannotBeBuiltFromIsRefused) {
  expectRefused({0, 12, VertexFormat::float32x3}, 0, address, "no vertices");
  expectRefused({0, 12, VertexFormat::float32x3}, 3, 0, "device address");
  expectRefused({0, 12, VertexFormat::none}, 3, address, "none");
  // float32x4 is read as three components, but still takes 16 bytes.
  expectRefused({0, 12, VertexFormat::float32x4}, 3, address, "stride of 12");
  EXPECT_TRUE(buildInput({0, 12, VertexFormat::float32x3}, 1, address).ok());
}

TEST(BuildGeometryTest, TheBoxBecomesATransform) {
  const Box box{{-1, 2, -0.5f}, {3, 2.5f, 4}};
  const auto transform = boxTransform(box);
  ASSERT_TRUE(transform.ok());
  const float expected[3][4] = {{2, 0, 0, 1}, {0, 0.25f, 0, 2.25f}, {0, 0, 2.25f, 1.75f}};
  for (int row = 0; row < 3; ++row) {
    for (int column = 0; column < 4; ++column)
      EXPECT_EQ(transform->matrix[row][column], expected[row][column]) << row << ", " << column;
  }
}

TEST(BuildGeometryTest, TheTransformPutsPositionsWhereTheFormatSaysTheyAre) {
  const Box box{{-1.1f, 20.3f, -0.7f}, {3.3f, 21.9f, 1e-3f}};
  const auto transform = boxTransform(box);
  ASSERT_TRUE(transform.ok());
  const std::array<std::int16_t, 4> stored{-32767, 12345, 32767, 0};
  const auto position = decodePosition(VertexFormat::snorm16x4, stored.data(), box);
  for (std::size_t axis = 0; axis < 3; ++axis) {
    const double value = stored[axis] / 32767.0;
    EXPECT_NEAR(static_cast<double>(transform->matrix[axis][axis]) * value +
                    static_cast<double>(transform->matrix[axis][3]),
                position[axis], 2e-6);
  }
}

TEST(BuildGeometryTest, ABoxWithoutExtentHasNoTransform) {
  EXPECT_FALSE(boxTransform({{0, 0, 0}, {1, 0, 1}}).ok());
  EXPECT_FALSE(boxTransform({{0, 2, 0}, {1, 1, 1}}).ok());
  EXPECT_FALSE(boxTransform({{0, 0, 0}, {1, std::numeric_limits<float>::infinity(), 1}}).ok());
  EXPECT_FALSE(boxTransform({{std::numeric_limits<float>::quiet_NaN(), 0, 0}, {1, 1, 1}}).ok());
  const float largest = std::numeric_limits<float>::max();
  const auto transform = boxTransform({{-largest, 0, 0}, {largest, 1, 1}});
  ASSERT_TRUE(transform.ok());
  EXPECT_EQ(transform->matrix[0][0], largest);
}

TEST(BuildGeometryTest, TheUsageIsThatOfABuildsInput) {
  EXPECT_EQ(
      buildInputUsage,
      VkBufferUsageFlags{VK_BUFFER_USAGE_ACCELERATION_STRUCTURE_BUILD_INPUT_READ_ONLY_BIT_KHR |
                         VK_BUFFER_USAGE_SHADER_DEVICE_ADDRESS_BIT});
}

}  // namespace
}  // namespace dermis::vulkan
