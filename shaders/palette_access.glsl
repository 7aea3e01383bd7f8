// Reads the palette. It has a status unit, then the rotation and dual part of each joint, or its logarithm, then the scale and
// shear parts of the joints. For linear blending it is the joint matrices, three rows each.
#ifndef DERMIS_PALETTE_ACCESS_GLSL
#define DERMIS_PALETTE_ACCESS_GLSL

#include "abi.h"
#include "mesh_access.glsl"
#include "scale_shear.glsl"

#ifdef TEXELS
#include "cpu_device/texels.glsl"
#else
layout(set = 0, binding = BINDING_PALETTES, std430) restrict readonly buffer Palettes { uvec4 palettes[]; };

uvec4 paletteBits(uint unit) { return palettes[unit]; }
#endif

vec4 paletteUnit(uint unit) { return uintBitsToFloat(paletteBits(unit)); }

// The first unit of a palette, its number of joints, and whether one of them scales or shears.
struct Pose {
  uint palette;
  uint joints;
  bool scales;
};

StatusRecord loadStatus(uint palette) {
  uvec4 a = paletteBits(palette);
  return StatusRecord(a.x, a.y, a.z, a.w);
}

// The constant false if no palette may scale, so that compilers remove all code for scale. Matrices have no status.
bool paletteScales(uint palette) { return SCALES && METHOD != METHOD_LINEAR && loadStatus(palette).twoPhase != 0u; }

// `joint` is in units, as in `Influences`.
vec4 paletteRotation(uint palette, uint joint) { return paletteUnit(palette + 1u + joint); }
vec4 paletteDual(uint palette, uint joint) { return paletteUnit(palette + 2u + joint); }

ScaleShear paletteScaleShear(Pose pose, uint joint) {
  uint part = JOINT_UNITS == UNITS_OF_SCALE_SHEAR ? joint : joint / JOINT_UNITS * UNITS_OF_SCALE_SHEAR;
  uint unit = pose.palette + 1u + pose.joints * JOINT_UNITS + part;
  vec4 first = paletteUnit(unit);
  vec4 second = paletteUnit(unit + 1u);
  return ScaleShear(first.xyz, vec3(first.w, second.xy));
}

vec4 paletteLogarithmRow(uint palette, uint joint, uint row) {
  return paletteUnit(palette + 1u + joint + row);
}

vec4 paletteRow(uint palette, uint joint, uint row) { return paletteUnit(palette + joint + row); }

#endif
