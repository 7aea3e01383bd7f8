// Joints that are rigid exactly, in double precision: what a method makes of them, past the
// rounding of palettes to float32. The reference takes joints apart itself; here they come taken
// apart.
#pragma once

#include <span>
#include <vector>

#include "by_hand.h"
#include "dual_quat.h"
#include "reference_rig.h"
#include "verify/methods.h"

namespace dermis::test {

/// ½ (0, t) q by its components.
inline DualQuatd rigidOf(const glm::dquat& q, const glm::dvec3& t) {
  const glm::dvec3 v(q.x, q.y, q.z);
  const glm::dvec3 d = 0.5 * (q.w * t + glm::cross(t, v));
  return {q, glm::dquat(-0.5 * glm::dot(t, v), d.x, d.y, d.z)};
}

/// As the reference has them.
inline reference::Rigid toReference(const DualQuatd& q) {
  return {{q.real.x, q.real.y, q.real.z, q.real.w}, {q.dual.x, q.dual.y, q.dual.z, q.dual.w}};
}
inline DualQuatd fromReference(const reference::Rigid& q) {
  return {{q.real.w, q.real.x, q.real.y, q.real.z}, {q.dual.w, q.dual.x, q.dual.y, q.dual.z}};
}

inline glm::dquat turnAbout(const glm::dvec3& axis, double angle) {
  const glm::dvec3 v = std::sin(angle / 2) * axis;
  return {std::cos(angle / 2), v.x, v.y, v.z};
}

/// Uniform over all rotations, in either sign.
inline glm::dquat randomTurn(RigRandom& random) {
  for (;;) {
    const glm::dquat q(random.between(-1, 1), random.between(-1, 1), random.between(-1, 1),
                       random.between(-1, 1));
    const double square = glm::dot(q, q);
    if (square > 0.01 && square <= 1) return q * (1 / std::sqrt(square));
  }
}

inline DualQuatd randomRigid(RigRandom& random, double reach = 1) {
  const glm::dquat q = randomTurn(random);
  return rigidOf(q, random.vector(reach));
}

inline std::vector<DualQuatd> randomRigids(RigRandom& random, std::size_t count) {
  std::vector<DualQuatd> rigids;
  while (rigids.size() < count) rigids.push_back(randomRigid(random));
  return rigids;
}

inline std::vector<double> randomWeights(RigRandom& random, std::size_t count) {
  std::vector<double> weights(count);
  double sum = 0;
  for (double& weight : weights) sum += weight = random.between(0.05, 1);
  for (double& weight : weights) weight /= sum;
  return weights;
}

/// A turn and a shift that a method made.
struct Motion3 {
  glm::dmat3 rotation;
  glm::dvec3 translation;
};

/// One vertex' joints and weights, by rising joint; the weights sum to 1.
class ExactRig {
 public:
  ExactRig(std::span<const DualQuatd> joints, std::span<const double> weights) {
    for (std::uint32_t i = 0; i < joints.size(); ++i) {
      reference::Joint& joint = joints_.emplace_back();
      const glm::dmat4x3 matrix = toMatrix(joints[i]);
      joint.linear = glm::dmat3(matrix[0], matrix[1], matrix[2]);
      joint.translation = translationOf(joints[i]);
      joint.rigid = toReference(joints[i]);
      joint.scaleShear = glm::dmat3(1.0);
      joint.rigidForKernels = true;
      influences_.push_back({i, weights[i], weights[i]});
    }
  }

  glm::dvec3 move(const glm::dvec3& p, Method method, const reference::MethodInputs& inputs = {}) {
    reference::VertexToSkin vertex{joints_, influences_, {}, inputs};
    vertex.bind.position = p;
    conditioning = {};
    conditioning.stretch = conditioning.scale = 1;
    return reference::skinVertex(vertex, method, conditioning).position;
  }
  /// Of points that have these weights.
  Motion3 motion(Method method, const reference::MethodInputs& inputs = {}) {
    Motion3 motion;
    motion.translation = move(glm::dvec3(0.0), method, inputs);
    for (int i = 0; i < 3; ++i) {
      glm::dvec3 e(0.0);
      e[i] = 1;
      motion.rotation[i] = move(e, method, inputs) - motion.translation;
    }
    return motion;
  }

  std::span<const reference::Joint> joints() const { return joints_; }
  std::span<const reference::Influence> influences() const { return influences_; }

  reference::Conditioning conditioning;  ///< of the last move

 private:
  std::vector<reference::Joint> joints_;
  std::vector<reference::Influence> influences_;
};

inline std::vector<DualQuatd> movedBy(const DualQuatd& left, std::span<const DualQuatd> joints,
                                      const DualQuatd& right) {
  std::vector<DualQuatd> moved;
  for (const DualQuatd& joint : joints) moved.push_back(left * joint * right);
  return moved;
}

}  // namespace dermis::test
