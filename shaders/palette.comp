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
#include "scale_shear.glsl"
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

// ---- Polar decomposition of a 3×3 matrix.

// One rotation of Jacobi's method: makes the entry pq of a symmetric 4×4 matrix zero. j and k are the other two indices, vp and vq
// the eigenvectors so far. It uses scalars, since drivers put indexed arrays into memory. The largest entries are about 1. A
// denormal entry counts as zero, since it is not defined whether a GPU flushes it.
void turnJacobi(inout float app, inout float aqq, inout float apq, inout float ajp, inout float ajq, inout float akp,
                inout float akq, inout vec4 vp, inout vec4 vq) {
  precise float theta = (aqq - app) / (2.0 * apq);
  precise float tangent = (theta < 0.0 ? -1.0 : 1.0) / (abs(theta) + sqrt(1.0 + theta * theta));
  if (abs(apq) < 1e-37 || abs(theta) > 1e18) tangent = 0.0;
  float cosine = inverseRoot(1.0 + tangent * tangent);
  precise float sine = tangent * cosine;
  precise float p = app - tangent * apq;
  precise float q = aqq + tangent * apq;
  precise vec2 j = vec2(cosine * ajp - sine * ajq, sine * ajp + cosine * ajq);
  precise vec2 k = vec2(cosine * akp - sine * akq, sine * akp + cosine * akq);
  precise vec4 turnedP = cosine * vp - sine * vq;
  precise vec4 turnedQ = sine * vp + cosine * vq;
  app = p;
  aqq = q;
  apq = 0.0;
  ajp = j.x;
  ajq = j.y;
  akp = k.x;
  akq = k.y;
  vp = turnedP;
  vq = turnedQ;
}

// The rotation nearest to a matrix, as a unit quaternion: the eigenvector of the largest eigenvalue of a symmetric 4×4 matrix (Horn
// 1987, "Closed-form solution of absolute orientation using unit quaternions"). It is also correct for a matrix of rank 2, and
// finite for any matrix. Computed by cyclic Jacobi; `refineRotation` makes it accurate.
vec4 nearestRotation(vec3 r0, vec3 r1, vec3 r2) {
  precise float xx = r0.x - r1.y - r2.z;
  precise float yy = -r0.x + r1.y - r2.z;
  precise float zz = -r0.x - r1.y + r2.z;
  precise float ww = r0.x + r1.y + r2.z;
  precise float xy = r0.y + r1.x;
  precise float xz = r0.z + r2.x;
  precise float yz = r1.z + r2.y;
  precise float xw = r2.y - r1.z;
  precise float yw = r0.z - r2.x;
  precise float zw = r1.x - r0.y;
  vec4 vx = vec4(1.0, 0.0, 0.0, 0.0);
  vec4 vy = vec4(0.0, 1.0, 0.0, 0.0);
  vec4 vz = vec4(0.0, 0.0, 1.0, 0.0);
  vec4 vw = vec4(0.0, 0.0, 0.0, 1.0);

  // A sweep is three turns. Each turn rotates the pairs xy and zw, and then y, z and w change places. Convergence is quadratic:
  // most matrices need two to four sweeps.
  [[dont_unroll]] for (uint turn = 0u; turn < 24u; ++turn) {
    precise float outside = abs(xy) + abs(xz) + abs(xw) + abs(yz) + abs(yw) + abs(zw);
    precise float inside = abs(xx) + abs(yy) + abs(zz) + abs(ww);
    precise float negligible = 1e-12 * inside;
    if (outside <= negligible) break;
    turnJacobi(xx, yy, xy, xz, yz, xw, yw, vx, vy);
    turnJacobi(zz, ww, zw, xz, xw, yz, yw, vz, vw);
    vec3 diagonal = vec3(zz, ww, yy);
    vec3 ofX = vec3(xz, xw, xy);
    vec3 others = vec3(zw, yz, yw);
    vec4 first = vy;
    yy = diagonal.x;
    zz = diagonal.y;
    ww = diagonal.z;
    xy = ofX.x;
    xz = ofX.y;
    xw = ofX.z;
    yz = others.x;
    yw = others.y;
    zw = others.z;
    vy = vz;
    vz = vw;
    vw = first;
  }

  float largest = max(max(xx, yy), max(zz, ww));
  vec4 q = xx == largest ? vx : (yy == largest ? vy : (zz == largest ? vz : vw));
  return unitQuaternion(q);
}

// Adds the product a b to a sum that is stored as two floats: the rounding errors of product and sum go to `rest`. The product is
// split by Dekker's method (1971, "A floating-point technique for extending the available precision"), the sum by Knuth's.
void addExactly(inout vec4 sum, inout vec4 rest, float a, vec4 b) {
  precise vec4 product = a * b;
  precise float wideA = 4097.0 * a;
  precise float highA = wideA - (wideA - a);
  precise float lowA = a - highA;
  precise vec4 wideB = 4097.0 * b;
  precise vec4 highB = wideB - (wideB - b);
  precise vec4 lowB = b - highB;
  precise vec4 lost = ((highA * highB - product) + highA * lowB + lowA * highB) + lowA * lowB;
  precise vec4 total = sum + product;
  precise vec4 part = total - sum;
  precise vec4 lostToo = (sum - (total - part)) + (product - part);
  precise vec4 restSoFar = rest + (lost + lostToo);
  sum = total;
  rest = restSoFar;
}

// The residual of q as an eigenvector of Horn's matrix H of C (see `nearestRotation`): H q − (q · H q) q. For the q that
// `nearestRotation` returns, it is a few roundings (2^-24 each) of the terms that cancel. Plain floats would leave hardly a digit
// of it, and more are needed: if C stretches one axis 1000 times as much as the others, a rotation by ω about that axis changes the
// residual by only a few thousandths of ω, relative to these terms.
vec4 eigenvectorResidual(vec4 q, vec3 r0, vec3 r1, vec3 r2) {
  vec4 sum = vec4(0.0);
  vec4 rest = vec4(0.0);
  // The second and third rows are like the first, with x, y and z permuted cyclically.
  [[dont_unroll]] for (uint axis = 0u; axis < 3u; ++axis) {
    addExactly(sum, rest, r0.x, vec4(q.x, -q.y, -q.z, q.w));
    addExactly(sum, rest, r0.y, vec4(q.y, q.x, -q.w, -q.z));
    addExactly(sum, rest, r0.z, vec4(q.z, q.w, q.x, q.y));
    vec3 row = r0.yzx;
    r0 = r1.yzx;
    r1 = r2.yzx;
    r2 = row;
    q = q.yzxw;
    sum = sum.yzxw;
    rest = rest.yzxw;
  }
  addExactly(sum, rest, -dot4(q, sum), q);
  precise vec4 residual = sum + rest;
  return residual;
}

// The symmetric part of Rᵀ C. The columns of Rᵀ C are the columns of C, rotated back. q has length 1 except for rounding errors, so
// 2 / |q|² is nearly 2 (2 − |q|²).
ScaleShear scaleShearOf(vec4 q, vec3 r0, vec3 r1, vec3 r2) {
  vec4 back = vec4(-q.xyz, q.w);
  precise float factor = 2.0 * (2.0 - dot4(q, q));
  vec3 s0 = rotateBy(back, factor, vec3(r0.x, r1.x, r2.x));
  vec3 s1 = rotateBy(back, factor, vec3(r0.y, r1.y, r2.y));
  vec3 s2 = rotateBy(back, factor, vec3(r0.z, r1.z, r2.z));
  precise vec3 mixed = 0.5 * vec3(s1.x + s0.y, s2.x + s0.z, s2.y + s1.z);
  return ScaleShear(vec3(s0.x, s1.y, s2.z), mixed);
}

// Newton's method for the polar decomposition: improves q and computes S. For the exact R, Rᵀ C is symmetric. If the current
// rotation is R' = R (1 − [ω]×), then R'ᵀ C − Cᵀ R' is [(tr S − S) ω]×. The residual, rotated back, is the vector (tr S − S) ω.
// Each step solves for ω. Without these steps the rotation would have an error of a few roundings times σ₁ / (σ₂ + σ₃). Vertices
// with several joints would show it.
ScaleShear refineRotation(inout vec4 q, vec3 r0, vec3 r1, vec3 r2) {
  ScaleShear s;
  uint left = 3u;
  [[dont_unroll]] for (;;) {
    s = scaleShearOf(q, r0, r1, r2);
    if (left == 0u) break;
    vec4 residual = eigenvectorResidual(q, r0, r1, r2);
    vec3 asymmetry = quaternionProduct(vec4(-q.xyz, q.w), residual).xyz;
    precise float trace = s.diagonal.x + s.diagonal.y + s.diagonal.z;
    vec3 h0 = vec3(s.diagonal.y + s.diagonal.z, -s.mixed.x, -s.mixed.y);
    vec3 h1 = vec3(-s.mixed.x, s.diagonal.x + s.diagonal.z, -s.mixed.z);
    vec3 h2 = vec3(-s.mixed.y, -s.mixed.z, s.diagonal.x + s.diagonal.y);
    vec3 c0 = cross3(h1, h2);
    vec3 c1 = cross3(h2, h0);
    vec3 c2 = cross3(h0, h1);
    precise float determinant = dot3(h0, c0);
    precise float negligible = 1e-6 * trace * trace * trace;
    if (determinant <= negligible) break;  // of rank 1
    precise vec3 turn = vec3(dot3(c0, asymmetry), dot3(c1, asymmetry), dot3(c2, asymmetry)) / determinant;
    float square = dot3(turn, turn);
    if (square > 0.01) break;
    precise vec3 halfTurn = 0.5 * turn;
    q = unitQuaternion(quaternionProduct(q, vec4(halfTurn, 1.0)));
    left = square <= 1e-9 ? 0u : left - 1u;
  }
  return s;
}

// The determinant of a matrix, given by its rows. `magnitude` is the sum of the absolute values of all products. The bound of the
// determinant's rounding error is proportional to it.
float determinantOf(vec3 r0, vec3 r1, vec3 r2, out float magnitude) {
  vec3 c = cross3(r1, r2);
  precise vec3 uncancelled = abs(r1.yzx * r2.zxy) + abs(r1.zxy * r2.yzx);
  magnitude = dot3(abs(r0), uncancelled);
  return dot3(r0, c);
}

// The polar decomposition of C, given by its rows and its largest entry. If the determinant is negative, R is the rotation of −C, and
// S is negated. A determinant counts as 0 if rounding or flushed denormals can give that of a singular matrix either sign: if its
// absolute value is at most 1.43e-6 × `magnitude` (24 roundings of 2^-24 each), plus 1e-33 (about 2^-110) if C is scaled to entries
// of about 1, or 1e-33 times this scale if that is more. Flushing changes such a determinant by at most 32 × 2^-126 (1 + scale): its
// products, and the entries of C before they are scaled (docs/accuracy.md).
void polarParts(vec3 r0, vec3 r1, vec3 r2, float largest, out vec4 rotation, out ScaleShear scaleShear) {
  if (largest == 0.0) {
    rotation = vec4(0.0, 0.0, 0.0, 1.0);
    scaleShear = ScaleShear(vec3(0.0), vec3(0.0));
    return;
  }
  float scale = powerScale(largest);
  precise vec3 n0 = r0 * scale;
  precise vec3 n1 = r1 * scale;
  precise vec3 n2 = r2 * scale;
  float magnitude;
  float determinant = determinantOf(n0, n1, n2, magnitude);
  precise float limit = -1.43e-6 * magnitude - 1e-33 * max(1.0, scale);
  float side = determinant < limit ? -1.0 : 1.0;
  rotation = nearestRotation(side * n0, side * n1, side * n2);
  ScaleShear scaled = refineRotation(rotation, side * n0, side * n1, side * n2);
  float back = side * inversePowerScale(largest);
  precise vec3 diagonal = scaled.diagonal * back;
  precise vec3 mixed = scaled.mixed * back;
  scaleShear = ScaleShear(diagonal, mixed);
}

// ---- One joint.

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
