// Vertex formats and their decoding, where a layout places attributes, and what kernels cannot
// store.
#include "dermis/layout.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <string>
#include <string_view>

#include "attribute.h"
#include "dermis/plan.h"
#include "plan/check.h"
#include "plan/variant.h"
#include "strict_floating_point.h"

namespace dermis {

// -- Formats.

namespace {

/// How a format stores a vector.
struct Encoding {
  std::string_view name;
  ComponentType type;
  bool octahedral = false;
};

const Encoding& encodingOf(VertexFormat format) {
  static constexpr Encoding encodings[] = {{"none", ComponentType::snorm8},
                                           {"float32x3", ComponentType::float32},
                                           {"float32x4", ComponentType::float32},
                                           {"float16x3", ComponentType::float16},
                                           {"float16x4", ComponentType::float16},
                                           {"snorm16x3", ComponentType::snorm16},
                                           {"snorm16x4", ComponentType::snorm16},
                                           {"snorm8x3", ComponentType::snorm8},
                                           {"snorm8x4", ComponentType::snorm8},
                                           {"octahedral16x2", ComponentType::snorm16, true},
                                           {"octahedral8x2", ComponentType::snorm8, true}};
  const auto index = static_cast<std::size_t>(format);
  return encodings[index < std::size(encodings) ? index : 0];
}

/// The stored vector as an attribute of one element.
AttributeView viewOf(const Encoding& encoding, const void* data) {
  return {data, 1, 0, encoding.type, 4};
}

/// A point of the unfolded octahedron to the direction that it stands for.
std::array<double, 3> unfold(double x, double y) {
  const double z = 1 - std::abs(x) - std::abs(y);
  if (z < 0) {
    const double foldedX = (1 - std::abs(y)) * (x < 0 ? -1 : 1);
    y = (1 - std::abs(x)) * (y < 0 ? -1 : 1);
    x = foldedX;
  }
  const double length = std::hypot(x, y, z);
  return {x / length, y / length, z / length};
}

std::array<double, 3> loadVector(const AttributeView& stored) {
  return {loadReal(stored, 0, 0), loadReal(stored, 0, 1), loadReal(stored, 0, 2)};
}

}  // namespace

std::uint32_t formatAlignment(VertexFormat format) {
  return componentSize(encodingOf(format).type);
}

std::string_view formatName(VertexFormat format) {
  return encodingOf(format).name;
}

std::array<double, 3> decodePosition(VertexFormat format, const void* data, const Box& box) {
  if (!isPositionFormat(format)) return {};
  std::array<double, 3> position = loadVector(viewOf(encodingOf(format), data));
  if (!isSnormPosition(format)) return position;
  for (std::size_t axis = 0; axis < 3; ++axis) {
    const auto low = static_cast<double>(box.min[axis]), high = static_cast<double>(box.max[axis]);
    position[axis] = (low + high) / 2 + position[axis] * ((high - low) / 2);
  }
  return position;
}

std::array<double, 3> decodeNormal(VertexFormat format, const void* data) {
  if (!isNormalFormat(format)) return {};
  const Encoding& encoding = encodingOf(format);
  const AttributeView stored = viewOf(encoding, data);
  if (!encoding.octahedral) return loadVector(stored);
  return unfold(loadReal(stored, 0, 0), loadReal(stored, 0, 1));
}

std::array<double, 4> decodeTangent(VertexFormat format, const void* data) {
  if (!isTangentFormat(format)) return {};
  const Encoding& encoding = encodingOf(format);
  const AttributeView stored = viewOf(encoding, data);
  if (!encoding.octahedral) {
    const std::array<double, 3> v = loadVector(stored);
    return {v[0], v[1], v[2], loadReal(stored, 0, 3)};
  }
  // The second component counts from 1, so that its sign is free to be the handedness.
  const bool isWide = encoding.type == ComponentType::snorm16;
  const int largest = isWide ? 32767 : 127;
  const int signedStep = isWide ? int{loadComponent<std::int16_t>(stored, 0, 1)}
                                : int{loadComponent<std::int8_t>(stored, 0, 1)};
  const int step = std::clamp(std::abs(signedStep), 1, largest);
  const double y = 2.0 * (step - 1) / (largest - 1) - 1;
  const std::array<double, 3> v = unfold(loadReal(stored, 0, 0), y);
  return {v[0], v[1], v[2], signedStep < 0 ? -1.0 : 1.0};
}

// -- Layouts.

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

// -- What is refused.

namespace {

Error wrongFormat(VertexFormat format, const char* name, const Subject& subject) {
  if (format > allVertexFormats.back())
    return notAValue(subject.name() + ": the format of its " + name, format, "VertexFormat");
  return invalid(subject.name() + ": its " + name + " cannot be stored as " +
                 std::string(formatName(format)));
}

/// A format with the same values, of whole words.
VertexFormat formatOfWords(VertexFormat format) {
  switch (format) {
    case VertexFormat::float16x3:
      return VertexFormat::float16x4;
    case VertexFormat::snorm16x3:
      return VertexFormat::snorm16x4;
    case VertexFormat::snorm8x3:
      return VertexFormat::snorm8x4;
    case VertexFormat::octahedral8x2:
      return VertexFormat::octahedral16x2;
    default:
      return format;
  }
}

/// Attributes of a vertex that follow each other.
struct AttributeRun {
  std::size_t first = 0;     ///< by `Stream`
  std::size_t part = 0;      ///< the last one that is not whole words
  std::uint32_t length = 0;  ///< bytes
};

bool isOfWords(const OutputStreams& streams, const AttributeRun& run) {
  const OutputStream& first = streams[run.first];
  return (first.offset | first.stride | run.length) % 4 == 0;
}

Error wrongRun(const Job& job, const AttributeRun& run, const OutputStream& first,
               const Subject& subject) {
  if (run.length % 4 == 0) {
    return invalid(subject.name() + ": offset " + std::to_string(first.offset) + " and stride " +
                   std::to_string(first.stride) + " of its " + streamName(run.first) +
                   " must be multiples of 4");
  }
  const std::array formats{job.places[Stream::positions].format, job.places[Stream::normals].format,
                           job.places[Stream::tangents].format,
                           job.places[Stream::positions].format};
  return invalid(subject.name() + ": its " + streamName(run.part) + " as " +
                 std::string(formatName(formats[run.part])) + " are in a run of " +
                 std::to_string(run.length) + " bytes, which is not a multiple of 4; use " +
                 std::string(formatName(formatOfWords(formats[run.part]))));
}

}  // namespace

Result<void> checkFormats(VertexFormat positions, VertexFormat normals, VertexFormat tangents,
                          const Subject& subject) {
  if (!isPositionFormat(positions)) return wrongFormat(positions, "positions", subject);
  if (normals != VertexFormat::none && !isNormalFormat(normals))
    return wrongFormat(normals, "normals", subject);
  if (tangents != VertexFormat::none && !isTangentFormat(tangents))
    return wrongFormat(tangents, "tangents", subject);
  return {};
}

Result<void> checkPrevious(const VertexPlaces& places, const Subject& subject) {
  const VertexFormat positions = places[Stream::positions].format;
  const VertexFormat previous = places[Stream::previousPositions].format;
  if (previous == positions || previous == VertexFormat::none) return {};
  if (previous > allVertexFormats.back())
    return wrongFormat(previous, "previous positions", subject);
  return invalid(subject.name() + ": its previous positions are " +
                 std::string(formatName(previous)) + ", but its positions " +
                 std::string(formatName(positions)));
}

Result<void> checkRuns(const Job& job, const OutputStreams& streams, const Subject& subject) {
  AttributeRun run;
  std::uint64_t end = streams[0].offset;
  for (std::size_t index = 0; index < streamCount; ++index) {
    const OutputStream& stream = streams[index];
    if (stream.size == 0) continue;
    const bool follows = stream.offset == end && stream.stride == streams[run.first].stride;
    if (!follows || index == static_cast<std::size_t>(Stream::previousPositions)) {
      if (!isOfWords(streams, run)) return wrongRun(job, run, streams[run.first], subject);
      run = {index, index, 0};
    }
    if (stream.size % 4 != 0) run.part = index;
    run.length += stream.size;
    end = stream.offset + stream.size;
  }
  if (!isOfWords(streams, run)) return wrongRun(job, run, streams[run.first], subject);
  return {};
}

}  // namespace dermis
