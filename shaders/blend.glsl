// Skins a vertex by METHOD. The macros BULGE and COMPARISON decide which methods the module contains.
#ifndef DERMIS_BLEND_GLSL
#define DERMIS_BLEND_GLSL

#include "abi.h"
#include "mesh_access.glsl"
#include "palette_access.glsl"
#include "vertex.glsl"
#include "direction_map.glsl"
#include "methods/dual_quaternion.glsl"
#ifdef COMPARISON
#include "comparison/dual_exponential.glsl"
#include "comparison/iterative.glsl"
#include "comparison/log_matrix.glsl"
#include "comparison/spherical_blend.glsl"
#include "comparison/quaternion_translation.glsl"
#else
#include "methods/linear.glsl"
#include "methods/blended.glsl"
#include "methods/center_of_rotation.glsl"
#endif

Vertex skinByMethod(Vertex vertex, Influences influences, MethodInputs inputs, Pose pose) {
  switch (METHOD) {
#ifdef COMPARISON
    case METHOD_LOG_MATRIX:
      return skinLogMatrix(vertex, influences, pose);
    case METHOD_SPHERICAL_BLEND:
      return skinSpherical(vertex, influences, pose);
    case METHOD_QUATERNION_TRANSLATION:
      return skinQuaternionTranslation(vertex, influences, pose);
    default:
      return skinIterative(vertex, influences, pose);
#else
#ifdef BULGE
    case METHOD_BLENDED:
      return skinBlended(vertex, influences, pose, inputs.methodWeight);
    case METHOD_CENTER_OF_ROTATION:
      return skinCenterOfRotation(vertex, influences, pose, inputs.center);
    case METHOD_BULGE_CONTROLLED:
      return skinBulgeControlled(vertex, influences, pose, inputs.center, inputs.methodWeight);
#endif
#ifndef BULGE
    case METHOD_LINEAR:
      return skinLinear(vertex, influences, pose);
    case METHOD_DUAL_QUATERNION:
      return skinDualQuaternion(vertex, influences, pose);
#endif
    default:
      return vertex;  // no other method is in this module
#endif
  }
}

// A vertex without influences stays in bind pose.
Vertex skinVertex(Vertex vertex, Influences influences, MethodInputs inputs, Pose pose) {
  // All loaded influences of such a vertex are joint 0. Most meshes have no such vertex: selecting the result afterwards costs less
  // than a branch around everything. Comparison methods branch, since some of them iterate until they converge.
#ifdef COMPARISON
  const bool branches = true;
#else
  const bool branches = false;
#endif
  bool still = !hasSlot(influences.count, 0u);
  if (branches && still) return vertex;
  Vertex skinned = skinByMethod(vertex, influences, inputs, pose);
  if (still) skinned = vertex;
  return skinned;
}

#endif
