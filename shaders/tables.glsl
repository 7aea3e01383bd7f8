// Loads the records of the tables (abi.h).
#ifndef DERMIS_TABLES_GLSL
#define DERMIS_TABLES_GLSL

#include "abi.h"

// TABLES_ARE_WRITTEN: the kernel also stores records. Not with TEXELS.
#ifdef TABLES_ARE_WRITTEN
#define TABLE_ACCESS
#else
#define TABLE_ACCESS readonly
#endif
layout(set = 0, binding = BINDING_TABLES, std430) TABLE_ACCESS buffer Tables { uint tables[]; };
#ifdef TEXELS
#include "cpu_device/texels.glsl"
#else
layout(set = 0, binding = BINDING_TABLES, std430) TABLE_ACCESS buffer TableUnits { uvec4 tableUnits[]; };

// Four words of a record.
uvec4 tableUnit(uint word) { return tableUnits[word / 4u]; }
#endif

// A record of four words, and one of eight.
#define LOAD_FOUR(load, Record)                            \
  Record load(uint word) {                                 \
    uvec4 a = tableUnit(word);                             \
    return Record(a.x, a.y, a.z, a.w);                     \
  }
#define LOAD_EIGHT(load, Record)                           \
  Record load(uint word) {                                 \
    uvec4 a = tableUnit(word);                             \
    uvec4 b = tableUnit(word + 4u);                        \
    return Record(a.x, a.y, a.z, a.w, b.x, b.y, b.z, b.w); \
  }
LOAD_FOUR(loadPalette, PaletteRecord)
LOAD_FOUR(loadDriven, DrivenRecord)
LOAD_EIGHT(loadRig, RigRecord)

GroupRecord loadGroup(uint word) {
  uvec4 a = tableUnit(word);
  uvec4 b = tableUnit(word + 4u);
  uvec4 c = tableUnit(word + 8u);
  return GroupRecord(a.x, a.y, a.z, a.w, b.x, b.y, b.z, b.w, c.x, c.y, c.z, c.w);
}

LOAD_FOUR(loadBank, BankRecord)
LOAD_FOUR(loadBand, BandRecord)
LOAD_EIGHT(loadInstance, InstanceRecord)

ExtensionRecord loadExtension(uint word) {
  uvec4 a = tableUnit(word);
  vec4 b = uintBitsToFloat(tableUnit(word + 4u));  // snorm16 positions need this one and the next
  uvec4 c = tableUnit(word + 8u);
  return ExtensionRecord(a.x, a.y, a.z, a.w, b.x, b.y, b.z, b.w, uintBitsToFloat(c.x), uintBitsToFloat(c.y), c.z, c.w);
}

LOAD_FOUR(loadCandidate, CandidateRecord)
LOAD_FOUR(loadCulledDispatch, CulledDispatchRecord)

#ifdef TABLES_ARE_WRITTEN
void storeGroup(uint word, GroupRecord r) {
  tableUnits[word / 4u] = uvec4(r.workgroupEnd, r.mesh, r.firstVertex, r.vertexEnd);
  tableUnits[word / 4u + 1u] = uvec4(r.vertexGroups, r.firstInstance, r.instanceCount, r.positionStride);
  tableUnits[word / 4u + 2u] = uvec4(r.normalStride, r.tangentStride, r.previousStride, r.instancesEach);
}

void storeInstance(uint word, InstanceRecord r) {
  tableUnits[word / 4u] = uvec4(r.palette, r.positions, r.normals, r.tangents);
  tableUnits[word / 4u + 1u] = uvec4(r.previousPositions, r.joints, r.extension, r.reserved);
}

void storeIndirect(uint word, IndirectRecord r) { tableUnits[word / 4u] = uvec4(r.x, r.y, r.z, r.reserved); }
#endif

// Without the layers.
MorphListRecord loadMorphList(uint word) {
  uvec4 a = tableUnit(word);
  uvec4 b = tableUnit(word + 4u);
  uvec4 c = tableUnit(word + MORPH_LIST_DRIVEN);
  return MorphListRecord(a.x, a.y, a.z, a.w, b.x, b.y, b.z, b.w, 0.0, 0u, 0.0, 0u, 0.0, 0u, 0.0, 0u, c.x, c.y, c.z, c.w);
}

ActiveMorph loadActiveMorph(uint word) { return ActiveMorph(tables[word], uintBitsToFloat(tables[word + 1u])); }

// The number of the workgroup. Dispatches with many workgroups use x and y.
uint workgroupNumber() { return gl_WorkGroupID.y * gl_NumWorkGroups.x + gl_WorkGroupID.x; }

#endif
