// What is found out about an instance besides its vertices: the box of its positions, and how many were clamped.
#ifndef DERMIS_RESULTS_GLSL
#define DERMIS_RESULTS_GLSL

#include "abi.h"
#include "exact.glsl"

#ifdef ONE_OUTPUT

// There is no buffer for results; a plan asks for none.
void clearResult(uint result) {}
void addToBounds(uint result, vec3 position) {}
void countClamped(uint result) {}

#else

layout(set = 0, binding = BINDING_RESULTS, std430) coherent buffer Results { ResultRecord results[]; };

void clearResult(uint result) {
  results[result] = ResultRecord(0xffffffffu, 0xffffffffu, 0xffffffffu, 0u, 0u, 0u, 0u, 0u);
}

// As unsigned numbers these have the order of the floats; -0 counts as 0.
uint orderedBits(float value) {
  uint bits = floatBitsToUint(value);
  if (bits == 0x80000000u) bits = 0u;
  return (bits & 0x80000000u) != 0u ? ~bits : bits | 0x80000000u;
}

// Most positions are no extreme: it is cheaper to look first. What is read may be old; it is only ever farther in.
#define ADD_EXTREME(least, greatest, value)                  \
  if (!isNan(value)) {                                       \
    uint bits = orderedBits(value);                          \
    if (bits < (least)) atomicMin(least, bits);              \
    if (bits > (greatest)) atomicMax(greatest, bits);        \
  }

void addToBounds(uint result, vec3 position) {
  ADD_EXTREME(results[result].minX, results[result].maxX, position.x)
  ADD_EXTREME(results[result].minY, results[result].maxY, position.y)
  ADD_EXTREME(results[result].minZ, results[result].maxZ, position.z)
}

void countClamped(uint result) { atomicAdd(results[result].clampedVertices, 1u); }

#endif

#endif
