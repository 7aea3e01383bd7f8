// How a packed mesh is read: what every vertex has by units of four words, the rest by words.
#ifndef DERMIS_MESH_ACCESS_GLSL
#define DERMIS_MESH_ACCESS_GLSL

#include "abi.h"

#if defined(DERMIS_SKIN_GLSL)
// skin_include.glsl says how.
#elif defined(TEXELS)
layout(set = 0, binding = BINDING_MESH_TEXELS) uniform utextureBuffer meshTexels;
layout(set = 0, binding = BINDING_MESH_WORDS) uniform utextureBuffer meshWordTexels;

uvec4 meshUnit(uint unit) { return texelFetch(meshTexels, int(unit)); }
uint meshWord(uint word) { return texelFetch(meshWordTexels, int(word)).x; }
#else
layout(set = 0, binding = BINDING_MESHES, std430) readonly buffer Meshes { uint meshes[]; };
layout(set = 0, binding = BINDING_MESHES, std430) readonly buffer MeshUnits { uvec4 meshUnits[]; };

uvec4 meshUnit(uint unit) { return meshUnits[unit]; }
uint meshWord(uint word) { return meshes[word]; }
#endif

vec3 meshVector(uint word) {
  return vec3(uintBitsToFloat(meshWord(word)), uintBitsToFloat(meshWord(word + 1u)), uintBitsToFloat(meshWord(word + 2u)));
}

// The word at which a section begins.
uint meshSection(uint mesh, uint header) { return mesh + meshWord(mesh + header); }

MorphRecord loadMorph(uint word) {
  uvec4 a = meshUnit(word / 4u);
  return MorphRecord(a.x, a.y, a.z, a.w);
}

MorphBlockRecord loadMorphBlock(uint word) {
  uvec4 a = meshUnit(word / 4u);
  return MorphBlockRecord(a.x, a.y, a.z, a.w);
}

// The units at which stand the vertices of a mesh.
struct Sections {
  uint positions;
  uint normals;
  uint tangents;
  uint influences;
};

Sections sectionsOf(uint mesh) {
  uvec4 units = (mesh + meshUnit((mesh + MESH_HEADER_POSITIONS) / 4u)) / 4u;
  return Sections(units.x, units.y, units.z, units.w);
}

// Influences of a vertex that are read once, for all its instances. Bounds the loops over them, so that drivers unroll these.
const uint LOADED_INFLUENCES = INFLUENCES != 0u ? INFLUENCES : 4u;

// The influences of one vertex: the loaded ones, and where all of them stand.
struct Influences {
  uint unit;
  uint count;
  vec4 weights;
  uvec4 joints;
};

// `first` is the last word of the vertex' position.
Influences influencesOf(Sections sections, uint vertex, uint first) {
  uint end = meshUnit(sections.positions + vertex + 1u)[VERTEX_INFLUENCES];
  Influences influences;
  influences.unit = sections.influences + first / 2u;
  influences.count = (end / 2u - first / 2u) * 2u - first % 2u;
  if (INFLUENCES != 0u) influences.count = min(influences.count, INFLUENCES);
  influences.weights = vec4(0.0);
  influences.joints = uvec4(0u);
  uvec4 two = uvec4(0u);
  if (influences.count > 0u) two = meshUnit(influences.unit);
  influences.weights.xy = uintBitsToFloat(two.xz);
  influences.joints.xy = two.yw;
  if (LOADED_INFLUENCES > 2u) {
    two = uvec4(0u);
    if (influences.count > 2u) two = meshUnit(influences.unit + 1u);
    influences.weights.zw = uintBitsToFloat(two.xz);
    influences.joints.zw = two.yw;
  }
  return influences;
}

struct Influence {
  float weight;
  uint joint;
};

Influence loadInfluence(Influences influences, uint slot) {
  uvec4 two = meshUnit(influences.unit + slot / 2u);
  return slot % 2u == 0u ? Influence(uintBitsToFloat(two.x), two.y) : Influence(uintBitsToFloat(two.z), two.w);
}

// Whether a vertex has more than the loaded influences. Never, and a constant, where INFLUENCES is not 0.
bool hasFurther(Influences influences) { return INFLUENCES == 0u && influences.count > LOADED_INFLUENCES; }

// Any of them, for loops that do not tell apart which are loaded.
float influenceWeight(Influences influences, uint slot) {
  return INFLUENCES != 0u ? influences.weights[slot] : loadInfluence(influences, slot).weight;
}

uint influenceJoint(Influences influences, uint slot) {
  return INFLUENCES != 0u ? influences.joints[slot] : loadInfluence(influences, slot).joint;
}

// What some methods want to know of a vertex besides.
struct MethodInputs {
  vec3 center;
  float share;  // of dual quaternions, or the strength of bulge control
};

float meshShare(uint mesh, uint vertex, uint values, uint value) {
  uint section = meshWord(mesh + values);
  return uintBitsToFloat(section == 0u ? meshWord(mesh + value) : meshWord(mesh + section + vertex));
}

MethodInputs methodInputsOf(uint mesh, uint vertex) {
  MethodInputs inputs = MethodInputs(vec3(0.0), 0.0);
  if (METHOD == METHOD_CENTER_OF_ROTATION || METHOD == METHOD_BULGE_CONTROLLED) {
    inputs.center = uintBitsToFloat(meshUnit(meshSection(mesh, MESH_HEADER_CENTERS) / 4u + vertex).xyz);
  }
  if (METHOD == METHOD_BULGE_CONTROLLED) {
    inputs.share = meshShare(mesh, vertex, MESH_HEADER_BULGE_STRENGTHS, MESH_HEADER_BULGE_STRENGTH);
  }
  if (METHOD == METHOD_BLENDED) {
    inputs.share = meshShare(mesh, vertex, MESH_HEADER_DUAL_QUATERNION_WEIGHTS, MESH_HEADER_DUAL_QUATERNION_WEIGHT);
  }
  return inputs;
}

#endif
