#include "plan/variant.h"

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
  add(influences, 4);
  add(instancesPerInvocation, 8);
  add(workgroupSize, 16);
  return key;
}

std::vector<Variant> everyVariant(const Job& job, const Tuning& tuning) {
  std::vector<Variant> variants{paletteVariant(tuning)};
  Variant variant = outputVariant(job);
  variant.instancesPerInvocation = static_cast<std::uint8_t>(tuning.instancesPerInvocation);
  variant.workgroupSize = static_cast<std::uint16_t>(tuning.workgroupSize);
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
  return variants;
}

}  // namespace dermis
