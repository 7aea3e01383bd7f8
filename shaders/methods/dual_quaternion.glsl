// Dual-quaternion linear blending, in two phases if joints scale or shear; and functions that other methods share with it.
#ifndef DERMIS_DUAL_QUATERNION_GLSL
#define DERMIS_DUAL_QUATERNION_GLSL

#include "../exact.glsl"
#include "../quaternion.glsl"
#include "../scale_shear.glsl"
#include "../direction_map.glsl"
#include "../mesh_access.glsl"
#include "../palette_access.glsl"
#include "../vertex.glsl"

// The blended dual quaternion of a vertex (Kavan et al. 2007, section 4), in the hemisphere of the pivot, which is the first
// influence. Not normalized.
struct Blend {
  vec4 real;
  vec4 dual;
};

// Weights are not negative.
float signedWeight(vec4 pivot, vec4 rotation, float weight) {
  uint side = floatBitsToUint(dot4(pivot, rotation)) & 0x80000000u;
  return uintBitsToFloat(floatBitsToUint(weight) | side);
}

Blend addJoint(Blend blend, vec4 pivot, float weight, Pose pose, uint joint) {
  vec4 rotation = paletteRotation(pose.palette, joint);
  float towardsPivot = signedWeight(pivot, rotation, weight);
  precise vec4 real = fma(vec4(towardsPivot), rotation, blend.real);
  precise vec4 dual = fma(vec4(towardsPivot), paletteDual(pose.palette, joint), blend.dual);
  return Blend(real, dual);
}

Blend blendJoints(Influences influences, Pose pose) {
  vec4 pivot = paletteRotation(pose.palette, influences.joints.x);
  precise vec4 real = influences.weights.x * pivot;
  precise vec4 dual = influences.weights.x * paletteDual(pose.palette, influences.joints.x);
  Blend blend = Blend(real, dual);
#define ADD_JOINT(weight, joint) blend = addJoint(blend, pivot, weight, pose, joint)
  FOR_OTHER_INFLUENCES(influences, ADD_JOINT)
  return blend;
}

// Since weights sum to 1, the blended part is the pivot's part plus the weighted differences of the others. If no joint of the
// vertex scales, it is exactly the identity, so the vertex has the same bits as with a palette in which no joint scales.
ScaleShear addScaleShear(ScaleShear blend, ScaleShear pivot, float weight, Pose pose, uint joint) {
  ScaleShear part = paletteScaleShear(pose, joint);
  precise vec3 diagonal = fma(vec3(weight), part.diagonal - pivot.diagonal, blend.diagonal);
  precise vec3 mixed = fma(vec3(weight), part.mixed - pivot.mixed, blend.mixed);
  return ScaleShear(diagonal, mixed);
}

ScaleShear blendScaleShear(Influences influences, Pose pose) {
  ScaleShear pivot = paletteScaleShear(pose, influences.joints.x);
  ScaleShear blend = pivot;
#define ADD_SCALE_SHEAR(weight, joint) blend = addScaleShear(blend, pivot, weight, pose, joint)
  FOR_OTHER_INFLUENCES(influences, ADD_SCALE_SHEAR)
  return blend;
}

// The result of the first phase: the vertex, scaled and sheared in bind space. Its directions have unit length.
struct Scaled {
  Vertex vertex;
  ScaleShear part;
  float side;  // -1 if the vertex is mirrored, otherwise 1
};

vec3 scalePosition(ScaleShear part, vec3 p) {
  precise vec3 position = vec3(dot3(vec3(part.diagonal.x, part.mixed.x, part.mixed.y), p),
                               dot3(vec3(part.mixed.x, part.diagonal.y, part.mixed.z), p),
                               dot3(vec3(part.mixed.y, part.mixed.z, part.diagonal.z), p));
  return position;
}

Scaled scaleVertex(Vertex vertex, Influences influences, Pose pose) {
  Scaled scaled = Scaled(vertex, ScaleShear(vec3(1.0), vec3(0.0)), 1.0);
  if (pose.scales) {
    ScaleShear part = blendScaleShear(influences, pose);
    scaled.part = part;
    scaled.vertex.position = scalePosition(part, vertex.position);
    if (NORMALS || TANGENTS) {
      DirectionMap map =
          directionMap(vec3(part.diagonal.x, part.mixed.x, part.mixed.y), vec3(part.mixed.x, part.diagonal.y, part.mixed.z),
                       vec3(part.mixed.y, part.mixed.z, part.diagonal.z));
      scaled.side = map.side;
      if (NORMALS) scaled.vertex.normal = unitOr(mapNormal(map, vertex.givenNormal), vertex.normal);
      if (TANGENTS) scaled.vertex.tangent.xyz = unitOr(mapTangent(map, vertex.givenTangent), vertex.tangent.xyz);
    }
  }
  return scaled;
}

// 2 / |q|².
float turningFactor(vec4 q) {
  precise float factor = 2.0 / dot4(q, q);
  return factor;
}

// The second phase: rotates a vertex by a quaternion q of any length except 0, then translates it. `factor` is 2 / |q|². Directions
// keep unit length.
Vertex turnVertex(Scaled scaled, vec4 real, float factor, vec3 translation) {
  Vertex skinned = scaled.vertex;
  precise vec3 position = rotateBy(real, factor, scaled.vertex.position) + translation;
  skinned.position = position;
  if (NORMALS) skinned.normal = rotateBy(real, factor, scaled.vertex.normal);
  if (TANGENTS) {
    skinned.tangent = tangentOf(rotateBy(real, factor, scaled.vertex.tangent.xyz), scaled.vertex.tangent.w, scaled.side);
  }
  return skinned;
}

// The translation of a dual quaternion of any length except 0. `factor` is 2 / |real|², so `real` need not be normalized.
vec3 translationOf(vec4 real, vec4 dual, float factor) {
  precise vec3 straight = real.w * dual.xyz;
  precise vec3 translation = (fma(vec3(-dual.w), real.xyz, straight) + cross3(real.xyz, dual.xyz)) * factor;
  return translation;
}

// The vertex is scaled first, so that the blended quaternion takes no registers meanwhile.
Vertex skinDualQuaternion(Vertex vertex, Influences influences, Pose pose) {
  Scaled scaled = scaleVertex(vertex, influences, pose);
  Blend blend = blendJoints(influences, pose);
  float factor = turningFactor(blend.real);
  return turnVertex(scaled, blend.real, factor, translationOf(blend.real, blend.dual, factor));
}

#endif
