// For an engine's own vertex, mesh or compute shaders: skins a vertex of a packed mesh, with the arithmetic of Dermis' kernels. The
// build makes dermis_skin.glsl from skin_include.glsl and the sources of the kernels. It puts `dermis_` before every name that is
// not for engines.
//
// These macros may be defined before the #include:
//   DERMIS_METHOD              0 linear, 1 dual quaternions (the default), 6 blended, 7 center of rotation, 8 bulge-controlled
//   DERMIS_INFLUENCES          maximum influences of a vertex: 1, 2, 4, or 0 for any number (the default)
//   DERMIS_SCALES              false if no pose has `mayScale`; the default is true
//   DERMIS_SET, DERMIS_MESHES_BINDING, DERMIS_PALETTES_BINDING
//                              set and bindings of two readonly storage buffers: the mesh buffer and the palettes buffer (for
//                              linear, the poses buffer). The defaults are 0, 0 and 1.
//   DERMIS_MESH_UNIT(unit), DERMIS_PALETTE_UNIT(unit)
//                              define both to read from elsewhere than these two buffers. Each is a uvec4: the 16 bytes at byte
//                              `unit` × 16 of the mesh data or the palette data.
//
// Parameters of the functions:
// - `mesh` is the byte offset of the packed mesh in its buffer, divided by 4.
// - `palette` is Plan::paletteOffset, divided by 16; for linear, PoseDescription::matrixOffset, divided by 16. If no job needs the
//   dual quaternions of a pose, it is converted to them only if PoseDescription::isReadByShaders is set.
// - `jointCount` is the number of joints of the pose.
//
// Morph targets are not applied: an engine adds them between dermisBindVertex and dermisSkinVertex.
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
  vec3 normal;   // zero if the mesh has no normals
  vec4 tangent;  // xyz is zero if the mesh has no tangents; w is the handedness
};

// A vertex in bind pose, as the mesh stores it. Directions need not have unit length.
DermisVertex dermisBindVertex(uint mesh, uint vertex) {
  MeshHeader header = loadMeshHeader(mesh);
  Sections sections = sectionsOf(mesh);
  DermisVertex bind = DermisVertex(vec3(0.0), vec3(0.0), vec4(0.0));
  bind.position = uintBitsToFloat(meshUnit(sections.positions + vertex).xyz);
  if (header.normals != 0u) bind.normal = uintBitsToFloat(meshUnit(sections.normals + vertex).xyz);
  if (header.tangents != 0u) bind.tangent = uintBitsToFloat(meshUnit(sections.tangents + vertex));
  return bind;
}

// Skins a vertex. The joint matrices map bind space to the space of the result. The directions of the result have unit length, or
// are zero if those of `bind` are zero. The handedness is 1 or -1.
DermisVertex dermisSkinVertex(DermisVertex bind, uint mesh, uint vertex, uint palette, uint jointCount) {
  Sections sections = sectionsOf(mesh);
  uint first = loadPosition(sections.positions + vertex).influences;
  Vertex own = Vertex(bind.position, bind.normal, bind.tangent, vec3(0.0), vec3(0.0));
  makeDirectionsUnit(own, true, true);
  Pose pose = Pose(palette, jointCount, METHOD != METHOD_LINEAR && paletteScales(palette));
  Vertex skinned = skinVertex(own, influencesOf(sections, vertex, first), methodInputsOf(mesh, vertex), pose, true, true);
  return DermisVertex(skinned.position, skinned.normal, skinned.tangent);
}

// Calls dermisBindVertex, then dermisSkinVertex.
DermisVertex dermisSkin(uint mesh, uint vertex, uint palette, uint jointCount) {
  return dermisSkinVertex(dermisBindVertex(mesh, vertex), mesh, vertex, palette, jointCount);
}

#endif
