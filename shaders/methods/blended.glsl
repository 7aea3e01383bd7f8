// Interpolates between linear blending and dual quaternions. The linear part uses the decomposed joints, so that both parts read
// the same palette.
#ifndef DERMIS_BLENDED_GLSL
#define DERMIS_BLENDED_GLSL

#include "linear.glsl"
#include "dual_quaternion.glsl"

// The rows of R S, the 3×3 matrix of one joint.
void jointRows(vec4 q, Pose pose, uint joint, out vec3 r0, out vec3 r1, out vec3 r2) {
  rowsOfQuaternion(q, r0, r1, r2);
  if (pose.scales) {  // S is symmetric, so a row of R S is S times the row of R
    ScaleShear part = paletteScaleShear(pose, joint);
    r0 = scalePosition(part, r0);
    r1 = scalePosition(part, r1);
    r2 = scalePosition(part, r2);
  }
}

Vertex skinBlended(Vertex vertex, Influences influences, Pose pose, float share) {
  precise vec4 r0 = vec4(0.0);
  precise vec4 r1 = vec4(0.0);
  precise vec4 r2 = vec4(0.0);
  for (uint slot = 0u; slot < influences.count; ++slot) {
    float weight = influenceWeight(influences, slot);
    uint joint = influenceJoint(influences, slot);
    vec4 real = paletteRotation(pose.palette, joint);
    vec3 row0;
    vec3 row1;
    vec3 row2;
    jointRows(real, pose, joint, row0, row1, row2);
    vec3 translation = translationOf(real, paletteDual(pose.palette, joint), 2.0);
    r0 += weight * vec4(row0, translation.x);
    r1 += weight * vec4(row1, translation.y);
    r2 += weight * vec4(row2, translation.z);
  }
  Vertex straight = throughMatrix(vertex, r0, r1, r2);
  Vertex skinned = skinDualQuaternion(vertex, influences, pose);
  if (share >= 1.0) return skinned;
  precise float rest = 1.0 - share;
  precise vec3 position = rest * straight.position + share * skinned.position;
  skinned.position = position;
  // The handedness is that of the dual quaternions, whose scale parts contain the reflections. If the joints have nearly opposite
  // rotations, linear blending may give the other handedness.
  if (NORMALS) {
    precise vec3 normal = rest * straight.normal + share * skinned.normal;
    skinned.normal = unitOr(normal, skinned.normal);
  }
  if (TANGENTS) {
    precise vec3 tangent = rest * straight.tangent.xyz + share * skinned.tangent.xyz;
    skinned.tangent.xyz = unitOr(tangent, skinned.tangent.xyz);
  }
  return skinned;
}

#endif
