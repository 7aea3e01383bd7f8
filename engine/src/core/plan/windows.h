// Output that is larger than a storage buffer range may be is written through several ranges
// ("windows").
#pragma once

#include <cstddef>
#include <cstdint>
#include <vector>

#include "dermis/plan.h"

namespace dermis {

/// Vertices of one job whose output lies in one window.
struct VertexRun {
  std::uint32_t firstVertex = 0;
  std::uint32_t vertexEnd = 0;
  std::uint32_t window = 0;
};

/// Cuts a job's vertices into runs. Fails with `limitExceeded` where the attributes of one vertex
/// lie too far apart.
Result<void> cutIntoRuns(const Job& job, std::size_t jobIndex, std::uint64_t outputSize,
                         const DeviceLimits& limits, std::vector<VertexRun>& runs);

}  // namespace dermis
