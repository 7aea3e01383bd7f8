#version 450
#include "draw.glsl"
#include "view.glsl"

layout(location = 0) in vec3 position;
layout(location = 2) in vec2 texcoord;
layout(location = 3) in vec4 color;

layout(location = 0) out vec2 surfaceTexcoord;
layout(location = 1) out float surfaceAlpha;

void main() {
  surfaceTexcoord = texcoord;
  surfaceAlpha = color.a * draw.baseColor.a;
  mat4 matrix = draw.shadowIndex < 0 ? view.keyMatrix : view.skyMatrices[draw.shadowIndex];
  gl_Position = matrix * vec4(toWorld(position), 1.0);
}
