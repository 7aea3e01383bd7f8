// The arithmetic of rigs (docs/rigs.md), operation by operation as engine/src/core/rig/evaluate_inl.h has it.
#ifndef DERMIS_RIG_MATH_GLSL
#define DERMIS_RIG_MATH_GLSL

#include "clips.glsl"
#include "exact.glsl"

// A mat3 has the *rows* of a 3×3 matrix here.

mat3 linearOf(Transform t) { return mat3(t.r0.xyz, t.r1.xyz, t.r2.xyz); }

Transform transformOf(mat3 rows, vec3 shift) {
  return Transform(vec4(rows[0], shift.x), vec4(rows[1], shift.y), vec4(rows[2], shift.z));
}

vec3 rotated(mat3 rows, vec3 v) { return vec3(dot3(rows[0], v), dot3(rows[1], v), dot3(rows[2], v)); }

mat3 times(mat3 a, mat3 b) {
  precise vec3 r0 = fma(vec3(a[0].z), b[2], fma(vec3(a[0].y), b[1], a[0].x * b[0]));
  precise vec3 r1 = fma(vec3(a[1].z), b[2], fma(vec3(a[1].y), b[1], a[1].x * b[0]));
  precise vec3 r2 = fma(vec3(a[2].z), b[2], fma(vec3(a[2].y), b[1], a[2].x * b[0]));
  return mat3(r0, r1, r2);
}

// The adjugate of `parent`, which is its inverse × its determinant, × m, with the sign of the determinant.
mat3 relativeTo(mat3 parent, mat3 m) {
  vec3 c0 = cross3(parent[1], parent[2]);
  vec3 c1 = cross3(parent[2], parent[0]);
  vec3 c2 = cross3(parent[0], parent[1]);
  float sign_ = dot3(parent[0], c0) < 0.0 ? -1.0 : 1.0;
  mat3 product = times(transpose(mat3(c0, c1, c2)), m);
  precise vec3 r0 = product[0] * sign_;
  precise vec3 r1 = product[1] * sign_;
  precise vec3 r2 = product[2] * sign_;
  return mat3(r0, r1, r2);
}

// v with length 1, or `other` if the square of its length is 0.
vec3 unitVectorOr(vec3 v, vec3 other) {
  float square = dot3(v, v);
  precise vec3 unit = v * inverseRoot(square);
  return square > 0.0 ? unit : other;
}

// q with length 1, or the identity if the square of its length is at most `least`.
vec4 unitAbove(vec4 q, float least) {
  float square = dot4(q, q);
  precise vec4 unit = q * inverseRoot(square);
  return square > least ? unit : vec4(0.0, 0.0, 0.0, 1.0);
}

// The orthonormal columns that follow from those of a matrix by the method of Gram and Schmidt, as rows.
mat3 orthonormalColumns(mat3 rows) {
  mat3 columns = transpose(rows);
  vec3 x = unitVectorOr(columns[0], vec3(1.0, 0.0, 0.0));
  precise vec3 rest = columns[1] - x * dot3(x, columns[1]);
  vec3 y = unitVectorOr(rest, vec3(0.0, 1.0, 0.0));
  return mat3(x, y, cross3(x, y));
}

// The unit quaternion of a rotation with these columns: from the largest of its components (Shepperd 1978).
vec4 quaternionOfColumns(mat3 c) {
  precise vec3 differences = vec3(c[1].z - c[2].y, c[2].x - c[0].z, c[0].y - c[1].x);
  precise vec3 sums = vec3(c[1].z + c[2].y, c[0].z + c[2].x, c[0].y + c[1].x);
  precise float w = 1.0 + c[0].x + c[1].y + c[2].z;
  precise float x = 1.0 + c[0].x - c[1].y - c[2].z;
  precise float y = 1.0 - c[0].x + c[1].y - c[2].z;
  precise float z = 1.0 - c[0].x - c[1].y + c[2].z;
  vec4 q = vec4(differences, w);
  float largest = w;
  if (x > largest) {
    q = vec4(x, sums.z, sums.y, differences.x);
    largest = x;
  }
  if (y > largest) {
    q = vec4(sums.z, y, sums.x, differences.y);
    largest = y;
  }
  if (z > largest) q = vec4(sums.y, sums.x, z, differences.z);
  return unitOrIdentity(q);
}

// The rows of the rotation of a unit quaternion.
mat3 rotationOf(vec4 q) {
  vec3 r0;
  vec3 r1;
  vec3 r2;
  rowsOfQuaternion(q, r0, r1, r2);
  return mat3(r0, r1, r2);
}

// A linear map as rotation × (what is on and above the diagonal, by rows).
struct Frame {
  vec4 rotation;
  vec3 diagonal;
  vec3 above;  // row 0 columns 1 and 2, row 1 column 2
};

Frame frameOf(mat3 m) {
  mat3 columns = transpose(m);
  mat3 axes = orthonormalColumns(m);
  return Frame(quaternionOfColumns(axes), vec3(dot3(axes[0], columns[0]), dot3(axes[1], columns[1]), dot3(axes[2], columns[2])),
               vec3(dot3(axes[0], columns[1]), dot3(axes[0], columns[2]), dot3(axes[1], columns[2])));
}

Frame mixed(Frame a, Frame b, float share) {
  precise float rest = 1.0 - share;
  float other = dot4(a.rotation, b.rotation) < 0.0 ? -share : share;
  precise vec4 q = rest * a.rotation + other * b.rotation;
  precise vec3 diagonal = a.diagonal * rest + b.diagonal * share;
  precise vec3 above = a.above * rest + b.above * share;
  return Frame(unitOrIdentity(q), diagonal, above);
}

vec3 rowOfFrame(vec3 v, Frame frame) {
  precise float x = v.x * frame.diagonal.x;
  precise float y = v.x * frame.above.x + v.y * frame.diagonal.y;
  precise float z = v.x * frame.above.y + v.y * frame.above.z + v.z * frame.diagonal.z;
  return vec3(x, y, z);
}

mat3 linearOfFrame(vec4 rotation, Frame frame) {
  mat3 r = rotationOf(rotation);
  return mat3(rowOfFrame(r[0], frame), rowOfFrame(r[1], frame), rowOfFrame(r[2], frame));
}

// Minimax polynomials; evaluate_inl.h has their errors.

// For |x| <= 1.
float arcTangent(float x) {
  precise float s = x * x;
  precise float p = 0.00262224488 * s - 0.0151325371;
  p = p * s + 0.0411218628;
  p = p * s - 0.0736670643;
  p = p * s + 0.105739325;
  p = p * s - 0.141859755;
  p = p * s + 0.199903965;
  p = p * s - 0.333329856;
  precise float arc = x + x * s * p;
  return arc;
}

// For |x| <= pi / 2.
float sine(float x) {
  precise float s = x * x;
  precise float p = 2.60005481e-06 * s - 0.000198066147;
  p = p * s + 0.00833301712;
  p = p * s - 0.166666567;
  precise float result = x + x * s * p;
  return result;
}

// For |x| <= pi / 2.
float cosine(float x) {
  precise float s = x * x;
  precise float p = 2.47618864e-05 - 2.6077106e-07 * s;
  p = p * s - 0.00138884038;
  p = p * s + 0.0416666418;
  p = p * s - 0.5;
  precise float result = 1.0 + s * p;
  return result;
}

// For x <= 0; at least exp(-87).
float exponential(float x) {
  float clamped = x > -87.0 ? x : -87.0;
  precise float n = floor(clamped * 1.44269504 + 0.5);
  precise float r = (clamped - n * 0.693359375) + n * 0.000212194440;
  precise float p = 0.00138144672 * r + 0.00836878084;
  p = p * r + 0.0416683927;
  p = p * r + 0.166665196;
  p = p * r + 0.49999994;
  precise float value = 1.0 + (r + r * r * p);
  precise float result = value * uintBitsToFloat(uint(int(n) + 127) << 23u);
  return result;
}

#endif
