// The rules by which the joints of a vertex are blended.
#pragma once

#include <array>
#include <cstdint>
#include <optional>
#include <string_view>

namespace dermis {

enum class Method : std::uint8_t {
  /// Linear blend skinning: the joint matrices are blended. Collapses where joints twist.
  linear,
  /// Dual-quaternion linear blending (Kavan et al. 2007, section 4), in two phases where joints
  /// scale or shear:
  /// the scale/shear parts are blended linearly and applied in bind space, the rigid parts as dual
  /// quaternions.
  dualQuaternion,
};

inline constexpr std::array<Method, 2> allMethods{Method::linear, Method::dualQuaternion};

/// The method's name on the command line and in reports: "linear", "dual_quaternion".
std::string_view methodName(Method method);

/// The method of that name, or nothing.
std::optional<Method> methodFromName(std::string_view name);

}  // namespace dermis
