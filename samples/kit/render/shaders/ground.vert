#version 450
#include "view.glsl"

layout(location = 0) out vec3 worldPosition;

void main() {
  vec2 corner = vec2((gl_VertexIndex & 1) == 0 ? -1.0 : 1.0, gl_VertexIndex < 2 ? 1.0 : -1.0);
  worldPosition = view.ground.xyz + vec3(corner.x, 0.0, corner.y) * view.ground.w;
  gl_Position = view.viewProjection * vec4(worldPosition, 1.0);
}
