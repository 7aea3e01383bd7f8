#include "dermis/method.h"

namespace dermis {

std::string_view methodName(Method method) {
  switch (method) {
    case Method::linear:
      return "linear";
    case Method::dualQuaternion:
      return "dual_quaternion";
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
