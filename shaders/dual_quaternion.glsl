// Dual-quaternion linear blending, in two phases where joints scale or shear, and what other methods share with it. Needs exact,
// quaternion, polar, direction_map, mesh_access, palette_access and vertex.

// What the joints of a vertex blend to (Kavan et al. 2007, section 4): in the hemisphere of the pivot, which stands first. Not
// normalised.
struct Blend {
  vec4 real;
  vec4 dual;
  ScaleShear part;
};

float signedWeight(vec4 pivot, vec4 rotation, float weight) { return dot4(pivot, rotation) < 0.0 ? -weight : weight; }

// Weights sum to 1: the pivot's part, and how far the others differ. Where no joint scales that is 1 exactly, and the vertex comes
// out to the bit as if the palette had no such joint. A loop of its own, over nothing where it is not wanted: some drivers execute
// both sides of an `if`, but none goes through a loop that is over.
ScaleShear blendScaleShear(Influences influences, uint palette, uint jointCount, bool twoPhase) {
  precise vec3 diagonal = vec3(1.0);
  precise vec3 mixed = vec3(0.0);
  uint count = twoPhase ? influences.count : 0u;
  vec3 pivotDiagonal = vec3(0.0);
  vec3 pivotMixed = vec3(0.0);
  for (uint slot = 0u; slot < count; ++slot) {
    ScaleShear part = paletteScaleShear(palette, jointCount, influenceJoint(influences, slot));
    if (slot == 0u) {
      pivotDiagonal = part.diagonal;
      pivotMixed = part.mixed;
      diagonal = part.diagonal;
      mixed = part.mixed;
    }
    float weight = influenceWeight(influences, slot);
    diagonal += weight * (part.diagonal - pivotDiagonal);
    mixed += weight * (part.mixed - pivotMixed);
  }
  return ScaleShear(diagonal, mixed);
}

Blend blendJoints(Influences influences, uint palette, uint jointCount, bool twoPhase) {
  uint pivotJoint = influenceJoint(influences, 0u);
  vec4 pivot = paletteRotation(palette, pivotJoint);
  float pivotWeight = influenceWeight(influences, 0u);
  precise vec4 real = pivotWeight * pivot;
  precise vec4 dual = pivotWeight * paletteDual(palette, pivotJoint);
  for (uint slot = 1u; slot < MOST_INFLUENCES; ++slot) {
    if (slot >= influences.count) break;
    float weight = influenceWeight(influences, slot);
    uint joint = influenceJoint(influences, slot);
    vec4 rotation = paletteRotation(palette, joint);
    float towardsPivot = signedWeight(pivot, rotation, weight);
    real += towardsPivot * rotation;
    dual += towardsPivot * paletteDual(palette, joint);
  }
  return Blend(real, dual, blendScaleShear(influences, palette, jointCount, twoPhase));
}

// The first phase: a vertex scaled and sheared in bind space. Its directions are of unit length.
struct Scaled {
  Vertex vertex;
  float side;  // -1 where it was mirrored
};

vec3 scalePosition(ScaleShear part, vec3 p) {
  precise vec3 position = vec3(dot3(vec3(part.diagonal.x, part.mixed.x, part.mixed.y), p),
                               dot3(vec3(part.mixed.x, part.diagonal.y, part.mixed.z), p),
                               dot3(vec3(part.mixed.y, part.mixed.z, part.diagonal.z), p));
  return position;
}

Scaled scaleVertex(Vertex vertex, ScaleShear part, bool twoPhase, bool withNormal, bool withTangent) {
  Scaled scaled = Scaled(vertex, 1.0);
  if (twoPhase) {
    scaled.vertex.position = scalePosition(part, vertex.position);
    if (withNormal || withTangent) {
      DirectionMap map =
          directionMap(vec3(part.diagonal.x, part.mixed.x, part.mixed.y), vec3(part.mixed.x, part.diagonal.y, part.mixed.z),
                       vec3(part.mixed.y, part.mixed.z, part.diagonal.z));
      scaled.side = map.side;
      if (withNormal) scaled.vertex.normal = mapNormal(map, vertex.normal);
      if (withTangent) scaled.vertex.tangent.xyz = mapTangent(map, vertex.tangent.xyz);
    }
  }
  if (!UNIT_BEFORE) makeDirectionsUnit(scaled.vertex, withNormal, withTangent);
  return scaled;
}

// The second phase: turned by a quaternion of any length but 0, then moved. Directions stay of unit length.
Vertex turnVertex(Scaled scaled, vec4 real, float squaredLength, vec3 translation, bool withNormal, bool withTangent) {
  Vertex skinned = scaled.vertex;
  precise vec3 position = rotateBy(real, squaredLength, scaled.vertex.position) + translation;
  skinned.position = position;
  if (withNormal) skinned.normal = rotateBy(real, squaredLength, scaled.vertex.normal);
  if (withTangent) {
    skinned.tangent = tangentOf(rotateBy(real, squaredLength, scaled.vertex.tangent.xyz), scaled.vertex.tangent.w, scaled.side);
  }
  return skinned;
}

// The translation of a dual quaternion of any length but 0. Dividing by the squared length replaces normalising.
vec3 translationOf(vec4 real, vec4 dual, float squaredLength) {
  precise vec3 translation = (real.w * dual.xyz - dual.w * real.xyz + cross3(real.xyz, dual.xyz)) * (2.0 / squaredLength);
  return translation;
}

Vertex skinDualQuaternion(Vertex vertex, Influences influences, uint palette, uint jointCount, bool withNormal,
                          bool withTangent) {
  bool twoPhase = paletteIsTwoPhase(palette);
  Blend blend = blendJoints(influences, palette, jointCount, twoPhase);
  float squaredLength = dot4(blend.real, blend.real);
  return turnVertex(scaleVertex(vertex, blend.part, twoPhase, withNormal, withTangent), blend.real, squaredLength,
                    translationOf(blend.real, blend.dual, squaredLength), withNormal, withTangent);
}
