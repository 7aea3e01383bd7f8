// How a packed mesh is read. Needs abi.h.

layout(set = 0, binding = BINDING_MESHES, std430) readonly buffer Meshes { uint meshes[]; };

vec3 meshVector(uint word) {
  return vec3(uintBitsToFloat(meshes[word]), uintBitsToFloat(meshes[word + 1u]), uintBitsToFloat(meshes[word + 2u]));
}

// Where the influences of one vertex stand.
struct InfluenceRows {
  uint weights;  // word of slot 0's weight
  uint joints;   // word of slots 0 and 1's joints
  uint slots;    // of the block; those of this vertex may be fewer
};

InfluenceRows influenceRows(uint mesh, uint vertex) {
  uint block = mesh + meshes[mesh + MESH_HEADER_BLOCKS] + (vertex / BLOCK_VERTICES) * BLOCK_WORDS;
  InfluenceRows rows;
  rows.slots = meshes[block + BLOCK_SLOTS];
  rows.weights = mesh + meshes[block + BLOCK_OFFSET] + vertex % BLOCK_VERTICES;
  rows.joints = rows.weights + rows.slots * BLOCK_VERTICES;
  return rows;
}

float influenceWeight(InfluenceRows rows, uint slot) {
  return uintBitsToFloat(meshes[rows.weights + slot * BLOCK_VERTICES]);
}

uint influenceJoint(InfluenceRows rows, uint slot) {
  uint pair = meshes[rows.joints + (slot / 2u) * BLOCK_VERTICES];
  return slot % 2u == 0u ? pair & 0xffffu : pair >> 16u;
}
