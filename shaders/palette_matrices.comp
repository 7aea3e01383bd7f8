#version 450
#extension GL_GOOGLE_include_directive : require

// Copies joint matrices to the palettes buffer, for linear blending in a scene: the skin kernel then reads device memory, and not
// the memory that the CPU writes. One workgroup copies one palette.

#include "abi.h"
#include "tables.glsl"

layout(local_size_x_id = CONSTANT_WORKGROUP_SIZE) in;

layout(push_constant) uniform Push { PalettePush push; };

layout(set = 0, binding = BINDING_MESHES, std430) restrict readonly buffer Matrices { uvec4 matrices[]; };
layout(set = 0, binding = BINDING_PALETTES, std430) writeonly buffer Palettes { uvec4 palettes[]; };

void main() {
  uint number = workgroupNumber();
  if (number >= push.workgroupCount) return;
  PaletteRecord palette = loadPalette(push.palettes + number * PALETTE_WORDS);
  uint units = palette.jointCount * UNITS_OF_MATRIX;
  for (uint unit = gl_LocalInvocationID.x; unit < units; unit += gl_WorkGroupSize.x)
    palettes[palette.place + unit] = matrices[palette.matrices + unit];
}
