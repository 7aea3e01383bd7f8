// Skinned vertices as the vertex input of a graphics pipeline. Structures as data, no Vulkan call:
// they follow from the layout, so that pipelines can be created before there is any instance.
#pragma once

#include <array>
#include <cstdint>

#include <vulkan/vulkan_core.h>

#include "dermis/export.h"
#include "dermis/layout.h"
#include "dermis/result.h"
#include "dermis/scene.h"
#include "dermis/vertex_format.h"

namespace dermis::vulkan {

/// The format in which vertex input reads an attribute; every Vulkan device supports it for vertex
/// buffers. VK_FORMAT_UNDEFINED for `none`, float16x3, snorm16x3 and snorm8x3: devices commonly
/// read no vertices of three components smaller than 32 bits. Use x4 formats, or read them from a
/// storage buffer.
///
/// Positions in snorm16x4 and octahedral directions still have to be decoded in the shader:
/// dermis_decode.glsl.
DERMIS_VULKAN_API VkFormat vertexInputFormat(VertexFormat format);

/// The numbers that the engine's shaders and pipelines use.
struct VertexInputNumbers {
  std::uint32_t positions = 0;  ///< locations
  std::uint32_t normals = 1;
  std::uint32_t tangents = 2;
  std::uint32_t previousPositions = 3;
  std::uint32_t firstBinding = 0;
};

/// For VkPipelineVertexInputStateCreateInfo. Interleaved layouts have one binding, planar ones a
/// binding for each attribute, in the order of `VertexLayout`.
struct VertexInput {
  std::array<VkVertexInputBindingDescription, 4> bindings{};
  std::array<VkVertexInputAttributeDescription, 4> attributes{};
  std::uint32_t bindingCount = 0;
  std::uint32_t attributeCount = 0;
};

/// Fails with `invalidArgument` as `placeVertices`, if an attribute's format has no
/// `vertexInputFormat`, and if the layout's stride is no multiple of an attribute's component.
DERMIS_VULKAN_API Result<VertexInput> vertexInput(const VertexLayout& layout,
                                                  const VertexInputNumbers& numbers = {});

/// The offsets for vkCmdBindVertexBuffers: as many as `VertexInput::bindingCount`, each into the
/// output buffer. The buffer handle is the same for all of them. Drawing with offset 0 instead is
/// possible for interleaved layouts: `firstVertex` is `InstanceOutput::offset` / stride then.
DERMIS_VULKAN_API std::array<VkDeviceSize, 4> vertexBufferOffsets(const VertexLayout& layout,
                                                                  const InstanceOutput& output);
DERMIS_VULKAN_API std::array<VkDeviceSize, 4> vertexBufferOffsets(const VertexLayout& layout,
                                                                  const VertexPlaces& places);

}  // namespace dermis::vulkan
