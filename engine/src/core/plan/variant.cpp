#include "plan/variant.h"

#include <array>

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
std::uint64_t Variant::key() const {
  return static_cast<std::uint64_t>(kernel) | static_cast<std::uint64_t>(method) << 4 |
         static_cast<std::uint64_t>(normals) << 12 | static_cast<std::uint64_t>(influences) << 16 |
         static_cast<std::uint64_t>(instancesPerInvocation) << 24 |
         static_cast<std::uint64_t>(workgroupSize) << 32;
}

std::vector<Variant> everyVariant(const Tuning& tuning) {
  const auto workgroupSize = static_cast<std::uint16_t>(tuning.workgroupSize);
  std::vector<Variant> variants{
      {Kernel::palette, Method::dualQuaternion, false, 0, 1, workgroupSize}};
  for (const Method method : allMethods) {
    for (const bool normals : {false, true}) {
      for (const std::uint8_t influences : influenceClasses) {
        variants.push_back({Kernel::skin, method, normals, influences,
                            static_cast<std::uint8_t>(tuning.instancesPerInvocation),
                            workgroupSize});
      }
    }
  }
  return variants;
}

}  // namespace dermis
