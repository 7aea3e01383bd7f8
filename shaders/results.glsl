// What is found out about an instance besides its vertices: the box of its positions, and how many were clamped. Needs abi.h and exact.glsl.

#ifdef EXTRAS

layout(set = 0, binding = BINDING_RESULTS, std430) coherent buffer Results { uint results[]; };

// As unsigned numbers these have the order of the floats; -0 counts as 0.
uint orderedBits(float value) {
  uint bits = floatBitsToUint(value);
  if (bits == 0x80000000u) bits = 0u;
  return (bits & 0x80000000u) != 0u ? ~bits : bits | 0x80000000u;
}

// Most positions are no extreme: it is cheaper to look first. What is read may be old; it is only ever farther in.
void addExtreme(uint result, uint axis, float value) {
  if (isNan(value)) return;
  uint bits = orderedBits(value);
  if (bits < results[result + RESULT_MIN + axis]) atomicMin(results[result + RESULT_MIN + axis], bits);
  if (bits > results[result + RESULT_MAX + axis]) atomicMax(results[result + RESULT_MAX + axis], bits);
}

void addToBounds(uint result, vec3 position) {
  addExtreme(result, 0u, position.x);
  addExtreme(result, 1u, position.y);
  addExtreme(result, 2u, position.z);
}

void countClamped(uint result) { atomicAdd(results[result + RESULT_CLAMPED], 1u); }

#else

// There is no buffer for results; a plan asks for none.
void addToBounds(uint result, vec3 position) {}
void countClamped(uint result) {}

#endif
