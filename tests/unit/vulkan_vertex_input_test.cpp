// Vertex input made from a layout: what a graphics pipeline reads is what the kernels wrote.

#include "dermis/vulkan/drawing.h"

#include <gtest/gtest.h>

#include <array>
#include <cstdint>
#include <map>
#include <string>
#include <utility>

namespace dermis::test {
namespace {

using vulkan::VertexInput;

const std::map<VertexFormat, VkFormat> formats{
    {VertexFormat::none, VK_FORMAT_UNDEFINED},
    {VertexFormat::float32x3, VK_FORMAT_R32G32B32_SFLOAT},
    {VertexFormat::float32x4, VK_FORMAT_R32G32B32A32_SFLOAT},
    {VertexFormat::float16x3, VK_FORMAT_UNDEFINED},
    {VertexFormat::float16x4, VK_FORMAT_R16G16B16A16_SFLOAT},
    {VertexFormat::snorm16x3, VK_FORMAT_UNDEFINED},
    {VertexFormat::snorm16x4, VK_FORMAT_R16G16B16A16_SNORM},
    {VertexFormat::snorm8x3, VK_FORMAT_UNDEFINED},
    {VertexFormat::snorm8x4, VK_FORMAT_R8G8B8A8_SNORM},
    {VertexFormat::octahedral16x2, VK_FORMAT_R16G16_SNORM},
    {VertexFormat::octahedral8x2, VK_FORMAT_R8G8_SNORM}};

TEST(VertexInput, EveryFormatHasTheOneThatAllDevicesReadOrNone) {
  ASSERT_EQ(formats.size(), allVertexFormats.size() + 1);
  for (const auto& [format, expected] : formats)
    EXPECT_EQ(vulkan::vertexInputFormat(format), expected) << formatName(format);
}

constexpr VertexLayout everything{VertexFormat::snorm16x4, VertexFormat::octahedral8x2,
                                  VertexFormat::snorm8x4, true};
constexpr ByStream<std::uint32_t> otherLocations{{7, 5, 3, 1}};

void expectAttribute(const VkVertexInputAttributeDescription& attribute, std::uint32_t location,
                     std::uint32_t binding, VertexFormat format, std::uint64_t offset) {
  EXPECT_EQ(attribute.location, location);
  EXPECT_EQ(attribute.binding, binding);
  EXPECT_EQ(attribute.format, formats.at(format));
  EXPECT_EQ(attribute.offset, offset);
}

TEST(VertexInput, AnInterleavedLayoutHasOneBinding) {
  const VertexPlaces places = *placeVertices(everything, 100, 200 * 24);
  const VertexInput input = *vulkan::vertexInput(everything, otherLocations, 2);
  ASSERT_EQ(input.bindingCount, 1u);
  EXPECT_EQ(input.bindings[0].binding, 2u);
  EXPECT_EQ(input.bindings[0].stride, places[Stream::positions].stride);
  EXPECT_EQ(input.bindings[0].inputRate, VK_VERTEX_INPUT_RATE_VERTEX);
  ASSERT_EQ(input.attributeCount, 4u);
  const std::uint64_t start = places[Stream::positions].offset;
  expectAttribute(input.attributes[0], 7, 2, VertexFormat::snorm16x4, 0);
  expectAttribute(input.attributes[1], 5, 2, VertexFormat::octahedral8x2,
                  places[Stream::normals].offset - start);
  expectAttribute(input.attributes[2], 3, 2, VertexFormat::snorm8x4,
                  places[Stream::tangents].offset - start);
  expectAttribute(input.attributes[3], 1, 2, VertexFormat::snorm16x4,
                  places[Stream::previousPositions].offset - start);
}

TEST(VertexInput, APlanarLayoutHasABindingForEachAttribute) {
  VertexLayout layout = everything;
  layout.planar = true;
  layout.normals = VertexFormat::none;  // the numbers of bindings have no hole
  const VertexPlaces places = *placeVertices(layout, 100, 1584);
  const VertexInput input = *vulkan::vertexInput(layout, otherLocations, 2);
  ASSERT_EQ(input.bindingCount, 3u);
  ASSERT_EQ(input.attributeCount, 3u);
  const std::array attributes{places[Stream::positions], places[Stream::tangents],
                              places[Stream::previousPositions]};
  const std::array<std::uint32_t, 3> locations{7, 3, 1};
  for (std::uint32_t i = 0; i < 3; ++i) {
    EXPECT_EQ(input.bindings[i].binding, 2 + i);
    EXPECT_EQ(input.bindings[i].stride, attributes[i].stride);
    expectAttribute(input.attributes[i], locations[i], 2 + i, attributes[i].format, 0);
  }
}

void expectRefused(const VertexLayout& layout, const std::string& part) {
  const Result<VertexInput> input = vulkan::vertexInput(layout);
  ASSERT_FALSE(input.ok()) << part;
  EXPECT_EQ(input.error().code, ErrorCode::invalidArgument);
  EXPECT_NE(input.error().message.find(part), std::string::npos) << input.error().message;
}

TEST(VertexInput, WhatVertexBuffersCannotHaveIsRefused) {
  expectRefused({.positions = VertexFormat::float16x3}, "float16x3");
  expectRefused({.positions = VertexFormat::float32x3, .normals = VertexFormat::snorm8x3},
                "snorm8x3");
  expectRefused({.positions = VertexFormat::none}, "positions");
  expectRefused({.positions = VertexFormat::float32x3, .stride = 14}, "multiple of 4");
  expectRefused({.positions = VertexFormat::snorm16x4, .stride = 9}, "multiple of 2");
  EXPECT_TRUE(vulkan::vertexInput({.positions = VertexFormat::snorm16x4, .stride = 10}).ok());
}

}  // namespace
}  // namespace dermis::test
