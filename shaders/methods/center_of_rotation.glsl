// Blends quaternions about a center of rotation that was computed at import (Le and Hodgins 2016). The center itself is skinned
// linearly, by the decomposed joints. `skinBulgeControlled` moves the dual-quaternion result towards this one (bulge_controlled).
#ifndef DERMIS_CENTER_OF_ROTATION_GLSL
#define DERMIS_CENTER_OF_ROTATION_GLSL

#include "dual_quaternion.glsl"

// A point transformed by one joint: R S p + t.
vec3 throughJoint(Pose pose, uint joint, vec3 point) {
  if (pose.scales) point = scalePosition(paletteScaleShear(pose, joint), point);
  vec4 real = paletteRotation(pose.palette, joint);
  precise vec3 moved = rotateBy(real, 2.0, point) + translationOf(real, paletteDual(pose.palette, joint), 2.0);
  return moved;
}

vec3 linearPoint(Influences influences, Pose pose, vec3 point) {
  precise vec3 sum = vec3(0.0);
  for (uint slot = 0u; slot < influences.count; ++slot) {
    uint joint = influenceJoint(influences, slot);
    sum += influenceWeight(influences, slot) * throughJoint(pose, joint, point);
  }
  return sum;
}

// v' = Q S (v − c) + Σ w_j (R_j S_j c + t_j), where Q and S are blended.
Vertex skinCenterOfRotation(Vertex vertex, Influences influences, Pose pose, vec3 center) {
  precise vec3 lever = vertex.position - center;
  vertex.position = lever;
  Scaled scaled = scaleVertex(vertex, influences, pose);
  Blend blend = blendJoints(influences, pose);
  return turnVertex(scaled, blend.real, turningFactor(blend.real), linearPoint(influences, pose, center));
}

// Dual quaternions and centers of rotation rotate a vertex in the same way, and differ only in where the center goes. Adding a part
// of that difference removes a part of the bulge.
Vertex skinBulgeControlled(Vertex vertex, Influences influences, Pose pose, vec3 center, float strength) {
  Scaled scaled = scaleVertex(vertex, influences, pose);
  Blend blend = blendJoints(influences, pose);
  float factor = turningFactor(blend.real);
  vec3 translation = translationOf(blend.real, blend.dual, factor);
  vec3 scaledCenter = scalePosition(scaled.part, center);
  precise vec3 bulged = rotateBy(blend.real, factor, scaledCenter) + translation;
  precise vec3 drawn =
      translation + strength * (linearPoint(influences, pose, center) - bulged);
  return turnVertex(scaled, blend.real, factor, drawn);
}

#endif
