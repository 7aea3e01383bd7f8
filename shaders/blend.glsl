// The blending rules: a vertex, its influences and a palette to a skinned vertex. A slot of weight 0 is skipped, not
// multiplied: its palette entry may be anything. Needs exact, quaternion, polar, mesh_access and palette_access.

struct Vertex {
  vec3 position;
  vec3 normal;
};

// Normals go by the cofactors of the matrix, which have the direction of its inverse transpose and stay finite where it is
// singular; a mirror turns them over once.
vec3 normalByRows(vec3 r0, vec3 r1, vec3 r2, vec3 normal) {
  vec3 c0 = cross3(r1, r2);
  precise vec3 turned = vec3(dot3(c0, normal), dot3(cross3(r2, r0), normal), dot3(cross3(r0, r1), normal));
  return dot3(r0, c0) < 0.0 ? -turned : turned;
}

// As normalByRows, with the matrix scaled so that no product of two rows leaves the range of a float.
vec3 normalByMatrix(vec3 r0, vec3 r1, vec3 r2, vec3 normal) {
  float largest = max(largestComponent(r0), max(largestComponent(r1), largestComponent(r2)));
  if (largest == 0.0) return vec3(0.0);
  precise vec3 n0 = r0 / largest;
  precise vec3 n1 = r1 / largest;
  precise vec3 n2 = r2 / largest;
  return normalByRows(n0, n1, n2, normal);
}

Vertex skinLinear(Vertex vertex, InfluenceRows rows, uint slots, uint palette, bool withNormal) {
  precise vec4 r0 = vec4(0.0);
  precise vec4 r1 = vec4(0.0);
  precise vec4 r2 = vec4(0.0);
  for (uint slot = 0u; slot < slots; ++slot) {
    float weight = influenceWeight(rows, slot);
    if (weight == 0.0) continue;
    uint joint = influenceJoint(rows, slot);
    r0 += weight * paletteRow(palette, joint, 0u);
    r1 += weight * paletteRow(palette, joint, 1u);
    r2 += weight * paletteRow(palette, joint, 2u);
  }
  Vertex skinned;
  vec3 p = vertex.position;
  precise vec3 position = vec3(dot3(r0.xyz, p) + r0.w, dot3(r1.xyz, p) + r1.w, dot3(r2.xyz, p) + r2.w);
  skinned.position = position;
  skinned.normal = vec3(0.0);
  if (withNormal) {
    skinned.normal = unitOr(normalByMatrix(r0.xyz, r1.xyz, r2.xyz, vertex.normal), vertex.normal);
  }
  return skinned;
}

// Kavan et al. 2007, section 4: blend in the hemisphere of the pivot, which stands in slot 0. Instead of normalising, what
// follows divides by the squared length.
Vertex skinDualQuaternion(Vertex vertex, InfluenceRows rows, uint slots, uint palette, uint jointCount,
                          bool withNormal) {
  uint pivotJoint = influenceJoint(rows, 0u);
  vec4 pivot = paletteRotation(palette, pivotJoint);
  float pivotWeight = influenceWeight(rows, 0u);
  precise vec4 real = pivotWeight * pivot;
  precise vec4 dual = pivotWeight * paletteDual(palette, pivotJoint);
  bool twoPhase = paletteIsTwoPhase(palette);
  precise vec3 diagonal = vec3(1.0);
  precise vec3 mixed = vec3(0.0);
  if (twoPhase) {
    ScaleShear part = paletteScaleShear(palette, jointCount, pivotJoint);
    diagonal = pivotWeight * part.diagonal;
    mixed = pivotWeight * part.mixed;
  }
  for (uint slot = 1u; slot < slots; ++slot) {
    float weight = influenceWeight(rows, slot);
    if (weight == 0.0) continue;
    uint joint = influenceJoint(rows, slot);
    vec4 rotation = paletteRotation(palette, joint);
    float signedWeight = dot4(pivot, rotation) < 0.0 ? -weight : weight;
    real += signedWeight * rotation;
    dual += signedWeight * paletteDual(palette, joint);
    if (twoPhase) {
      ScaleShear part = paletteScaleShear(palette, jointCount, joint);
      diagonal += weight * part.diagonal;
      mixed += weight * part.mixed;
    }
  }

  Vertex scaled = vertex;
  if (twoPhase) {
    vec3 s0 = vec3(diagonal.x, mixed.x, mixed.y);
    vec3 s1 = vec3(mixed.x, diagonal.y, mixed.z);
    vec3 s2 = vec3(mixed.y, mixed.z, diagonal.z);
    vec3 p = vertex.position;
    precise vec3 position = vec3(dot3(s0, p), dot3(s1, p), dot3(s2, p));
    scaled.position = position;
    if (withNormal) scaled.normal = unitOr(normalByMatrix(s0, s1, s2, vertex.normal), vertex.normal);
  }

  float squaredLength = dot4(real, real);
  precise vec3 translation = (real.w * dual.xyz - dual.w * real.xyz + cross3(real.xyz, dual.xyz)) * (2.0 / squaredLength);
  Vertex skinned;
  precise vec3 position = rotateBy(real, squaredLength, scaled.position) + translation;
  skinned.position = position;
  skinned.normal = vec3(0.0);
  if (withNormal) skinned.normal = unitOr(rotateBy(real, squaredLength, scaled.normal), vec3(0.0));
  return skinned;
}
