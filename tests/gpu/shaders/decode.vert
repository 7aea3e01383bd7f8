#version 450
#extension GL_GOOGLE_include_directive : require

// Positions in snorm16x4, normals and tangents in octahedral8x2, as the vertex input reads them.
layout(location = 0) in vec4 position;
layout(location = 1) in vec2 normal;
layout(location = 2) in vec2 tangent;
#include "dermis_decode.glsl"
#include "values.glsl"

void main() {
  drawValues(dermisDecodePosition(position.xyz, boxMin.xyz, boxMax.xyz), dermisDecodeOctahedral(normal),
             dermisDecodeOctahedralTangent(tangent, 127.0));
}
