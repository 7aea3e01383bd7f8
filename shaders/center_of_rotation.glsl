// Blended quaternions about a centre of rotation that was found at import (Le and Hodgins 2016), and dual quaternions drawn
// towards them. The centre itself is skinned linearly, by the joints as they were taken apart. Needs dual_quaternion.

// A point moved by one joint: R S p + t.
vec3 throughJoint(uint palette, uint jointCount, uint joint, bool twoPhase, vec3 point) {
  if (twoPhase) point = scalePosition(paletteScaleShear(palette, jointCount, joint), point);
  vec4 real = paletteRotation(palette, joint);
  precise vec3 moved = rotateBy(real, 1.0, point) + translationOf(real, paletteDual(palette, joint), 1.0);
  return moved;
}

vec3 linearPoint(Influences influences, uint palette, uint jointCount, bool twoPhase, vec3 point) {
  precise vec3 sum = vec3(0.0);
  for (uint slot = 0u; slot < influences.count; ++slot) {
    uint joint = influenceJoint(influences, slot);
    sum += influenceWeight(influences, slot) * throughJoint(palette, jointCount, joint, twoPhase, point);
  }
  return sum;
}

// v' = Q S (v − c) + Σ w (R S c + t)
Vertex skinCenterOfRotation(Vertex vertex, Influences influences, uint palette, uint jointCount, vec3 center, bool withNormal,
                            bool withTangent) {
  bool twoPhase = paletteIsTwoPhase(palette);
  Blend blend = blendJoints(influences, palette, jointCount, twoPhase);
  precise vec3 lever = vertex.position - center;
  vertex.position = lever;
  return turnVertex(scaleVertex(vertex, blend.part, twoPhase, withNormal, withTangent), blend.real, dot4(blend.real, blend.real),
                    linearPoint(influences, palette, jointCount, twoPhase, center), withNormal, withTangent);
}

// Both methods turn a vertex alike, and differ by what becomes of the centre: some of that difference takes the bulge away.
Vertex skinBulgeControlled(Vertex vertex, Influences influences, uint palette, uint jointCount, vec3 center, float strength,
                           bool withNormal, bool withTangent) {
  bool twoPhase = paletteIsTwoPhase(palette);
  Blend blend = blendJoints(influences, palette, jointCount, twoPhase);
  float squaredLength = dot4(blend.real, blend.real);
  vec3 translation = translationOf(blend.real, blend.dual, squaredLength);
  vec3 scaledCenter = center;
  if (twoPhase) scaledCenter = scalePosition(blend.part, center);
  precise vec3 bulged = rotateBy(blend.real, squaredLength, scaledCenter) + translation;
  precise vec3 drawn =
      translation + strength * (linearPoint(influences, palette, jointCount, twoPhase, center) - bulged);
  return turnVertex(scaleVertex(vertex, blend.part, twoPhase, withNormal, withTangent), blend.real, squaredLength, drawn,
                    withNormal, withTangent);
}
