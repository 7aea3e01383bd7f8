// Arithmetic that a compiler may not reorder. Compilers may compute built-in dot, cross and normalize in any order, and differently
// in each specialization of a kernel. So kernels write out every floating-point sum that affects an output, and compute it as
// `precise`. `fma` rounds once or twice, but the same way in every pipeline of a device: the compiler of this project decorates it
// NoContraction, which makes it a single operation (SPIR-V, GLSL.std.450 Fma). Many GPUs need a third less arithmetic with it.
#ifndef DERMIS_EXACT_GLSL
#define DERMIS_EXACT_GLSL

float dot3(vec3 a, vec3 b) {
  precise float sum = fma(a.z, b.z, fma(a.y, b.y, a.x * b.x));
  return sum;
}

float dot4(vec4 a, vec4 b) {
  precise float sum = fma(a.w, b.w, fma(a.z, b.z, fma(a.y, b.y, a.x * b.x)));
  return sum;
}

// Where `fma` rounds once, the product of parallel vectors is not exactly 0.
vec3 cross3(vec3 a, vec3 b) {
  precise vec3 second = a.zxy * b.yzx;
  precise vec3 product = fma(a.yzx, b.zxy, -second);
  return product;
}

float largestComponent(vec3 v) {
  return max(abs(v.x), max(abs(v.y), abs(v.z)));
}

// NaN and infinity are recognized by their bits: without SignedZeroInfNanPreserve a driver may assume that isnan and isinf are
// false, and may give comparisons with NaN any result.
bool isNan(float value) {
  return (floatBitsToUint(value) & 0x7fffffffu) > 0x7f800000u;
}

bool isFinite(vec4 v) {
  const uvec4 exponent = uvec4(0x7f800000u);
  return all(notEqual(floatBitsToUint(v) & exponent, exponent));
}

// A power of two. It scales a normal number to between a half and 4, and a subnormal number to at least 2^-23, so that the square
// neither overflows nor underflows to 0. The multiplication does not round, and takes less time than a division.
float powerScale(float largest) {
  uint exponent = floatBitsToUint(largest) >> 23u;
  return uintBitsToFloat((253u - min(exponent, 252u)) << 23u);
}

// The inverse of that power, exactly.
float inversePowerScale(float largest) {
  uint exponent = floatBitsToUint(largest) >> 23u;
  return uintBitsToFloat((1u + min(exponent, 252u)) << 23u);
}

// Vulkan permits an error of 2.5 units in the last place for a division, of 2 for an inverse square root, and of both together for
// a square root. A step of Newton's method reduces each to about one rounding on any device. A zero divisor, the inverse root of
// zero, and infinite arguments give NaN, and denormals may. `squareRoot` of zero or of a denormal is 0.

float quotient(float a, float b) {
  precise float guess = a / b;
  precise float better = guess + (a - guess * b) / b;
  return better;
}

float inverseRoot(float square) {
  float guess = inversesqrt(square);
  precise float better = guess + 0.5 * guess * (1.0 - square * guess * guess);
  return better;
}

float squareRoot(float square) {
  float guess = sqrt(square);
  precise float better = guess + 0.5 * (square - guess * guess) / guess;
  return square < 1e-37 ? 0.0 : better;
}

// v with length 1, or `fallback` if v is zero. Works at any scale.
vec3 unitOr(vec3 v, vec3 fallback) {
  precise vec3 scaled = v * powerScale(largestComponent(v));
  float squared = dot3(scaled, scaled);
  precise vec3 unit = scaled * inversesqrt(squared);
  return squared == 0.0 ? fallback : unit;
}

#endif
