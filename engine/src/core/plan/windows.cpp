#include "plan/windows.h"

#include <algorithm>
#include <string>

#include "plan/check.h"

namespace dermis {
namespace {

/// What two neighbouring windows share, and so the longest output of one run: a run that begins
/// before the next window does ends inside its own.
std::uint64_t windowOverlap(const DeviceLimits& limits) {
  return limits.maxStorageBufferRange / 16;
}

/// The bytes that a vertex of a job is written to lie between `begin` and `end`; both grow with the
/// vertex.
struct OutputSpan {
  const Job& job;

  std::uint64_t begin(std::uint64_t vertex) const {
    const std::uint64_t positions = job.positions.offset + vertex * job.positions.stride;
    if (job.normals.stride == 0) return positions;
    return std::min(positions, job.normals.offset + vertex * job.normals.stride);
  }
  std::uint64_t end(std::uint64_t vertex) const {
    const std::uint64_t positions = job.positions.offset + vertex * job.positions.stride;
    if (job.normals.stride == 0) return positions + outputAttributeSize;
    return std::max(positions, job.normals.offset + vertex * job.normals.stride) +
           outputAttributeSize;
  }
};

/// The end of the longest run from `first` on that spans at most `longest` bytes, found by halving:
/// a run's span grows with its length.
std::uint32_t longestRun(const OutputSpan& span, std::uint32_t first, std::uint32_t vertices,
                         std::uint64_t longest) {
  std::uint32_t low = first + 1, high = vertices;
  while (low < high) {
    const std::uint32_t middle = low + (high - low + 1) / 2;
    if (span.end(middle - 1) - span.begin(first) <= longest) {
      low = middle;
    } else {
      high = middle - 1;
    }
  }
  return low;
}

}  // namespace

std::uint64_t outputWindowStep(const DeviceLimits& limits) {
  const std::uint64_t step = limits.maxStorageBufferRange - windowOverlap(limits);
  return step - step % std::max<std::uint64_t>(limits.minStorageBufferOffsetAlignment, 16);
}

Result<void> cutIntoRuns(const Job& job, std::size_t jobIndex, std::uint64_t outputSize,
                         const DeviceLimits& limits, std::vector<VertexRun>& runs) {
  runs.clear();
  const std::uint32_t vertices = job.mesh.vertexCount;
  if (outputSize <= limits.maxStorageBufferRange) {
    runs.push_back({0, vertices, 0});
    return {};
  }
  const std::uint64_t longest = windowOverlap(limits);
  const OutputSpan span{job};
  for (std::uint32_t vertex = 0; vertex < vertices;) {
    if (const std::uint64_t apart = span.end(vertex) - span.begin(vertex); apart > longest) {
      return Error{ErrorCode::limitExceeded,
                   jobName(jobIndex) + ": the positions and normals of one vertex lie " +
                       std::to_string(apart) +
                       " bytes apart, in an output larger than one storage buffer range at most " +
                       std::to_string(longest) + " are possible on this device"};
    }
    const std::uint32_t end = longestRun(span, vertex, vertices, longest);
    runs.push_back(
        {vertex, end, static_cast<std::uint32_t>(span.begin(vertex) / outputWindowStep(limits))});
    vertex = end;
  }
  return {};
}

}  // namespace dermis
