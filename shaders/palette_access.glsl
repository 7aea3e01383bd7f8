// How the palette is read. A status unit, then each joint's rotation and dual part, or its logarithm, then the scale/shear parts.
// Linear: the joint matrices, three rows each.
#ifndef DERMIS_PALETTE_ACCESS_GLSL
#define DERMIS_PALETTE_ACCESS_GLSL

#include "abi.h"
#include "scale_shear.glsl"

#if defined(DERMIS_SKIN_GLSL)
// skin_include.glsl says how.
#elif defined(TEXELS)
layout(set = 0, binding = BINDING_PALETTE_TEXELS) uniform utextureBuffer paletteTexels;

uvec4 paletteBits(uint unit) { return texelFetch(paletteTexels, int(unit)); }
#else
layout(set = 0, binding = BINDING_PALETTES, std430) restrict readonly buffer Palettes { uvec4 palettes[]; };

uvec4 paletteBits(uint unit) { return palettes[unit]; }
#endif

vec4 paletteUnit(uint unit) { return uintBitsToFloat(paletteBits(unit)); }

// Where a palette stands, how many joints it has, and whether one of them scales or shears.
struct Pose {
  uint palette;
  uint joints;
  bool scales;
};

StatusRecord loadStatus(uint palette) {
  uvec4 a = paletteBits(palette);
  return StatusRecord(a.x, a.y, a.z, a.w);
}

// False, and a constant, where no palette may scale: nothing of what scales is left in the code. Matrices have no status.
bool paletteScales(uint palette) { return SCALES && METHOD != METHOD_LINEAR && loadStatus(palette).twoPhase != 0u; }

vec4 paletteRotation(uint palette, uint joint) { return paletteUnit(palette + 1u + joint * 2u); }
vec4 paletteDual(uint palette, uint joint) { return paletteUnit(palette + 2u + joint * 2u); }

ScaleShear paletteScaleShear(Pose pose, uint joint) {
  const uint unitsOfJoint = METHOD == METHOD_LOG_MATRIX ? UNITS_OF_LOGARITHM : UNITS_OF_DUAL_QUATERNION;
  uint unit = pose.palette + 1u + pose.joints * unitsOfJoint + joint * 2u;
  vec4 first = paletteUnit(unit);
  vec4 second = paletteUnit(unit + 1u);
  return ScaleShear(first.xyz, vec3(first.w, second.xy));
}

vec4 paletteLogarithmRow(uint palette, uint joint, uint row) {
  return paletteUnit(palette + 1u + joint * UNITS_OF_LOGARITHM + row);
}

vec4 paletteRow(uint palette, uint joint, uint row) { return paletteUnit(palette + joint * 3u + row); }

#endif
