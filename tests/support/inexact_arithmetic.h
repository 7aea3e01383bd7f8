// Kernels as a GPU may execute them that is only as exact as Vulkan demands: "Precision and
// Operation of SPIR-V Instructions" in the Vulkan specification, for 32-bit floats.
#pragma once

#include <cstdint>
#include <span>
#include <string>
#include <vector>

namespace dermis::test {

/// To which side of the exact result an operation errs; `mixed`: it depends on the result's bits.
enum class Side { none, up, down, mixed };

/// What a device makes of the three operations whose results Vulkan does not ask to be rounded
/// correctly: division is 2 units in the last place further off than on the device that runs it,
/// which with its half makes Vulkan's 2.5; `inversesqrt` 2; `sqrt` is 1 / `inversesqrt`, as
/// Vulkan defines it.
struct Inexactness {
  Side division = Side::none;
  Side inverseRoot = Side::none;
  /// Denormals become 0 when they are loaded or computed. Not together with the others.
  bool flushesDenormals = false;
  /// `fma` rounds once: it is computed in double precision. lavapipe rounds twice. Needs
  /// shaderFloat64; not together with `flushesDenormals`.
  bool fuses = false;
};

/// A module with that arithmetic. `patched`, if not null, is increased by the operations changed.
std::vector<std::uint32_t> makeInexact(std::span<const std::uint32_t> module,
                                       const Inexactness& inexactness,
                                       std::size_t* patched = nullptr);

/// The operations on floats in a module that `makeInexact` does not know of and that Vulkan does
/// not ask to be exact or correctly rounded either: "OpIsNan", "GLSL.std.450 26". `NaN` tests are
/// among them because a driver may delete them.
std::vector<std::string> uncertainOperations(std::span<const std::uint32_t> module);

}  // namespace dermis::test
