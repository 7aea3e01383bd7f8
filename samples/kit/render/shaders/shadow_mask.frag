#version 450
#include "draw.glsl"

layout(location = 0) in vec2 surfaceTexcoord;
layout(location = 1) in float surfaceAlpha;

layout(set = 1, binding = 0) uniform sampler2D baseColorTexture;

void main() {
  if (surfaceAlpha * texture(baseColorTexture, surfaceTexcoord).a < draw.surface.z) discard;
}
