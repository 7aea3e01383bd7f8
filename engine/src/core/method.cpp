#include "dermis/layout.h"

#include "text.h"

namespace dermis {

std::string_view methodName(Method method) {
  constexpr const char* names[] = {"linear",     "dual_quaternion",    "dual_quaternion_iterative",
                                   "log_matrix", "spherical_blend",    "quaternion_translation",
                                   "blended",    "center_of_rotation", "bulge_controlled"};
  static_assert(std::size(names) == std::size_t(Method::bulgeControlled) + 1);
  return nameIn(names, method);
}

std::optional<Method> methodFromName(std::string_view name) {
  for (const Method method : allMethods) {
    if (methodName(method) == name) return method;
  }
  return std::nullopt;
}

}  // namespace dermis
