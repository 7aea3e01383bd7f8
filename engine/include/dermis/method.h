// The methods by which the joints of a vertex are blended.
#pragma once

#include <array>
#include <cstdint>
#include <optional>
#include <string_view>

#include "dermis/export.h"

namespace dermis {

/// How the joints of a vertex are blended. All methods use the same meshes and poses. If joints
/// scale or shear, all methods except `linear` blend in two phases: first the scale and shear parts
/// are blended linearly and applied in bind space, then the rigid parts are blended by the method.
/// docs/methods.md describes each.
enum class Method : std::uint8_t {
  /// Linear blend skinning: blends the joint matrices. The mesh collapses where joints twist.
  linear = 0,
  /// Dual-quaternion linear blending, DLB (Kavan et al. 2007, section 4). The mesh bulges where
  /// joints bend.
  dualQuaternion = 1,
  /// Dual-quaternion iterative blending, DIB (Kavan et al. 2008): refines the result of DLB in at
  /// most 20 steps. For comparison.
  dualQuaternionIterative = 2,
  /// Blends the logarithms of the rigid parts as matrices (Cordier and Magnenat-Thalmann 2005,
  /// Alexa 2002). May rotate the long way round. For comparison.
  logMatrix = 3,
  /// Spherical blend skinning (Kavan and Žára 2005): blends quaternions about a center of rotation
  /// that is computed for each vertex and pose. For comparison.
  sphericalBlend = 4,
  /// Blends quaternions and translations separately (Hejl 2004). The mesh tears at vertices whose
  /// joints do not meet. For comparison.
  quaternionTranslation = 5,
  /// Interpolates between `linear` and `dualQuaternion`, by `MeshView::dualQuaternionWeights`.
  blended = 6,
  /// Blends quaternions about centers of rotation that are computed once, at import (Le and Hodgins
  /// 2016). Does not collapse, and bulges less. Requires `MeshView::centersOfRotation`.
  centerOfRotation = 7,
  /// `dualQuaternion`, moved towards `centerOfRotation` by `MeshView::bulgeStrengths`. Requires
  /// `MeshView::centersOfRotation`.
  bulgeControlled = 8,
};

/// All methods, in the order of `Method`.
inline constexpr std::array<Method, 9> allMethods{
    Method::linear,    Method::dualQuaternion,   Method::dualQuaternionIterative,
    Method::logMatrix, Method::sphericalBlend,   Method::quaternionTranslation,
    Method::blended,   Method::centerOfRotation, Method::bulgeControlled};

/// Whether the method requires `MeshView::centersOfRotation`.
constexpr bool needsCentersOfRotation(Method method) {
  return method == Method::centerOfRotation || method == Method::bulgeControlled;
}

/// Whether the method is meant for comparison, not for use in an engine. The library may have been
/// built without its kernels (`DERMIS_COMPARISON_METHODS`).
constexpr bool isForComparison(Method method) {
  return method == Method::dualQuaternionIterative || method == Method::logMatrix ||
         method == Method::sphericalBlend || method == Method::quaternionTranslation;
}

/// The method's name on the command line and in reports: "linear", "dual_quaternion",
/// "dual_quaternion_iterative", "log_matrix", "spherical_blend", "quaternion_translation",
/// "blended", "center_of_rotation", "bulge_controlled".
DERMIS_CORE_API std::string_view methodName(Method method);

/// The method of that name; empty if there is none.
DERMIS_CORE_API std::optional<Method> methodFromName(std::string_view name);

}  // namespace dermis
