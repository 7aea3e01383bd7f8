// Adds the displacements of active morph targets to a vertex in bind pose.
#ifndef DERMIS_MORPH_GLSL
#define DERMIS_MORPH_GLSL

#include "abi.h"
#include "tables.glsl"
#include "mesh_access.glsl"
#include "vertex.glsl"

// Finds the displacement of a vertex by a target: sets `word`, or returns false if the target does not displace the vertex.
bool findDisplacement(uint mesh, MorphRecord target, uint vertex, out uint word) {
  uint number = vertex / MORPH_BLOCK_VERTICES - target.firstBlock;
  // For a block before the first, the subtraction wraps around.
  if (number >= target.blockCount) return false;
  MorphBlockRecord block = loadMorphBlock(mesh + target.blocks + number * MORPH_BLOCK_WORDS);
  uint lane = vertex % MORPH_BLOCK_VERTICES;
  uint mask = lane < 32u ? block.maskLow : block.maskHigh;
  uint bit = 1u << (lane % 32u);
  if ((mask & bit) == 0u) return false;
  uint before = uint(bitCount(mask & (bit - 1u))) + (lane < 32u ? 0u : uint(bitCount(block.maskLow)));
  word = mesh + block.displacements + before * 3u * uint(bitCount(target.attributes));
  return true;
}

// `number` is the index of the vertex. The active targets begin at word `first` of the tables, sorted by target.
void morphVertex(inout Vertex vertex, uint mesh, uint number, uint first, uint count) {
  precise vec3 position = vertex.position;
  precise vec3 normal = vertex.normal;
  precise vec3 tangent = vertex.tangent.xyz;
  uint targets = mesh + loadMeshHeader(mesh).morphs;
  for (uint i = 0u; i < count; ++i) {
    ActiveMorph morph = loadActiveMorph(first + i * ACTIVE_MORPH_WORDS);
    MorphRecord target = loadMorph(targets + morph.target * MORPH_WORDS);
    float weight = morph.weight;
    uint word;
    if (!findDisplacement(mesh, target, number, word)) continue;
    if ((target.attributes & MORPH_HAS_POSITIONS) != 0u) {
      position += weight * meshVector(word);
      word += 3u;
    }
    if ((target.attributes & MORPH_HAS_NORMALS) != 0u) {
      if (NORMALS) normal += weight * meshVector(word);
      word += 3u;
    }
    if (TANGENTS && (target.attributes & MORPH_HAS_TANGENTS) != 0u) tangent += weight * meshVector(word);
  }
  vertex.position = position;
  vertex.normal = normal;
  vertex.tangent.xyz = tangent;
}

#endif
