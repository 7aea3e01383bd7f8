#include "dermis/layout.h"

namespace dermis {

std::string_view methodName(Method method) {
  switch (method) {
    case Method::linear:
      return "linear";
    case Method::dualQuaternion:
      return "dual_quaternion";
    case Method::dualQuaternionIterative:
      return "dual_quaternion_iterative";
    case Method::logMatrix:
      return "log_matrix";
    case Method::sphericalBlend:
      return "spherical_blend";
    case Method::quaternionTranslation:
      return "quaternion_translation";
    case Method::blended:
      return "blended";
    case Method::centerOfRotation:
      return "center_of_rotation";
    case Method::bulgeControlled:
      return "bulge_controlled";
  }
  return "unknown";
}

std::optional<Method> methodFromName(std::string_view name) {
  for (const Method method : allMethods) {
    if (methodName(method) == name) return method;
  }
  return std::nullopt;
}

}  // namespace dermis
