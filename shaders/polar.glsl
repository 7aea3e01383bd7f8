// Polar decomposition of a 3×3 matrix. Needs exact.glsl and quaternion.glsl.

// The rotation nearest to a matrix, as a unit quaternion: the eigenvector of the largest eigenvalue of a symmetric 4×4
// matrix (Horn 1987, "Closed-form solution of absolute orientation using unit quaternions"). It also is the right rotation
// for a matrix of rank 2, and finite for any. Cyclic Jacobi, which is as exact as float32 allows.
vec4 nearestRotation(vec3 r0, vec3 r1, vec3 r2) {
  precise float a[16];  // symmetric, in the order x y z w
  a[0] = r0.x - r1.y - r2.z;
  a[5] = -r0.x + r1.y - r2.z;
  a[10] = -r0.x - r1.y + r2.z;
  a[15] = r0.x + r1.y + r2.z;
  a[1] = a[4] = r0.y + r1.x;
  a[2] = a[8] = r0.z + r2.x;
  a[6] = a[9] = r1.z + r2.y;
  a[3] = a[12] = r2.y - r1.z;
  a[7] = a[13] = r0.z - r2.x;
  a[11] = a[14] = r1.x - r0.y;
  precise float v[16];  // eigenvectors, one a column
  for (uint i = 0u; i < 16u; ++i) v[i] = i % 5u == 0u ? 1.0 : 0.0;

  for (uint sweep = 0u; sweep < 8u; ++sweep) {
    for (uint p = 0u; p < 3u; ++p) {
      for (uint q = p + 1u; q < 4u; ++q) {
        precise float offDiagonal = a[p * 4u + q];
        if (offDiagonal == 0.0) continue;
        precise float theta = (a[q * 5u] - a[p * 5u]) / (2.0 * offDiagonal);
        precise float tangent = (theta < 0.0 ? -1.0 : 1.0) / (abs(theta) + sqrt(1.0 + theta * theta));
        if (isinf(theta) || abs(theta) > 1e18) tangent = 0.0;
        precise float cosine = inversesqrt(1.0 + tangent * tangent);
        precise float sine = tangent * cosine;
        for (uint k = 0u; k < 4u; ++k) {
          precise float x = a[k * 4u + p];
          precise float y = a[k * 4u + q];
          a[k * 4u + p] = cosine * x - sine * y;
          a[k * 4u + q] = sine * x + cosine * y;
        }
        for (uint k = 0u; k < 4u; ++k) {
          precise float x = a[p * 4u + k];
          precise float y = a[q * 4u + k];
          a[p * 4u + k] = cosine * x - sine * y;
          a[q * 4u + k] = sine * x + cosine * y;
          x = v[k * 4u + p];
          y = v[k * 4u + q];
          v[k * 4u + p] = cosine * x - sine * y;
          v[k * 4u + q] = sine * x + cosine * y;
        }
        a[p * 4u + q] = 0.0;
        a[q * 4u + p] = 0.0;
      }
    }
  }
  uint largest = 0u;
  for (uint i = 1u; i < 4u; ++i) {
    if (a[i * 5u] > a[largest * 5u]) largest = i;
  }
  precise vec4 q = vec4(v[largest], v[4u + largest], v[8u + largest], v[12u + largest]);
  precise vec4 unit = q * inversesqrt(dot4(q, q));
  return unit;
}

// A scale/shear part: the symmetric matrix S of C = R S.
struct ScaleShear {
  vec3 diagonal;  // xx yy zz
  vec3 mixed;     // xy xz yz
};

// The determinant of a matrix given by its rows, and how large it would be if no product in it cancelled: what its rounding
// error is measured by.
float determinantOf(vec3 r0, vec3 r1, vec3 r2, out float magnitude) {
  vec3 c = cross3(r1, r2);
  precise vec3 uncancelled = abs(r1.yzx * r2.zxy) + abs(r1.zxy * r2.yzx);
  magnitude = dot3(abs(r0), uncancelled);
  return dot3(r0, c);
}

// C, given by its rows, taken apart. With a negative determinant R is the rotation of −C and the sign goes into S; one that
// rounding may have made negative (24 roundings of 2^-24) counts as 0: a flat matrix has one of either sign.
void polarParts(vec3 r0, vec3 r1, vec3 r2, out vec4 rotation, out ScaleShear scaleShear) {
  float largest = max(largestComponent(r0), max(largestComponent(r1), largestComponent(r2)));
  if (largest == 0.0) {
    rotation = vec4(0.0, 0.0, 0.0, 1.0);
    scaleShear = ScaleShear(vec3(0.0), vec3(0.0));
    return;
  }
  precise vec3 n0 = r0 / largest;
  precise vec3 n1 = r1 / largest;
  precise vec3 n2 = r2 / largest;
  float magnitude;
  float determinant = determinantOf(n0, n1, n2, magnitude);
  float side = determinant < -1.43e-6 * magnitude ? -1.0 : 1.0;
  rotation = nearestRotation(side * n0, side * n1, side * n2);

  // Columns of S: each column of C turned back, averaged with its transpose.
  vec4 back = vec4(-rotation.xyz, rotation.w);
  float squared = dot4(rotation, rotation);
  precise vec3 s0 = rotateBy(back, squared, vec3(r0.x, r1.x, r2.x));
  precise vec3 s1 = rotateBy(back, squared, vec3(r0.y, r1.y, r2.y));
  precise vec3 s2 = rotateBy(back, squared, vec3(r0.z, r1.z, r2.z));
  precise vec3 mixed = 0.5 * vec3(s1.x + s0.y, s2.x + s0.z, s2.y + s1.z);
  scaleShear = ScaleShear(vec3(s0.x, s1.y, s2.z), mixed);
}
