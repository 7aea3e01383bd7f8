// For an engine's own vertex, mesh or compute shaders: a vertex of a packed mesh skinned by a pose, with the arithmetic of Dermis'
// kernels. Made from the kernels' sources by the build, which puts `dermis_` before every name that is not for engines.
//
// Define before the #include, where the default does not suit:
//   DERMIS_METHOD              0 linear, 1 dual quaternions (the default), 6 blended, 7 centre of rotation, 8 bulge-controlled
//   DERMIS_INFLUENCES          the most influences of a vertex: 1, 2, 4, or 0 for any number (the default)
//   DERMIS_SCALES              false if no pose has `mayScale`; true is the default
//   DERMIS_SET, DERMIS_MESHES_BINDING, DERMIS_PALETTES_BINDING
//                              where two readonly storage buffers stand: the mesh buffer, and the palettes buffer (linear: the poses
//                              buffer). The defaults are 0, 0 and 1.
//   DERMIS_MESH_UNIT(unit), DERMIS_PALETTE_UNIT(unit)
//                              both, instead of the two buffers: 16 bytes of either as a uvec4, by `unit` times 16 bytes
//
// `mesh` is the byte offset of the packed mesh in its buffer, divided by 4. `palette` is Plan::paletteOffset, divided by 16; for
// linear, PoseDescription::matrixOffset divided by 16. `jointCount` is that of the pose. Poses that no job reads are converted
// only if PoseDescription::isReadByShaders. Morph targets are not applied: add them between dermisBindVertex and dermisSkinVertex.
#ifndef DERMIS_SKIN_GLSL
#define DERMIS_SKIN_GLSL

#ifndef DERMIS_METHOD
#define DERMIS_METHOD 1u
#endif
#ifndef DERMIS_INFLUENCES
#define DERMIS_INFLUENCES 0u
#endif
#ifndef DERMIS_SCALES
#define DERMIS_SCALES true
#endif
#ifndef DERMIS_MESH_UNIT
#ifndef DERMIS_SET
#define DERMIS_SET 0
#endif
#ifndef DERMIS_MESHES_BINDING
#define DERMIS_MESHES_BINDING 0
#endif
#ifndef DERMIS_PALETTES_BINDING
#define DERMIS_PALETTES_BINDING 1
#endif
layout(set = DERMIS_SET, binding = DERMIS_MESHES_BINDING, std430) readonly buffer DermisMeshes { uvec4 dermisMeshes[]; };
layout(set = DERMIS_SET, binding = DERMIS_PALETTES_BINDING, std430) readonly buffer DermisPalettes { uvec4 dermisPalettes[]; };
#define DERMIS_MESH_UNIT(unit) dermisMeshes[unit]
#define DERMIS_PALETTE_UNIT(unit) dermisPalettes[unit]
#endif

const uint METHOD = DERMIS_METHOD;
const uint INFLUENCES = DERMIS_INFLUENCES;
const bool FULL = false;
const bool SCALES = DERMIS_SCALES;

uvec4 meshUnit(uint unit) { return DERMIS_MESH_UNIT(unit); }
uint meshWord(uint word) { return meshUnit(word / 4u)[word % 4u]; }
uvec4 paletteBits(uint unit) { return DERMIS_PALETTE_UNIT(unit); }

#include "blend.glsl"

struct DermisVertex {
  vec3 position;
  vec3 normal;   // of unit length; zero without normals
  vec4 tangent;  // likewise; w: the handedness, 1 or -1
};

// As the mesh has it.
DermisVertex dermisBindVertex(uint mesh, uint vertex) {
  MeshHeader header = loadMeshHeader(mesh);
  Sections sections = sectionsOf(mesh);
  DermisVertex bind = DermisVertex(vec3(0.0), vec3(0.0), vec4(0.0));
  bind.position = uintBitsToFloat(meshUnit(sections.positions + vertex).xyz);
  if (header.normals != 0u) bind.normal = uintBitsToFloat(meshUnit(sections.normals + vertex).xyz);
  if (header.tangents != 0u) bind.tangent = uintBitsToFloat(meshUnit(sections.tangents + vertex));
  return bind;
}

// Position and directions in the space of the joint matrices.
DermisVertex dermisSkinVertex(DermisVertex bind, uint mesh, uint vertex, uint palette, uint jointCount) {
  Sections sections = sectionsOf(mesh);
  uint first = loadPosition(sections.positions + vertex).influences;
  Vertex own = Vertex(bind.position, bind.normal, bind.tangent, vec3(0.0), vec3(0.0));
  makeDirectionsUnit(own, true, true);
  Pose pose = Pose(palette, jointCount, METHOD != METHOD_LINEAR && paletteScales(palette));
  Vertex skinned = skinVertex(own, influencesOf(sections, vertex, first), methodInputsOf(mesh, vertex), pose, true, true);
  return DermisVertex(skinned.position, skinned.normal, skinned.tangent);
}

DermisVertex dermisSkin(uint mesh, uint vertex, uint palette, uint jointCount) {
  return dermisSkinVertex(dermisBindVertex(mesh, vertex), mesh, vertex, palette, jointCount);
}

#endif
