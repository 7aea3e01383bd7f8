// Transforms normals and tangents.
#ifndef DERMIS_DIRECTION_MAP_GLSL
#define DERMIS_DIRECTION_MAP_GLSL

#include "exact.glsl"
#include "vertex.glsl"

// The rows of a blended 3×3 matrix, and the sign of its determinant. If poses may scale, the matrix is scaled so that no product of
// two or three entries overflows, and the square of the largest entry does not underflow.
struct DirectionMap {
  vec3 r0;
  vec3 r1;
  vec3 r2;
  float side;
};

// If no pose may scale, the matrix is not scaled. Linear blending applies the scale of joints even then; its products are in range
// for joint scales between 2^-20 and 2^30. Otherwise, the matrix is multiplied by a power of two. If products are in range anyway,
// results have the same bits with and without this multiplication.
DirectionMap directionMap(vec3 r0, vec3 r1, vec3 r2) {
  if (!SCALES) return DirectionMap(r0, r1, r2, dot3(r0, cross3(r1, r2)) < 0.0 ? -1.0 : 1.0);
  float scale = powerScale(max(largestComponent(r0), max(largestComponent(r1), largestComponent(r2))));
  precise vec3 n0 = r0 * scale;
  precise vec3 n1 = r1 * scale;
  precise vec3 n2 = r2 * scale;
  return DirectionMap(n0, n1, n2, dot3(n0, cross3(n1, n2)) < 0.0 ? -1.0 : 1.0);
}

// Transforms a normal by the cofactor matrix, times the sign of the determinant. It has the direction of the inverse transpose, and
// is finite for singular matrices. The result does not have unit length, and may be zero.
vec3 mapNormal(DirectionMap map, vec3 normal) {
  precise vec3 turned = map.side * vec3(dot3(cross3(map.r1, map.r2), normal), dot3(cross3(map.r2, map.r0), normal),
                                        dot3(cross3(map.r0, map.r1), normal));
  return turned;
}

// The direction with length 1, or `fallback` if it is zero.
vec3 unitOfMapped(vec3 direction, vec3 fallback) {
  if (SCALES) return unitOr(direction, fallback);
  float squared = dot3(direction, direction);
  precise vec3 unit = direction * inversesqrt(squared);
  return squared == 0.0 ? fallback : unit;
}

// Transforms a tangent by the matrix itself.
vec3 mapTangent(DirectionMap map, vec3 tangent) {
  precise vec3 turned = vec3(dot3(map.r0, tangent), dot3(map.r1, tangent), dot3(map.r2, tangent));
  return turned;
}

#endif
