#include <algorithm>
#include <cassert>
#include <cmath>
#include <vector>

#include <glm/geometric.hpp>
#include <glm/matrix.hpp>

#include "strict_floating_point.h"
#include "verify/joint.h"
#include "verify/methods.h"

namespace dermis::reference {
namespace {

using glm::dmat3;
using glm::dvec3;
using glm::dvec4;

/// Transforms a normal by the inverse transpose of m, without normalizing. Finite even if m is
/// singular.
dvec3 transformNormal(const BlendedMatrix& matrix, const dvec3& normal,
                      Conditioning& conditioning) {
  const auto& [m, determinant, largest, stretch] = matrix;
  const dvec3 result = adjugateTranspose(m) * normal;
  const double inputLength = glm::length(normal);
  if (inputLength == 0) return result;  // stays zero, exactly
  conditioning.normalAlignment =
      largest > 0 ? glm::length(result) / (largest * stretch * inputLength) : 0;
  // If rounding decides the sign of the determinant, it also decides the sign of the normal.
  if (matrix.isFlat()) conditioning.normalAlignment = 0;
  if (glm::length(result) == 0) return normal;  // rank 1 or 0: any direction is valid
  return determinant < 0 ? -result : result;
}

/// Transforms a tangent by the same matrix as positions, without normalizing.
dvec3 transformTangent(const BlendedMatrix& matrix, const dvec3& tangent,
                       Conditioning& conditioning) {
  const dvec3 result = matrix.m * tangent;
  const double inputLength = glm::length(tangent);
  if (inputLength == 0) return result;  // stays zero, exactly
  conditioning.tangentAlignment =
      matrix.stretch > 0 ? glm::length(result) / (matrix.stretch * inputLength) : 0;
  return glm::length(result) == 0 ? tangent : result;
}

/// A mirror inverts a tangent frame's handedness.
double transformHandedness(const BlendedMatrix& matrix, double handedness,
                           Conditioning& conditioning) {
  conditioning.handednessAmbiguous = matrix.isFlat();
  return matrix.determinant < 0 ? -handedness : handedness;
}

}  // namespace

BlendedMatrix::BlendedMatrix(const dmat3& matrix, double largestOfJoints)
    : m(matrix),
      determinant(glm::determinant(matrix)),
      largest(singularValues(matrix).values[0]),
      stretch(largestOfJoints) {}

bool BlendedMatrix::isFlat(double error) const {
  return std::abs(determinant) <= (error + 1e-5 * stretch + flushed) * largest * largest;
}

BindVertex transformDirections(const BlendedMatrix& matrix, const BindVertex& vertex,
                               Conditioning& conditioning) {
  return {vertex.position, unitOrZero(transformNormal(matrix, vertex.normal, conditioning)),
          unitOrZero(transformTangent(matrix, vertex.tangent, conditioning)),
          transformHandedness(matrix, vertex.handedness, conditioning)};
}

dmat3 adjugateTranspose(const dmat3& m) {
  // Each column is the cross product of the other two.
  return dmat3(glm::cross(m[1], m[2]), glm::cross(m[2], m[0]), glm::cross(m[0], m[1]));
}

dvec3 unitOrZero(const dvec3& v) {
  const double length = glm::length(v);
  return length > 0 ? v / length : dvec3(0.0);
}

// -- Iterative blending (DIB).

namespace {

constexpr int mostSteps = 20;

/// The squared size of a screw. Its dual part is measured relative to the reach of the joints.
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
      // Near a full turn, rounding decides the axis, and with it the step.
      conditioning.signAmbiguous |= difference.real.w < -0.9;
      mean = mean + log(difference) * influence.weight;
    }
    b = normalize(b * exp(mean));
    const double size = std::sqrt(squareOf(mean, reach));
    if (before > 0 && size > 1e-9) slowest = std::max(slowest, size / before);
    before = size;
    if (size <= 1e-15) break;
  }
  // The error of one step remains in the next, reduced by the factor by which steps shrink.
  conditioning.turning = 1 / (1 - std::min(slowest, 1 - 1.0 / mostSteps));
  conditioning.leverage = (conditioning.turning - 1) * conditioning.scale;
  return b;
}

/// The matrix logarithm of a rigid transform is the logarithm of its dual quaternion in another
/// representation. The same holds for the exponential, and so for sums of logarithms.
Rigid blendLogarithms(const VertexToSkin& vertex, Conditioning& conditioning) {
  Rigid mean{glm::dvec4(0.0), glm::dvec4(0.0)};
  for (const Influence& influence : vertex.influences) {
    Rigid joint = vertex.joints[influence.joint].rigid;
    // At half a turn the logarithm jumps to its opposite.
    conditioning.signAmbiguous |= vertex.influences.size() > 1 && std::abs(joint.real.w) < 1e-5;
    if (joint.real.w < 0) joint = -joint;
    mean = mean + log(normalize(joint)) * influence.weight;
  }
  return exp(mean);
}

// -- Spherical blending.

namespace {

/// In directions in which rotations differ by less, the center stays at 0.
constexpr double leastSingularValue = 1e-3;
/// Packing drops weights below the first. Those below the second it may drop: the sum of all is
/// rounded to 1, for which the strongest weight is off by 2^-25 at most.
constexpr double leastWeight = 0x1p-49, leastKeptWeight = 0x1p-24;

}  // namespace

dvec3 sphericalCenter(const VertexToSkin& vertex, Conditioning& conditioning) {
  struct Turned {
    dmat3 rotation;
    dvec3 translation;
  };
  std::vector<Turned> joints;
  for (const Influence& influence : vertex.influences) {
    if (influence.weight < leastWeight) continue;
    conditioning.signAmbiguous |= influence.weight < leastKeptWeight;
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
  // Sums over pairs are those over differences from the mean, times the number of joints.
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
  // Rotations have rounding errors; if they are nearly equal, these errors move the center far.
  conditioning.leverage = glm::length(center) + (std::isfinite(least) ? apart / least : 0);
  return center;
}

// -- All methods.

namespace {

BindVertex skinLinear(const VertexToSkin& vertex, Conditioning& conditioning) {
  dmat3 linear(0.0);
  dvec3 translation(0.0);
  for (const Influence& influence : vertex.influences) {
    linear += influence.weight * vertex.joints[influence.joint].linear;
    translation += influence.weight * vertex.joints[influence.joint].translation;
  }
  conditioning.normalRotatedOnly = false;
  BindVertex skinned =
      transformDirections(BlendedMatrix(linear, conditioning.stretch), vertex.bind, conditioning);
  skinned.position = linear * vertex.bind.position + translation;
  return skinned;
}

BindVertex skinDualQuaternion(const VertexToSkin& vertex, Conditioning& conditioning) {
  const RigidBlend blend = blendRigid(vertex, conditioning);
  return moveRigidly(vertex, blend.scaleShear, blend.rigid.real, translationOf(blend.rigid),
                     conditioning);
}

BindVertex skinIterative(const VertexToSkin& vertex, Conditioning& conditioning) {
  const RigidBlend blend = blendRigid(vertex, conditioning);
  const Rigid rigid = iterate(vertex, blend.rigid, conditioning);
  return moveRigidly(vertex, blend.scaleShear, rigid.real, translationOf(rigid), conditioning);
}

BindVertex skinLogMatrix(const VertexToSkin& vertex, Conditioning& conditioning) {
  const bool signs = conditioning.signAmbiguous;  // log-matrix has no pivot
  const RigidBlend blend = blendRigid(vertex, conditioning);
  conditioning.signAmbiguous = signs;
  conditioning.blendLength = 1;
  const Rigid rigid = blendLogarithms(vertex, conditioning);
  return moveRigidly(vertex, blend.scaleShear, rigid.real, translationOf(rigid), conditioning);
}

/// Σ w (R S p + t), or without S if not `withScale`.
dvec3 linearPoint(const VertexToSkin& vertex, const dvec3& point, bool withScale) {
  dvec3 sum(0.0);
  for (const Influence& influence : vertex.influences) {
    const Joint& joint = vertex.joints[influence.joint];
    sum += influence.weight * (withScale ? joint.linear * point + joint.translation
                                         : transformPoint(joint.rigid, point));
  }
  return sum;
}

BindVertex skinSpherical(const VertexToSkin& vertex, Conditioning& conditioning) {
  const RigidBlend blend = blendRigid(vertex, conditioning);
  const dvec3 center = sphericalCenter(vertex, conditioning);
  // Q (p − r) + Σ w (R r + t)
  const dvec3 translation = linearPoint(vertex, center, false) - rotate(blend.rigid.real, center);
  return moveRigidly(vertex, blend.scaleShear, blend.rigid.real, translation, conditioning);
}

BindVertex skinQuaternionTranslation(const VertexToSkin& vertex, Conditioning& conditioning) {
  const RigidBlend blend = blendRigid(vertex, conditioning);
  dvec3 translation(0.0);
  for (const Influence& influence : vertex.influences)
    translation += influence.weight * vertex.joints[influence.joint].translation;
  return moveRigidly(vertex, blend.scaleShear, blend.rigid.real, translation, conditioning);
}

BindVertex skinBlended(const VertexToSkin& vertex, Conditioning& conditioning) {
  Conditioning linearConditioning = conditioning;
  const BindVertex linear = skinLinear(vertex, linearConditioning);
  const BindVertex turned = skinDualQuaternion(vertex, conditioning);
  const double share = vertex.inputs.dualQuaternionWeight;
  const dvec3 normal = (1 - share) * linear.normal + share * turned.normal;
  const dvec3 tangent = (1 - share) * linear.tangent + share * turned.tangent;
  // The more two unit vectors cancel, the less accurate is the direction of their sum.
  const auto lengthOf = [](const dvec3& sum, const dvec3& part) {
    return part == dvec3(0.0) ? 1 : glm::length(sum);
  };
  conditioning.normalLength = lengthOf(normal, turned.normal);
  conditioning.tangentLength = lengthOf(tangent, turned.tangent);
  conditioning.normalRotatedOnly = false;
  conditioning.normalAlignment =
      std::min(conditioning.normalAlignment, linearConditioning.normalAlignment);
  conditioning.tangentAlignment =
      std::min(conditioning.tangentAlignment, linearConditioning.tangentAlignment);
  return {(1 - share) * linear.position + share * turned.position, unitOrZero(normal),
          unitOrZero(tangent), turned.handedness};
}

/// The distance of the center has the same effect as that of the vertex's position.
void conditionCenter(const VertexToSkin& vertex, Conditioning& conditioning) {
  const double distance = 2 * glm::length(vertex.inputs.center);
  conditioning.leverage = conditioning.stretch * distance;
  conditioning.distance += distance;
}

/// Le and Hodgins 2016: Q S (v − c) + Σ w C c.
BindVertex skinCenterOfRotation(const VertexToSkin& vertex, Conditioning& conditioning) {
  const dvec3& center = vertex.inputs.center;
  const RigidBlend blend = blendRigid(vertex, conditioning);
  conditionCenter(vertex, conditioning);
  const dvec3 translation =
      linearPoint(vertex, center, true) - rotate(blend.rigid.real, blend.scaleShear * center);
  return moveRigidly(vertex, blend.scaleShear, blend.rigid.real, translation, conditioning);
}

/// Linear blending and dual quaternions transform the center differently; a part of the difference
/// is added.
BindVertex skinBulgeControlled(const VertexToSkin& vertex, Conditioning& conditioning) {
  const dvec3& center = vertex.inputs.center;
  const RigidBlend blend = blendRigid(vertex, conditioning);
  conditionCenter(vertex, conditioning);
  const dvec3 bulge =
      transformPoint(blend.rigid, blend.scaleShear * center) - linearPoint(vertex, center, true);
  return moveRigidly(vertex, blend.scaleShear, blend.rigid.real,
                     translationOf(blend.rigid) - vertex.inputs.bulgeStrength * bulge,
                     conditioning);
}

}  // namespace

const Influence& pivotOf(std::span<const Influence> influences) {
  // In ascending order of joints: the first of the strongest has the lowest joint.
  return *std::max_element(
      influences.begin(), influences.end(),
      [](const Influence& a, const Influence& b) { return a.stored < b.stored; });
}

RigidBlend blendRigid(const VertexToSkin& vertex, Conditioning& conditioning) {
  const Influence& strongest = pivotOf(vertex.influences);
  const dvec4 pivot = vertex.joints[strongest.joint].rigid.real;
  RigidBlend blend;
  blend.rigid = {dvec4(0.0), dvec4(0.0)};
  bool kernelsScale = false;
  for (const Influence& influence : vertex.influences) {
    const Joint& joint = vertex.joints[influence.joint];
    const double dot = glm::dot(joint.rigid.real, pivot);
    conditioning.signAmbiguous |= std::abs(dot) < 1e-5;
    blend.rigid = blend.rigid + joint.rigid * (dot < 0 ? -influence.weight : influence.weight);
    blend.scaleShear += influence.weight * joint.scaleShear;
    kernelsScale |= !joint.rigidForKernels;
  }
  const double norm = std::sqrt(glm::dot(blend.rigid.real, blend.rigid.real));
  // No summand points away from the pivot: dot(real, pivot) ≥ its weight. NaN is accepted.
  assert(!(norm < strongest.weight * (1 - 1e-9)));
  conditioning.blendLength = norm;
  blend.rigid = blend.rigid * (1 / norm);
  conditioning.normalRotatedOnly = !kernelsScale;
  return blend;
}

BindVertex moveRigidly(const VertexToSkin& vertex, const dmat3& scaleShear, const dvec4& rotation,
                       const dvec3& translation, Conditioning& conditioning) {
  const BindVertex scaled = transformDirections(BlendedMatrix(scaleShear, conditioning.stretch),
                                                vertex.bind, conditioning);
  return {rotate(rotation, scaleShear * vertex.bind.position) + translation,
          unitOrZero(rotate(rotation, scaled.normal)), unitOrZero(rotate(rotation, scaled.tangent)),
          scaled.handedness};
}

BindVertex skinVertex(const VertexToSkin& vertex, Method method, Conditioning& conditioning) {
  switch (method) {
    case Method::linear:
      return skinLinear(vertex, conditioning);
    case Method::dualQuaternion:
      return skinDualQuaternion(vertex, conditioning);
    case Method::dualQuaternionIterative:
      return skinIterative(vertex, conditioning);
    case Method::logMatrix:
      return skinLogMatrix(vertex, conditioning);
    case Method::sphericalBlend:
      return skinSpherical(vertex, conditioning);
    case Method::quaternionTranslation:
      return skinQuaternionTranslation(vertex, conditioning);
    case Method::blended:
      return skinBlended(vertex, conditioning);
    case Method::centerOfRotation:
      return skinCenterOfRotation(vertex, conditioning);
    case Method::bulgeControlled:
      return skinBulgeControlled(vertex, conditioning);
  }
  return vertex.bind;
}

}  // namespace dermis::reference
