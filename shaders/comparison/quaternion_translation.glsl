// Blends quaternions and translations separately (Hejl 2004).
#ifndef DERMIS_QUATERNION_TRANSLATION_GLSL
#define DERMIS_QUATERNION_TRANSLATION_GLSL

#include "../methods/dual_quaternion.glsl"

vec3 jointTranslation(Pose pose, uint joint) {
  return translationOf(paletteRotation(pose.palette, joint), paletteDual(pose.palette, joint), 2.0);
}

Vertex skinQuaternionTranslation(Vertex vertex, Influences influences, Pose pose) {
  Blend blend = blendJoints(influences, pose);
  precise vec3 translation = vec3(0.0);
  for (uint slot = 0u; slot < influences.count; ++slot) {
    translation += influenceWeight(influences, slot) * jointTranslation(pose, influenceJoint(influences, slot));
  }
  Scaled scaled = scaleVertex(vertex, influences, pose);
  return turnVertex(scaled, blend.real, turningFactor(blend.real), translation);
}

#endif
