// Log-matrix blending (Cordier and Magnenat-Thalmann 2005): blends the logarithms of the joints, which are 3×4 matrices from the
// palette kernel. The exponential is computed by scaling and squaring, as in Alexa 2002.
#ifndef DERMIS_LOG_MATRIX_GLSL
#define DERMIS_LOG_MATRIX_GLSL

#include "../methods/dual_quaternion.glsl"

struct Affine {  // rows; the fourth row is 0 0 0 1, or 0 0 0 0 for a logarithm
  vec4 r0;
  vec4 r1;
  vec4 r2;
};

vec4 rowTimes(vec4 row, Affine m) {
  precise vec4 product = row.x * m.r0 + row.y * m.r1 + row.z * m.r2;
  return product;
}

float rowSum(vec4 row) {
  precise float sum = abs(row.x) + abs(row.y) + abs(row.z);
  return sum;
}

Affine exponentialOf(Affine logarithm) {
  // Halve the matrix until its norm is at most a half. Then the error of eight terms is at most 6e-9 in the rotation, and at most
  // 1.2e-8 times the largest component of the halved translation.
  precise float norm = max(rowSum(logarithm.r0), max(rowSum(logarithm.r1), rowSum(logarithm.r2)));
  uint squarings = 0u;
  precise float scale = 1.0;
  while (norm > 0.5 && squarings < 8u) {
    norm *= 0.5;
    scale *= 0.5;
    ++squarings;
  }
  precise vec4 l0 = scale * logarithm.r0;
  precise vec4 l1 = scale * logarithm.r1;
  precise vec4 l2 = scale * logarithm.r2;
  Affine l = Affine(l0, l1, l2);
  Affine power = Affine(vec4(1.0, 0.0, 0.0, 0.0), vec4(0.0, 1.0, 0.0, 0.0), vec4(0.0, 0.0, 1.0, 0.0));
  for (uint term = 8u; term > 0u; --term) {
    float inverse = quotient(1.0, float(term));
    precise vec4 r0 = vec4(1.0, 0.0, 0.0, 0.0) + inverse * (rowTimes(l.r0, power) + vec4(0.0, 0.0, 0.0, l.r0.w));
    precise vec4 r1 = vec4(0.0, 1.0, 0.0, 0.0) + inverse * (rowTimes(l.r1, power) + vec4(0.0, 0.0, 0.0, l.r1.w));
    precise vec4 r2 = vec4(0.0, 0.0, 1.0, 0.0) + inverse * (rowTimes(l.r2, power) + vec4(0.0, 0.0, 0.0, l.r2.w));
    power = Affine(r0, r1, r2);
  }
  for (uint squaring = 0u; squaring < squarings; ++squaring) {
    precise vec4 r0 = rowTimes(power.r0, power) + vec4(0.0, 0.0, 0.0, power.r0.w);
    precise vec4 r1 = rowTimes(power.r1, power) + vec4(0.0, 0.0, 0.0, power.r1.w);
    precise vec4 r2 = rowTimes(power.r2, power) + vec4(0.0, 0.0, 0.0, power.r2.w);
    power = Affine(r0, r1, r2);
  }
  return power;
}

vec3 direct(Affine m, vec3 v) {
  return vec3(dot3(m.r0.xyz, v), dot3(m.r1.xyz, v), dot3(m.r2.xyz, v));
}

Vertex skinLogMatrix(Vertex vertex, Influences influences, Pose pose) {
  precise vec4 r0 = vec4(0.0);
  precise vec4 r1 = vec4(0.0);
  precise vec4 r2 = vec4(0.0);
  for (uint slot = 0u; slot < influences.count; ++slot) {
    float weight = influenceWeight(influences, slot);
    uint joint = influenceJoint(influences, slot);
    r0 += weight * paletteLogarithmRow(pose.palette, joint, 0u);
    r1 += weight * paletteLogarithmRow(pose.palette, joint, 1u);
    r2 += weight * paletteLogarithmRow(pose.palette, joint, 2u);
  }
  Affine blended = exponentialOf(Affine(r0, r1, r2));
  Scaled scaled = scaleVertex(vertex, influences, pose);
  Vertex skinned = scaled.vertex;
  precise vec3 position = direct(blended, scaled.vertex.position) + vec3(blended.r0.w, blended.r1.w, blended.r2.w);
  skinned.position = position;
  if (NORMALS) skinned.normal = unitOr(direct(blended, scaled.vertex.normal), vec3(0.0));
  if (TANGENTS) {
    skinned.tangent =
        tangentOf(unitOr(direct(blended, scaled.vertex.tangent.xyz), vec3(0.0)), scaled.vertex.tangent.w, scaled.side);
  }
  return skinned;
}

#endif
