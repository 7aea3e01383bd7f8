#version 450
#extension GL_GOOGLE_include_directive : require

// Skins vertices: a workgroup takes a run of vertices of one mesh, and each invocation skins its vertex for several
// instances of that mesh, so that a vertex is read once.

#include "abi.h"

layout(constant_id = CONSTANT_METHOD) const uint METHOD = METHOD_DUAL_QUATERNION;
layout(constant_id = CONSTANT_NORMALS) const bool NORMALS = true;
layout(constant_id = CONSTANT_INFLUENCES) const uint INFLUENCES = 0u;
layout(constant_id = CONSTANT_INSTANCES) const uint INSTANCES = 1u;

#include "exact.glsl"
#include "quaternion.glsl"
#include "polar.glsl"
#include "tables.glsl"
#include "mesh_access.glsl"
#include "palette_access.glsl"
#include "blend.glsl"

layout(local_size_x_id = CONSTANT_WORKGROUP_SIZE) in;

layout(set = 0, binding = BINDING_OUTPUT, std430) writeonly buffer Output { uint outputWords[]; };

void writeVector(uint word, vec3 v) {
  outputWords[word] = floatBitsToUint(v.x);
  outputWords[word + 1u] = floatBitsToUint(v.y);
  outputWords[word + 2u] = floatBitsToUint(v.z);
}

// The group that a workgroup belongs to: the first whose end lies behind it.
uint findGroup(uint number) {
  uint low = 0u;
  uint high = push[PUSH_RECORD_COUNT] - 1u;
  while (low < high) {
    uint middle = (low + high) / 2u;
    if (tables[push[PUSH_FIRST_RECORD] + middle * GROUP_WORDS + GROUP_WORKGROUP_END] <= number) {
      low = middle + 1u;
    } else {
      high = middle;
    }
  }
  return low;
}

void main() {
  uint number = workgroupNumber();
  if (number >= push[PUSH_WORKGROUP_COUNT]) return;
  uint index = findGroup(number);
  uint group = push[PUSH_FIRST_RECORD] + index * GROUP_WORDS;
  uint local = index == 0u ? number : number - tables[group - GROUP_WORDS + GROUP_WORKGROUP_END];

  // Workgroups go over the vertices for some instances, then over the vertices again for the next: their palettes stay near.
  uint vertexGroups = tables[group + GROUP_VERTEX_GROUPS];
  uint firstVertex = tables[group + GROUP_FIRST_VERTEX];
  uint vertex = firstVertex + (local % vertexGroups) * gl_WorkGroupSize.x + gl_LocalInvocationID.x;
  if (vertex >= tables[group + GROUP_VERTEX_END]) return;
  uint firstInstance = (local / vertexGroups) * INSTANCES;
  uint instanceEnd = min(firstInstance + INSTANCES, tables[group + GROUP_INSTANCE_COUNT]);

  uint mesh = tables[group + GROUP_MESH];
  Vertex bind;
  bind.position = meshVector(mesh + meshes[mesh + MESH_HEADER_POSITIONS] + vertex * 3u);
  bind.normal = vec3(0.0);
  if (NORMALS) bind.normal = meshVector(mesh + meshes[mesh + MESH_HEADER_NORMALS] + vertex * 3u);
  InfluenceRows rows = influenceRows(mesh, vertex);
  uint slots = INFLUENCES == 0u ? rows.slots : min(rows.slots, INFLUENCES);
  bool hasWeight = slots > 0u && influenceWeight(rows, 0u) != 0.0;

  for (uint instance = firstInstance; instance < instanceEnd; ++instance) {
    uint record = push[PUSH_INSTANCE_RECORDS] + (tables[group + GROUP_FIRST_INSTANCE] + instance) * INSTANCE_WORDS;
    uint palette = tables[record + INSTANCE_PALETTE];
    Vertex skinned = Vertex(bind.position, vec3(0.0));
    if (!hasWeight) {
      if (NORMALS) skinned.normal = unitOr(bind.normal, vec3(0.0));
    } else if (METHOD == METHOD_LINEAR) {
      skinned = skinLinear(bind, rows, slots, palette, NORMALS);
    } else {
      skinned = skinDualQuaternion(bind, rows, slots, palette, tables[record + INSTANCE_JOINTS], NORMALS);
    }
    uint run = vertex - firstVertex;
    writeVector(tables[record + INSTANCE_POSITIONS] + run * tables[group + GROUP_POSITION_STRIDE], skinned.position);
    if (NORMALS) {
      writeVector(tables[record + INSTANCE_NORMALS] + run * tables[group + GROUP_NORMAL_STRIDE], skinned.normal);
    }
  }
}
