#include "dermis/vulkan/drawing.h"

#include <cmath>
#include <cstddef>
#include <string>
#include <utility>

namespace dermis::vulkan {
namespace {

Error invalid(std::string message) {
  return {ErrorCode::invalidArgument, std::move(message)};
}

Result<void> checkLayout(const OutputAttribute& positions, VkFormat format,
                         VkDeviceAddress outputAddress) {
  const std::string name(formatName(positions.format));
  if (format == VK_FORMAT_UNDEFINED)
    return invalid("an acceleration structure cannot be built on every device from positions in " +
                   name);
  if (positions.stride < formatSize(positions.format)) {
    return invalid("the stride of " + std::to_string(positions.stride) +
                   " bytes is less than the size of a position in " + name);
  }
  const std::uint32_t alignment = formatAlignment(positions.format);
  if (positions.stride % alignment != 0) {
    return invalid("the stride of " + std::to_string(positions.stride) +
                   " bytes is not a multiple of " + std::to_string(alignment) +
                   ", the size of a component of " + name);
  }
  if ((outputAddress + positions.offset) % alignment != 0) {
    return invalid("the address of the positions, " + std::to_string(outputAddress) + " + offset " +
                   std::to_string(positions.offset) + ", is not a multiple of " +
                   std::to_string(alignment) + ", the size of a component of " + name);
  }
  return {};
}

}  // namespace

VkFormat buildInputFormat(VertexFormat positions) {
  switch (positions) {
    case VertexFormat::float32x3:
    case VertexFormat::float32x4:  // Not every device reads R32G32B32A32: the stride skips w.
      return VK_FORMAT_R32G32B32_SFLOAT;
    case VertexFormat::float16x4:
      return VK_FORMAT_R16G16B16A16_SFLOAT;
    case VertexFormat::snorm16x4:
      return VK_FORMAT_R16G16B16A16_SNORM;
    default:
      return VK_FORMAT_UNDEFINED;
  }
}

Result<VkAccelerationStructureGeometryTrianglesDataKHR> buildInput(const OutputAttribute& positions,
                                                                   std::uint32_t vertexCount,
                                                                   VkDeviceAddress outputAddress) {
  if (vertexCount == 0) return invalid("there are no vertices to build from");
  if (outputAddress == 0) return invalid("the output has no device address");
  const VkFormat format = buildInputFormat(positions.format);
  if (Result<void> checked = checkLayout(positions, format, outputAddress); !checked)
    return checked.error();

  VkAccelerationStructureGeometryTrianglesDataKHR triangles{};
  triangles.sType = VK_STRUCTURE_TYPE_ACCELERATION_STRUCTURE_GEOMETRY_TRIANGLES_DATA_KHR;
  triangles.vertexFormat = format;
  triangles.vertexData.deviceAddress = outputAddress + positions.offset;
  triangles.vertexStride = positions.stride;
  triangles.maxVertex = vertexCount - 1;
  triangles.indexType = VK_INDEX_TYPE_NONE_KHR;
  return triangles;
}

Result<VkTransformMatrixKHR> boxTransform(const Box& box) {
  VkTransformMatrixKHR transform{};
  for (std::size_t axis = 0; axis < 3; ++axis) {
    const double low = static_cast<double>(box.min[axis]);
    const double high = static_cast<double>(box.max[axis]);
    // In double precision neither the sum nor the difference of two floats overflows.
    const auto halfSize = static_cast<float>((high - low) / 2);
    if (!std::isfinite(low) || !std::isfinite(high) || !(halfSize > 0))
      return invalid("the box of snorm16 positions must be finite, with sides longer than 0");
    transform.matrix[axis][axis] = halfSize;
    transform.matrix[axis][3] = static_cast<float>((low + high) / 2);
  }
  return transform;
}

}  // namespace dermis::vulkan
