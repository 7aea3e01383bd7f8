#include "plan/placement.h"

#include <algorithm>
#include <limits>
#include <span>

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

bool isSnormPosition(VertexFormat format) {
  return format == VertexFormat::snorm16x3 || format == VertexFormat::snorm16x4;
}

bool hasResults(const Variant& variant) {
  return variant.bounds || isSnormPosition(variant.positions);
}

bool hasResult(const Job& job) {
  return job.bounds || isSnormPosition(job.positions.format);
}

namespace {

/// Kernels are specialised for so many influences a vertex; 0 is any number.
constexpr std::array<std::uint8_t, 4> influenceClasses{1, 2, 4, 0};

}  // namespace

std::uint8_t influenceClass(std::uint32_t maxInfluences) {
  for (const std::uint8_t influences : influenceClasses) {
    if (maxInfluences <= influences) return influences;
  }
  return 0;
}

namespace {

bool hasActive(std::span<const MorphWeight> morphs) {
  return std::ranges::any_of(morphs, [](const MorphWeight& morph) { return morph.weight != 0; });
}

/// What follows from the outputs alone.
Variant outputVariant(const Job& job) {
  Variant variant;
  variant.method = job.method;
  variant.positions = job.positions.format;
  variant.normals = job.normals.format;
  variant.tangents = job.tangents.format;
  variant.motion = job.motion;
  variant.bounds = job.bounds;
  const OutputStreams streams = outputStreams(job);
  for (std::size_t stream = 0; stream < streamCount; ++stream)
    variant.units[stream] = streams[stream].size != 0 ? storeUnit(streams[stream]) : 4;
  return variant;
}

}  // namespace

Variant skinVariant(const Job& job, const Tuning& tuning) {
  Variant variant = outputVariant(job);
  variant.morphs =
      hasActive(job.morphs) || (job.motion == Motion::reskinned && hasActive(job.previousMorphs));
  variant.instancesPerInvocation = static_cast<std::uint8_t>(tuning.instancesPerInvocation);
  variant.workgroupSize = static_cast<std::uint16_t>(tuning.workgroupSize);
  return variant;
}

Variant paletteVariant(const Tuning& tuning) {
  Variant variant;
  variant.kernel = Kernel::palette;
  variant.workgroupSize = static_cast<std::uint16_t>(tuning.workgroupSize);
  return variant;
}

std::uint64_t Variant::key() const {
  std::uint64_t key = 0;
  const auto add = [&key](auto value, unsigned bits) {
    key = key << bits | static_cast<std::uint64_t>(value);
  };
  add(kernel, 2);
  add(method, 4);
  add(positions, 4);
  add(normals, 4);
  add(tangents, 4);
  for (const std::uint8_t unit : units) add(unit / 2, 2);
  add(motion, 2);
  add(morphs, 1);
  add(bounds, 1);
  add(scales, 1);
  add(texels, 1);
  add(pairs, 1);
  add(influences, 4);
  add(instancesPerInvocation, 8);
  add(workgroupSize, 16);
  return key;
}

bool mayReadTexels(const Variant& variant, const DeviceLimits& limits) {
  return variant.kernel == Kernel::skin && limits.maxTexelBufferElements != 0 &&
         limits.maxStorageBuffersPerStage >= storageBuffersWanted &&
         std::ranges::all_of(variant.units, [](std::uint8_t unit) { return unit == 4; });
}

bool fitsUnitTexels(std::uint64_t bytes, const DeviceLimits& limits) {
  return bytes / 16 <= limits.maxTexelBufferElements;
}

bool fitsWordTexels(std::uint64_t bytes, const DeviceLimits& limits) {
  return bytes / 4 <= limits.maxTexelBufferElements;
}

bool mayStorePairs(const Job& job, const DeviceLimits& limits) {
  const OutputAttribute& positions = job.positions;
  const OutputAttribute& normals = job.normals;
  return limits.shaderInt64 && mayReadTexels(outputVariant(job), limits) && !hasResult(job) &&
         job.motion == Motion::none && positions.format == VertexFormat::float32x3 &&
         normals.format == VertexFormat::float32x3 && normals.offset == positions.offset + 12 &&
         normals.stride == positions.stride && (positions.offset | positions.stride) % 8 == 0;
}

namespace {

/// The ways of reading and storing that a plan chooses by the size of the batch and the buffers.
struct Access {
  bool texels, pairs;
};

std::vector<Access> everyAccess(const Job& job, const DeviceLimits& limits) {
  const bool mayRead = mayReadTexels(outputVariant(job), limits);
  const bool mustRead = mayRead && fitsWordTexels(limits.maxStorageBufferRange, limits);
  std::vector<Access> ways;
  if (!mustRead) ways.push_back({false, false});
  if (mayRead) ways.push_back({true, false});
  if (mayStorePairs(job, limits)) ways.push_back({true, true});
  return ways;
}

}  // namespace

std::vector<Variant> everyVariant(const Job& job, const DeviceLimits& limits,
                                  const Tuning& tuning) {
  std::vector<Variant> variants{paletteVariant(tuning)};
  Variant variant = skinVariant(job, tuning);
  for (const Access& access : everyAccess(job, limits)) {
    variant.texels = access.texels;
    variant.pairs = access.pairs;
    for (const bool morphs : {false, true}) {
      for (const std::uint8_t influences : influenceClasses) {
        for (const bool scales : {false, true}) {
          if (scales && job.method == Method::linear) continue;
          variant.morphs = morphs;
          variant.influences = influences;
          variant.scales = scales;
          variants.push_back(variant);
        }
      }
    }
  }
  return variants;
}

// -- Windows.

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
