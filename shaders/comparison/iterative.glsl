// Dual-quaternion iterative blending (DIB, Kavan et al. 2008): the blended transform is moved by the mean screw from it to the
// joints, until the mean screw is negligible.
#ifndef DERMIS_ITERATIVE_GLSL
#define DERMIS_ITERATIVE_GLSL

#include "../methods/dual_quaternion.glsl"
#include "dual_exponential.glsl"

// The loop reaches the maximum only if joints are nearly antipodal. Usually a few steps are enough.
const uint MAX_STEPS = 20u;

void makeUnit(inout vec4 real, inout vec4 dual) {
  float inverse = inverseRoot(dot4(real, real));
  precise vec4 unit = inverse * real;
  precise vec4 scaled = inverse * dual;
  precise vec4 orthogonal = scaled - dot4(unit, scaled) * unit;
  real = unit;
  dual = orthogonal;
}

// The mean screw from a transform to the joints. `reach` is the largest component of their dual parts.
Screw meanScrew(vec4 real, vec4 dual, Influences influences, Pose pose, vec4 pivot, out float reach) {
  precise vec3 turn = vec3(0.0);
  precise vec3 shift = vec3(0.0);
  vec4 backReal = conjugateOf(real);
  vec4 backDual = conjugateOf(dual);
  reach = 0.0;
  for (uint slot = 0u; slot < influences.count; ++slot) {
    float weight = influenceWeight(influences, slot);
    uint joint = influenceJoint(influences, slot);
    vec4 jointReal = paletteRotation(pose.palette, joint);
    vec4 jointDual = paletteDual(pose.palette, joint);
    reach = max(reach, max(largestComponent(jointDual.xyz), abs(jointDual.w)));
    if (dot4(pivot, jointReal) < 0.0) {
      jointReal = -jointReal;
      jointDual = -jointDual;
    }
    precise vec4 differenceDual = quaternionProduct(backReal, jointDual) + quaternionProduct(backDual, jointReal);
    Screw screw = screwOf(quaternionProduct(backReal, jointReal), differenceDual);
    turn += weight * screw.real;
    shift += weight * screw.dual;
  }
  return Screw(turn, shift);
}

Vertex skinIterative(Vertex vertex, Influences influences, Pose pose) {
  Blend blend = blendJoints(influences, pose);
  vec4 pivot = paletteRotation(pose.palette, influences.joints.x);
  makeUnit(blend.real, blend.dual);
  for (uint step = 0u; step < MAX_STEPS; ++step) {
    float reach;
    Screw screw = meanScrew(blend.real, blend.dual, influences, pose, pivot, reach);
    vec4 real;
    vec4 dual;
    exponentialOf(screw, real, dual);
    precise vec4 movedDual = quaternionProduct(blend.real, dual) + quaternionProduct(blend.dual, real);
    blend.real = quaternionProduct(blend.real, real);
    blend.dual = movedDual;
    makeUnit(blend.real, blend.dual);
    // The tolerance is five roundings (2^-24 each); 9e-14 is about its square. The shift and `reach` are scaled, since the square
    // of `reach` may be infinite or 0.
    float scale = powerScale(reach);
    precise float scaledReach = scale * reach;
    precise vec3 shift = scale * screw.dual;
    precise float near = 9e-14 * scaledReach * scaledReach;
    if (dot3(screw.real, screw.real) <= 9e-14 && dot3(shift, shift) <= near) break;
  }
  Scaled scaled = scaleVertex(vertex, influences, pose);
  return turnVertex(scaled, blend.real, 2.0, translationOf(blend.real, blend.dual, 2.0));
}

#endif
