// Arithmetic that a compiler may not reorder. Built-in dot, cross and normalize may be computed in
// any order and differ between specialisations of one kernel, so every sum that reaches an output
// is spelled out here.

float dot3(vec3 a, vec3 b) {
  precise float sum = a.x * b.x + a.y * b.y + a.z * b.z;
  return sum;
}

float dot4(vec4 a, vec4 b) {
  precise float sum = a.x * b.x + a.y * b.y + a.z * b.z + a.w * b.w;
  return sum;
}

vec3 cross3(vec3 a, vec3 b) {
  precise vec3 product = vec3(a.y * b.z - a.z * b.y, a.z * b.x - a.x * b.z, a.x * b.y - a.y * b.x);
  return product;
}

float largestComponent(vec3 v) {
  return max(abs(v.x), max(abs(v.y), abs(v.z)));
}

// NaN and infinity are told by their bits: without SignedZeroInfNanPreserve a driver may take isnan
// and isinf for false, and a comparison with NaN for anything.
bool isNan(float value) {
  return (floatBitsToUint(value) & 0x7fffffffu) > 0x7f800000u;
}

bool isFinite(vec4 v) {
  const uvec4 exponent = uvec4(0x7f800000u);
  return all(notEqual(floatBitsToUint(v) & exponent, exponent));
}

// The power of two that brings a normal number to between a half and 4, and a subnormal one to at
// least 2^-23, so that its square neither overflows nor vanishes: multiplying by it rounds nothing,
// and takes less time than a division.
float powerScale(float largest) {
  uint exponent = floatBitsToUint(largest) >> 23u;
  return uintBitsToFloat((253u - min(exponent, 252u)) << 23u);
}

// v with length 1, at any scale of a joint, or `fallback` where v vanished.
vec3 unitOr(vec3 v, vec3 fallback) {
  precise vec3 scaled = v * powerScale(largestComponent(v));
  float squared = dot3(scaled, scaled);
  precise vec3 unit = scaled * inversesqrt(squared);
  return squared == 0.0 ? fallback : unit;
}
