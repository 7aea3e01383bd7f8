// Spherical blend skinning (Kavan and Žára 2005). Blends quaternions about the point r whose images under all joints are nearest to
// each other. r solves (R_a − R_b) r = t_b − t_a over all pairs of joints in the least-squares sense. The equations
// (R_j − mean R) r = mean t − t_j over all joints have the same solution. The rows are brought to triangular form one by one,
// because the normal equations would lose half of the digits.
#ifndef DERMIS_SPHERICAL_BLEND_GLSL
#define DERMIS_SPHERICAL_BLEND_GLSL

#include "../methods/dual_quaternion.glsl"

// Smaller singular values count as 0, as in the pseudo-inverse.
const float LEAST_SINGULAR_VALUE = 1e-3;

// Rows of [A | b].
struct System {
  vec4 r0;
  vec4 r1;
  vec4 r2;
};

// A Givens rotation of two rows that makes a component of the second row 0. Components below 1e-18 count as 0: they are far below
// LEAST_SINGULAR_VALUE, and their squares may be denormal.
void eliminate(inout vec4 upper, inout vec4 row, uint component) {
  precise float square = upper[component] * upper[component] + row[component] * row[component];
  if (square < 1e-36) return;
  precise float inverse = inverseRoot(square);
  precise float cosine = upper[component] * inverse;
  precise float sine = row[component] * inverse;
  precise vec4 first = cosine * upper + sine * row;
  precise vec4 second = cosine * row - sine * upper;
  upper = first;
  row = second;
  row[component] = 0.0;
}

void addRow(inout System system, vec4 row) {
  eliminate(system.r0, row, 0u);
  eliminate(system.r1, row, 1u);
  eliminate(system.r2, row, 2u);
}

// One-sided Jacobi: rotates two columns so that they are orthogonal, and va and vb with them. Returns false if they already were.
bool orthogonalize(inout vec3 a, inout vec3 b, inout vec3 va, inout vec3 vb) {
  precise float alpha = dot3(a, a);
  precise float beta = dot3(b, b);
  precise float gamma = dot3(a, b);
  precise float negligible = 1e-7 * sqrt(alpha * beta);
  if (abs(gamma) <= negligible) return false;
  precise float zeta = (beta - alpha) / (2.0 * gamma);
  precise float tangent = (zeta < 0.0 ? -1.0 : 1.0) / (abs(zeta) + sqrt(1.0 + zeta * zeta));
  precise float cosine = inverseRoot(1.0 + tangent * tangent);
  precise float sine = cosine * tangent;
  precise vec3 first = cosine * a - sine * b;
  precise vec3 second = sine * a + cosine * b;
  precise vec3 vFirst = cosine * va - sine * vb;
  precise vec3 vSecond = sine * va + cosine * vb;
  a = first;
  b = second;
  va = vFirst;
  vb = vSecond;
  return true;
}

vec3 along(vec3 column, vec3 direction, vec3 right) {
  precise float square = dot3(column, column);
  if (square <= LEAST_SINGULAR_VALUE * LEAST_SINGULAR_VALUE) return vec3(0.0);
  precise vec3 part = quotient(dot3(column, right), square) * direction;
  return part;
}

vec3 leastSquares(System system) {
  vec3 c0 = vec3(system.r0.x, 0.0, 0.0);
  vec3 c1 = vec3(system.r0.y, system.r1.y, 0.0);
  vec3 c2 = vec3(system.r0.z, system.r1.z, system.r2.z);
  vec3 right = vec3(system.r0.w, system.r1.w, system.r2.w);
  vec3 v0 = vec3(1.0, 0.0, 0.0);
  vec3 v1 = vec3(0.0, 1.0, 0.0);
  vec3 v2 = vec3(0.0, 0.0, 1.0);
  for (uint sweep = 0u; sweep < 8u; ++sweep) {
    bool turned = orthogonalize(c0, c1, v0, v1);
    turned = orthogonalize(c0, c2, v0, v2) || turned;
    turned = orthogonalize(c1, c2, v1, v2) || turned;
    if (!turned) break;
  }
  precise vec3 sum = along(c0, v0, right) + along(c1, v1, right) + along(c2, v2, right);
  return sum;
}

// The rigid part of a joint, [R | t].
System jointSystem(Pose pose, uint joint) {
  vec4 real = paletteRotation(pose.palette, joint);
  vec3 r0;
  vec3 r1;
  vec3 r2;
  rowsOfQuaternion(real, r0, r1, r2);
  vec3 t = translationOf(real, paletteDual(pose.palette, joint), 2.0);
  return System(vec4(r0, t.x), vec4(r1, t.y), vec4(r2, t.z));
}

Vertex skinSpherical(Vertex vertex, Influences influences, Pose pose) {
  Blend blend = blendJoints(influences, pose);
  // The mean, and the weighted mean.
  precise vec4 m0 = vec4(0.0);
  precise vec4 m1 = vec4(0.0);
  precise vec4 m2 = vec4(0.0);
  precise vec4 w0 = vec4(0.0);
  precise vec4 w1 = vec4(0.0);
  precise vec4 w2 = vec4(0.0);
  float share = quotient(1.0, float(influences.count));
  for (uint slot = 0u; slot < influences.count; ++slot) {
    float weight = influenceWeight(influences, slot);
    System joint = jointSystem(pose, influenceJoint(influences, slot));
    m0 += share * joint.r0;
    m1 += share * joint.r1;
    m2 += share * joint.r2;
    w0 += weight * joint.r0;
    w1 += weight * joint.r1;
    w2 += weight * joint.r2;
  }
  System system = System(vec4(0.0), vec4(0.0), vec4(0.0));
  const vec4 rightSide = vec4(1.0, 1.0, 1.0, -1.0);
  for (uint slot = 0u; slot < influences.count; ++slot) {
    System joint = jointSystem(pose, influenceJoint(influences, slot));
    precise vec4 d0 = rightSide * (joint.r0 - m0);
    precise vec4 d1 = rightSide * (joint.r1 - m1);
    precise vec4 d2 = rightSide * (joint.r2 - m2);
    addRow(system, d0);
    addRow(system, d1);
    addRow(system, d2);
  }
  vec3 center = leastSquares(system);
  Scaled scaled = scaleVertex(vertex, influences, pose);
  precise vec3 lever = scaled.vertex.position - center;
  scaled.vertex.position = lever;
  precise vec3 moved =
      vec3(dot3(w0.xyz, center) + w0.w, dot3(w1.xyz, center) + w1.w, dot3(w2.xyz, center) + w2.w);
  return turnVertex(scaled, blend.real, turningFactor(blend.real), moved);
}

#endif
