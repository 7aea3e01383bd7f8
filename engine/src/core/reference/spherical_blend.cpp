#include <algorithm>
#include <cmath>
#include <vector>

#include <glm/geometric.hpp>
#include <glm/matrix.hpp>

#include "decompose.h"
#include "methods.h"

namespace dermis::reference {
namespace {

using glm::dmat3;
using glm::dvec3;

/// In directions in which the rotations differ by less, the centre stays where it is: 0.
constexpr double leastSingularValue = 1e-3;
/// What packing drops.
constexpr double leastWeight = 0x1p-49;

}  // namespace

dvec3 sphericalCenter(const VertexToSkin& vertex, Conditioning& conditioning) {
  struct Turned {
    dmat3 rotation;
    dvec3 translation;
  };
  std::vector<Turned> joints;
  for (const Influence& influence : vertex.influences) {
    if (influence.weight < leastWeight) continue;
    const Joint& joint = vertex.joints[influence.joint];
    joints.push_back({matrixOf(joint.rigid.real), joint.translation});
  }
  // The normal equations of (R_a − R_b) r = t_b − t_a over all pairs.
  dmat3 square(0.0);
  dvec3 right(0.0);
  double apart = 0;
  for (std::size_t a = 0; a < joints.size(); ++a) {
    for (std::size_t b = a + 1; b < joints.size(); ++b) {
      const dmat3 difference = joints[a].rotation - joints[b].rotation;
      const dvec3 shift = joints[b].translation - joints[a].translation;
      square += glm::transpose(difference) * difference;
      right += glm::transpose(difference) * shift;
      apart = std::max(apart, glm::length(shift));
    }
  }
  // Pairs count as many times as there are joints what differences from the mean would give.
  const auto count = static_cast<double>(joints.size());
  const SingularValues parts = singularValues(square);
  dvec3 center(0.0);
  double least = HUGE_VAL;
  for (int i = 0; i < 3; ++i) {
    const double singularValue = std::sqrt(parts.values[i] / count);
    conditioning.signAmbiguous |= std::abs(singularValue - leastSingularValue) < 1e-5;
    if (singularValue <= leastSingularValue) continue;
    least = std::min(least, singularValue);
    center += parts.right[i] * (glm::dot(parts.right[i], right) / parts.values[i]);
  }
  // Rotations are known to a rounding; where they all but agree, that moves the centre far.
  conditioning.leverage = glm::length(center) + (std::isfinite(least) ? apart / least : 0);
  return center;
}

}  // namespace dermis::reference
