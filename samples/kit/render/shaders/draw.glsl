// Push constants of each draw. samples/kit/render/lighting.h declares the same in C++.
#ifndef DERMIS_RENDER_DRAW_GLSL
#define DERMIS_RENDER_DRAW_GLSL

layout(push_constant) uniform Draw {
  vec4 rows[3];     // model to world, row-major
  vec4 baseColor;
  vec4 surface;     // metallic, roughness, alpha cutoff, 1 if colors come from a value per vertex
  int shadowIndex;  // -1: the key light, otherwise a sky light
} draw;

vec3 toWorld(vec3 position) {
  return vec3(dot(draw.rows[0], vec4(position, 1.0)), dot(draw.rows[1], vec4(position, 1.0)),
              dot(draw.rows[2], vec4(position, 1.0)));
}

vec3 directionToWorld(vec3 direction) {
  return vec3(dot(draw.rows[0].xyz, direction), dot(draw.rows[1].xyz, direction),
              dot(draw.rows[2].xyz, direction));
}

#endif
