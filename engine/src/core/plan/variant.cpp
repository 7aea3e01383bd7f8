#include "plan/variant.h"

#include <algorithm>
#include <array>

#include "plan/outputs.h"

namespace dermis {
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
  Variant variant = outputVariant(job);
  variant.instancesPerInvocation = static_cast<std::uint8_t>(tuning.instancesPerInvocation);
  variant.workgroupSize = static_cast<std::uint16_t>(tuning.workgroupSize);
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

}  // namespace dermis
