#include "dermis/layout.h"

#include <string>

#include "dermis/plan.h"
#include "plan/check.h"

namespace dermis {
namespace {

/// A multiple of the size of every store that may write an attribute.
constexpr std::uint64_t planarAlignment = 48;

ByStream<VertexFormat> formatsOf(const VertexLayout& layout) {
  return {{layout.positions, layout.normals, layout.tangents,
           layout.motion ? layout.positions : VertexFormat::none}};
}

template <typename Number>
Number roundUp(Number value, Number multiple) {
  return (value + multiple - 1) / multiple * multiple;
}

Result<VertexPlaces> interleave(const VertexLayout& layout, std::uint32_t vertexCount,
                                std::uint64_t offset) {
  VertexPlaces places;
  std::uint32_t size = 0;
  const ByStream<VertexFormat> formats = formatsOf(layout);
  for (std::size_t stream = 0; stream < streamCount; ++stream) {
    if (formats[stream] == VertexFormat::none) continue;
    size = roundUp(size, formatAlignment(formats[stream]));
    places.attributes[stream] = {offset + size, 0, formats[stream]};
    size += formatSize(formats[stream]);
  }
  const std::uint32_t stride = layout.stride != 0 ? layout.stride : roundUp(size, 4u);
  if (stride < size) {
    return Error{ErrorCode::invalidArgument, "the layout's stride of " + std::to_string(stride) +
                                                 " bytes is less than the " + std::to_string(size) +
                                                 " of its attributes"};
  }
  for (OutputAttribute& attribute : places.attributes) {
    if (attribute.format != VertexFormat::none) attribute.stride = stride;
  }
  places.size = std::uint64_t{stride} * vertexCount;
  places.alignment = stride;
  return places;
}

VertexPlaces planar(const VertexLayout& layout, std::uint32_t vertexCount, std::uint64_t offset) {
  VertexPlaces places;
  places.alignment = planarAlignment;
  const ByStream<VertexFormat> formats = formatsOf(layout);
  for (std::size_t stream = 0; stream < streamCount; ++stream) {
    const std::uint32_t size = formatSize(formats[stream]);
    if (size == 0) continue;
    places.attributes[stream] = {offset + places.size, size, formats[stream]};
    places.size = roundUp(places.size + std::uint64_t{size} * vertexCount, planarAlignment);
  }
  return places;
}

}  // namespace

Result<VertexPlaces> placeVertices(const VertexLayout& layout, std::uint32_t vertexCount,
                                   std::uint64_t offset) {
  if (Result<void> good =
          checkFormats(layout.positions, layout.normals, layout.tangents, {"the layout"});
      !good)
    return good.error();
  if (layout.planar && layout.stride != 0) {
    return invalid("the layout is planar and has a stride; only interleaved layouts may have one");
  }
  Result<VertexPlaces> places =
      layout.planar ? planar(layout, vertexCount, offset) : interleave(layout, vertexCount, offset);
  if (!places) return places;
  if (offset % places->alignment != 0) {
    return invalid("vertices of this layout must begin at a multiple of " +
                   std::to_string(places->alignment) + " bytes, not at " + std::to_string(offset));
  }
  return places;
}

}  // namespace dermis
