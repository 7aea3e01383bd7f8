// All of this is derived, without leaving out terms of second order. ~ marks the bank, e(x) is
// `JointError::at`, w are weights, p is the vertex in bind pose. Norms are spectral, angles between
// 0 and π.
//
// A joint C = R S of the bank is C~ = Q C + F, with Q a rotation and ‖F‖ ≤ `shape`. Along the path
// C + s Qᵀ F, with X = Rᵀ Qᵀ F and singular values σ, the derivatives of C = R S are
// - R' = R Ω, where Ω S + S Ω = X − Xᵀ. For axial vectors of skew matrices, the left side is a
//   multiplication by tr S − S, which has the eigenvalues σ2 + σ3, σ1 + σ3 and σ1 + σ2. So
//   |ω| ≤ 2 ‖X‖ / (σ2 + σ3). The integral is the angle −ln(1 − 2 shape / (σ2 + σ3)), since a σ
//   changes by ‖F‖ at most. The same holds for the path from C to C~, with `linear` instead of
//   `shape`, if σ3 stays above 0.
// - S'ij = ½ (Xij + Xji) + ½ (σi − σj) / (σi + σj) (Xij − Xji) between the eigenvectors i and j.
//   The first matrix has at most the norm ‖X‖. The second is symmetric without a diagonal, its
//   three entries have the length D ‖X‖, D = (σ1 − σ3) / (σ1 + σ3), and its norm is at most √(4/3)
//   of it.
// Q turns by 2 asin((linear + shape) / (2 σ2)) at most: (Q − 1) C is as long as that angle's chord,
// times C's part in the plane of the turn, which is at least σ2. A rotation by φ has a quaternion
// that is off by 2 sin(φ/4). If σ3 ≤ shape, C~ may be a mirror though C is none.
//
// Linear: Σ w C p is off by Σ w e(p) at most.
//
// Dual quaternions: let P = Σ w S p, x = R P + t its image by one joint, c the image by the blend.
// - x~ − x = (C~ p + t~ − C p − t) + R~ (P~ − P − (S~ − S) p) + (R~ − R)(P − S p). Let f bound it.
// - Left and right multiplication by rigid transforms changes no blend. So let c be the origin of
//   the world and P that of bind space, for the bank P~. Joints are rotations q and translations
//   y = x − c, in the pivot's hemisphere. With b = Σ w q the blend's translation is
//   vec(Σ w y q b*) / |b|², which is 0. That of the bank, with y + (x~ − x), is off by
//     Σ w f / |b~| + Σ w |y| |q~ b~* − q b*| / |b~|²,
//   and |q~ b~* − q b*| ≤ |q~ − q| |b~| + |b~ − b|.
// - |b~| ≥ |b| − |b~ − b|, and |b~| ≥ the pivot's weight.
//
// About a center of rotation z: R_b S_b (p − z) + Σ w (C z + t) is off by Σ w e(z), the turn of the
// blend and the error of S_b. R_b is turned by twice the angle between b and b~: by a chord of
// 2 |b~ − b| / |b|. `bulgeControlled` takes a part of c(z) − Σ w (C z + t) away from c(p), with c
// the image by dual quaternions. All of it leaves the above, since c(p) − c(z) = R_b S_b (p − z).
// So it is the mean of both, weighted by the strength.
//
// Directions: through a matrix M that is off by E, a tangent is off by E of M t, a normal by
// 2 σ_max E + E² of its image by the cofactors. A vector that is off by the share s of its length
// turns by asin s at most.
#include "verify/bank_error.h"

#include <algorithm>
#include <cmath>
#include <numbers>

#include <glm/geometric.hpp>
#include <glm/matrix.hpp>

#include "strict_floating_point.h"

namespace dermis::reference {
namespace {

using glm::dmat3;
using glm::dmat4;
using glm::dvec3;
using glm::dvec4;

/// Of a joint that kernels treat as rigid: half of the largest deviation that they accept
/// (docs/accuracy.md, "The shortcut").
constexpr double mostShortcut = 4.3e-6;

/// Whether the bank's matrix may be within the rounding errors of a kernel of having rank 1 or of
/// being no mirror (`polarParts`).
bool mayBeDegenerate(const Joint& joint, const dvec3& values, double shape) {
  const double largest = values[0] + shape;
  const dvec3 least = values - shape;
  bool degenerate = least[1] <= 1e-5 * largest || least[1] + least[2] < 0x1p-100;
  if (glm::determinant(joint.linear) >= 0) return degenerate;
  // The determinant's products together are at most 3 √3 σ1³, if they do not cancel.
  const double rounding = 32 * floatRounding * 5.2 * largest * largest * largest;
  const double flushing = 0x1p-100 * largest * largest * std::max(1.0, largest);
  return degenerate || least[0] * least[1] * least[2] <= rounding + flushing;
}

/// The angle of a rotation's error, if the matrix is off by this much.
double polarTurn(const dvec3& values, double error) {
  return -std::log1p(-2 * error / (values[1] + values[2]));
}

/// How far a unit vector turns that was off by this share of its length before.
double chordOf(double share) {
  return share < 1 ? 2 * std::sin(std::asin(share) / 2) : unbounded;
}

/// 0 · ∞ = 0
double times(double factor, double error) {
  return factor == 0 ? 0 : factor * error;
}

}  // namespace

JointError::JointError(const Joint& joint, const JointMatrix& inverseBindMatrix,
                       const std::array<double, 3>& bounds)
    : atJoint(bounds[0]), perDistance(bounds[1]), linear(unbounded), shape(unbounded) {
  for (glm::length_t row = 0; row < 3; ++row)
    for (glm::length_t column = 0; column < 4; ++column)
      inverseBind[column][row] = double{inverseBindMatrix.m[row][column]};
  uncertain = true;
  if (!joint.finite || !(perDistance < unbounded)) return;
  linear = perDistance * singularValues(dmat3(inverseBind)).values[0];
  shape = std::min(bounds[2], linear);
  const dvec3 values = singularValues(joint.linear).values;
  if (!(shape < values[2]) || mayBeDegenerate(joint, values, shape)) return;
  uncertain = false;
  const double deviation = (values[0] - values[2] + 2 * shape) / (values[0] + values[2]);
  scaleShear = (1 + std::sqrt(4.0 / 3) * deviation) * shape;
  double angle =
      2 * std::asin(std::min(1.0, (linear + shape) / (2 * values[1]))) + polarTurn(values, shape);
  if (linear < values[2]) angle = std::min(angle, polarTurn(values, linear));
  angle = std::min(angle, std::numbers::pi);
  turn = 2 * std::sin(angle / 2);
  quaternion = 2 * std::sin(angle / 4);
}

double JointError::at(const dvec3& point) const {
  if (!(perDistance < unbounded)) return unbounded;
  return atJoint + perDistance * glm::length(dvec3(inverseBind * dvec4(point, 1)));
}

namespace {

/// What becomes of directions that a matrix transforms.
struct Directions {
  double normal = 0, tangent = 0;                    ///< how far they may turn
  double normalAlignment = 1, tangentAlignment = 1;  ///< at least
  bool flat = false;
};

Directions transformed(const BlendedMatrix& matrix, double error, const BindVertex& bind) {
  Directions result;
  const double largest = matrix.largest;
  result.flat = matrix.isFlat(error);
  if (bind.normal != dvec3(0.0)) {
    const double length = glm::length(adjugateTranspose(matrix.m) * glm::normalize(bind.normal));
    const double off = (2 * largest + error) * error;
    const bool known = length > off && !result.flat;
    result.normal = known ? chordOf(off / length) : unbounded;
    result.normalAlignment = known ? (length - off) / (matrix.stretch * (largest + error)) : 0;
  }
  if (bind.tangent != dvec3(0.0)) {
    const double length = glm::length(matrix.m * glm::normalize(bind.tangent));
    result.tangent = length > error ? chordOf(error / length) : unbounded;
    result.tangentAlignment = length > error ? (length - error) / matrix.stretch : 0;
  }
  return result;
}

/// The errors of one vertex. `stretch` is that of the bank.
class VertexError {
 public:
  VertexError(const VertexToSkin& vertex, std::span<const JointError> errors, double stretch)
      : vertex_(vertex), errors_(errors), stretch_(stretch) {
    Conditioning ofSource;
    blend_ = blendRigid(vertex, ofSource);
    signAmbiguous_ = false;
    const Influence& pivot = pivotOf(vertex.influences);
    for (const Influence& influence : vertex.influences) {
      const JointError& error = errors[influence.joint];
      scaleShear_ += influence.weight * error.scaleShear;
      quaternion_ += influence.weight * error.quaternion;
      if (influence.joint == pivot.joint) continue;
      const double dot = glm::dot(vertex.joints[influence.joint].rigid.real,
                                  vertex.joints[pivot.joint].rigid.real);
      signAmbiguous_ |= std::abs(dot) < 1e-5 + error.quaternion + errors[pivot.joint].quaternion;
    }
    blendLength_ = std::max(ofSource.blendLength - quaternion_, pivot.weight);
    turn_ = std::min(2.0, 2 * quaternion_ / ofSource.blendLength);
  }

  bool signAmbiguous() const { return signAmbiguous_; }
  double blendLength() const { return blendLength_; }

  double linearPosition(const dvec3& point) const {
    double sum = 0;
    for (const Influence& influence : vertex_.influences)
      sum += influence.weight * errors_[influence.joint].at(point);
    return sum;
  }

  double dualQuaternionPosition() const {
    const dvec3& p = vertex_.bind.position;
    const dvec3 scaled = blend_.scaleShear * p, image = transformPoint(blend_.rigid, scaled);
    double sum = 0;
    for (const Influence& influence : vertex_.influences) {
      const double weight = influence.weight;
      const Joint& joint = vertex_.joints[influence.joint];
      const JointError& error = errors_[influence.joint];
      const double others = scaleShear_ + (1 - 2 * weight) * error.scaleShear;
      const double moved = error.at(p) + others * glm::length(p) +
                           error.turn * glm::length(scaled - joint.scaleShear * p);
      const double apart = glm::length(transformPoint(joint.rigid, scaled) - image);
      sum += weight * (moved + apart * (error.quaternion + quaternion_ / blendLength_));
    }
    return sum / blendLength_;
  }

  double centeredPosition() const {
    const dvec3 arm = vertex_.bind.position - vertex_.inputs.center;
    return linearPosition(vertex_.inputs.center) + scaleShear_ * glm::length(arm) +
           turn_ * glm::length(blend_.scaleShear * arm);
  }

  Directions linearDirections() const {
    dmat3 matrix(0.0);
    double error = 0;
    for (const Influence& influence : vertex_.influences) {
      matrix += influence.weight * vertex_.joints[influence.joint].linear;
      error += influence.weight * errors_[influence.joint].linear;
    }
    return transformed(BlendedMatrix(matrix, stretch_), error, vertex_.bind);
  }

  Directions rotatedDirections() const {
    Directions result =
        transformed(BlendedMatrix(blend_.scaleShear, stretch_), scaleShear_, vertex_.bind);
    if (vertex_.bind.normal != dvec3(0.0)) result.normal += turn_;
    if (vertex_.bind.tangent != dvec3(0.0)) result.tangent += turn_;
    return result;
  }

 private:
  const VertexToSkin& vertex_;
  std::span<const JointError> errors_;
  double stretch_;
  RigidBlend blend_;
  double scaleShear_ = 0;   ///< of the blended S
  double quaternion_ = 0;   ///< of b
  double blendLength_ = 1;  ///< |b| at least
  double turn_ = 0;         ///< of the blended rotation
  bool signAmbiguous_ = false;
};

/// The mean of two directions, which is normalized: its `length` in the source becomes that of the
/// bank.
double blendedDirection(double share, double linear, double rotated, double& length) {
  const double off = times(1 - share, linear) + times(share, rotated);
  const double turned = chordOf(off / length);
  length = std::max(length - off, 0.0);
  return turned;
}

}  // namespace

BankError bankError(const VertexToSkin& vertex, std::span<const JointError> errors, Method method,
                    Conditioning& conditioning) {
  const dvec3& p = vertex.bind.position;
  double translation = 0, shape = 0;
  for (const Influence& influence : vertex.influences) {
    const JointError& error = errors[influence.joint];
    translation = std::max(translation, error.at(dvec3(0.0)));
    shape = std::max(shape, error.shape);
    conditioning.degenerate |= error.uncertain;
    const double distance = vertex.joints[influence.joint].distanceFromRotation + error.shape;
    conditioning.rigidShortcut =
        std::max(conditioning.rigidShortcut, std::min(distance, mostShortcut));
  }
  conditioning.stretch += shape;
  conditioning.scale += translation + shape * glm::length(p);
  if (needsCentersOfRotation(method))
    conditioning.leverage += 2 * shape * glm::length(vertex.inputs.center);
  conditioning.normalRotatedOnly = false;  // whether it is, is known of the bank only

  const VertexError error(vertex, errors, conditioning.stretch);
  BankError result;
  Directions directions;
  if (method == Method::linear) {
    result.position = error.linearPosition(p);
    directions = error.linearDirections();
  } else {
    conditioning.signAmbiguous |= error.signAmbiguous();
    conditioning.blendLength = error.blendLength();
    result.position = method == Method::centerOfRotation ? error.centeredPosition()
                                                         : error.dualQuaternionPosition();
    directions = error.rotatedDirections();
  }
  if (method == Method::bulgeControlled) {
    const double strength = vertex.inputs.bulgeStrength;
    result.position = (1 - strength) * result.position + strength * error.centeredPosition();
  }
  if (method == Method::blended) {
    const double share = vertex.inputs.dualQuaternionWeight;
    result.position = (1 - share) * error.linearPosition(p) + share * result.position;
    const Directions linear = error.linearDirections();
    directions.normal =
        blendedDirection(share, linear.normal, directions.normal, conditioning.normalLength);
    directions.tangent =
        blendedDirection(share, linear.tangent, directions.tangent, conditioning.tangentLength);
    directions.normalAlignment = std::min(directions.normalAlignment, linear.normalAlignment);
    directions.tangentAlignment = std::min(directions.tangentAlignment, linear.tangentAlignment);
  }
  result.normal = directions.normal;
  result.tangent = directions.tangent;
  conditioning.normalAlignment = directions.normalAlignment;
  conditioning.tangentAlignment = directions.tangentAlignment;
  conditioning.handednessAmbiguous = directions.flat;
  return result;
}

}  // namespace dermis::reference
