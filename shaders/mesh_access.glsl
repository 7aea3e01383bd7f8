// Reads a packed mesh: header, vertices, influences and morph records in units of four words; displacements, dual-quaternion
// weights and bulge strengths in words.
#ifndef DERMIS_MESH_ACCESS_GLSL
#define DERMIS_MESH_ACCESS_GLSL

#include "abi.h"

#ifdef TEXELS
#include "cpu_device/texels.glsl"
#else
layout(set = 0, binding = BINDING_MESHES, std430) readonly buffer Meshes { uint meshes[]; };
layout(set = 0, binding = BINDING_MESHES, std430) readonly buffer MeshUnits { uvec4 meshUnits[]; };

uvec4 meshUnit(uint unit) { return meshUnits[unit]; }
uint meshWord(uint word) { return meshes[word]; }
#endif

vec3 meshVector(uint word) {
  return vec3(uintBitsToFloat(meshWord(word)), uintBitsToFloat(meshWord(word + 1u)), uintBitsToFloat(meshWord(word + 2u)));
}

// Compilers remove unused loads.
MeshHeader loadMeshHeader(uint mesh) {
  uvec4 a = meshUnit(mesh / 4u);
  uvec4 b = meshUnit(mesh / 4u + 1u);
  uvec4 c = meshUnit(mesh / 4u + 2u);
  uvec4 d = meshUnit(mesh / 4u + 3u);
  uvec4 e = meshUnit(mesh / 4u + 4u);
  return MeshHeader(a.x, a.y, a.z, a.w, b.x, b.y, b.z, b.w, c.x, c.y, c.z, c.w, d.x, d.y, d.z, uintBitsToFloat(d.w), e.x,
                    uintBitsToFloat(e.y), e.z, e.w);
}

PositionRecord loadPosition(uint unit) {
  uvec4 a = meshUnit(unit);
  vec3 p = uintBitsToFloat(a.xyz);
  return PositionRecord(p.x, p.y, p.z, a.w);
}

MorphRecord loadMorph(uint word) {
  uvec4 a = meshUnit(word / 4u);
  return MorphRecord(a.x, a.y, a.z, a.w);
}

MorphBlockRecord loadMorphBlock(uint word) {
  uvec4 a = meshUnit(word / 4u);
  return MorphBlockRecord(a.x, a.y, a.z, a.w);
}

// The first units of the first four sections of the mesh, counted from the beginning of the mesh buffer.
struct Sections {
  uint positions;
  uint normals;
  uint tangents;
  uint influences;
};

Sections sectionsOf(uint mesh) {
  MeshHeader header = loadMeshHeader(mesh);
  uvec4 units = (mesh + uvec4(header.positions, header.normals, header.tangents, header.influences)) / 4u;
  return Sections(units.x, units.y, units.z, units.w);
}

// The number of influences of a vertex that are loaded once, for all instances. It limits the loops over them, so that drivers
// unroll the loops.
const uint LOADED_INFLUENCES = INFLUENCES != 0u ? INFLUENCES : 4u;

// Whether a vertex with `count` influences has this one. A constant if FULL.
bool hasSlot(uint count, uint slot) { return FULL || slot < count; }

// The units of a joint in the palette that METHOD reads. Joints are multiplied by it when they are loaded: once for all instances.
const uint JOINT_UNITS = METHOD == METHOD_LINEAR ? UNITS_OF_MATRIX
                         : METHOD == METHOD_LOG_MATRIX ? UNITS_OF_LOGARITHM : UNITS_OF_DUAL_QUATERNION;

// The influences of one vertex: the unit at which they begin, their number, and the loaded ones. Joints are in units of the palette.
struct Influences {
  uint unit;
  uint count;
  vec4 weights;
  uvec4 joints;
};

// `first` is PositionRecord::influences of the vertex.
Influences influencesOf(Sections sections, uint vertex, uint first) {
  uint end = loadPosition(sections.positions + vertex + 1u).influences;
  Influences influences;
  influences.unit = sections.influences + first / 2u;
  influences.count = (end / 2u - first / 2u) * 2u - first % 2u;
  if (INFLUENCES != 0u) influences.count = min(influences.count, INFLUENCES);
  influences.weights = vec4(0.0);
  influences.joints = uvec4(0u);
  uvec4 two = uvec4(0u);
  if (hasSlot(influences.count, 0u)) two = meshUnit(influences.unit);
  influences.weights.xy = uintBitsToFloat(two.xz);
  influences.joints.xy = two.yw;
  if (LOADED_INFLUENCES > 2u) {
    two = uvec4(0u);
    if (hasSlot(influences.count, 2u)) two = meshUnit(influences.unit + 1u);
    influences.weights.zw = uintBitsToFloat(two.xz);
    influences.joints.zw = two.yw;
  }
  influences.joints *= JOINT_UNITS;
  return influences;
}

InfluenceRecord loadInfluence(Influences influences, uint slot) {
  uvec4 two = meshUnit(influences.unit + slot / 2u);
  return slot % 2u == 0u ? InfluenceRecord(uintBitsToFloat(two.x), two.y * JOINT_UNITS)
                         : InfluenceRecord(uintBitsToFloat(two.z), two.w * JOINT_UNITS);
}

struct InfluencePair {
  InfluenceRecord first;
  InfluenceRecord second;
};

// The influences `slot`, which is even, and `slot` + 1: they are in one unit.
InfluencePair loadInfluences(Influences influences, uint slot) {
  uvec4 two = meshUnit(influences.unit + slot / 2u);
  return InfluencePair(InfluenceRecord(uintBitsToFloat(two.x), two.y * JOINT_UNITS),
                       InfluenceRecord(uintBitsToFloat(two.z), two.w * JOINT_UNITS));
}

// Whether a vertex has more than the loaded influences. The constant false if INFLUENCES is not 0.
bool hasFurther(Influences influences) { return INFLUENCES == 0u && influences.count > LOADED_INFLUENCES; }

// Executes ADD(weight, joint), a macro, for all influences but the first, in their order.
#define FOR_FURTHER_INFLUENCES(influences, ADD)                       \
  if (hasFurther(influences)) {                                       \
    uint slot = LOADED_INFLUENCES;                                    \
    do {                                                              \
      InfluencePair two = loadInfluences(influences, slot);           \
      ADD(two.first.weight, two.first.joint);                         \
      if (++slot >= influences.count) break;                          \
      ADD(two.second.weight, two.second.joint);                       \
    } while (++slot < influences.count);                              \
  }
#ifdef TEXELS
#define FOR_OTHER_INFLUENCES(influences, ADD)                         \
  for (uint slot = 1u; slot < LOADED_INFLUENCES; ++slot) {            \
    if (!hasSlot(influences.count, slot)) break;                      \
    ADD(influences.weights[slot], influences.joints[slot]);           \
  }                                                                   \
  FOR_FURTHER_INFLUENCES(influences, ADD)
#else
// Not a loop over the loaded ones, which would move the multiplication of joints into the loop over instances: the compilers of GPUs
// take it out of the selection by index. lavapipe (25.0.7) is a fifth faster with that loop for linear blending.
#define FOR_OTHER_INFLUENCES(influences, ADD)                         \
  if (LOADED_INFLUENCES > 1u && hasSlot(influences.count, 1u)) {      \
    ADD(influences.weights.y, influences.joints.y);                   \
    if (LOADED_INFLUENCES > 2u && hasSlot(influences.count, 2u)) {    \
      ADD(influences.weights.z, influences.joints.z);                 \
      if (LOADED_INFLUENCES > 3u && hasSlot(influences.count, 3u)) {  \
        ADD(influences.weights.w, influences.joints.w);               \
        FOR_FURTHER_INFLUENCES(influences, ADD)                       \
      }                                                               \
    }                                                                 \
  }
#endif

// The weight of any influence, for loops that do not distinguish loaded influences from others.
float influenceWeight(Influences influences, uint slot) {
  return INFLUENCES != 0u ? influences.weights[slot] : loadInfluence(influences, slot).weight;
}

uint influenceJoint(Influences influences, uint slot) {
  return INFLUENCES != 0u ? influences.joints[slot] : loadInfluence(influences, slot).joint;
}

// Data of a vertex that only some methods use.
struct MethodInputs {
  vec3 center;
  float methodWeight;  // dual-quaternion weight (blended) or bulge strength (bulge_controlled), 0 to 1
};

// Reads a value per vertex from `section`, or returns `value` if the mesh has no such section.
float meshShare(uint mesh, uint vertex, uint section, float value) {
  return section == 0u ? value : uintBitsToFloat(meshWord(mesh + section + vertex));
}

MethodInputs methodInputsOf(uint mesh, uint vertex) {
  MethodInputs inputs = MethodInputs(vec3(0.0), 0.0);
  MeshHeader header = loadMeshHeader(mesh);
  if (METHOD == METHOD_CENTER_OF_ROTATION || METHOD == METHOD_BULGE_CONTROLLED) {
    inputs.center = uintBitsToFloat(meshUnit((mesh + header.centers) / 4u + vertex).xyz);
  }
  if (METHOD == METHOD_BULGE_CONTROLLED) {
    inputs.methodWeight = meshShare(mesh, vertex, header.bulgeStrengths, header.bulgeStrength);
  }
  if (METHOD == METHOD_BLENDED) {
    inputs.methodWeight = meshShare(mesh, vertex, header.dualQuaternionWeights, header.dualQuaternionWeight);
  }
  return inputs;
}

#endif
