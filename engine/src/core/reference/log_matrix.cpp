#include <cmath>

#include <glm/geometric.hpp>

#include "methods.h"

namespace dermis::reference {

/// A rigid transform's matrix logarithm is that of its dual quaternion in another dress, and so is
/// the exponential: sums of them are sums of these.
Rigid blendLogarithms(const VertexToSkin& vertex, Conditioning& conditioning) {
  Rigid mean{glm::dvec4(0.0), glm::dvec4(0.0)};
  for (const Influence& influence : vertex.influences) {
    Rigid joint = vertex.joints[influence.joint].rigid;
    // At half a turn the logarithm jumps to the opposite one.
    conditioning.signAmbiguous |= vertex.influences.size() > 1 && std::abs(joint.real.w) < 1e-5;
    if (joint.real.w < 0) joint = -joint;
    mean = mean + log(normalize(joint)) * influence.weight;
  }
  return exp(mean);
}

}  // namespace dermis::reference
