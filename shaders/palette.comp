#version 450
#extension GL_GOOGLE_include_directive : require
#extension GL_EXT_control_flow_attributes : require

// Converts joint matrices (3×4) to unit dual quaternions and, if poses may scale, to scale and shear parts (the identity for rigid
// joints). One workgroup converts one palette, so that the status of the whole palette needs no second pass. For linear blending in
// a scene it copies them: the skin kernel then reads device memory, and not the memory that the CPU writes. With a rig, the driven
// joints of a pose are in another buffer.
//   LOGARITHMS      converts to logarithms of the rigid parts instead of dual quaternions

#include "abi.h"
#include "exact.glsl"
#include "quaternion.glsl"
#include "polar.glsl"
#ifdef LOGARITHMS
#include "comparison/dual_exponential.glsl"
#endif
#include "tables.glsl"

layout(constant_id = CONSTANT_METHOD) const uint METHOD = METHOD_DUAL_QUATERNION;
layout(constant_id = CONSTANT_SCALES) const bool SCALES = true;
layout(constant_id = CONSTANT_RIGID) const bool RIGID = false;
layout(constant_id = CONSTANT_RIGGED) const bool RIGGED = false;

layout(local_size_x_id = CONSTANT_WORKGROUP_SIZE) in;

layout(push_constant) uniform Push { PalettePush push; };

layout(set = 0, binding = BINDING_MESHES, std430) readonly buffer Matrices { uvec4 matrices[]; };
layout(set = 0, binding = BINDING_DRIVEN, std430) readonly buffer Driven { uvec4 driven[]; };
layout(set = 0, binding = BINDING_PALETTES, std430) writeonly buffer Palettes { uvec4 palettes[]; };

shared uint nonRigidJoints;
shared uint nonFiniteJoints;

// A joint is rigid if det > 0 and the absolute values of each row of CᵀC − 1 sum to at most 8e-6. Then every singular value is
// within 4e-6 of 1. This needs no decomposition. (Limiting single entries is not enough: nine entries of 8e-6 are a stretch of
// 12e-6.)
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

#ifdef LOGARITHMS
const uint UNITS_OF_JOINT = UNITS_OF_LOGARITHM;

// Row `number` of the logarithm [ω]× | v of a rigid transform. ω and v are twice the real and dual parts of `screw`, which `main`
// computes for the shorter rotation.
vec4 jointUnit(Screw screw, uint number) {
  precise vec3 turn = 2.0 * screw.real;
  precise vec3 shift = 2.0 * screw.dual;
  vec4 row = vec4(-turn.y, turn.x, 0.0, shift.z);
  if (number == 0u) row = vec4(0.0, -turn.z, turn.y, shift.x);
  if (number == 1u) row = vec4(turn.z, 0.0, -turn.x, shift.y);
  return row;
}
#else
const uint UNITS_OF_JOINT = UNITS_OF_DUAL_QUATERNION;
#endif

vec4 scaleShearUnit(ScaleShear part, uint number) {
  return number == 0u ? vec4(part.diagonal, part.mixed.x) : vec4(part.mixed.yz, 0.0, 0.0);
}

// The loop over joints has one load and one store, each in an inner loop: lavapipe compiles every load and store into a loop over
// lanes, which takes most of the compile time of this kernel.
void main() {
  uint number = workgroupNumber();
  if (number >= push.workgroupCount) return;
  PaletteRecord palette = loadPalette(push.palettes + number * PALETTE_WORDS);
  if (palette.needed == 0u) return;
  DrivenRecord rigged = DrivenRecord(0u, palette.jointCount, 0u, 0u);
  if (RIGGED) rigged = loadDriven(push.driven + number * DRIVEN_WORDS);
  if (METHOD == METHOD_LINEAR) {
    uint units = palette.jointCount * UNITS_OF_MATRIX;
    uint writtenUnits = RIGGED ? rigged.writtenJoints * UNITS_OF_MATRIX : units;
    for (uint unit = gl_LocalInvocationID.x; unit < units; unit += gl_WorkGroupSize.x) {
      uvec4 row;
      if (unit < writtenUnits || !RIGGED) {
        row = matrices[palette.matrices + unit];
      } else {
        row = driven[rigged.driven + unit - writtenUnits];
      }
      palettes[palette.place + unit] = row;
    }
    return;
  }
  if (gl_LocalInvocationID.x == 0u) {
    nonRigidJoints = 0u;
    nonFiniteJoints = 0u;
  }
  barrier();

  // The loop tests at its end: if the test comes first, lavapipe executes the rest of the body once more with all lanes off.
  uint joint = gl_LocalInvocationID.x;
  if (joint < palette.jointCount) do {
    vec4 r0 = vec4(0.0);
    vec4 r1 = vec4(0.0);
    vec4 r2 = vec4(0.0);
    bool isDriven = RIGGED && joint >= rigged.writtenJoints;
    uint from = isDriven ? rigged.driven + (joint - rigged.writtenJoints) * UNITS_OF_MATRIX
                         : palette.matrices + joint * UNITS_OF_MATRIX;
    uint end = from + UNITS_OF_MATRIX;
    [[dont_unroll]] do {
      r0 = r1;
      r1 = r2;
      if (isDriven) {
        r2 = uintBitsToFloat(driven[from]);
      } else {
        r2 = uintBitsToFloat(matrices[from]);
      }
    } while (++from != end);

    vec4 rotation;
    ScaleShear scaleShear = ScaleShear(vec3(1.0), vec3(0.0));
    // If an entry is larger than 2, products in isRigid may overflow, and comparisons with NaN may give any result.
    float largest = max(largestComponent(r0.xyz), max(largestComponent(r1.xyz), largestComponent(r2.xyz)));
    bool rigid = largest <= 2.0 && isRigid(r0.xyz, r1.xyz, r2.xyz);
    if (!isFinite(r0) || !isFinite(r1) || !isFinite(r2)) {
      atomicAdd(nonFiniteJoints, 1u);
      rotation = vec4(uintBitsToFloat(0x7fc00000u));
    } else {
      if (!rigid) atomicAdd(nonRigidJoints, 1u);
      if (RIGID || rigid) {
        // Of another matrix it makes a unit quaternion, too, if no square overflows.
        float scale = RIGID && !rigid ? powerScale(max(largest, 1.0)) : 1.0;
        precise vec3 n0 = r0.xyz * scale;
        precise vec3 n1 = r1.xyz * scale;
        precise vec3 n2 = r2.xyz * scale;
        rotation = quaternionOfRows(n0, n1, n2);
      } else {
        polarParts(r0.xyz, r1.xyz, r2.xyz, largest, rotation, scaleShear);
      }
    }
    vec4 dual = dualPart(rotation, vec3(r0.w, r1.w, r2.w));
#ifdef LOGARITHMS
    Screw screw = rotation.w < 0.0 ? screwOf(-rotation, -dual) : screwOf(rotation, dual);
#endif

    uint first = palette.place + 1u;
    uint unit = 0u;
    [[dont_unroll]] do {
      uint place = first + joint * UNITS_OF_JOINT + unit;
#ifdef LOGARITHMS
      vec4 value = jointUnit(screw, unit);
#else
      vec4 value = unit == 0u ? rotation : dual;
#endif
      if (SCALES && unit >= UNITS_OF_JOINT) {
        place = first + palette.jointCount * UNITS_OF_JOINT + joint * UNITS_OF_SCALE_SHEAR + (unit - UNITS_OF_JOINT);
        value = scaleShearUnit(scaleShear, unit - UNITS_OF_JOINT);
      }
      palettes[place] = floatBitsToUint(value);
    } while (++unit < UNITS_OF_JOINT + (SCALES ? UNITS_OF_SCALE_SHEAR : 0u));
    joint += gl_WorkGroupSize.x;
  } while (joint < palette.jointCount);
  barrier();

  if (gl_LocalInvocationID.x == 0u) {
    uint nonRigid = nonRigidJoints;
    StatusRecord status = StatusRecord(SCALES && nonRigid != 0u ? 1u : 0u, nonRigid, SCALES ? 0u : nonRigid, nonFiniteJoints);
    palettes[palette.place] =
        uvec4(status.twoPhase, status.nonRigidJoints, status.undeclaredScale, status.nonFiniteJoints);
  }
}
