#include "plan/windows.h"

#include <algorithm>
#include <limits>

namespace dermis {
namespace {

/// What two neighbouring windows share.
std::uint64_t windowOverlap(const DeviceLimits& limits) {
  return limits.maxStorageBufferRange / 16;
}

/// Half of what windows share: runs that begin in a window end in it, and so do those of attributes
/// that begin up to as much later.
std::uint64_t longestRun(const DeviceLimits& limits) {
  return windowOverlap(limits) / 2;
}

using Oversized = std::array<bool, streamCount>;

void chooseWindows(const OutputStreams& streams, const Oversized& oversized,
                   const DeviceLimits& limits, VertexRun& run) {
  const std::uint64_t step = outputWindowStep(limits);
  std::uint64_t common = std::numeric_limits<std::uint64_t>::max();
  for (std::size_t stream = 0; stream < streamCount; ++stream) {
    if (!oversized[stream]) continue;
    const std::uint64_t window = streams[stream].begin(run.firstVertex) / step;
    run.windows[stream] = static_cast<std::uint32_t>(window);
    common = std::min(common, window);
  }
  for (std::size_t stream = 0; stream < streamCount; ++stream) {
    if (oversized[stream] &&
        streams[stream].end(run.vertexEnd) > common * step + limits.maxStorageBufferRange)
      return;
  }
  for (std::size_t stream = 0; stream < streamCount; ++stream) {
    if (oversized[stream]) run.windows[stream] = static_cast<std::uint32_t>(common);
  }
}

}  // namespace

std::uint64_t outputWindowStep(const DeviceLimits& limits) {
  const std::uint64_t step = limits.maxStorageBufferRange - windowOverlap(limits);
  return step - step % std::max<std::uint64_t>(limits.minStorageBufferOffsetAlignment, 16);
}

void cutIntoRuns(const OutputStreams& streams, std::uint32_t vertexCount,
                 const std::array<std::uint64_t, streamCount>& sizes, const DeviceLimits& limits,
                 std::vector<VertexRun>& runs) {
  runs.clear();
  Oversized oversized{};
  std::uint64_t longest = vertexCount;
  for (std::size_t stream = 0; stream < streamCount; ++stream) {
    if (streams[stream].size == 0 || sizes[stream] <= limits.maxStorageBufferRange) continue;
    oversized[stream] = true;
    longest =
        std::min(longest, (longestRun(limits) - streams[stream].size) / streams[stream].stride +
                              std::uint64_t{1});
  }
  for (std::uint64_t vertex = 0; vertex < vertexCount; vertex += longest) {
    VertexRun run;
    run.firstVertex = static_cast<std::uint32_t>(vertex);
    run.vertexEnd =
        static_cast<std::uint32_t>(std::min<std::uint64_t>(vertex + longest, vertexCount));
    chooseWindows(streams, oversized, limits, run);
    runs.push_back(run);
  }
}

}  // namespace dermis
