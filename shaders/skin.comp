#version 450
#extension GL_GOOGLE_include_directive : require

// Skins vertices. A workgroup processes consecutive vertices of one mesh. Each invocation skins a vertex (with TEXELS, one or more)
// for up to INSTANCES instances of that mesh, so that a vertex is read once for all of them. Macros select the features of a module
// (CMakeLists.txt lists the modules). With all features in one module, drivers would take several times as long to create each
// pipeline. The macros:
//   EXTRAS          previous positions and results; separate modules, since layers and drivers treat everything that a module
//                   declares as used, whatever its specialization constants are
//   BULGE           the methods that reduce the bulge (blended, center of rotation, bulge-controlled), instead of linear and dual
//                   quaternions
//   COMPARISON      the methods that are only for comparison
//   TEXELS          for CPU devices: tables, meshes and palettes are read as uniform texel buffers, and one store writes an
//                   attribute, or a whole vertex (needs scalar block layout and 64-bit integers)
//   STAGED          vertices are stored 16 or 8 bytes at a time where they begin at a multiple of that; others are gathered in shared
//                   memory, from which consecutive invocations store 16 bytes each
//   ONE_OUTPUT      all attributes go to one buffer, previous positions too; no results (4 storage buffers in all)

#ifdef TEXELS
#extension GL_EXT_samplerless_texture_functions : require
#extension GL_EXT_shader_explicit_arithmetic_types_int64 : require
#extension GL_EXT_scalar_block_layout : require
#endif

#include "abi.h"

#ifdef COMPARISON
layout(constant_id = CONSTANT_METHOD) const uint METHOD = METHOD_DUAL_QUATERNION_ITERATIVE;
#elif defined(BULGE)
layout(constant_id = CONSTANT_METHOD) const uint METHOD = METHOD_BULGE_CONTROLLED;
#else
layout(constant_id = CONSTANT_METHOD) const uint METHOD = METHOD_DUAL_QUATERNION;
#endif
layout(constant_id = CONSTANT_INFLUENCES) const uint INFLUENCES = 0u;
layout(constant_id = CONSTANT_INSTANCES) const uint INSTANCES = 1u;
layout(constant_id = CONSTANT_POSITION_FORMAT) const uint POSITION_FORMAT = FORMAT_FLOAT32X3;
layout(constant_id = CONSTANT_NORMAL_FORMAT) const uint NORMAL_FORMAT = FORMAT_NONE;
layout(constant_id = CONSTANT_TANGENT_FORMAT) const uint TANGENT_FORMAT = FORMAT_NONE;
layout(constant_id = CONSTANT_WIDE) const uint WIDE = 0u;
layout(constant_id = CONSTANT_MORPHS) const bool MORPHS = false;
layout(constant_id = CONSTANT_SCALES) const bool SCALES = true;
layout(constant_id = CONSTANT_FULL) const bool FULL = false;
#if defined(TEXELS) || defined(STAGED)
layout(constant_id = CONSTANT_RECORD) const uint RECORD = RECORD_APART;
#else
const uint RECORD = RECORD_APART;
#endif
#if defined(EXTRAS) || defined(ONE_OUTPUT)
layout(constant_id = CONSTANT_MOTION) const bool MOTION = false;
#define HAS_MOTION
#endif
#ifdef EXTRAS
layout(constant_id = CONSTANT_BOUNDS) const bool BOUNDS = false;
#else
const bool BOUNDS = false;
#endif

const bool WIDE_POSITIONS = (WIDE & 1u) != 0u;
const bool WIDE_NORMALS = (WIDE & 2u) != 0u;
const bool WIDE_TANGENTS = (WIDE & 4u) != 0u;
const bool WIDE_PREVIOUS = (WIDE & 8u) != 0u;
const bool NORMALS = NORMAL_FORMAT != FORMAT_NONE;
const bool TANGENTS = TANGENT_FORMAT != FORMAT_NONE;

#include "exact.glsl"
#include "quaternion.glsl"
#include "tables.glsl"
#include "vertex.glsl"
#include "mesh_access.glsl"
#include "palette_access.glsl"
#include "morph.glsl"
#include "blend.glsl"
#include "encode.glsl"

layout(local_size_x_id = CONSTANT_WORKGROUP_SIZE) in;

#include "output_access.glsl"
#ifdef EXTRAS
#include "results.glsl"
#else
void addToBounds(uint result, vec3 position) {}
void countClamped(uint result) {}
#endif

layout(push_constant) uniform Push { SkinPush push; };

// Vertices that an invocation skins.
#ifdef TEXELS
#define VERTICES push.verticesPerInvocation
#else
#define VERTICES 1u
#endif

// Finds the group of a workgroup: the first whose end is after it.
uint findGroup(uint number) {
  uint low = 0u;
  uint high = push.groupCount - 1u;
  while (low < high) {
    uint middle = (low + high) / 2u;
    if (loadGroup(push.groups + middle * GROUP_WORDS).workgroupEnd <= number) {
      low = middle + 1u;
    } else {
      high = middle;
    }
  }
  return low;
}

// `first` receives PositionRecord::influences.
Vertex bindVertex(Sections sections, uint vertex, out uint first) {
  Vertex bind = Vertex(vec3(0.0), vec3(0.0), vec4(0.0), vec3(0.0), vec3(0.0));
  PositionRecord position = loadPosition(sections.positions + vertex);
  first = position.influences;
  bind.position = vec3(position.x, position.y, position.z);
  if (NORMALS) bind.normal = uintBitsToFloat(meshUnit(sections.normals + vertex).xyz);
  if (TANGENTS) bind.tangent = uintBitsToFloat(meshUnit(sections.tangents + vertex));
  return bind;
}

// The box that snorm16 positions are relative to.
struct BoxScale {
  vec3 center;
  vec3 inverse;  // 1 / half of the size
};

BoxScale boxOf(InstanceRecord instance) {
  if (!isSnormPosition(POSITION_FORMAT)) return BoxScale(vec3(0.0), vec3(0.0));
  ExtensionRecord r = loadExtension(instance.extension);
  return BoxScale(vec3(r.centerX, r.centerY, r.centerZ), vec3(r.inverseX, r.inverseY, r.inverseZ));
}

// An instance, and the byte offsets of this invocation's vertex (with STAGED: of the workgroup's first one): positions, normals,
// tangents, previous positions.
struct Instance {
  InstanceRecord record;
  uvec4 places;
  uint recordPlace;  // of storeRecord
  BoxScale box;
};

uvec4 placesOf(InstanceRecord r) { return uvec4(r.positions, r.normals, r.tangents, r.previousPositions); }

Instance readInstance(uint word, uvec4 offsets) {
  InstanceRecord record = loadInstance(word);
  uvec4 places = placesOf(record) + offsets;
  return Instance(record, places, recordPlace(places.x), boxOf(record));
}

// Encodes a position in its format.
uvec4 encodePosition(vec3 position, Instance instance) {
  vec4 v = vec4(position, 1.0);
  if (isSnormPosition(POSITION_FORMAT)) {
    precise vec3 relative = (position - instance.box.center) * instance.box.inverse;
    v.xyz = relative;
    // A vertex on a face of the engine's box may be outside by a rounding error.
    if (any(greaterThan(abs(relative), vec3(1.00001)))) {
      countClamped(loadExtension(instance.record.extension).result);
    }
  }
  return encodeComponents(POSITION_FORMAT, v);
}

// What an invocation reads once for all its instances.
struct Work {
  uint mesh;
  uint vertex;
  Vertex bind;
  Influences influences;
  MethodInputs inputs;
};

Work workOf(uint mesh, Sections sections, uint vertex) {
  Work work;
  work.mesh = mesh;
  work.vertex = vertex;
  uint firstInfluence;
  work.bind = bindVertex(sections, vertex, firstInfluence);
  if (!MORPHS) makeDirectionsUnit(work.bind);
  work.inputs = methodInputsOf(mesh, vertex);
  work.influences = influencesOf(sections, vertex, firstInfluence);
  return work;
}

#ifdef HAS_MOTION
// The position in the output, before this frame overwrites it.
uvec4 keptPosition(Instance instance) {
#ifdef TEXELS
  if (RECORD == 24u && POSITION_FORMAT == FORMAT_FLOAT32X3) return loadRecordPosition(instance.recordPlace);
#endif
  return loadPositions(instance.places.x, formatBytes(POSITION_FORMAT), WIDE_POSITIONS);
}
#endif

void skinInstance(Instance instance, Work work, bool scales) {
#ifdef HAS_MOTION
  if (MOTION && (instance.record.joints & INSTANCE_SETTLES) != 0u) {
    storePrevious(instance.places.w, keptPosition(instance), formatBytes(POSITION_FORMAT), WIDE_PREVIOUS);
    return;
  }
#endif

  Vertex morphed = work.bind;
  if (MORPHS) {
    ExtensionRecord extension = loadExtension(instance.record.extension);
    morphVertex(morphed, work.mesh, work.vertex, extension.morphs, extension.morphCount);
    makeDirectionsUnit(morphed);
  }
  Pose pose = Pose(instance.record.palette, instance.record.joints & INSTANCE_JOINTS, scales);
  Vertex skinned = skinVertex(morphed, work.influences, work.inputs, pose);
  if (BOUNDS) addToBounds(loadExtension(instance.record.extension).result, skinned.position);
  uvec4 position = encodePosition(skinned.position, instance);
#ifdef HAS_MOTION
  // The kept position must be read before the new one overwrites it.
  if (MOTION) {
    bool restarts = (instance.record.joints & INSTANCE_RESTARTS) != 0u;
    storePrevious(instance.places.w, restarts ? position : keptPosition(instance), formatBytes(POSITION_FORMAT), WIDE_PREVIOUS);
  }
#endif
  uvec4 normal = NORMALS ? encodeNormal(NORMAL_FORMAT, skinned.normal) : uvec4(0u);
  uvec4 tangent = TANGENTS ? encodeTangent(TANGENT_FORMAT, skinned.tangent) : uvec4(0u);
  joinAttributes(position, normal, tangent);
  uint positions = formatBytes(POSITION_FORMAT);
  uint normals = formatBytes(NORMAL_FORMAT);
  if (RECORD > RECORD_IN_PAIRS) {
    storeRecord(instance.recordPlace, position, normal, tangent);
  } else {
    if (RECORD == RECORD_IN_PAIRS) {
      storePositionAndNormal(instance.places.x, position.xyz, normal.xyz);
    } else {
      storePositions(instance.places.x, position, positions, WIDE_POSITIONS);
      if (NORMALS) storeNormals(instance.places.y, normal, bytesFromWord(positions, NORMAL_FORMAT), WIDE_NORMALS);
    }
    if (TANGENTS) storeTangents(instance.places.z, tangent, bytesFromWord(positions + normals, TANGENT_FORMAT), WIDE_TANGENTS);
  }
}

// The instances that an invocation skins: the word of the first record, and their number.
struct Share {
  uint records;
  uint count;
};

Share shareOf(GroupRecord group, uint number) {
  uint size = group.instancesEach & ~EVENLY_SPACED;
  uint first = min(number * size, group.instanceCount);
  return Share(push.instances + (group.firstInstance + first) * INSTANCE_WORDS, min(size, group.instanceCount - first));
}

#ifdef TEXELS
#include "cpu_device/skin_instances.glsl"
#else
void skinInstances(GroupRecord group, Share share, uint run, uint vertex) {
  Work work = workOf(group.mesh, sectionsOf(group.mesh), vertex);
  uvec4 offsets = run * uvec4(group.positionStride, group.normalStride, group.tangentStride, group.previousStride);
  for (uint i = 0u; i < share.count; ++i) {
    Instance instance = readInstance(share.records + i * INSTANCE_WORDS, offsets);
    skinInstance(instance, work, paletteScales(instance.record.palette));
  }
}
#endif

void main() {
  uint number = workgroupNumber();
  if (number >= push.workgroupCount) return;
  uint index = findGroup(number);
  uint word = push.groups + index * GROUP_WORDS;
  GroupRecord group = loadGroup(word);
  if (index != 0u) number -= loadGroup(word - GROUP_WORDS).workgroupEnd;
  // Consecutive workgroups process all vertices for some instances, then all vertices for the next instances, so that palettes stay
  // in the cache.
  uint run = (number % group.vertexGroups) * gl_WorkGroupSize.x * VERTICES;
#ifdef STAGED
  // All invocations reach each barrier. Those without a vertex skin the last vertex again; their staged records are never stored.
  uint first = group.firstVertex + run;
  stagedRecords = min(group.vertexEnd - first, gl_WorkGroupSize.x);
  uint vertex = min(first + gl_LocalInvocationID.x, group.vertexEnd - 1u);
#else
  run += gl_LocalInvocationID.x;
  uint vertex = group.firstVertex + run;
  if (vertex >= group.vertexEnd) return;
#endif
  Share share = shareOf(group, number / group.vertexGroups);
  if (share.count != 0u) skinInstances(group, share, run, vertex);
}
