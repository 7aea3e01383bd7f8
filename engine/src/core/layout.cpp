#include "dermis/layout.h"

#include <algorithm>
#include <array>
#include <string>

#include "dermis/plan.h"
#include "plan/check.h"

namespace dermis {
namespace {

/// A multiple of the size of every store that may write an attribute.
constexpr std::uint64_t planarAlignment = 48;

std::array<VertexFormat, streamCount> formatsOf(const VertexLayout& layout) {
  return {layout.positions, layout.normals, layout.tangents,
          layout.motion != Motion::none ? layout.positions : VertexFormat::none};
}

template <typename Number>
Number roundUp(Number value, Number multiple) {
  return (value + multiple - 1) / multiple * multiple;
}

/// The attributes of places, by `Stream`.
std::array<OutputAttribute*, streamCount> attributesOf(VertexPlaces& places) {
  return {&places.positions, &places.normals, &places.tangents, &places.previousPositions};
}

Result<VertexPlaces> interleave(const VertexLayout& layout, std::uint32_t vertexCount,
                                std::uint64_t offset) {
  VertexPlaces places;
  std::uint32_t size = 0;
  const std::array<VertexFormat, streamCount> formats = formatsOf(layout);
  for (std::size_t stream = 0; stream < streamCount; ++stream) {
    if (formats[stream] == VertexFormat::none) continue;
    size = roundUp(size, formatAlignment(formats[stream]));
    *attributesOf(places)[stream] = {offset + size, 0, formats[stream]};
    size += formatSize(formats[stream]);
  }
  const std::uint32_t stride = layout.stride != 0 ? layout.stride : roundUp(size, 4u);
  if (stride < size) {
    return Error{ErrorCode::invalidArgument, "the layout's stride of " + std::to_string(stride) +
                                                 " bytes is less than the " + std::to_string(size) +
                                                 " of its attributes"};
  }
  for (OutputAttribute* attribute : attributesOf(places)) {
    if (attribute->format != VertexFormat::none) attribute->stride = stride;
  }
  places.size = std::uint64_t{stride} * vertexCount;
  places.alignment = stride;
  return places;
}

VertexPlaces separate(const VertexLayout& layout, std::uint32_t vertexCount, std::uint64_t offset) {
  VertexPlaces places;
  places.alignment = planarAlignment;
  const std::array<VertexFormat, streamCount> formats = formatsOf(layout);
  for (std::size_t stream = 0; stream < streamCount; ++stream) {
    const std::uint32_t size = formatSize(formats[stream]);
    if (size == 0) continue;
    *attributesOf(places)[stream] = {offset + places.size, size, formats[stream]};
    places.size = roundUp(places.size + std::uint64_t{size} * vertexCount, planarAlignment);
  }
  return places;
}

}  // namespace

Result<VertexPlaces> placeVertices(const VertexLayout& layout, std::uint32_t vertexCount,
                                   std::uint64_t offset) {
  if (layout.arrangement > Arrangement::planar)
    return notAValue("the layout's arrangement", layout.arrangement, "Arrangement");
  if (layout.motion > Motion::kept)
    return notAValue("the layout's motion", layout.motion, "Motion");
  if (Result<void> good =
          checkFormats(layout.positions, layout.normals, layout.tangents, {"the layout"});
      !good)
    return good.error();
  const bool isPlanar = layout.arrangement == Arrangement::planar;
  if (isPlanar && layout.stride != 0) {
    return invalid("the layout is planar and has a stride; only interleaved layouts may have one");
  }
  Result<VertexPlaces> places =
      isPlanar ? separate(layout, vertexCount, offset) : interleave(layout, vertexCount, offset);
  if (!places) return places;
  places->motion = layout.motion;
  if (offset % places->alignment != 0) {
    return invalid("vertices of this layout must begin at a multiple of " +
                   std::to_string(places->alignment) + " bytes, not at " + std::to_string(offset));
  }
  return places;
}

void Job::place(const VertexPlaces& places) {
  positions = places.positions;
  normals = places.normals;
  tangents = places.tangents;
  previousPositions = places.previousPositions;
  motion = places.motion;
}

}  // namespace dermis
