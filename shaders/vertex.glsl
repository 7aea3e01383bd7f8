// A vertex on its way through a kernel. Needs exact.glsl.

struct Vertex {
  vec3 position;
  vec3 normal;
  vec4 tangent;  // w: the handedness, 1 or -1 once it is skinned
};

// Once for all instances: what only turns a vertex need not do it. Not where palettes may scale, since a direction that was
// scaled is made a unit once more, which for a joint that does not scale would change its last bits: there scaleVertex does it.
const bool UNIT_BEFORE = !SCALES;

void makeDirectionsUnit(inout Vertex vertex, bool withNormal, bool withTangent) {
  if (withNormal) vertex.normal = unitOr(vertex.normal, vec3(0.0));
  if (withTangent) vertex.tangent = vec4(unitOr(vertex.tangent.xyz, vec3(0.0)), vertex.tangent.w < 0.0 ? -1.0 : 1.0);
}

vec4 tangentOf(vec3 direction, float handedness, float side) {
  return vec4(direction, (handedness < 0.0) == (side < 0.0) ? 1.0 : -1.0);
}
