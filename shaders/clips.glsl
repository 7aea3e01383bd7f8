// Reads a bank of clips (engine/src/core/clips/bank.h) in the mesh buffer. It was checked when it was made.
#ifndef DERMIS_CLIPS_GLSL
#define DERMIS_CLIPS_GLSL

#include "abi.h"
#include "quaternion.glsl"

#ifdef TEXELS
#include "cpu_device/texels.glsl"

uvec4 clipUnit(uint unit) { return meshUnit(unit); }
uint clipWord(uint word) { return meshWord(word); }
// Two reads take less time than three.
uvec3 clipThreeWords(uint word) {
  uvec4 a = clipUnit(word / 4u);
  uvec4 b = clipUnit((word + 2u) / 4u);
  if ((word & 2u) != 0u) a = uvec4(a.zw, b.xy);
  return (word & 1u) != 0u ? a.yzw : a.xyz;
}
#else
layout(set = 0, binding = BINDING_MESHES, std430) readonly buffer Clips { uint clipWords[]; };
layout(set = 0, binding = BINDING_MESHES, std430) readonly buffer ClipUnits { uvec4 clipUnits[]; };

uvec4 clipUnit(uint unit) { return clipUnits[unit]; }
uint clipWord(uint word) { return clipWords[word]; }
uvec3 clipThreeWords(uint word) { return uvec3(clipWords[word], clipWords[word + 1u], clipWords[word + 2u]); }
#endif

const float ROOT_OF_HALF = 0.70710678;
const float ROOT_OF_TWO = 2.0 * ROOT_OF_HALF;

// Rows of a 3×4 matrix.
struct Transform {
  vec4 r0;
  vec4 r1;
  vec4 r2;
};

Transform loadTransform(uint word) {
  uint unit = word / 4u;
  return Transform(uintBitsToFloat(clipUnit(unit)), uintBitsToFloat(clipUnit(unit + 1u)), uintBitsToFloat(clipUnit(unit + 2u)));
}

vec4 rowTimes(vec4 row, Transform b) {
  precise vec4 product = fma(vec4(row.z), b.r2, fma(vec4(row.y), b.r1, row.x * b.r0));
  precise float shifted = product.w + row.w;
  return vec4(product.xyz, shifted);
}

Transform multiply(Transform a, Transform b) {
  return Transform(rowTimes(a.r0, b), rowTimes(a.r1, b), rowTimes(a.r2, b));
}

// A number of float16. `unpackHalf2x16` may take a denormal one for 0.
float fromHalf(uint bits) {
  precise float denormal = float(bits & 0x3ffu) * 5.9604644775390625e-8;  // 2⁻²⁴
  uint exponent = bits >> 10u & 31u;
  float size = exponent == 0u ? denormal : uintBitsToFloat((exponent + 112u) << 23u | (bits & 0x3ffu) << 13u);
  return (bits & 0x8000u) != 0u ? -size : size;
}

// A key: three integers, and for rotations the component that is not stored.
struct Key {
  uvec3 values;
  uint missing;
};

// A key of size 0, 1 or 2 has 2, 3 or 4 halves of 16 bits. Of its words `low` is the first, and `high` the last. If `isOdd`, it
// begins with the upper half of a word.
Key keyOf(uint low, uint high, bool isOdd, uint size, bool isRotation) {
  if (size == 0u) return Key((uvec3(low) >> uvec3(0u, 10u, 20u)) & 1023u, low >> 30u);
  if (size == 1u) {
    uint both = isOdd ? low >> 16u | high << 16u : low;
    uint last = isOdd ? high >> 16u : high & 0xffffu;
    if (isRotation) return Key(uvec3(both, both >> 16u, last) & 0x7fffu, (both >> 15u & 1u) | both >> 31u << 1u);
    return Key(uvec3(both & 0xffffu, both >> 16u, last), 0u);
  }
  if (isRotation) return Key(uvec3(low & 0xfffffu, (low >> 20u & 1023u) | (high & 1023u) << 10u, high >> 10u & 0xfffffu), low >> 30u);
  return Key(uvec3(low & 0x1fffffu, low >> 21u | (high & 1023u) << 11u, high >> 10u & 0x1fffffu), 0u);
}

// A quaternion of about unit length. `step`: what the integers of a key count.
vec4 rotationOf(Key key, float step) {
  precise vec3 v = vec3(key.values) * step - ROOT_OF_HALF;
  precise float square = 1.0 - dot3(v, v);
  float other = squareRoot(max(0.0, square));
  if (key.missing == 0u) return vec4(other, v);
  if (key.missing == 1u) return vec4(v.x, other, v.yz);
  if (key.missing == 2u) return vec4(v.xy, other, v.z);
  return vec4(v, other);
}

vec4 unitOrIdentity(vec4 q) {
  float square = dot4(q, q);
  precise vec4 unit = q * inverseRoot(square);
  return square > 0.0 ? unit : vec4(0.0, 0.0, 0.0, 1.0);
}

// A clip at a time inside it.
struct ClipTime {
  uint clips;    // the word where the bank begins
  uint classes;  // word offset in the bank
  float frame;   // of the finest intervals
};

const uint TRACK_AT_REST = 0u;  // without numbers
const uint TRACK_WITH_KEYS = 2u;
uint trackKind(uint word) { return word >> 30u; }

// Samples a track with one value or with keys. `word` is that of the track.
vec4 sampleTrack(ClipTime at, uint word, bool isRotation) {
  bool hasKeys = trackKind(word) == TRACK_WITH_KEYS;
  // Four words: of the value, or of two keys. lavapipe executes both sides of a condition, so they are loaded once.
  uvec4 words = at.clips + (word & 0x3fffffffu) + uvec4(0u, 1u, 2u, isRotation ? 3u : 2u);
  uint size = 0u;
  bool isOdd = false;
  uint range = 0u;
  precise float fraction = 0.0;
  if (hasKeys) {
    uint column = word & ((1u << TRACK_COLUMN_BITS) - 1u);
    uint unit = (at.clips + at.classes + (word >> TRACK_COLUMN_BITS & 255u) * CLIP_CLASS_WORDS) / 4u;
    uvec4 a = clipUnit(unit);       // format, level, number of keys, number of columns
    uvec4 b = clipUnit(unit + 1u);  // keys, halves of a row, ranges, jumps
    size = a.x & 3u;
    // A power of two, which a division need not give exactly.
    precise float position = at.frame * uintBitsToFloat((127u - a.y) << 23u);
    float interval = min(floor(position), float(a.z - 2u));
    fraction = position - interval;
    uint row = uint(interval);
    if (b.w != 0u) {
      uint jumps = at.clips + b.w + row * ((a.w + 3u) / 4u) + column / 4u;
      uint jump = clipWord(jumps) >> (column % 4u * 8u) & 255u;
      precise float part = fraction * 256.0;
      if (jump != 0u) fraction = part >= float(jump + 1u) ? 1.0 : 0.0;
    }
    uint firstHalf = 2u * (at.clips + b.x) + row * b.y + column * (2u + size);
    isOdd = firstHalf % 2u == 1u;
    words = firstHalf / 2u + uvec4(0u, min(size, 1u), b.y / 2u, b.y / 2u + min(size, 1u));  // a row has whole words
    range = (at.clips + b.z) / 4u + 2u * column;
  }
  uvec4 bits = uvec4(clipWord(words.x), clipWord(words.y), clipWord(words.z), clipWord(words.w));
  if (!hasKeys) return uintBitsToFloat(uvec4(bits.xyz, isRotation ? bits.w : 0u));
  Key from = keyOf(bits.x, bits.y, isOdd, size, isRotation);
  Key to = keyOf(bits.z, bits.w, isOdd, size, isRotation);
  precise float rest = 1.0 - fraction;
  if (isRotation) {
    float step = size == 0u ? ROOT_OF_TWO / 1023.0 : size == 1u ? ROOT_OF_TWO / 32767.0 : ROOT_OF_TWO / 1048575.0;
    vec4 p = rotationOf(from, step);
    vec4 q = rotationOf(to, step);
    float share = dot4(p, q) < 0.0 ? -fraction : fraction;
    precise vec4 mixed = rest * p + share * q;
    return unitOrIdentity(mixed);
  }
  vec3 least = uintBitsToFloat(clipUnit(range).xyz);
  vec3 scale = uintBitsToFloat(clipUnit(range + 1u).xyz);
  precise vec3 p = least + vec3(from.values) * scale;
  precise vec3 q = least + vec3(to.values) * scale;
  precise vec3 mixed = rest * p + fraction * q;
  return vec4(mixed, 0.0);
}

#endif
