#version 450
#extension GL_GOOGLE_include_directive : require

// Lists the active morph targets of instances whose weights are written on the GPU, as the CPU lists those of others: in ascending
// order, without weights of 0. An invocation for each instance.

#define TABLES_ARE_WRITTEN
#include "abi.h"
#include "tables.glsl"

layout(local_size_x_id = CONSTANT_WORKGROUP_SIZE) in;

layout(push_constant) uniform Push { MorphListPush push; };

layout(set = 0, binding = BINDING_WEIGHTS, std430) restrict readonly buffer Weights { uint weights[]; };

void main() {
  uint number = workgroupNumber() * gl_WorkGroupSize.x + gl_LocalInvocationID.x;
  if (number >= push.listCount) return;
  MorphListRecord record = loadMorphList(push.lists + number * MORPH_LIST_WORDS);
  uint word = record.list;
  for (uint target = 0u; target < record.weightCount; ++target) {
    uint weight = weights[record.weights + target];  // the bits of a float
    if ((weight & 0x7fffffffu) == 0u) continue;
    tables[word] = target;
    tables[word + 1u] = weight;
    word += ACTIVE_MORPH_WORDS;
  }
  tables[record.extension + EXTENSION_MORPH_COUNT] = (word - record.list) / ACTIVE_MORPH_WORDS;
}
