// Morph targets: what the active ones add to a vertex in bind pose.
#ifndef DERMIS_MORPH_GLSL
#define DERMIS_MORPH_GLSL

#include "abi.h"
#include "tables.glsl"
#include "mesh_access.glsl"
#include "vertex.glsl"

// The displacement of a vertex by a target, at `word`; false where the target leaves it alone.
bool findDisplacement(uint mesh, uint target, uint vertex, out uint word) {
  uint block = vertex / MORPH_BLOCK_VERTICES - meshWord(target + MORPH_FIRST_BLOCK);
  // A block before the first wraps around.
  if (block >= meshWord(target + MORPH_BLOCK_COUNT)) return false;
  uint entry = meshSection(mesh, target - mesh + MORPH_BLOCKS) + block * MORPH_BLOCK_WORDS;
  uint lane = vertex % MORPH_BLOCK_VERTICES;
  uint low = meshWord(entry + MORPH_BLOCK_MASK);
  uint mask = lane < 32u ? low : meshWord(entry + MORPH_BLOCK_MASK + 1u);
  uint bit = 1u << (lane % 32u);
  if ((mask & bit) == 0u) return false;
  uint before = uint(bitCount(mask & (bit - 1u))) + (lane < 32u ? 0u : uint(bitCount(low)));
  uint words = 3u * uint(bitCount(meshWord(target + MORPH_ATTRIBUTES)));
  word = mesh + meshWord(entry + MORPH_BLOCK_DISPLACEMENTS) + before * words;
  return true;
}

// `first` is where the active targets stand in the tables, in rising order.
void morphVertex(inout Vertex vertex, uint mesh, uint number, uint first, uint count, bool withNormal, bool withTangent) {
  precise vec3 position = vertex.position;
  precise vec3 normal = vertex.normal;
  precise vec3 tangent = vertex.tangent.xyz;
  uint targets = meshSection(mesh, MESH_HEADER_MORPHS);
  for (uint i = 0u; i < count; ++i) {
    ActiveMorph morph = loadActiveMorph(first + i * ACTIVE_MORPH_WORDS);
    uint target = targets + morph.target * MORPH_WORDS;
    float weight = morph.weight;
    uint word;
    if (!findDisplacement(mesh, target, number, word)) continue;
    uint attributes = meshWord(target + MORPH_ATTRIBUTES);
    if ((attributes & MORPH_HAS_POSITIONS) != 0u) {
      position += weight * meshVector(word);
      word += 3u;
    }
    if ((attributes & MORPH_HAS_NORMALS) != 0u) {
      if (withNormal) normal += weight * meshVector(word);
      word += 3u;
    }
    if (withTangent && (attributes & MORPH_HAS_TANGENTS) != 0u) tangent += weight * meshVector(word);
  }
  vertex.position = position;
  vertex.normal = normal;
  vertex.tangent.xyz = tangent;
}

#endif
