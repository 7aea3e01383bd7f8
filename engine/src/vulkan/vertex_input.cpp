#include "dermis/vulkan/drawing.h"

#include <string>

namespace dermis::vulkan {

VkFormat vertexInputFormat(VertexFormat format) {
  switch (format) {
    case VertexFormat::float32x3:
      return VK_FORMAT_R32G32B32_SFLOAT;
    case VertexFormat::float32x4:
      return VK_FORMAT_R32G32B32A32_SFLOAT;
    case VertexFormat::float16x4:
      return VK_FORMAT_R16G16B16A16_SFLOAT;
    case VertexFormat::snorm16x4:
      return VK_FORMAT_R16G16B16A16_SNORM;
    case VertexFormat::snorm8x4:
      return VK_FORMAT_R8G8B8A8_SNORM;
    case VertexFormat::octahedral16x2:
      return VK_FORMAT_R16G16_SNORM;
    case VertexFormat::octahedral8x2:
      return VK_FORMAT_R8G8_SNORM;
    case VertexFormat::none:
    case VertexFormat::float16x3:
    case VertexFormat::snorm16x3:
    case VertexFormat::snorm8x3:
      break;
  }
  return VK_FORMAT_UNDEFINED;
}

Result<VertexInput> vertexInput(const VertexLayout& layout,
                                const ByStream<std::uint32_t>& locations,
                                std::uint32_t firstBinding) {
  const Result<VertexPlaces> places = placeVertices(layout, 1);
  if (!places) return places.error();
  VertexInput input;
  const auto add = [&](const OutputAttribute& attribute, std::uint32_t location) -> Result<void> {
    if (attribute.format == VertexFormat::none) return {};
    const std::string name(formatName(attribute.format));
    const VkFormat format = vertexInputFormat(attribute.format);
    if (format == VK_FORMAT_UNDEFINED) {
      return Error{ErrorCode::invalidArgument,
                   "vertex input cannot read " + name +
                       " on every device: use a format of four components, or a storage buffer"};
    }
    if (attribute.stride % formatAlignment(attribute.format) != 0) {
      return Error{ErrorCode::invalidArgument,
                   "the stride of " + std::to_string(attribute.stride) +
                       " bytes is not a multiple of " +
                       std::to_string(formatAlignment(attribute.format)) +
                       ", the size of a component of " + name};
    }
    if (layout.planar || input.bindingCount == 0) {
      input.bindings[input.bindingCount] = {firstBinding + input.bindingCount, attribute.stride,
                                            VK_VERTEX_INPUT_RATE_VERTEX};
      ++input.bindingCount;
    }
    const std::uint32_t binding = input.bindings[input.bindingCount - 1].binding;
    const auto offset = layout.planar ? 0 : static_cast<std::uint32_t>(attribute.offset);
    input.attributes[input.attributeCount++] = {location, binding, format, offset};
    return {};
  };
  for (std::size_t stream = 0; stream < streamCount; ++stream) {
    if (Result<void> added = add(places->attributes[stream], locations[stream]); !added)
      return added.error();
  }
  return input;
}

}  // namespace dermis::vulkan
