// Encodes attributes in the formats of VertexFormat, as up to four words.
#ifndef DERMIS_ENCODE_GLSL
#define DERMIS_ENCODE_GLSL

#include "abi.h"
#include "exact.glsl"

uint formatBytes(uint format) {
  switch (format) {
    case FORMAT_FLOAT32X3: return 12u;
    case FORMAT_FLOAT32X4: return 16u;
    case FORMAT_FLOAT16X3:
    case FORMAT_SNORM16X3: return 6u;
    case FORMAT_FLOAT16X4:
    case FORMAT_SNORM16X4: return 8u;
    case FORMAT_SNORM8X3: return 3u;
    case FORMAT_SNORM8X4:
    case FORMAT_OCTAHEDRAL16X2: return 4u;
    case FORMAT_OCTAHEDRAL8X2: return 2u;
    default: return 0u;
  }
}

// IEEE 754 binary16, rounded to nearest, ties to even; Vulkan does not define how packHalf2x16 rounds. Without branches, since
// neighboring invocations would diverge.
uint halfBits(float value) {
  uint bits = floatBitsToUint(value);
  uint magnitude = bits & 0x7fffffffu;
  uint normal = (magnitude - 0x38000000u + 0xfffu + ((magnitude >> 13u) & 1u)) >> 13u;
  // Below 2^-14 the step is 2^-24, which is the step of a float32 at 0.5.
  precise float shifted = uintBitsToFloat(min(magnitude, 0x38800000u)) + 0.5;
  uint subnormal = floatBitsToUint(shifted) - 0x3f000000u;
  uint finite = magnitude < 0x38800000u ? subnormal : normal;
  uint special = magnitude > 0x7f800000u ? 0x7e00u : 0x7c00u;  // NaN, or infinity for values of 65520 and more
  return ((bits >> 16u) & 0x8000u) | (magnitude >= 0x477ff000u ? special : finite);
}

int snorm(float value, float largest) {
  precise float scaled = clamp(value, -1.0, 1.0) * largest;
  return int(roundEven(scaled));
}

uvec4 packHalves(vec4 v) {
  return uvec4(halfBits(v.x) | halfBits(v.y) << 16u, halfBits(v.z) | halfBits(v.w) << 16u, 0u, 0u);
}

uvec4 packSnorm16(vec4 v) {
  uvec4 c = uvec4(snorm(v.x, 32767.0), snorm(v.y, 32767.0), snorm(v.z, 32767.0), snorm(v.w, 32767.0)) & 0xffffu;
  return uvec4(c.x | c.y << 16u, c.z | c.w << 16u, 0u, 0u);
}

uvec4 packSnorm8(vec4 v) {
  uvec4 c = uvec4(snorm(v.x, 127.0), snorm(v.y, 127.0), snorm(v.z, 127.0), snorm(v.w, 127.0)) & 0xffu;
  return uvec4(c.x | c.y << 8u | c.z << 16u | c.w << 24u, 0u, 0u, 0u);
}

// A direction projected onto the octahedron |x| + |y| + |z| = 1, whose lower half is folded outwards to the corners of the square
// (Meyer et al. 2010, "On floating-point normal vectors").
vec2 octahedral(vec3 direction) {
  precise float sum = abs(direction.x) + abs(direction.y) + abs(direction.z);
  precise vec2 upper = direction.xy / (sum == 0.0 ? 1.0 : sum);
  precise vec2 folded = 1.0 - abs(upper.yx);
  vec2 lower = vec2(upper.x < 0.0 ? -folded.x : folded.x, upper.y < 0.0 ? -folded.y : folded.y);
  return direction.z >= 0.0 ? upper : lower;
}

// An integer from 1 to `largest`, negated if the handedness is negative.
int signedByHand(float value, float handedness, float largest) {
  precise float scaled = (clamp(value, -1.0, 1.0) * 0.5 + 0.5) * (largest - 1.0);
  int step = 1 + int(roundEven(scaled));
  return handedness < 0.0 ? -step : step;
}

uvec4 packPair16(int x, int y) { return uvec4((uint(x) & 0xffffu) | (uint(y) & 0xffffu) << 16u, 0u, 0u, 0u); }
uvec4 packPair8(int x, int y) { return uvec4((uint(x) & 0xffu) | (uint(y) & 0xffu) << 8u, 0u, 0u, 0u); }

// Any format except the octahedral ones.
uvec4 encodeComponents(uint format, vec4 v) {
  switch (format) {
    case FORMAT_FLOAT16X3:
    case FORMAT_FLOAT16X4: return packHalves(v);
    case FORMAT_SNORM16X3:
    case FORMAT_SNORM16X4: return packSnorm16(v);
    case FORMAT_SNORM8X3:
    case FORMAT_SNORM8X4: return packSnorm8(v);
    default: return floatBitsToUint(v);
  }
}

bool isSnormPosition(uint format) { return format == FORMAT_SNORM16X3 || format == FORMAT_SNORM16X4; }

uvec4 encodeNormal(uint format, vec3 normal) {
  if (format == FORMAT_OCTAHEDRAL16X2) {
    vec2 o = octahedral(normal);
    return packPair16(snorm(o.x, 32767.0), snorm(o.y, 32767.0));
  }
  if (format == FORMAT_OCTAHEDRAL8X2) {
    vec2 o = octahedral(normal);
    return packPair8(snorm(o.x, 127.0), snorm(o.y, 127.0));
  }
  return encodeComponents(format, vec4(normal, 0.0));
}

uvec4 encodeTangent(uint format, vec4 tangent) {
  if (format == FORMAT_OCTAHEDRAL16X2) {
    vec2 o = octahedral(tangent.xyz);
    return packPair16(snorm(o.x, 32767.0), signedByHand(o.y, tangent.w, 32767.0));
  }
  if (format == FORMAT_OCTAHEDRAL8X2) {
    vec2 o = octahedral(tangent.xyz);
    return packPair8(snorm(o.x, 127.0), signedByHand(o.y, tangent.w, 127.0));
  }
  return encodeComponents(format, tangent);
}

#endif
