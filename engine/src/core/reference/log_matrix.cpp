#include <cmath>

#include "methods.h"

namespace dermis::reference {

/// A rigid transform's matrix logarithm is that of its dual quaternion in another dress, and so is
/// the exponential: sums of them are sums of these.
DualQuatd blendLogarithms(const VertexToSkin& vertex, Conditioning& conditioning) {
  DualQuatd mean{glm::dquat(0, 0, 0, 0), glm::dquat(0, 0, 0, 0)};
  for (const Influence& influence : vertex.influences) {
    DualQuatd joint = vertex.joints[influence.joint].rigid;
    // At half a turn the logarithm jumps to the opposite one.
    conditioning.signAmbiguous |= vertex.influences.size() > 1 && std::abs(joint.real.w) < 1e-5;
    if (joint.real.w < 0) joint = -joint;
    mean = mean + log(normalize(joint)) * influence.weight;
  }
  return exp(mean);
}

}  // namespace dermis::reference
