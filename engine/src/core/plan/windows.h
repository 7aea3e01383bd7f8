// Output that is larger than a storage buffer range may be is written through several ranges
// ("windows").
#pragma once

#include <array>
#include <cstdint>
#include <vector>

#include "dermis/plan.h"
#include "plan/outputs.h"

namespace dermis {

/// Vertices of one job of which each attribute lies in one window of its buffer.
struct VertexRun {
  std::uint32_t firstVertex = 0;
  std::uint32_t vertexEnd = 0;
  std::array<std::uint32_t, streamCount> windows{};
};

/// Cuts a job's vertices into runs. Attributes that lie near to each other get windows of one
/// number.
void cutIntoRuns(const OutputStreams& streams, std::uint32_t vertexCount,
                 const std::array<std::uint64_t, streamCount>& sizes, const DeviceLimits& limits,
                 std::vector<VertexRun>& runs);

}  // namespace dermis
