// Quaternions and translations, each blended on its own (Hejl 2004). Needs dual_quaternion.

vec3 jointTranslation(uint palette, uint joint) {
  return translationOf(paletteRotation(palette, joint), paletteDual(palette, joint), 1.0);
}

Vertex skinQuaternionTranslation(Vertex vertex, Influences influences, uint palette, uint jointCount, bool withNormal,
                                 bool withTangent) {
  bool twoPhase = paletteIsTwoPhase(palette);
  Blend blend = blendJoints(influences, palette, jointCount, twoPhase);
  precise vec3 translation = vec3(0.0);
  for (uint slot = 0u; slot < influences.count; ++slot) {
    translation += influenceWeight(influences, slot) * jointTranslation(palette, influenceJoint(influences, slot));
  }
  return turnVertex(scaleVertex(vertex, blend.part, twoPhase, withNormal, withTangent), blend.real, dot4(blend.real, blend.real),
                    translation, withNormal, withTangent);
}
