// A vertex on its way through a kernel.

struct Vertex {
  vec3 position;
  vec3 normal;
  vec4 tangent;  // w: the handedness, 1 or -1 once it is skinned
};

vec4 tangentOf(vec3 direction, float handedness, float side) {
  return vec4(direction, (handedness < 0.0) == (side < 0.0) ? 1.0 : -1.0);
}
