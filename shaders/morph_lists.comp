#version 450
#extension GL_GOOGLE_include_directive : require

// Lists the active morph targets of instances whose weights are made on the GPU, as the CPU lists those of others: in ascending
// order, without weights of 0. Weights are in a buffer, or sampled from clips; those of the last targets may be driven by the rig of
// the pose. An invocation for each instance.

#define TABLES_ARE_WRITTEN
#include "abi.h"
#include "tables.glsl"
#include "weights.glsl"

layout(local_size_x_id = CONSTANT_WORKGROUP_SIZE) in;

layout(push_constant) uniform Push { MorphListPush push; };

layout(set = 0, binding = BINDING_WEIGHTS, std430) readonly buffer Weights { uint writtenWeights[]; };
layout(set = 0, binding = BINDING_DRIVEN, std430) readonly buffer Driven { uint drivenWords[]; };

// Appends a target to a list that ends at `word`. `weight` has the bits of a float.
void append(inout uint word, uint target, uint weight) {
  if ((weight & 0x7fffffffu) == 0u) return;
  tables[word] = target;
  tables[word + 1u] = weight;
  word += ACTIVE_MORPH_WORDS;
}

void main() {
  uint number = workgroupNumber() * gl_WorkGroupSize.x + gl_LocalInvocationID.x;
  if (number >= push.listCount) return;
  uint record = push.lists + number * MORPH_LIST_WORDS;
  MorphListRecord list = loadMorphList(record);
  WeightSource source = WeightSource(record + MORPH_LIST_LAYERS, list.layerCount, list.clips, list.weights, list.track, list.masks);
  bool isSampled = list.clips != MORPH_LIST_NO_CLIPS;
  float sum = 0.0;
  if (isSampled) sum = sumOfFactors(source);
  uvec3 group = uvec3(0u);
  uint word = list.list;
  for (uint target = 0u; target < list.weightCount; ++target) {
    uint weight;  // the bits of a float
    if (isSampled) {
      if (target % 3u == 0u) group = floatBitsToUint(sampleGroup(source, sum, target / 3u));
      weight = target % 3u == 0u ? group.x : target % 3u == 1u ? group.y : group.z;
    } else {
      weight = writtenWeights[list.weights + target];
    }
    append(word, target, weight);
  }
  for (uint i = 0u; i < list.drivenCount; ++i) append(word, list.firstDriven + i, drivenWords[list.driven + i]);
  tables[list.extension + EXTENSION_MORPH_COUNT] = list.listed + (word - list.list) / ACTIVE_MORPH_WORDS;
}
