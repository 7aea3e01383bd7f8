#include "system/layout.h"

#include <algorithm>
#include <string>

namespace dermis {
namespace {

constexpr std::uint64_t planarAlignment = 16;

std::array<VertexFormat, streamCount> formatsOf(const VertexLayout& layout) {
  return {layout.positions, layout.normals, layout.tangents,
          layout.previousPositions ? layout.positions : VertexFormat::none};
}

template <typename Number>
Number roundUp(Number value, Number multiple) {
  return (value + multiple - 1) / multiple * multiple;
}

Result<LaidOutVertices> interleave(const VertexLayout& layout, std::uint32_t vertexCount) {
  LaidOutVertices laidOut;
  std::uint32_t size = 0;
  const std::array<VertexFormat, streamCount> formats = formatsOf(layout);
  for (std::size_t stream = 0; stream < streamCount; ++stream) {
    if (formats[stream] == VertexFormat::none) continue;
    size = roundUp(size, formatAlignment(formats[stream]));
    laidOut.attributes[stream] = {size, 0, formats[stream]};
    size += formatSize(formats[stream]);
  }
  const std::uint32_t stride = layout.stride != 0 ? layout.stride : roundUp(size, 4u);
  if (stride < size) {
    return Error{ErrorCode::invalidArgument, "the instance's stride of " + std::to_string(stride) +
                                                 " bytes is less than the " + std::to_string(size) +
                                                 " of its attributes"};
  }
  for (OutputAttribute& attribute : laidOut.attributes) {
    if (attribute.format != VertexFormat::none) attribute.stride = stride;
  }
  laidOut.size = std::uint64_t{stride} * vertexCount;
  laidOut.alignment = stride;
  return laidOut;
}

LaidOutVertices separate(const VertexLayout& layout, std::uint32_t vertexCount) {
  LaidOutVertices laidOut;
  laidOut.alignment = planarAlignment;
  const std::array<VertexFormat, streamCount> formats = formatsOf(layout);
  for (std::size_t stream = 0; stream < streamCount; ++stream) {
    const std::uint32_t size = formatSize(formats[stream]);
    if (size == 0) continue;
    laidOut.attributes[stream] = {laidOut.size, size, formats[stream]};
    laidOut.size = roundUp(laidOut.size + std::uint64_t{size} * vertexCount, planarAlignment);
  }
  return laidOut;
}

}  // namespace

std::uint32_t attributeBytes(const VertexLayout& layout) {
  std::uint32_t bytes = 0;
  for (const VertexFormat format : formatsOf(layout)) bytes += formatSize(format);
  return bytes;
}

Result<LaidOutVertices> layOut(const VertexLayout& layout, std::uint32_t vertexCount) {
  if (layout.arrangement == Arrangement::interleaved) return interleave(layout, vertexCount);
  if (layout.stride != 0) {
    return Error{ErrorCode::invalidArgument,
                 "the instance's layout is planar: attributes stand without gaps, a stride is for "
                 "interleaved ones"};
  }
  return separate(layout, vertexCount);
}

}  // namespace dermis
