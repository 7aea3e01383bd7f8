// The rules by which the joints of a vertex are blended.
#pragma once

#include <array>
#include <cstdint>
#include <optional>
#include <string_view>

#include "dermis/export.h"

namespace dermis {

/// All take the same mesh and pose. Those that blend rotations do it in two phases where joints
/// scale or shear: the scale/shear parts are blended linearly and applied in bind space, then the
/// rigid parts are blended by the rule. docs/methods.md has a page on each.
enum class Method : std::uint8_t {
  /// Linear blend skinning: the joint matrices are blended. Collapses where joints twist.
  linear,
  /// Dual-quaternion linear blending, DLB (Kavan et al. 2007, section 4). Bulges where joints bend.
  dualQuaternion,
  /// DIB (Kavan et al. 2008): DLB refined towards the screw motion "in the middle" of the joints',
  /// by at most 20 steps. For comparison.
  dualQuaternionIterative,
  /// The logarithms of the rigid parts are blended as matrices (Cordier and Magnenat-Thalmann 2005,
  /// Alexa 2002). May go the long way round. For comparison.
  logMatrix,
  /// Blended quaternions about a centre of rotation that is found for each vertex and pose (Kavan
  /// and Žára 2005). For comparison.
  sphericalBlend,
  /// Quaternions and translations, each blended on its own (Hejl 2004). Tears where a vertex has
  /// joints that do not meet. For comparison.
  quaternionTranslation,
  /// Between `linear` and `dualQuaternion`, by `MeshView::dualQuaternionWeights`.
  blended,
  /// Blended quaternions about centres of rotation that are found once, at import (Le and Hodgins
  /// 2016): does not collapse, and bulges less. Needs `MeshView::centersOfRotation`.
  centerOfRotation,
  /// `dualQuaternion` drawn towards `centerOfRotation` by `MeshView::bulgeStrengths`. Needs
  /// `MeshView::centersOfRotation`.
  bulgeControlled,
};

inline constexpr std::array<Method, 9> allMethods{
    Method::linear,    Method::dualQuaternion,   Method::dualQuaternionIterative,
    Method::logMatrix, Method::sphericalBlend,   Method::quaternionTranslation,
    Method::blended,   Method::centerOfRotation, Method::bulgeControlled};

/// Whether meshes need `MeshView::centersOfRotation` for it.
constexpr bool needsCentersOfRotation(Method method) {
  return method == Method::centerOfRotation || method == Method::bulgeControlled;
}

/// Whether it is there to be compared with, not for every day: its kernels may have been left out
/// of the library (`DERMIS_COMPARISON_METHODS`).
constexpr bool isForComparison(Method method) {
  return method == Method::dualQuaternionIterative || method == Method::logMatrix ||
         method == Method::sphericalBlend || method == Method::quaternionTranslation;
}

/// The method's name on the command line and in reports: "linear", "dual_quaternion",
/// "dual_quaternion_iterative", "log_matrix", "spherical_blend", "quaternion_translation",
/// "blended", "center_of_rotation", "bulge_controlled".
DERMIS_CORE_API std::string_view methodName(Method method);

/// The method of that name, or nothing.
DERMIS_CORE_API std::optional<Method> methodFromName(std::string_view name);

}  // namespace dermis
