// A vertex layout as the attributes of a job.
#pragma once

#include <array>
#include <cstdint>

#include "dermis/instance.h"
#include "dermis/plan.h"

namespace dermis {

struct LaidOutVertices {
  /// Offsets from the beginning of the instance's bytes.
  std::array<OutputAttribute, streamCount> attributes;
  std::uint64_t size = 0;
  std::uint64_t alignment = 1;  ///< of the beginning; need not be a power of two
};

/// Fails with `invalidArgument` where the stride is too small.
Result<LaidOutVertices> layOut(const VertexLayout& layout, std::uint32_t vertexCount);

/// Bytes of one vertex: what its attributes take.
std::uint32_t attributeBytes(const VertexLayout& layout);

}  // namespace dermis
