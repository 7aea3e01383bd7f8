#version 450
#include "dermis_decode.glsl"
#include "draw.glsl"
#include "view.glsl"

// Skinned attributes, as stored in the output buffer of Dermis.
layout(location = 0) in vec3 position;
layout(location = 1) in vec3 normal;
// Attributes that skinning does not change.
layout(location = 2) in vec2 texcoord;
layout(location = 3) in vec4 color;
layout(location = 4) in float value;

layout(location = 0) out vec3 worldPosition;
layout(location = 1) out vec3 worldNormal;
layout(location = 2) out vec2 surfaceTexcoord;
layout(location = 3) out vec4 surfaceColor;
layout(location = 4) out float surfaceValue;

layout(constant_id = 3) const bool normalsAreOctahedral = false;

void main() {
  worldPosition = toWorld(position);
  worldNormal = directionToWorld(normalsAreOctahedral ? dermisDecodeOctahedral(normal.xy) : normal);
  surfaceTexcoord = texcoord;
  surfaceColor = color * draw.baseColor;
  surfaceValue = value;
  gl_Position = view.viewProjection * vec4(worldPosition, 1.0);
}
