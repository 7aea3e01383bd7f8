#include "plan/outputs.h"

namespace dermis {

OutputStreams outputStreams(const Job& job) {
  const auto stream = [](const OutputAttribute& attribute, VertexFormat format) {
    if (format == VertexFormat::none) return OutputStream{};
    return OutputStream{attribute.offset, attribute.stride, formatSize(format)};
  };
  return {stream(job.positions, job.positions.format), stream(job.normals, job.normals.format),
          stream(job.tangents, job.tangents.format),
          stream(job.previousPositions,
                 job.motion == Motion::none ? VertexFormat::none : job.positions.format)};
}

std::array<std::uint64_t, streamCount> outputSizes(const OutputSizes& sizes) {
  return {sizes.positions, sizes.normals, sizes.tangents, sizes.previousPositions};
}

const char* streamName(std::size_t stream) {
  static constexpr std::array<const char*, streamCount> names{"positions", "normals", "tangents",
                                                              "previous positions"};
  return names[stream];
}

std::uint8_t storeUnit(const OutputStream& stream) {
  const std::uint64_t bits = stream.offset | stream.stride | stream.size;
  return bits % 4 == 0 ? 4 : bits % 2 == 0 ? 2 : 1;
}

Variant outputVariant(const Job& job) {
  Variant variant;
  variant.method = job.method;
  variant.positions = job.positions.format;
  variant.normals = job.normals.format;
  variant.tangents = job.tangents.format;
  variant.motion = job.motion;
  variant.bounds = job.bounds;
  const OutputStreams streams = outputStreams(job);
  for (std::size_t stream = 0; stream < streamCount; ++stream) {
    variant.units[stream] = streams[stream].size != 0 ? storeUnit(streams[stream]) : 4;
  }
  return variant;
}

bool isSnormPosition(VertexFormat format) {
  return format == VertexFormat::snorm16x3 || format == VertexFormat::snorm16x4;
}

bool hasResults(const Variant& variant) {
  return variant.bounds || isSnormPosition(variant.positions);
}

bool hasResult(const Job& job) {
  return job.bounds || isSnormPosition(job.positions.format);
}

}  // namespace dermis
