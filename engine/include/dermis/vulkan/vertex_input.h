// Skinned vertices as the vertex input of a graphics pipeline. The functions fill structures and
// call no Vulkan function. Vertex input depends on the layout only, so an engine can create its
// pipelines before it adds instances.
#pragma once

#include <array>
#include <cstdint>

#include <vulkan/vulkan_core.h>

#include "dermis/export.h"
#include "dermis/layout.h"
#include "dermis/result.h"
#include "dermis/vertex_format.h"

namespace dermis::vulkan {

/// The format with which vertex input reads an attribute. Every Vulkan device supports it for
/// vertex buffers. VK_FORMAT_UNDEFINED for `none`, and for float16x3, snorm16x3 and snorm8x3, which
/// Vulkan does not require devices to support. Use x4 formats instead, or read the attribute from a
/// storage buffer.
///
/// The shader must decode snorm16x4 positions and octahedral directions (dermis_decode.glsl).
DERMIS_VULKAN_API VkFormat vertexInputFormat(VertexFormat format);

/// Locations and bindings that the engine's shaders and pipelines use.
struct VertexInputNumbers {
  std::uint32_t positions = 0;          ///< location of the positions
  std::uint32_t normals = 1;            ///< location of the normals
  std::uint32_t tangents = 2;           ///< location of the tangents
  std::uint32_t previousPositions = 3;  ///< location of the previous positions
  std::uint32_t firstBinding = 0;       ///< number of the first binding
};

/// For VkPipelineVertexInputStateCreateInfo. An interleaved layout has one binding: bind the output
/// buffer at `InstanceOutput::offset`, or at 0 for draws with `IndexedDraw::vertexOffset`. A planar
/// layout has one binding for each attribute, in the order positions, normals, tangents, previous
/// positions: bind each at its `OutputAttribute::offset`.
struct VertexInput {
  std::array<VkVertexInputBindingDescription, 4> bindings{};
  std::array<VkVertexInputAttributeDescription, 4> attributes{};
  std::uint32_t bindingCount = 0;    ///< elements of `bindings` that are used
  std::uint32_t attributeCount = 0;  ///< elements of `attributes` that are used
};

/// The vertex input of a layout. Fails with `invalidArgument` as `placeVertices` does, if
/// `vertexInputFormat` returns VK_FORMAT_UNDEFINED for an attribute, and if the stride of the
/// layout is not a multiple of the size of an attribute's component.
DERMIS_VULKAN_API Result<VertexInput> vertexInput(const VertexLayout& layout,
                                                  const VertexInputNumbers& numbers = {});

}  // namespace dermis::vulkan
