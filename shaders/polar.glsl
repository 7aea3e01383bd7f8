// Polar decomposition of a 3×3 matrix. Needs exact.glsl and quaternion.glsl.

// One rotation of Jacobi's method: makes the entry pq of a symmetric 4×4 matrix zero. j and k are the other two indices, vp and vq
// the eigenvectors so far. In scalars, since drivers keep an array that is indexed in memory.
void turnJacobi(inout float app, inout float aqq, inout float apq, inout float ajp, inout float ajq, inout float akp,
                inout float akq, inout vec4 vp, inout vec4 vq) {
  precise float theta = (aqq - app) / (2.0 * apq);
  precise float tangent = (theta < 0.0 ? -1.0 : 1.0) / (abs(theta) + sqrt(1.0 + theta * theta));
  if (apq == 0.0 || abs(theta) > 1e18) tangent = 0.0;
  precise float cosine = inversesqrt(1.0 + tangent * tangent);
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

// The rotation nearest to a matrix, as a unit quaternion: the eigenvector of the largest eigenvalue of a symmetric 4×4
// matrix (Horn 1987, "Closed-form solution of absolute orientation using unit quaternions"). It also is the right rotation
// for a matrix of rank 2, and finite for any. Cyclic Jacobi, which is as exact as float32 allows.
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

  // It converges quadratically: four or five sweeps, and few matrices take more.
  for (uint sweep = 0u; sweep < 8u; ++sweep) {
    precise float outside = abs(xy) + abs(xz) + abs(xw) + abs(yz) + abs(yw) + abs(zw);
    precise float inside = abs(xx) + abs(yy) + abs(zz) + abs(ww);
    precise float negligible = 1e-12 * inside;
    if (outside <= negligible) break;
    turnJacobi(xx, yy, xy, xz, yz, xw, yw, vx, vy);
    turnJacobi(xx, zz, xz, xy, yz, xw, zw, vx, vz);
    turnJacobi(xx, ww, xw, xy, yw, xz, zw, vx, vw);
    turnJacobi(yy, zz, yz, xy, xz, yw, zw, vy, vz);
    turnJacobi(yy, ww, yw, xy, xw, yz, zw, vy, vw);
    turnJacobi(zz, ww, zw, xz, xw, yz, yw, vz, vw);
  }

  float largest = max(max(xx, yy), max(zz, ww));
  vec4 q = xx == largest ? vx : (yy == largest ? vy : (zz == largest ? vz : vw));
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
