// How skinned attributes are written. Each has a buffer of its own, which may be one and the same; with ONE_OUTPUT it is, for
// devices that have no more storage buffers a stage.
#ifndef DERMIS_OUTPUT_ACCESS_GLSL
#define DERMIS_OUTPUT_ACCESS_GLSL

#include "abi.h"

#ifdef PAIRS
layout(set = 0, binding = BINDING_POSITIONS, std430) writeonly buffer PositionsPairs { uint64_t positionsPairs[]; };

// A position and the normal behind it, two words at a time: drivers that store lane by lane take half as long.
void storePositionAndNormal(uint place, uvec3 position, uvec3 normal) {
  uint pair = place / 8u;
  positionsPairs[pair] = packUint2x32(position.xy);
  positionsPairs[pair + 1u] = packUint2x32(uvec2(position.z, normal.x));
  positionsPairs[pair + 2u] = packUint2x32(normal.yz);
}
#endif

#define STREAM_BINDING BINDING_POSITIONS
#define STREAM_WORDS_BLOCK PositionsWords
#define STREAM_WORDS positionsWords
#define STREAM_HALVES_BLOCK PositionsHalves
#define STREAM_HALVES positionsHalves
#define STREAM_BYTES_BLOCK PositionsBytes
#define STREAM_BYTES positionsBytes
#define STREAM_STORE storePositions
#if defined(EXTRAS) || defined(ONE_OUTPUT)
#define STREAM_LOAD loadPositions
#endif
#include "stream.glsl"

#ifdef ONE_OUTPUT
#define storeNormals storePositions
#define storeTangents storePositions
#define storePrevious storePositions
#else
#define STREAM_BINDING BINDING_NORMALS
#define STREAM_WORDS_BLOCK NormalsWords
#define STREAM_WORDS normalsWords
#define STREAM_HALVES_BLOCK NormalsHalves
#define STREAM_HALVES normalsHalves
#define STREAM_BYTES_BLOCK NormalsBytes
#define STREAM_BYTES normalsBytes
#define STREAM_STORE storeNormals
#include "stream.glsl"

#define STREAM_BINDING BINDING_TANGENTS
#define STREAM_WORDS_BLOCK TangentsWords
#define STREAM_WORDS tangentsWords
#define STREAM_HALVES_BLOCK TangentsHalves
#define STREAM_HALVES tangentsHalves
#define STREAM_BYTES_BLOCK TangentsBytes
#define STREAM_BYTES tangentsBytes
#define STREAM_STORE storeTangents
#include "stream.glsl"

#ifdef EXTRAS
#define STREAM_BINDING BINDING_PREVIOUS
#define STREAM_WORDS_BLOCK PreviousWords
#define STREAM_WORDS previousWords
#define STREAM_HALVES_BLOCK PreviousHalves
#define STREAM_HALVES previousHalves
#define STREAM_BYTES_BLOCK PreviousBytes
#define STREAM_BYTES previousBytes
#define STREAM_STORE storePrevious
#include "stream.glsl"
#endif
#endif

#endif
