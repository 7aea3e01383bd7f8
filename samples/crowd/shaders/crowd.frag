#version 450

layout(location = 0) in vec3 normal;
layout(location = 1) in vec2 surfaceTexcoord;
layout(location = 2) flat in vec3 color;

layout(location = 0) out vec4 outColor;

// Light from the sun and the sky, on checks that show the texture coordinates.
void main() {
  vec3 direction = normalize(normal);
  float sun = max(dot(direction, normalize(vec3(0.4, 0.8, 0.45))), 0.0);
  float sky = 0.35 + 0.25 * direction.y;
  vec2 cell = floor(surfaceTexcoord * 24.0);
  float check = mod(cell.x + cell.y, 2.0) < 1.0 ? 1.0 : 0.82;
  outColor = vec4(color * check * (0.75 * sun + sky), 1.0);
}
