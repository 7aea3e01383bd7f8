// Skinned positions as the geometry of a bottom-level acceleration structure, for ray tracing
// (VK_KHR_acceleration_structure). Structures as data, no Vulkan call: the engine builds.
//
// 1. The output buffer of the positions has `buildInputUsage`, and memory that was allocated with
//    VK_MEMORY_ALLOCATE_DEVICE_ADDRESS_BIT.
// 2. `record`, the barrier `outputScope(Consumer::accelerationStructureBuild)`, then the build of
//    the geometry that `buildInput` describes.
// 3. Before the next `record` into the same positions, the barrier
//    `inputScope(PreviousUse::accelerationStructureBuild)`.
//
// Refit (VK_BUILD_ACCELERATION_STRUCTURE_MODE_UPDATE_KHR) from pose to pose: skinning changes
// neither the number nor the order of vertices, and everything else that an update must leave as it
// was stays as it was as long as the format does. Rebuild
// - where the pose jumps, after a teleport or at a cut, and every so often while it moves: a refit
//   keeps the tree of the pose that was built, and rays get slower the further the two are apart;
// - where a vertex became NaN, or no longer is: a triangle whose x is NaN is inactive, which an
//   update must not change (Vulkan 1.3, "Inactive Primitives and Instances"). A NaN in y or z alone
//   is undefined behaviour in any build: what is traced needs finite poses.
#pragma once

#include <cstdint>

#include <vulkan/vulkan_core.h>

#include "dermis/export.h"
#include "dermis/plan.h"
#include "dermis/result.h"
#include "dermis/types.h"
#include "dermis/vertex_format.h"

namespace dermis::vulkan {

/// What a buffer that builds read from (positions, indices, transforms) needs as usage, besides
/// what `Plan::buffer` says.
inline constexpr VkBufferUsageFlags buildInputUsage =
    VK_BUFFER_USAGE_ACCELERATION_STRUCTURE_BUILD_INPUT_READ_ONLY_BIT_KHR |
    VK_BUFFER_USAGE_SHADER_DEVICE_ADDRESS_BIT;

/// The format in which a build reads positions that are stored in this one;
/// VK_FORMAT_UNDEFINED where not every device with acceleration structures can (Vulkan 1.3,
/// "Required Format Support").
///
/// float32x3, float32x4, float16x4 and snorm16x4 can be read; the fourth component is not looked
/// at. float16x3 and snorm16x3 cannot: an engine may ask its device for them
/// (VK_FORMAT_FEATURE_ACCELERATION_STRUCTURE_VERTEX_BUFFER_BIT_KHR).
DERMIS_VULKAN_API VkFormat buildInputFormat(VertexFormat positions);

/// Skinned positions as the vertices of a geometry: `vertexFormat`, `vertexData`, `vertexStride`
/// and `maxVertex`. No indices (VK_INDEX_TYPE_NONE_KHR, every three vertices are a triangle) and no
/// transform: the engine sets its own, and for snorm16x4 a transform from `boxTransform`.
///
/// `positions`: `Job::positions`, or `Job::previousPositions` with the format of `positions`.
/// `vertexCount`: `MeshInfo::vertexCount`. `outputAddress`: the device address of the output range,
/// that is vkGetBufferDeviceAddress of its buffer plus `BufferRange::offset`.
///
/// Fails with `invalidArgument` where there is no vertex or no address, where `buildInputFormat`
/// has no format, the stride is smaller than a position, or where address + offset or the stride is
/// no multiple of a component's size: 4 bytes for float32, 2 for the others
/// (VUID-vkCmdBuildAccelerationStructuresKHR-pInfos-03711,
/// VUID-VkAccelerationStructureGeometryTrianglesDataKHR-vertexStride-03735). `makePlan` demands as
/// much unless the device stores less than a word.
DERMIS_VULKAN_API Result<VkAccelerationStructureGeometryTrianglesDataKHR> buildInput(
    const OutputAttribute& positions, std::uint32_t vertexCount, VkDeviceAddress outputAddress);

/// From positions in snorm16 to the mesh's space: centre + half the size · c. As the geometry's
/// transform it stands in a buffer with `buildInputUsage`, at an address that is a multiple of 16;
/// a refit may change it, so that each pose can have its own box. Or the engine multiplies the
/// transform of the instance in the top-level structure by it, from the right.
///
/// Fails with `invalidArgument` where the box is not finite or a side is not longer than 0: the
/// matrix must be invertible (VUID-VkTransformMatrixKHR-matrix-03799).
DERMIS_VULKAN_API Result<VkTransformMatrixKHR> boxTransform(const Box& box);

}  // namespace dermis::vulkan
