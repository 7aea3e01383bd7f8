#include "verify/conditioning.h"

#include <algorithm>
#include <cmath>

#include "dermis/verify.h"
#include "strict_floating_point.h"

namespace dermis::reference {
namespace {

/// The upper end of the range of the contract (docs/accuracy.md).
constexpr double greatest = 0x1p100;

/// A: the factor by which dividing by |b| increases errors if |b| is less than a quarter.
double amplification(Method method, const Conditioning& conditioning) {
  return method == Method::linear ? 1 : std::max(1.0, 0.25 / conditioning.blendLength);
}

/// How well a direction is conditioned that is transformed by a 3×3.
struct Direction {
  double alignment;
  double bindRounding;     ///< in units of u
  double length;           ///< of the vector that is normalized at the end
  double shortcutsInside;  ///< how many times M is used, and so how many times its error counts
};

/// Bound for a direction that is transformed by a 3×3, or by a blended rotation, or both.
double directionBound(Method method, const Conditioning& conditioning, const Direction& direction) {
  constexpr double leastAlignment = 1e-3;
  constexpr double mostOfAlignment = 0.05;
  const double bind = floatRounding * direction.bindRounding;
  const double turned = 1.5e-6 * conditioning.turning * amplification(method, conditioning);
  if (method != Method::linear && conditioning.normalRotatedOnly) {
    return bind > mostOfAlignment ? -1 : turned + conditioning.rigidShortcut + bind;
  }
  const double given = bind + flushed / conditioning.stretch;
  const double aligned = direction.alignment * direction.length;
  if (aligned < leastAlignment || given > mostOfAlignment * aligned) return -1;
  const bool linear = method == Method::linear;
  const double matrix =
      6 * floatRounding + (linear ? 0 : direction.shortcutsInside * conditioning.rigidShortcut);
  const double after = linear ? 2 * floatRounding : turned;
  return ((matrix + given) / direction.alignment + after) / direction.length;
}

}  // namespace

double positionBound(Method method, const Conditioning& conditioning) {
  const double given = floatRounding * conditioning.positionRounding * conditioning.stretch +
                       flushed * (1 + conditioning.distance + conditioning.stretch);
  if (method == Method::linear) return 6 * floatRounding * conditioning.scale + given;
  const double amplified = amplification(method, conditioning);
  return 24 * floatRounding * amplified * amplified * (conditioning.scale + conditioning.leverage) +
         conditioning.rigidShortcut * conditioning.distance + given;
}

double normalBound(Method method, const Conditioning& conditioning) {
  return directionBound(
      method, conditioning,
      {conditioning.normalAlignment, conditioning.normalRounding, conditioning.normalLength, 2});
}

double tangentBound(Method method, const Conditioning& conditioning) {
  return directionBound(
      method, conditioning,
      {conditioning.tangentAlignment, conditioning.tangentRounding, conditioning.tangentLength, 1});
}

VertexBounds boundsOf(Method method, const Conditioning& conditioning) {
  VertexBounds bounds;
  bounds.position = positionBound(method, conditioning);
  bounds.normal = normalBound(method, conditioning);
  bounds.tangent = tangentBound(method, conditioning);
  bounds.scale = conditioning.scale;
  // Linear blending has no quaternion signs and no rotations.
  bounds.onlyFinite =
      method != Method::linear && (conditioning.signAmbiguous || conditioning.degenerate);
  bounds.undefined = conditioning.undefined;
  const double reach =
      std::max({conditioning.scale, conditioning.distance, conditioning.stretch,
                conditioning.stretch * conditioning.distance, conditioning.positionRounding});
  // No float32 input makes it infinite; a faulty reference excuses nothing.
  bounds.outOfRange =
      conditioning.directionOutOfRange || (reach > greatest && std::isfinite(reach));
  // If the bind pose nearly cancels, rounding decides whether anything is left.
  bounds.normalMayVanish = floatRounding * conditioning.normalRounding >= 1;
  bounds.tangentMayVanish = floatRounding * conditioning.tangentRounding >= 1;
  bounds.eitherHandedness = conditioning.handednessAmbiguous;
  return bounds;
}

}  // namespace dermis::reference
