#version 450
#extension GL_GOOGLE_include_directive : require

// Clears the results that skin kernels add to. One result for each invocation.

#include "abi.h"
#include "results.glsl"
#include "tables.glsl"

layout(local_size_x_id = CONSTANT_WORKGROUP_SIZE) in;

layout(push_constant) uniform Push { ClearPush push; };

void main() {
  uint number = workgroupNumber() * gl_WorkGroupSize.x + gl_LocalInvocationID.x;
  if (number < push.resultCount) clearResult(tables[push.results + number]);
}
