// For an engine's own shaders: decodes the formats of skinned vertices (VertexFormat in dermis/layout.h). Vertex input
// decodes float32, float16 and snorm components itself. It reads octahedral16x2 as VK_FORMAT_R16G16_SNORM.
#ifndef DERMIS_DECODE_GLSL
#define DERMIS_DECODE_GLSL

// A normal of unit length from octahedral16x2 or octahedral8x2. `stored` is read as snorm: from -1 to 1. Source: Meyer et al. 2010,
// "On floating-point normal vectors".
vec3 dermisDecodeOctahedral(vec2 stored) {
  vec3 direction = vec3(stored, 1.0 - abs(stored.x) - abs(stored.y));
  float below = max(-direction.z, 0.0);
  direction.x += direction.x >= 0.0 ? -below : below;
  direction.y += direction.y >= 0.0 ? -below : below;
  return normalize(direction);
}

// A tangent of unit length from octahedral16x2 (`largest` is 32767) or octahedral8x2 (127); w is the handedness. `stored` is read
// as snorm. The sign of its second component is the handedness. The absolute value of that component times `largest`, an integer
// from 1 to `largest`, encodes the coordinate from -1 to 1.
vec4 dermisDecodeOctahedralTangent(vec2 stored, float largest) {
  float handedness = stored.y < 0.0 ? -1.0 : 1.0;
  float y = (abs(stored.y) * largest - 1.0) / (largest - 1.0) * 2.0 - 1.0;
  return vec4(dermisDecodeOctahedral(vec2(stored.x, y)), handedness);
}

// A position from snorm16x3 or snorm16x4. `stored` is read as snorm. The box is that of the job or instance.
vec3 dermisDecodePosition(vec3 stored, vec3 boxMin, vec3 boxMax) {
  return 0.5 * (boxMin + boxMax) + stored * (0.5 * (boxMax - boxMin));
}

// For shaders that read attributes as words from a storage buffer instead of vertex input. Results for octahedral attributes and
// snorm16 positions are arguments for the functions above. Other results are final.
vec4 dermisUnpackSnorm16(uvec2 words) { return vec4(unpackSnorm2x16(words.x), unpackSnorm2x16(words.y)); }
vec2 dermisUnpackOctahedral16(uint word) { return unpackSnorm2x16(word); }
vec4 dermisUnpackSnorm8(uint word) { return unpackSnorm4x8(word); }
vec2 dermisUnpackOctahedral8(uint halfWord) { return unpackSnorm4x8(halfWord).xy; }
vec4 dermisUnpackFloat16(uvec2 words) { return vec4(unpackHalf2x16(words.x), unpackHalf2x16(words.y)); }

#endif
