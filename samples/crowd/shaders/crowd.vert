#version 450
#include "dermis_decode.glsl"

// What Dermis wrote, of all figures: one vertex buffer.
layout(location = 0) in vec3 position;
layout(location = 1) in vec2 octahedralNormal;

layout(location = 0) out vec3 normal;
layout(location = 1) out vec2 surfaceTexcoord;
layout(location = 2) flat out vec3 color;

// [figure]
struct Figure {
  vec4 rows[3];       // from the space of the character to the world
  vec3 color;
  int firstVertex;    // IndexedDraw::vertexOffset
  uint firstTexcoord; // of its mesh
};
layout(set = 0, binding = 0, std430) readonly buffer Figures { Figure figures[]; };
layout(set = 0, binding = 1, std430) readonly buffer Texcoords { vec2 texcoords[]; }; // of each mesh once, in one list

// What skinning does not change stands there once for all figures of a mesh.
vec2 texcoordOf(Figure figure) { return texcoords[figure.firstTexcoord + gl_VertexIndex - figure.firstVertex]; }
// [/figure]

layout(push_constant) uniform Push { mat4 viewProjection; } push;

void main() {
  Figure figure = figures[gl_InstanceIndex];
  mat4x3 toWorld = transpose(mat3x4(figure.rows[0], figure.rows[1], figure.rows[2]));
  normal = mat3(toWorld) * dermisDecodeOctahedral(octahedralNormal);
  surfaceTexcoord = texcoordOf(figure);
  color = figure.color;
  gl_Position = push.viewProjection * vec4(toWorld * vec4(position, 1.0), 1.0);
}
