// The blending rules: a vertex, its influences and a palette to a skinned vertex. Needs exact, quaternion, polar,
// mesh_access, palette_access and vertex.

// A blended 3×3 matrix by its rows, scaled so that no product of two of them leaves the range of a float, and the sign of its
// determinant: what directions are transformed by.
struct DirectionMap {
  vec3 r0;
  vec3 r1;
  vec3 r2;
  float side;
};

DirectionMap directionMap(vec3 r0, vec3 r1, vec3 r2) {
  float largest = max(largestComponent(r0), max(largestComponent(r1), largestComponent(r2)));
  precise vec3 n0 = r0 / (largest == 0.0 ? 1.0 : largest);
  precise vec3 n1 = r1 / (largest == 0.0 ? 1.0 : largest);
  precise vec3 n2 = r2 / (largest == 0.0 ? 1.0 : largest);
  return DirectionMap(n0, n1, n2, dot3(n0, cross3(n1, n2)) < 0.0 ? -1.0 : 1.0);
}

// Normals go by the cofactors of the matrix, which have the direction of its inverse transpose and stay finite where it is
// singular; a mirror turns them over once. Of unit length.
vec3 mapNormal(DirectionMap map, vec3 normal) {
  precise vec3 turned = map.side * vec3(dot3(cross3(map.r1, map.r2), normal), dot3(cross3(map.r2, map.r0), normal),
                                        dot3(cross3(map.r0, map.r1), normal));
  return unitOr(turned, normal);
}

// Tangents go by the matrix itself.
vec3 mapTangent(DirectionMap map, vec3 tangent) {
  precise vec3 turned = vec3(dot3(map.r0, tangent), dot3(map.r1, tangent), dot3(map.r2, tangent));
  return unitOr(turned, tangent);
}

Vertex skinLinear(Vertex vertex, Influences influences, uint palette, bool withNormal, bool withTangent) {
  float pivotWeight = influenceWeight(influences, 0u);
  uint pivotJoint = influenceJoint(influences, 0u);
  precise vec4 r0 = pivotWeight * paletteRow(palette, pivotJoint, 0u);
  precise vec4 r1 = pivotWeight * paletteRow(palette, pivotJoint, 1u);
  precise vec4 r2 = pivotWeight * paletteRow(palette, pivotJoint, 2u);
  for (uint slot = 1u; slot < influences.count; ++slot) {
    float weight = influenceWeight(influences, slot);
    uint joint = influenceJoint(influences, slot);
    r0 += weight * paletteRow(palette, joint, 0u);
    r1 += weight * paletteRow(palette, joint, 1u);
    r2 += weight * paletteRow(palette, joint, 2u);
  }
  Vertex skinned = vertex;
  vec3 p = vertex.position;
  precise vec3 position = vec3(dot3(r0.xyz, p) + r0.w, dot3(r1.xyz, p) + r1.w, dot3(r2.xyz, p) + r2.w);
  skinned.position = position;
  if (withNormal || withTangent) {
    DirectionMap map = directionMap(r0.xyz, r1.xyz, r2.xyz);
    if (withNormal) skinned.normal = mapNormal(map, vertex.normal);
    if (withTangent) skinned.tangent = tangentOf(mapTangent(map, vertex.tangent.xyz), vertex.tangent.w, map.side);
  }
  return skinned;
}

// Kavan et al. 2007, section 4: blend in the hemisphere of the pivot, which stands first. Instead of normalising, what follows
// divides by the squared length.
Vertex skinDualQuaternion(Vertex vertex, Influences influences, uint palette, uint jointCount, bool withNormal,
                          bool withTangent) {
  uint pivotJoint = influenceJoint(influences, 0u);
  vec4 pivot = paletteRotation(palette, pivotJoint);
  float pivotWeight = influenceWeight(influences, 0u);
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
  for (uint slot = 1u; slot < influences.count; ++slot) {
    float weight = influenceWeight(influences, slot);
    uint joint = influenceJoint(influences, slot);
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
  float side = 1.0;
  if (twoPhase) {
    vec3 s0 = vec3(diagonal.x, mixed.x, mixed.y);
    vec3 s1 = vec3(mixed.x, diagonal.y, mixed.z);
    vec3 s2 = vec3(mixed.y, mixed.z, diagonal.z);
    vec3 p = vertex.position;
    precise vec3 position = vec3(dot3(s0, p), dot3(s1, p), dot3(s2, p));
    scaled.position = position;
    if (withNormal || withTangent) {
      DirectionMap map = directionMap(s0, s1, s2);
      side = map.side;
      if (withNormal) scaled.normal = mapNormal(map, vertex.normal);
      if (withTangent) scaled.tangent.xyz = mapTangent(map, vertex.tangent.xyz);
    }
  }

  float squaredLength = dot4(real, real);
  precise vec3 translation = (real.w * dual.xyz - dual.w * real.xyz + cross3(real.xyz, dual.xyz)) * (2.0 / squaredLength);
  Vertex skinned = vertex;
  precise vec3 position = rotateBy(real, squaredLength, scaled.position) + translation;
  skinned.position = position;
  if (withNormal) skinned.normal = unitOr(rotateBy(real, squaredLength, scaled.normal), vec3(0.0));
  if (withTangent) {
    vec3 direction = unitOr(rotateBy(real, squaredLength, scaled.tangent.xyz), vec3(0.0));
    skinned.tangent = tangentOf(direction, vertex.tangent.w, side);
  }
  return skinned;
}

// A vertex without influences stays in bind pose.
Vertex skinVertex(Vertex vertex, Influences influences, uint palette, uint jointCount, bool withNormal, bool withTangent) {
  if (influences.count == 0u) {
    Vertex still = vertex;
    if (withNormal) still.normal = unitOr(vertex.normal, vec3(0.0));
    if (withTangent) still.tangent = tangentOf(unitOr(vertex.tangent.xyz, vec3(0.0)), vertex.tangent.w, 1.0);
    return still;
  }
  if (METHOD == METHOD_LINEAR) return skinLinear(vertex, influences, palette, withNormal, withTangent);
  return skinDualQuaternion(vertex, influences, palette, jointCount, withNormal, withTangent);
}
