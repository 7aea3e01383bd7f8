// Quaternions are (x, y, z, w), with w the scalar, and are multiplied by the Hamilton product.
#ifndef DERMIS_QUATERNION_GLSL
#define DERMIS_QUATERNION_GLSL

#include "exact.glsl"

vec4 unitQuaternion(vec4 q) {
  precise vec4 unit = q * inverseRoot(dot4(q, q));
  return unit;
}

// The unit quaternion of a matrix C that is nearly a rotation, given by its rows. For a rotation, all columns of the symmetric
// matrix below are multiples of the quaternion, and its diagonal is 4x², 4y², 4z², 4w². The first guess is the column with the
// largest diagonal entry (Shepperd 1978). If C is not quite orthogonal, the rotation of the guess is off by at most √5 / 2 times
// the largest sum of absolute values in a row of CᵀC − 1. A step of the power method leaves less than the square of that sum, so
// that the result is the rotation of the polar decomposition.
vec4 quaternionOfRows(vec3 r0, vec3 r1, vec3 r2) {
  precise float x = 1.0 + r0.x - r1.y - r2.z;
  precise float y = 1.0 - r0.x + r1.y - r2.z;
  precise float z = 1.0 - r0.x - r1.y + r2.z;
  precise float w = 1.0 + r0.x + r1.y + r2.z;
  precise vec3 sums = vec3(r1.z + r2.y, r0.z + r2.x, r0.y + r1.x);
  precise vec3 differences = vec3(r2.y - r1.z, r0.z - r2.x, r1.x - r0.y);
  vec4 ofX = vec4(x, sums.z, sums.y, differences.x);
  vec4 ofY = vec4(sums.z, y, sums.x, differences.y);
  vec4 ofZ = vec4(sums.y, sums.x, z, differences.z);
  vec4 ofW = vec4(differences, w);
  vec4 guess = ofZ;
  if (w >= x && w >= y && w >= z) {
    guess = ofW;
  } else if (x >= y && x >= z) {
    guess = ofX;
  } else if (y >= z) {
    guess = ofY;
  }
  precise vec4 q = guess.x * ofX + guess.y * ofY + guess.z * ofZ + guess.w * ofW;
  return unitQuaternion(q);
}

// v rotated by a quaternion q = (r, w) of any length except 0: v + factor r × (r × v + w v). `factor` is 2 / |q|².
vec3 rotateBy(vec4 q, float factor, vec3 v) {
  precise vec3 inner = fma(vec3(q.w), v, cross3(q.xyz, v));
  precise vec3 turned = fma(cross3(q.xyz, inner), vec3(factor), v);
  return turned;
}

// The dual part of a rigid transform: ½ (t, 0) q.
vec4 dualPart(vec4 q, vec3 t) {
  precise vec3 vector = 0.5 * (q.w * t + cross3(t, q.xyz));
  precise float scalar = -0.5 * dot3(t, q.xyz);
  return vec4(vector, scalar);
}

// a b
vec4 quaternionProduct(vec4 a, vec4 b) {
  precise vec3 vector = a.w * b.xyz + b.w * a.xyz + cross3(a.xyz, b.xyz);
  precise float scalar = a.w * b.w - dot3(a.xyz, b.xyz);
  return vec4(vector, scalar);
}

vec4 conjugateOf(vec4 q) {
  return vec4(-q.xyz, q.w);
}

// The rows of the rotation of a unit quaternion.
void rowsOfQuaternion(vec4 q, out vec3 r0, out vec3 r1, out vec3 r2) {
  precise vec3 doubled = q.xyz + q.xyz;
  precise vec3 squares = doubled * q.xyz;
  precise vec3 products = doubled.xyx * q.yzz;  // 2xy 2yz 2xz
  precise vec3 byScalar = doubled * q.w;
  precise vec3 row0 = vec3(1.0 - (squares.y + squares.z), products.x - byScalar.z, products.z + byScalar.y);
  precise vec3 row1 = vec3(products.x + byScalar.z, 1.0 - (squares.x + squares.z), products.y - byScalar.x);
  precise vec3 row2 = vec3(products.z - byScalar.y, products.y + byScalar.x, 1.0 - (squares.x + squares.y));
  r0 = row0;
  r1 = row1;
  r2 = row2;
}

#endif
