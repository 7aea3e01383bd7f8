// The results of an instance: the box of its positions, and the number of clamped vertices.
#ifndef DERMIS_RESULTS_GLSL
#define DERMIS_RESULTS_GLSL

#include "abi.h"
#include "exact.glsl"

#ifndef RESULTS_BINDING
#define RESULTS_BINDING BINDING_RESULTS
#endif
layout(set = 0, binding = RESULTS_BINDING, std430) coherent buffer Results { ResultRecord results[]; };
#ifdef TEXELS
// The same buffer in 64-bit words. lavapipe loads each lane separately, so reading a box by three 64-bit loads takes less time than
// by six 32-bit loads.
layout(set = 0, binding = RESULTS_BINDING, std430) coherent buffer ResultPairs { uint64_t resultPairs[]; };
#endif

void clearResult(uint result) {
  results[result] = ResultRecord(0xffffffffu, 0xffffffffu, 0xffffffffu, 0u, 0u, 0u, 0u, 0u);
}

// Unsigned integers that compare like the floats. -0 counts as 0.
uint orderedBits(float value) {
  uint bits = floatBitsToUint(value);
  if (bits == 0x80000000u) bits = 0u;
  return (bits & 0x80000000u) != 0u ? ~bits : bits | 0x80000000u;
}

struct ResultBox {
  uvec3 least;
  uvec3 greatest;
};

ResultBox resultBox(uint result) {
#ifdef TEXELS
  uvec2 a = unpackUint2x32(resultPairs[result * 4u]);
  uvec2 b = unpackUint2x32(resultPairs[result * 4u + 1u]);
  uvec2 c = unpackUint2x32(resultPairs[result * 4u + 2u]);
  return ResultBox(uvec3(a, b.x), uvec3(b.y, c));
#else
  ResultRecord r = results[result];
  return ResultBox(uvec3(r.minX, r.minY, r.minZ), uvec3(r.maxX, r.maxY, r.maxZ));
#endif
}

// Most positions do not change the box, so it is cheaper to compare first. The values that are read may be out of date. Since a box
// only grows, this costs at most a needless atomic operation.
#define ADD_EXTREME(least, greatest, bits, before, after, value) \
  if (!isNan(value)) {                                           \
    if (bits < (before)) atomicMin(least, bits);                 \
    if (bits > (after)) atomicMax(greatest, bits);               \
  }

void addToBounds(uint result, vec3 position) {
  ResultBox box = resultBox(result);
  uvec3 bits = uvec3(orderedBits(position.x), orderedBits(position.y), orderedBits(position.z));
  ADD_EXTREME(results[result].minX, results[result].maxX, bits.x, box.least.x, box.greatest.x, position.x)
  ADD_EXTREME(results[result].minY, results[result].maxY, bits.y, box.least.y, box.greatest.y, position.y)
  ADD_EXTREME(results[result].minZ, results[result].maxZ, bits.z, box.least.z, box.greatest.z, position.z)
}

void countClamped(uint result) { atomicAdd(results[result].clampedVertices, 1u); }

#endif
