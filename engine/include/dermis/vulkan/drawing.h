// Skinned vertices as input: of graphics pipelines, and of acceleration structures.
#pragma once

#include <array>
#include <cstdint>

#include <vulkan/vulkan_core.h>

#include "dermis/layout.h"
#include "dermis/mesh.h"
#include "dermis/plan.h"
#include "dermis/result.h"

// ---- Skinned vertices as the vertex input of a graphics pipeline. The functions fill structures
// and call no Vulkan function. Vertex input depends on the layout only, so an engine can create its
// pipelines before it adds instances.

namespace dermis::vulkan {

/// The format with which vertex input reads an attribute. Every Vulkan device supports it for
/// vertex buffers. VK_FORMAT_UNDEFINED for `none`, and for float16x3, snorm16x3 and snorm8x3, which
/// Vulkan does not require devices to support. Use x4 formats instead, or read the attribute from a
/// storage buffer.
///
/// The shader must decode snorm16x4 positions and octahedral directions (dermis_decode.glsl).
DERMIS_VULKAN_API VkFormat vertexInputFormat(VertexFormat format);

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

/// The vertex input of a layout. `locations` are those of the attributes in the engine's shader,
/// `firstBinding` is the number of the first binding. Fails with `invalidArgument` as
/// `placeVertices` does, if `vertexInputFormat` returns VK_FORMAT_UNDEFINED for an attribute, and
/// if the stride of the layout is not a multiple of the size of an attribute's component.
DERMIS_VULKAN_API Result<VertexInput> vertexInput(
    const VertexLayout& layout, const ByStream<std::uint32_t>& locations = {{0, 1, 2, 3}},
    std::uint32_t firstBinding = 0);

// ---- Skinned positions as the geometry of a bottom-level acceleration structure, for ray tracing
// (VK_KHR_acceleration_structure). The functions fill structures and call no Vulkan function: the
// engine builds.
//
// 1. The output buffer of the positions has `buildInputUsage`, and its memory was allocated with
//    VK_MEMORY_ALLOCATE_DEVICE_ADDRESS_BIT.
// 2. The engine calls `record`, records the barrier
//    `barrierBetween(Use::dermis, Use::accelerationStructureBuild)`, and builds the geometry that
//    `buildInput` returns.
// 3. Before the next `record` into the same positions, it records the barrier
//    `barrierBetween(Use::accelerationStructureBuild, Use::dermis)`.
//
// Refit from pose to pose (VK_BUILD_ACCELERATION_STRUCTURE_MODE_UPDATE_KHR). This is valid as long
// as the format stays the same, since skinning changes neither the number nor the order of
// vertices. Rebuild
// - if the pose jumps, after a teleport or at a cut, and from time to time while it moves: a refit
//   keeps the tree of the pose that was built, and rays get slower the more the poses differ;
// - if a vertex becomes NaN or is no longer NaN. A triangle whose x is NaN is inactive, which an
//   update must not change (Vulkan 1.3, "Inactive Primitives and Instances"). A NaN in y or z alone
//   is undefined behavior in any build, so poses must be finite.

/// The usage of a buffer that builds read (positions, indices, transforms), in addition to the
/// usage that `Plan::buffer` returns.
inline constexpr VkBufferUsageFlags buildInputUsage =
    VK_BUFFER_USAGE_ACCELERATION_STRUCTURE_BUILD_INPUT_READ_ONLY_BIT_KHR |
    VK_BUFFER_USAGE_SHADER_DEVICE_ADDRESS_BIT;

/// The format with which a build reads positions that are stored in format `positions`.
///
/// float32x3 and float32x4 are read as VK_FORMAT_R32G32B32_SFLOAT: the stride skips the fourth
/// component. float16x4 and snorm16x4 are read with four components, of which builds ignore the
/// fourth. Every device with acceleration structures supports these formats (Vulkan 1.3, "Required
/// Format Support"). For all other formats the function returns VK_FORMAT_UNDEFINED. An engine may
/// ask its device whether it can read float16x3 or snorm16x3
/// (VK_FORMAT_FEATURE_ACCELERATION_STRUCTURE_VERTEX_BUFFER_BIT_KHR).
DERMIS_VULKAN_API VkFormat buildInputFormat(VertexFormat positions);

/// Skinned positions as the vertices of a geometry. Sets `vertexFormat`, `vertexData`,
/// `vertexStride` and `maxVertex`. It sets VK_INDEX_TYPE_NONE_KHR (every three vertices are a
/// triangle) and no transform. The engine sets its indices, and for snorm16x4 the transform of
/// `boxTransform`.
///
/// - `positions`: positions or previous positions of `Job::places` or `InstanceOutput::places`.
/// - `vertexCount`: `MeshInfo::vertexCount`.
/// - `outputAddress`: the device address from which the offset of `positions` counts. For a `Job`:
///   vkGetBufferDeviceAddress of the output buffer, plus `BufferRange::offset`. For an
///   `InstanceOutput`: vkGetBufferDeviceAddress of the output buffer.
///
/// Fails with `invalidArgument`
/// - if there are no vertices, or the address is 0;
/// - if `buildInputFormat` returns VK_FORMAT_UNDEFINED;
/// - if the stride is smaller than a position;
/// - if the stride, or address + offset, is not a multiple of the size of a component, which is 4
///   bytes for float32 and 2 for the others (VUID-vkCmdBuildAccelerationStructuresKHR-pInfos-03711,
///   VUID-VkAccelerationStructureGeometryTrianglesDataKHR-vertexStride-03735). For an instance of a
///   batch or a scene, only the address can be wrong.
DERMIS_VULKAN_API Result<VkAccelerationStructureGeometryTrianglesDataKHR> buildInput(
    const OutputAttribute& positions, std::uint32_t vertexCount, VkDeviceAddress outputAddress);

/// The transform from positions in snorm16 to the space of the pose: center + half size · c.
///
/// The engine uses it in one of two ways. As the transform of the geometry it is in a buffer with
/// `buildInputUsage`, at an address that is a multiple of 16; a refit may change it, so that each
/// pose can have its own box. Or the engine multiplies the transform of the instance in the
/// top-level structure by it, from the right.
///
/// Fails with `invalidArgument` if the box is not finite or a side is not longer than 0, since the
/// matrix must be invertible (VUID-VkTransformMatrixKHR-matrix-03799).
DERMIS_VULKAN_API Result<VkTransformMatrixKHR> boxTransform(const Box& box);

}  // namespace dermis::vulkan
