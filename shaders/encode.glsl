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

// The low bits of two words.
uint pair16(uint x, uint y) { return (x & 0xffffu) | y << 16u; }
uint pair8(uint x, uint y) { return (x & 0xffu) | (y & 0xffu) << 8u; }

// IEEE 754 binary16 without the sign, rounded to nearest, ties to even; Vulkan does not define how packHalf2x16 rounds. Without
// branches, since neighboring invocations would diverge.
uint halfMagnitude(float value) {
  uint magnitude = floatBitsToUint(value) & 0x7fffffffu;
  // NaN and all that becomes infinite, as numbers whose exponent is one too large for a binary16.
  magnitude = min(magnitude, magnitude > 0x7f800000u ? 0x47c00000u : 0x47800000u);
  uint normal = (magnitude + ((magnitude >> 13u) & 1u) + (0xfffu - 0x38000000u)) >> 13u;
  // Below 2^-14 the step is 2^-24, which is the step of a float32 at 0.5.
  precise float shifted = uintBitsToFloat(magnitude) + 0.5;
  return magnitude < 0x38800000u ? floatBitsToUint(shifted) - 0x3f000000u : normal;
}

uint packHalves(float x, float y) {
  uint signs = (floatBitsToUint(x) >> 16u & 0x8000u) | (floatBitsToUint(y) & 0x80000000u);
  return halfMagnitude(x) | halfMagnitude(y) << 16u | signs;
}

// -1 to 1 as an integer from -largest to largest, in the low bits of the result; the others are not zero. The sum with 1.5 * 2^23
// is rounded to an integer, to nearest, ties to even, and has it in its low bits.
uint snormOfUnit(float value, float largest) {
  precise float scaled = value * largest;
  precise float rounded = scaled + 12582912.0;
  return floatBitsToUint(rounded);
}

uint snorm(float value, float largest) { return snormOfUnit(clamp(value, -1.0, 1.0), largest); }

uvec4 packSnorm16(vec4 v) {
  return uvec4(pair16(snorm(v.x, 32767.0), snorm(v.y, 32767.0)), pair16(snorm(v.z, 32767.0), snorm(v.w, 32767.0)), 0u, 0u);
}

uvec4 packSnorm8(vec4 v) {
  uint high = pair8(snorm(v.z, 127.0), snorm(v.w, 127.0));
  return uvec4(pair8(snorm(v.x, 127.0), snorm(v.y, 127.0)) | high << 16u, 0u, 0u, 0u);
}

// A direction of about unit length, or 0, projected onto the octahedron |x| + |y| + |z| = 1, whose lower half is folded outwards to
// the corners of the square (Meyer et al. 2010, "On floating-point normal vectors").
vec2 octahedral(vec3 direction) {
  precise float sum = abs(direction.x) + abs(direction.y) + abs(direction.z);
  precise vec2 upper = direction.xy / max(sum, 1e-30);
  precise vec2 folded = 1.0 - abs(upper.yx);
  vec2 lower = vec2(upper.x < 0.0 ? -folded.x : folded.x, upper.y < 0.0 ? -folded.y : folded.y);
  return direction.z >= 0.0 ? upper : lower;
}

// An integer from 1 to `largest`, negated if the handedness is negative.
uint signedByHand(float value, float handedness, float largest) {
  precise float scaled = (clamp(value, -1.0, 1.0) * 0.5 + 0.5) * (largest - 1.0);
  int step = 1 + int(roundEven(scaled));
  return uint(handedness < 0.0 ? -step : step);
}

// Any format except the octahedral ones.
uvec4 encodeComponents(uint format, vec4 v) {
  switch (format) {
    case FORMAT_FLOAT16X3:
    case FORMAT_FLOAT16X4: return uvec4(packHalves(v.x, v.y), packHalves(v.z, v.w), 0u, 0u);
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
    return uvec4(pair16(snormOfUnit(o.x, 32767.0), snormOfUnit(o.y, 32767.0)), 0u, 0u, 0u);
  }
  if (format == FORMAT_OCTAHEDRAL8X2) {
    vec2 o = octahedral(normal);
    return uvec4(pair8(snormOfUnit(o.x, 127.0), snormOfUnit(o.y, 127.0)), 0u, 0u, 0u);
  }
  return encodeComponents(format, vec4(normal, 0.0));
}

uvec4 encodeTangent(uint format, vec4 tangent) {
  if (format == FORMAT_OCTAHEDRAL16X2) {
    vec2 o = octahedral(tangent.xyz);
    return uvec4(pair16(snormOfUnit(o.x, 32767.0), signedByHand(o.y, tangent.w, 32767.0)), 0u, 0u, 0u);
  }
  if (format == FORMAT_OCTAHEDRAL8X2) {
    vec2 o = octahedral(tangent.xyz);
    return uvec4(pair8(snormOfUnit(o.x, 127.0), signedByHand(o.y, tangent.w, 127.0)), 0u, 0u, 0u);
  }
  return encodeComponents(format, tangent);
}

#endif
