// A vertex on its way through a kernel.
#ifndef DERMIS_VERTEX_GLSL
#define DERMIS_VERTEX_GLSL

#include "exact.glsl"

struct Vertex {
  vec3 position;
  vec3 normal;   // of unit length, or zero where it has none
  vec4 tangent;  // likewise; w: the handedness, 1 or -1
  // As the mesh has them. What scales starts from these: a unit that went through a joint that does not scale, and was made a unit
  // again, would differ in its last bits from one that did not.
  vec3 givenNormal;
  vec3 givenTangent;
};

// Once for all instances: what only turns a vertex need not do it.
void makeDirectionsUnit(inout Vertex vertex, bool withNormal, bool withTangent) {
  vertex.givenNormal = vertex.normal;
  vertex.givenTangent = vertex.tangent.xyz;
  if (withNormal) vertex.normal = unitOr(vertex.normal, vec3(0.0));
  if (withTangent) vertex.tangent = vec4(unitOr(vertex.tangent.xyz, vec3(0.0)), vertex.tangent.w < 0.0 ? -1.0 : 1.0);
}

vec4 tangentOf(vec3 direction, float handedness, float side) {
  return vec4(direction, (handedness < 0.0) == (side < 0.0) ? 1.0 : -1.0);
}

#endif
