// Quaternions are x y z w, Hamilton's. Needs exact.glsl.

// The unit quaternion of a rotation given by its rows, by the largest of the four squared components (Shepperd 1978).
vec4 quaternionOfRows(vec3 r0, vec3 r1, vec3 r2) {
  precise float x = 1.0 + r0.x - r1.y - r2.z;
  precise float y = 1.0 - r0.x + r1.y - r2.z;
  precise float z = 1.0 - r0.x - r1.y + r2.z;
  precise float w = 1.0 + r0.x + r1.y + r2.z;
  precise vec4 q;
  if (w >= x && w >= y && w >= z) {
    q = vec4(r2.y - r1.z, r0.z - r2.x, r1.x - r0.y, w);
  } else if (x >= y && x >= z) {
    q = vec4(x, r0.y + r1.x, r0.z + r2.x, r2.y - r1.z);
  } else if (y >= z) {
    q = vec4(r0.y + r1.x, y, r1.z + r2.y, r0.z - r2.x);
  } else {
    q = vec4(r0.z + r2.x, r1.z + r2.y, z, r1.x - r0.y);
  }
  precise vec4 unit = q * inversesqrt(dot4(q, q));
  return unit;
}

// v turned by a quaternion of any length but 0, whose squared length is given: v + 2 r × (r × v + w v) / |q|².
vec3 rotateBy(vec4 q, float squaredLength, vec3 v) {
  precise vec3 inner = cross3(q.xyz, v) + q.w * v;
  precise vec3 turned = v + cross3(q.xyz, inner) * (2.0 / squaredLength);
  return turned;
}

// The dual part of a rigid transform: ½ (0, t) q.
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

vec4 conjugateOf(vec4 q) { return vec4(-q.xyz, q.w); }

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
