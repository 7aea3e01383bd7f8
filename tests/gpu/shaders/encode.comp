#version 450
#extension GL_GOOGLE_include_directive : require

// Encodes consecutive bit patterns of floats.

#include "encode.glsl"

layout(local_size_x = 64) in;
layout(push_constant) uniform Push { uint first; };
layout(set = 0, binding = 0, std430) writeonly buffer Encoded { uvec2 encoded[]; };

void main() {
  uint bits = first + gl_GlobalInvocationID.x;
  float value = uintBitsToFloat(bits);
  float negated = uintBitsToFloat(bits ^ 0x80000000u);
  encoded[gl_GlobalInvocationID.x] =
      uvec2(packHalves(value, negated), pair16(snorm(value, 32767.0), snorm(value, 127.0)));
}
