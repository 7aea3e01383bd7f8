#version 450
#extension GL_GOOGLE_include_directive : require

// An engine that skins in its vertex shader, and has names of its own.
layout(constant_id = 0) const uint method = 1u;
#define DERMIS_METHOD method
#define DERMIS_SET 0
#define DERMIS_MESHES_BINDING 3
#define DERMIS_PALETTES_BINDING 5
struct Vertex {
  float own;
};
float linear(float x) { return x; }
#include "dermis_skin.glsl"
#include "values.glsl"

void main() {
  DermisVertex skinned = dermisSkin(mesh, uint(gl_VertexIndex), palette, jointCount);
  drawValues(skinned.position, skinned.normal, skinned.tangent);
}
