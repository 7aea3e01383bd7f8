// The results of an instance: the box of its positions, and the number of clamped vertices.
#ifndef DERMIS_RESULTS_GLSL
#define DERMIS_RESULTS_GLSL

#include "abi.h"
#include "exact.glsl"

#ifdef ONE_OUTPUT

// There is no buffer for results, and no plan has any.
void clearResult(uint result) {}
void addToBounds(uint result, vec3 position) {}
void countClamped(uint result) {}

#else

layout(set = 0, binding = BINDING_RESULTS, std430) coherent buffer Results { ResultRecord results[]; };

void clearResult(uint result) {
  results[result] = ResultRecord(0xffffffffu, 0xffffffffu, 0xffffffffu, 0u, 0u, 0u, 0u, 0u);
}

// Unsigned integers that compare like the floats. -0 counts as 0.
uint orderedBits(float value) {
  uint bits = floatBitsToUint(value);
  if (bits == 0x80000000u) bits = 0u;
  return (bits & 0x80000000u) != 0u ? ~bits : bits | 0x80000000u;
}

// Most positions do not change the box, so it is cheaper to compare first. The value that is read may be outdated, but then the box
// is only larger now.
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
