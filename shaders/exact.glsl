// Arithmetic that a compiler may not reorder. Built-in dot, cross and normalize may be computed in any order and differ
// between specialisations of one kernel, so every sum that reaches an output is spelled out here.

float dot3(vec3 a, vec3 b) {
  precise float sum = a.x * b.x + a.y * b.y + a.z * b.z;
  return sum;
}

float dot4(vec4 a, vec4 b) {
  precise float sum = a.x * b.x + a.y * b.y + a.z * b.z + a.w * b.w;
  return sum;
}

vec3 cross3(vec3 a, vec3 b) {
  precise vec3 product =
      vec3(a.y * b.z - a.z * b.y, a.z * b.x - a.x * b.z, a.x * b.y - a.y * b.x);
  return product;
}

float largestComponent(vec3 v) { return max(abs(v.x), max(abs(v.y), abs(v.z))); }

// The power of two that brings a normal number to between a half and 4, and a subnormal one to at least 2^-23, so that its square
// neither overflows nor vanishes: multiplying by it rounds nothing, and takes less time than a division.
float powerScale(float largest) {
  uint exponent = floatBitsToUint(largest) >> 23u;
  return uintBitsToFloat((253u - min(exponent, 252u)) << 23u);
}

// v with length 1, or `fallback` with length 1 where v vanished; zero where both did, at any scale of a joint.
vec3 unitOr(vec3 v, vec3 fallback) {
  float largest = largestComponent(v);
  if (largest == 0.0) {
    v = fallback;
    largest = largestComponent(v);
    if (largest == 0.0) return vec3(0.0);
  }
  precise vec3 scaled = v * powerScale(largest);
  precise vec3 unit = scaled * inversesqrt(dot3(scaled, scaled));
  return unit;
}
