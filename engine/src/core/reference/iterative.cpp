#include <algorithm>
#include <cmath>

#include <glm/geometric.hpp>

#include "methods.h"

namespace dermis::reference {
namespace {

constexpr int mostSteps = 20;

/// The square of a screw's size; the dual part is measured by how far the joints reach.
double squareOf(const Rigid& screw, double reach) {
  const double dual = glm::dot(screw.dual, screw.dual);
  return glm::dot(screw.real, screw.real) + (reach > 0 ? dual / (reach * reach) : 0);
}

}  // namespace

Rigid iterate(const VertexToSkin& vertex, Rigid start, Conditioning& conditioning) {
  const glm::dvec4 pivot = vertex.joints[pivotOf(vertex.influences).joint].rigid.real;
  Rigid b = normalize(start);
  double reach = 0, before = 0, slowest = 0;
  for (const Influence& influence : vertex.influences) {
    const glm::dvec4& dual = vertex.joints[influence.joint].rigid.dual;
    reach = std::max(reach, std::sqrt(glm::dot(dual, dual)));
  }
  for (int step = 0; step < mostSteps; ++step) {
    Rigid mean{glm::dvec4(0.0), glm::dvec4(0.0)};
    for (const Influence& influence : vertex.influences) {
      Rigid joint = vertex.joints[influence.joint].rigid;
      if (glm::dot(joint.real, pivot) < 0) joint = -joint;
      const Rigid difference = normalize(conjugate(b) * joint);
      // Near a full turn the axis, and with it the step, is a matter of rounding.
      conditioning.signAmbiguous |= difference.real.w < -0.9;
      mean = mean + log(difference) * influence.weight;
    }
    b = normalize(b * exp(mean));
    const double size = std::sqrt(squareOf(mean, reach));
    if (before > 0 && size > 1e-9) slowest = std::max(slowest, size / before);
    before = size;
    if (size <= 1e-15) break;
  }
  // Errors of one step live on in the next, by the factor by which steps shrink.
  conditioning.turning = 1 / (1 - std::min(slowest, 1 - 1.0 / mostSteps));
  conditioning.leverage = (conditioning.turning - 1) * conditioning.scale;
  return b;
}

}  // namespace dermis::reference
