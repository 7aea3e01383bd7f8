#include "methods.h"

#include <algorithm>
#include <cassert>
#include <cmath>

#include <glm/geometric.hpp>
#include <glm/matrix.hpp>

#include "directions.h"

namespace dermis::reference {
namespace {

using glm::dmat3;
using glm::dvec3;
using glm::dvec4;

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
  const bool signs = conditioning.signAmbiguous;  // no pivot here
  const RigidBlend blend = blendRigid(vertex, conditioning);
  conditioning.signAmbiguous = signs;
  conditioning.blendLength = 1;
  const Rigid rigid = blendLogarithms(vertex, conditioning);
  return moveRigidly(vertex, blend.scaleShear, rigid.real, translationOf(rigid), conditioning);
}

/// Σ w (R S p + t), or without S.
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
  // A sum of unit vectors that all but cancel is the less certain.
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

/// A centre that is far away counts as the vertex' own position does.
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

/// What linear blending and dual quaternions make of the centre differs; that much of it is added.
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
  // In the order of joints: the first of the strongest has the lowest.
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
  // No summand points away from the pivot: dot(real, pivot) ≥ its weight. NaN is let through.
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
