#version 450
#extension GL_GOOGLE_include_directive : require

// Joint matrices (3×4) to unit dual quaternions, or the logarithms of the rigid parts, and, where a joint is not rigid, its
// scale/shear part; or copied as they are: one workgroup a palette, so that what is said of the whole palette needs no second
// pass. The workgroups behind those clear the results that the skin kernel adds to. With ONE_OUTPUT there are no results (4
// storage buffers in all).

#include "abi.h"
#include "exact.glsl"
#include "quaternion.glsl"
#include "polar.glsl"
#include "dual_exponential.glsl"
#include "tables.glsl"
#include "results.glsl"

layout(local_size_x_id = CONSTANT_WORKGROUP_SIZE) in;

layout(push_constant) uniform Push { PalettePush push; };

layout(set = 0, binding = BINDING_MESHES, std430) restrict readonly buffer Matrices { vec4 matrices[]; };
layout(set = 0, binding = BINDING_PALETTES, std430) writeonly buffer Palettes { uvec4 palettes[]; };

shared uint nonRigidJoints;
shared uint nonFiniteJoints;

// A joint is rigid when det > 0 and no row of CᵀC − 1 sums, by absolute values, to more than 8e-6: then no singular value is
// further than 4e-6 from 1, and no decomposition is needed to know it. (Single entries would not do: nine of 8e-6 make a
// stretch of 12e-6.)
bool isRigid(vec3 r0, vec3 r1, vec3 r2) {
  precise vec3 c0 = vec3(r0.x, r1.x, r2.x);
  precise vec3 c1 = vec3(r0.y, r1.y, r2.y);
  precise vec3 c2 = vec3(r0.z, r1.z, r2.z);
  precise vec3 squares = vec3(dot3(c0, c0), dot3(c1, c1), dot3(c2, c2)) - 1.0;
  precise vec3 products = vec3(dot3(c0, c1), dot3(c0, c2), dot3(c1, c2));
  precise float determinant = dot3(r0, cross3(r1, r2));
  precise vec3 rowSums = abs(squares) + vec3(abs(products.x) + abs(products.y), abs(products.x) + abs(products.z),
                                             abs(products.y) + abs(products.z));
  return determinant > 0.0 && largestComponent(rowSums) <= 8e-6;
}

void writeScaleShear(uint unit, ScaleShear part) {
  palettes[unit] = floatBitsToUint(vec4(part.diagonal, part.mixed.x));
  palettes[unit + 1u] = floatBitsToUint(vec4(part.mixed.yz, 0.0, 0.0));
}

// The logarithm of a rigid transform, the short way round: rows of [ω]× | v, twice its screw.
void writeLogarithm(uint unit, vec4 rotation, vec4 dual) {
  Screw screw = rotation.w < 0.0 ? screwOf(-rotation, -dual) : screwOf(rotation, dual);
  precise vec3 turn = 2.0 * screw.real;
  precise vec3 shift = 2.0 * screw.dual;
  palettes[unit] = floatBitsToUint(vec4(0.0, -turn.z, turn.y, shift.x));
  palettes[unit + 1u] = floatBitsToUint(vec4(turn.z, 0.0, -turn.x, shift.y));
  palettes[unit + 2u] = floatBitsToUint(vec4(-turn.y, turn.x, 0.0, shift.z));
}

// For linear blending, which is to read the memory of the device, not that which the CPU writes.
void copyMatrices(PaletteRecord palette) {
  uint units = palette.jointCount * UNITS_OF_MATRIX;
  for (uint unit = gl_LocalInvocationID.x; unit < units; unit += gl_WorkGroupSize.x)
    palettes[palette.place + unit] = floatBitsToUint(matrices[palette.matrices + unit]);
}

void main() {
  uint number = workgroupNumber();
  if (number >= push.workgroupCount) return;
  if (number >= push.paletteCount) {
    uint cleared = (number - push.paletteCount) * gl_WorkGroupSize.x + gl_LocalInvocationID.x;
    if (cleared < push.resultCount) clearResult(tables[push.palettes + push.paletteCount * PALETTE_WORDS + cleared]);
    return;
  }
  PaletteRecord palette = loadPalette(push.palettes + number * PALETTE_WORDS);
  if ((palette.flags & PALETTE_MATRICES) != 0u) {
    copyMatrices(palette);
    return;
  }
  bool mayScale = (palette.flags & PALETTE_MAY_SCALE) != 0u;
  bool logarithms = (palette.flags & PALETTE_LOGARITHMS) != 0u;
  uint unitsOfJoint = logarithms ? UNITS_OF_LOGARITHM : UNITS_OF_DUAL_QUATERNION;

  if (gl_LocalInvocationID.x == 0u) {
    nonRigidJoints = 0u;
    nonFiniteJoints = 0u;
  }
  barrier();

  // The loop tests at its end: if the test comes first, lavapipe executes the rest of the body once more with all lanes off.
  uint joint = gl_LocalInvocationID.x;
  if (joint < palette.jointCount) do {
    vec4 r0 = matrices[palette.matrices + joint * 3u];
    vec4 r1 = matrices[palette.matrices + joint * 3u + 1u];
    vec4 r2 = matrices[palette.matrices + joint * 3u + 2u];
    vec4 rotation;
    ScaleShear scaleShear = ScaleShear(vec3(1.0), vec3(0.0));
    if (!isFinite(r0) || !isFinite(r1) || !isFinite(r2)) {
      atomicAdd(nonFiniteJoints, 1u);
      rotation = vec4(uintBitsToFloat(0x7fc00000u));
    } else if (isRigid(r0.xyz, r1.xyz, r2.xyz)) {
      rotation = quaternionOfRows(r0.xyz, r1.xyz, r2.xyz);
    } else {
      atomicAdd(nonRigidJoints, 1u);
      polarParts(r0.xyz, r1.xyz, r2.xyz, rotation, scaleShear);
    }
    vec4 dual = dualPart(rotation, vec3(r0.w, r1.w, r2.w));
    uint unit = palette.place + 1u + joint * unitsOfJoint;
    if (logarithms) {
      writeLogarithm(unit, rotation, dual);
    } else {
      palettes[unit] = floatBitsToUint(rotation);
      palettes[unit + 1u] = floatBitsToUint(dual);
    }
    if (mayScale) writeScaleShear(palette.place + 1u + palette.jointCount * unitsOfJoint + joint * 2u, scaleShear);
    joint += gl_WorkGroupSize.x;
  } while (joint < palette.jointCount);
  barrier();

  if (gl_LocalInvocationID.x == 0u) {
    uint nonRigid = nonRigidJoints;
    StatusRecord status =
        StatusRecord(mayScale && nonRigid != 0u ? 1u : 0u, nonRigid, mayScale ? 0u : nonRigid, nonFiniteJoints);
    palettes[palette.place] =
        uvec4(status.twoPhase, status.nonRigidJoints, status.undeclaredScale, status.nonFiniteJoints);
  }
}
