// Linear blend skinning.
#ifndef DERMIS_LINEAR_GLSL
#define DERMIS_LINEAR_GLSL

#include "../exact.glsl"
#include "../direction_map.glsl"
#include "../mesh_access.glsl"
#include "../palette_access.glsl"
#include "../vertex.glsl"

// Transforms a vertex by a blended 3×4 matrix, given by its rows.
Vertex throughMatrix(Vertex vertex, vec4 r0, vec4 r1, vec4 r2) {
  Vertex skinned = vertex;
  vec3 p = vertex.position;
  precise vec3 position = vec3(dot3(r0.xyz, p) + r0.w, dot3(r1.xyz, p) + r1.w, dot3(r2.xyz, p) + r2.w);
  skinned.position = position;
  if (NORMALS || TANGENTS) {
    DirectionMap map = directionMap(r0.xyz, r1.xyz, r2.xyz);
    if (NORMALS) skinned.normal = unitOfMapped(mapNormal(map, vertex.normal), vertex.normal);
    if (TANGENTS) {
      vec3 direction = unitOfMapped(mapTangent(map, vertex.tangent.xyz), vertex.tangent.xyz);
      skinned.tangent = tangentOf(direction, vertex.tangent.w, map.side);
    }
  }
  return skinned;
}

// The rows of a 3×4 matrix.
struct Rows {
  vec4 r0;
  vec4 r1;
  vec4 r2;
};

Rows addMatrix(Rows blend, float weight, Pose pose, uint joint) {
  precise vec4 r0 = fma(vec4(weight), paletteRow(pose.palette, joint, 0u), blend.r0);
  precise vec4 r1 = fma(vec4(weight), paletteRow(pose.palette, joint, 1u), blend.r1);
  precise vec4 r2 = fma(vec4(weight), paletteRow(pose.palette, joint, 2u), blend.r2);
  return Rows(r0, r1, r2);
}

Vertex skinLinear(Vertex vertex, Influences influences, Pose pose) {
  precise vec4 r0 = influences.weights.x * paletteRow(pose.palette, influences.joints.x, 0u);
  precise vec4 r1 = influences.weights.x * paletteRow(pose.palette, influences.joints.x, 1u);
  precise vec4 r2 = influences.weights.x * paletteRow(pose.palette, influences.joints.x, 2u);
  Rows blend = Rows(r0, r1, r2);
#define ADD_MATRIX(weight, joint) blend = addMatrix(blend, weight, pose, joint)
  FOR_OTHER_INFLUENCES(influences, ADD_MATRIX)
  return throughMatrix(vertex, blend.r0, blend.r1, blend.r2);
}

#endif
