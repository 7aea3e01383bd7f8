// A vertex that is being skinned.
#ifndef DERMIS_VERTEX_GLSL
#define DERMIS_VERTEX_GLSL

#include "exact.glsl"

struct Vertex {
  vec3 position;
  vec3 normal;   // of unit length; zero if there is none
  vec4 tangent;  // the same; w is the handedness, 1 or -1
  // The directions before normalizing: from the mesh, plus morph displacements. Scaling starts from these: a direction that is
  // normalized, transformed by a joint that does not scale, and normalized again would differ in its last bits from one that is
  // normalized once.
  vec3 givenNormal;
  vec3 givenTangent;
};

// Called before the loop over instances or, with morph targets, for each instance. A method that only rotates a vertex need not
// normalize again.
void makeDirectionsUnit(inout Vertex vertex) {
  vertex.givenNormal = vertex.normal;
  vertex.givenTangent = vertex.tangent.xyz;
  if (NORMALS) vertex.normal = unitOr(vertex.normal, vec3(0.0));
  if (TANGENTS) vertex.tangent = vec4(unitOr(vertex.tangent.xyz, vec3(0.0)), vertex.tangent.w < 0.0 ? -1.0 : 1.0);
}

vec4 tangentOf(vec3 direction, float handedness, float side) {
  return vec4(direction, (handedness < 0.0) == (side < 0.0) ? 1.0 : -1.0);
}

#endif
