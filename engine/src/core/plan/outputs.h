// The attributes of a job's output, one like the other.
#pragma once

#include <array>
#include <cstdint>

#include "dermis/plan.h"

namespace dermis {

/// One attribute as plans see it; `size` 0 where it is not wanted.
struct OutputStream {
  std::uint64_t offset = 0;
  std::uint32_t stride = 0;
  std::uint32_t size = 0;  ///< bytes of one element

  std::uint64_t begin(std::uint64_t vertex) const { return offset + vertex * stride; }
  /// Of vertices before `vertexEnd`.
  std::uint64_t end(std::uint64_t vertexEnd) const { return begin(vertexEnd - 1) + size; }
};

using OutputStreams = std::array<OutputStream, streamCount>;

OutputStreams outputStreams(const Job& job);

std::array<std::uint64_t, streamCount> outputSizes(const OutputSizes& sizes);

const char* streamName(std::size_t stream);

/// Bytes that one store may write: 4, 2 or 1.
std::uint8_t storeUnit(const OutputStream& stream);

/// The skin kernel for a job, but for what depends on its mesh's influences and on tuning.
Variant outputVariant(const Job& job);

/// Whether positions are stored relative to a box.
bool isSnormPosition(VertexFormat format);

/// Whether the kernel finds something out about the instance.
bool hasResult(const Job& job);

}  // namespace dermis
