#version 450
#include "draw.glsl"
#include "view.glsl"

// What Dermis skinned, as it stands in its output buffer.
layout(location = 0) in vec3 position;
layout(location = 1) in vec3 normal;
// What skinning leaves as it is.
layout(location = 2) in vec2 texcoord;
layout(location = 3) in vec4 color;
layout(location = 4) in float value;

layout(location = 0) out vec3 worldPosition;
layout(location = 1) out vec3 worldNormal;
layout(location = 2) out vec2 surfaceTexcoord;
layout(location = 3) out vec4 surfaceColor;
layout(location = 4) out float surfaceValue;

layout(constant_id = 3) const bool normalsAreOctahedral = false;

// dermis/vertex_format.h, octahedral.
vec3 fromOctahedral(vec2 packed) {
  vec3 direction = vec3(packed, 1.0 - abs(packed.x) - abs(packed.y));
  float below = max(-direction.z, 0.0);
  direction.x += direction.x >= 0.0 ? -below : below;
  direction.y += direction.y >= 0.0 ? -below : below;
  return direction;
}

void main() {
  worldPosition = toWorld(position);
  worldNormal = directionToWorld(normalsAreOctahedral ? fromOctahedral(normal.xy) : normal);
  surfaceTexcoord = texcoord;
  surfaceColor = color * draw.baseColor;
  surfaceValue = value;
  gl_Position = view.viewProjection * vec4(worldPosition, 1.0);
}
