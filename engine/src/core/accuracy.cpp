#include "dermis/accuracy.h"

#include <algorithm>
#include <cmath>
#include <cstring>

namespace dermis {
namespace {

reference::Double3 readVector(const AttributeView& view, std::size_t element) {
  float value[3];
  std::memcpy(value, static_cast<const unsigned char*>(view.data) + element * view.stride,
              sizeof(value));
  return {value[0], value[1], value[2]};
}

double distance(const reference::Double3& a, const reference::Double3& b) {
  return std::hypot(a[0] - b[0], a[1] - b[1], a[2] - b[2]);
}

double length(const reference::Double3& a) {
  return std::hypot(a[0], a[1], a[2]);
}

bool isFinite(const reference::Double3& a) {
  return std::isfinite(a[0]) && std::isfinite(a[1]) && std::isfinite(a[2]);
}

bool isThreeFloats(const AttributeView& view, std::size_t count) {
  return view.count == count && view.type == ComponentType::float32 && view.components >= 3 &&
         view.stride >= 12;
}

/// error ÷ bound, where a bound of 0 allows no error.
double share(double error, double bound) {
  if (error == 0) return 0;
  return bound > 0 ? error / bound : HUGE_VAL;
}

}  // namespace

double positionBound(Method method, const reference::Conditioning& conditioning) {
  if (method == Method::linear) return 6 * floatRounding * conditioning.scale;
  return 24 * floatRounding * conditioning.scale +
         std::min(4e-6, conditioning.rigidShortcut) * conditioning.distance;
}

double normalBound(Method method, const reference::Conditioning& conditioning) {
  constexpr double turning = 1.5e-6;
  const bool throughMatrix = method == Method::linear || !conditioning.normalRotatedOnly;
  if (!throughMatrix) return turning + conditioning.rigidShortcut;
  if (conditioning.normalAlignment < 1e-3) return -1;
  const double matrix = 6 * floatRounding / conditioning.normalAlignment;
  return method == Method::linear ? matrix : matrix + turning + conditioning.rigidShortcut;
}

Result<Comparison> compare(const reference::SkinnedMesh& expected, const AttributeView& positions,
                           const AttributeView& normals, Method method) {
  const std::size_t count = expected.positions.size();
  const bool withNormals = normals && !expected.normals.empty();
  if (!isThreeFloats(positions, count) || (withNormals && !isThreeFloats(normals, count))) {
    return Error{ErrorCode::invalidArgument,
                 "what is compared must have three floats for each of the reference's " +
                     std::to_string(count) + " vertices"};
  }

  Comparison result;
  const auto fail = [&](std::size_t vertex) {
    if (result.failures == 0) result.firstFailure = static_cast<std::uint32_t>(vertex);
    ++result.failures;
  };
  for (std::size_t vertex = 0; vertex < count; ++vertex) {
    const reference::Conditioning& conditioning = expected.conditioning[vertex];
    if (!isFinite(expected.positions[vertex])) {
      ++result.skipped;
      continue;
    }
    const reference::Double3 position = readVector(positions, vertex);
    const reference::Double3 normal =
        withNormals ? readVector(normals, vertex) : reference::Double3{};
    if (!isFinite(position) || !isFinite(normal)) {
      fail(vertex);
      continue;
    }
    const bool arbitrary =
        method != Method::linear && (conditioning.signAmbiguous || conditioning.degenerate);
    if (arbitrary) {
      ++result.onlyFinite;
      continue;
    }
    ++result.compared;
    const double error = distance(position, expected.positions[vertex]);
    const double positionShare = share(error, positionBound(method, conditioning));
    result.largestPositionError = std::max(result.largestPositionError, error);
    if (positionShare > result.worstPosition) {
      result.worstPosition = positionShare;
      result.worstPositionVertex = static_cast<std::uint32_t>(vertex);
    }
    double normalShare = 0;
    if (withNormals) {
      const double bound = normalBound(method, conditioning);
      const double expectedLength = length(expected.normals[vertex]);
      if (bound < 0) {
        // Only its length can be said.
        normalShare = std::abs(length(normal) - (expectedLength > 0 ? 1 : 0)) / 1e-6;
      } else if (expectedLength > 0 || length(normal) > 0) {
        normalShare = share(distance(normal, expected.normals[vertex]), bound);
      }
      if (normalShare > result.worstNormal) {
        result.worstNormal = normalShare;
        result.worstNormalVertex = static_cast<std::uint32_t>(vertex);
      }
    }
    if (positionShare > 1 || normalShare > 1) fail(vertex);
  }
  return result;
}

}  // namespace dermis
