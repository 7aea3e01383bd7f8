// What C++ and GLSL share: binding numbers, specialization constants, and the records in buffers
// and push constants. Both include this file.
#ifndef DERMIS_ABI_H
#define DERMIS_ABI_H

#ifdef __cplusplus
#include <cstddef>
#include <cstdint>
#include <cstring>
#include <span>
namespace dermis::abi {
using uint = std::uint32_t;
#define DERMIS_CONSTANT inline constexpr uint
#else
#define DERMIS_CONSTANT const uint
#endif

// Storage buffers of descriptor set 0. On a device with fewer than BINDING_COUNT storage buffers
// per stage, kernels have the first MIN_BINDING_COUNT only: all attributes go to
// BINDING_POSITIONS, and there are no results.
DERMIS_CONSTANT BINDING_TABLES = 0u;
DERMIS_CONSTANT BINDING_MESHES = 1u;  // meshes and clips; palette kernel: the joint matrices
// Palettes, written by the palette kernel and read by the skin kernel. For linear blending in a
// batch, the joint matrices are bound here instead.
DERMIS_CONSTANT BINDING_PALETTES = 2u;
DERMIS_CONSTANT BINDING_WEIGHTS = 2u;  // of the kernel that lists morph targets
// Palette, rig and morph-list kernels: driven joints, and behind those of a pose its weights.
DERMIS_CONSTANT BINDING_DRIVEN = 3u;
DERMIS_CONSTANT BINDING_JOINTS = 2u;     // rig kernel: the joint matrices of poses
DERMIS_CONSTANT BINDING_POSITIONS = 3u;  // compose kernel: the joint matrices
DERMIS_CONSTANT MIN_BINDING_COUNT = 4u;
DERMIS_CONSTANT BINDING_NORMALS = 4u;
DERMIS_CONSTANT BINDING_TANGENTS = 5u;
DERMIS_CONSTANT BINDING_PREVIOUS = 6u;
DERMIS_CONSTANT BINDING_RESULTS = 7u;
DERMIS_CONSTANT BINDING_COUNT = 8u;

// Uniform texel buffers of variants that read through them. They are views of the ranges that are
// bound as the storage buffers of tables, meshes and palettes.
DERMIS_CONSTANT BINDING_TABLE_TEXELS = 8u;
DERMIS_CONSTANT BINDING_MESH_TEXELS = 9u;
DERMIS_CONSTANT BINDING_PALETTE_TEXELS = 10u;
DERMIS_CONSTANT TEXEL_BINDING_COUNT = 3u;
DERMIS_CONSTANT TEXEL_BYTES = 16u;

// Specialization constants.
DERMIS_CONSTANT CONSTANT_WORKGROUP_SIZE = 0u;
DERMIS_CONSTANT CONSTANT_METHOD = 1u;
DERMIS_CONSTANT CONSTANT_INFLUENCES = 2u;  // 1, 2, 4, or 0 for any number
DERMIS_CONSTANT CONSTANT_INSTANCES = 3u;   // maximum instances per invocation
DERMIS_CONSTANT CONSTANT_POSITION_FORMAT = 4u;
DERMIS_CONSTANT CONSTANT_NORMAL_FORMAT = 5u;
DERMIS_CONSTANT CONSTANT_TANGENT_FORMAT = 6u;
DERMIS_CONSTANT CONSTANT_WIDE = 7u;  // a bit for each attribute: whether one store writes all of it
DERMIS_CONSTANT CONSTANT_MOTION = 8u;
DERMIS_CONSTANT CONSTANT_MORPHS = 9u;   // 0 or 1
DERMIS_CONSTANT CONSTANT_BOUNDS = 10u;  // 0 or 1
DERMIS_CONSTANT CONSTANT_SCALES = 11u;  // 0 or 1: whether palettes may be two-phase
// 0 or 1: whether every vertex has exactly as many influences as CONSTANT_INFLUENCES says.
DERMIS_CONSTANT CONSTANT_FULL = 12u;
DERMIS_CONSTANT CONSTANT_RECORD = 13u;  // bytes of all attributes, stored together; or RECORD_*
DERMIS_CONSTANT CONSTANT_RIGID = 14u;   // 0 or 1: whether joints are taken for rigid
DERMIS_CONSTANT CONSTANT_RIGGED = 15u;  // 0 or 1: whether poses have driven joints
DERMIS_CONSTANT CONSTANT_COUNT = 16u;
DERMIS_CONSTANT RECORD_APART = 0u;     // each attribute is stored separately
DERMIS_CONSTANT RECORD_IN_PAIRS = 1u;  // float32x3 positions and normals, 8 bytes at a time

// Values of Method.
DERMIS_CONSTANT METHOD_LINEAR = 0u;
DERMIS_CONSTANT METHOD_DUAL_QUATERNION = 1u;
DERMIS_CONSTANT METHOD_DUAL_QUATERNION_ITERATIVE = 2u;
DERMIS_CONSTANT METHOD_LOG_MATRIX = 3u;
DERMIS_CONSTANT METHOD_SPHERICAL_BLEND = 4u;
DERMIS_CONSTANT METHOD_QUATERNION_TRANSLATION = 5u;
DERMIS_CONSTANT METHOD_BLENDED = 6u;
DERMIS_CONSTANT METHOD_CENTER_OF_ROTATION = 7u;
DERMIS_CONSTANT METHOD_BULGE_CONTROLLED = 8u;

// Values of VertexFormat.
DERMIS_CONSTANT FORMAT_NONE = 0u;
DERMIS_CONSTANT FORMAT_FLOAT32X3 = 1u;
DERMIS_CONSTANT FORMAT_FLOAT32X4 = 2u;
DERMIS_CONSTANT FORMAT_FLOAT16X3 = 3u;
DERMIS_CONSTANT FORMAT_FLOAT16X4 = 4u;
DERMIS_CONSTANT FORMAT_SNORM16X3 = 5u;
DERMIS_CONSTANT FORMAT_SNORM16X4 = 6u;
DERMIS_CONSTANT FORMAT_SNORM8X3 = 7u;
DERMIS_CONSTANT FORMAT_SNORM8X4 = 8u;
DERMIS_CONSTANT FORMAT_OCTAHEDRAL16X2 = 9u;
DERMIS_CONSTANT FORMAT_OCTAHEDRAL8X2 = 10u;

// ---- Packed mesh: a header, then sections. Offsets count words from the beginning of the mesh.
// Four words at a multiple of 4 are a unit: kernels read them at once.
DERMIS_CONSTANT MESH_MAGIC = 0x4d4b5344u;  // "DSKM"
DERMIS_CONSTANT MESH_VERSION = 6u;
struct MeshHeader {
  uint magic;
  uint version;
  // Of all words after it: hash = rotl((hash ^ word) * 16777619, 15), beginning with 2166136261.
  uint checksum;
  uint wordCount;  // of the packed mesh
  uint vertexCount;
  uint requiredJoints;  // the largest joint index + 1
  uint maxInfluences;   // maximum influences of a vertex
  uint morphCount;
  // Word offsets of sections. The first four are one unit.
  uint positions;   // PositionRecord: one for each vertex, and one more
  uint normals;     // 4 words for each vertex: 3 floats and a 0. If the offset is 0, there are none
  uint tangents;    // the same, with the handedness as the fourth float
  uint influences;  // InfluenceRecord
  uint centers;     // centers of rotation: 4 words for each vertex, in the layout of `normals`
  uint morphs;      // MorphRecord
  // A float for each vertex. If the offset is 0, all vertices have dualQuaternionWeight.
  uint dualQuaternionWeights;
  float dualQuaternionWeight;
  // A float for each vertex. If the offset is 0, all vertices have bulgeStrength.
  uint bulgeStrengths;
  float bulgeStrength;
  uint minInfluences;  // minimum influences of a vertex
  uint reserved;
};
DERMIS_CONSTANT MESH_HEADER_WORDS = 20u;

// The influences of a vertex end where those of the next vertex begin. The record after the last
// vertex has the end of its influences.
struct PositionRecord {
  float x;
  float y;
  float z;
  // 2 × i, where i is the index of its first unit in the section of influences. Plus 1 if the last
  // influence is padding.
  uint influences;
};
DERMIS_CONSTANT VERTEX_WORDS = 4u;

// The influences of a vertex are consecutive, two in a unit. The first is the pivot of the vertex.
// A vertex without influences stays in bind pose.
struct InfluenceRecord {
  float weight;  // the weights of a vertex sum to exactly 1; padding has weight 0
  uint joint;
};
DERMIS_CONSTANT INFLUENCE_WORDS = 2u;

// A morph target. The vertices of the mesh form blocks of MORPH_BLOCK_VERTICES. There is a record
// for each block from the first that has a displaced vertex to the last. A displacement has 3
// floats for each attribute of the target, in the order of MORPH_HAS_*. MorphRecord and
// MorphBlockRecord begin at multiples of 4 words.
struct MorphRecord {
  uint firstBlock;
  uint blockCount;
  uint blocks;      // word offset of the block records
  uint attributes;  // MORPH_HAS_*
};
DERMIS_CONSTANT MORPH_WORDS = 4u;
DERMIS_CONSTANT MORPH_HAS_POSITIONS = 1u;
DERMIS_CONSTANT MORPH_HAS_NORMALS = 2u;
DERMIS_CONSTANT MORPH_HAS_TANGENTS = 4u;
DERMIS_CONSTANT MORPH_BLOCK_VERTICES = 64u;
struct MorphBlockRecord {
  uint maskLow;  // one bit for each vertex: whether it is displaced
  uint maskHigh;
  uint displacements;  // word offset of the displacement of the first displaced vertex
  uint reserved;
};
DERMIS_CONSTANT MORPH_BLOCK_WORDS = 4u;

// ---- Clips: the bank that packClips makes (engine/src/core/clips/bank.h has its records), then
// steps (StepRecord). Of a bank, kernels know:
DERMIS_CONSTANT CLIPS_OFFSETS = 8u;  // words: the offsets of nodes, skins, clips and masks
DERMIS_CONSTANT CLIP_NODE_WORDS = 16u;
DERMIS_CONSTANT CLIP_WORDS = 8u;
DERMIS_CONSTANT CLIP_CLASS_WORDS = 8u;
DERMIS_CONSTANT TRACK_COLUMN_BITS = 22u;

// A product that the compose kernel computes: of `matrix`, which is multiplied from the left by
// transforms of the figure, one after the other: that of a node and those of what is above it.
DERMIS_CONSTANT MAX_CHAIN = 9u;
struct StepRecord {
  uint matrix;  // word offset in the bank; 0: the identity
  uint place;   // the joint of the figure's poses, or if `matrix` is 0 a global transform
  uint chainLength;
  uint chain[MAX_CHAIN];
};
DERMIS_CONSTANT STEP_WORDS = 12u;

// ---- Rigs: engine/src/core/rig/blob.h has the records. Of a rig, kernels know:
DERMIS_CONSTANT RIG_COUNTS = 4u;   // words: written and driven joints, given and driven weights
DERMIS_CONSTANT RIG_DRIVERS = 8u;  // words: the offset of the drivers, and their number
DERMIS_CONSTANT RIG_DRIVER_WORDS = 4u;
DERMIS_CONSTANT RIG_TWIST = 0u;  // kinds of drivers
DERMIS_CONSTANT RIG_CORRECTIVE = 1u;
DERMIS_CONSTANT RIG_CHAIN = 2u;
DERMIS_CONSTANT RIG_LINEAR = 3u;
DERMIS_CONSTANT RIG_SENSOR_WORDS = 28u;
DERMIS_CONSTANT RIG_CORRECTIVE_WORDS = 8u;
DERMIS_CONSTANT RIG_OFFSET_JOINT_WORDS = 28u;
DERMIS_CONSTANT RIG_OFFSET_WORDS = 12u;
DERMIS_CONSTANT RIG_NODE_WORDS = 12u;
DERMIS_CONSTANT RIG_CHAIN_JOINT_WORDS = 16u;
DERMIS_CONSTANT RIG_LINEAR_WORDS = 4u;
DERMIS_CONSTANT RIG_TERM_WORDS = 16u;
DERMIS_CONSTANT RIG_NO_JOINT = 0xffffffffu;

// ---- Records. A struct of scalars has the same layout in C++ and in std430. NAME_WORDS is the
// size of a record in the tables or in a packed mesh. The tables are one buffer of words. Records
// in it begin at multiples of four words, except ActiveMorph.

// A pose that the palette kernel converts. Offsets into the poses and palettes buffers count units
// of 16 bytes.
struct PaletteRecord {
  uint matrices;  // the first joint matrix; each has 3 units
  // The palette: a status, then the joints, then the scale and shear parts of the joints if the
  // pose may scale. For linear blending in a scene: only the joint matrices.
  uint place;
  uint jointCount;
  uint needed;  // 0: nothing is converted, unless the visibility kernel sets it
};
DERMIS_CONSTANT PALETTE_WORDS = 4u;
DERMIS_CONSTANT PALETTE_NEEDED = 3u;  // the word of `needed`
// Of a pose with a rig, for each PaletteRecord.
struct DrivenRecord {
  uint driven;         // unit of the first driven joint in its buffer
  uint writtenJoints;  // the number of joints before it
  uint reserved0;
  uint reserved1;
};
DERMIS_CONSTANT DRIVEN_WORDS = 4u;
DERMIS_CONSTANT UNITS_OF_DUAL_QUATERNION = 2u;
DERMIS_CONSTANT UNITS_OF_LOGARITHM = 3u;  // the rows of a 3×4 matrix
DERMIS_CONSTANT UNITS_OF_MATRIX = 3u;
DERMIS_CONSTANT UNITS_OF_SCALE_SHEAR = 2u;

// A bank that figures play, and for each band of its nodes a BandRecord. Offsets count words of the
// mesh buffer.
struct BankRecord {
  uint clips;  // the bank
  uint nodeCount;
  uint reserved0;
  uint reserved1;
};
DERMIS_CONSTANT BANK_WORDS = 4u;
struct BandRecord {
  uint steps;
  uint stepCount;
  uint reserved0;
  uint reserved1;
};
DERMIS_CONSTANT BAND_WORDS = 4u;

// A figure whose poses are sampled. Layers of additive clips come after the others.
struct FigureRecord {
  uint
      matrices;  // unit of the palettes buffer: the local transforms of its nodes, then global ones
  uint poses;    // unit of the poses buffer: the joints of its first pose, then those of the others
  uint layerCount;  // and FIGURE_NEEDED; without it, nothing is sampled
  uint bank;        // word offset of its BankRecord
  float time0;      // seconds inside the clip
  uint layer0;      // clip, 10 bits; mask, 5 bits; LAYER_ADDITIVE; weight as float16
  float time1;
  uint layer1;
  float time2;
  uint layer2;
  float time3;
  uint layer3;
};
DERMIS_CONSTANT FIGURE_WORDS = 12u;
DERMIS_CONSTANT FIGURE_LAYER_COUNT = 2u;      // the word of `layerCount`
DERMIS_CONSTANT FIGURE_NEEDED = 0x80000000u;  // also set by the visibility kernel
DERMIS_CONSTANT LAYER_ADDITIVE = 0x8000u;
DERMIS_CONSTANT UNITS_OF_TRANSFORM = 3u;  // the rows of a 3×4 matrix

// A pose whose driven joints and weights are computed. Offsets into the buffers of joints count
// units of 16 bytes.
struct RigRecord {
  uint joints;  // the first joint matrix; behind those of the pose, its given weights
  uint driven;  // the first driven joint; behind them, all weights
  // Word offset of the FigureRecord that samples the pose and has FIGURE_NEEDED, or RIG_NO_FIGURE.
  uint figure;
  uint clips;  // word of the mesh buffer: the bank that the given weights are sampled from
  // As in a MorphListRecord.
  uint weights;
  uint track;
  uint masks;
  uint reserved;
};
DERMIS_CONSTANT RIG_WORDS = 8u;
DERMIS_CONSTANT RIG_NO_FIGURE = 0xffffffffu;

// The unit at the beginning of a palette. The same as PoseStatus.
struct StatusRecord {
  uint twoPhase;
  uint nonRigidJoints;
  uint undeclaredScale;
  uint nonFiniteJoints;
};

// A group: instances of one mesh with the same output layout, in one dispatch.
struct GroupRecord {
  uint workgroupEnd;  // workgroups of this dispatch up to and including this group
  uint mesh;          // word offset of the packed mesh in the mesh buffer
  uint firstVertex;
  uint vertexEnd;
  uint vertexGroups;  // workgroups needed to process every vertex of the group once
  uint firstInstance;
  uint instanceCount;
  uint positionStride;  // strides are in bytes
  uint normalStride;
  uint tangentStride;
  uint previousStride;
  // Instances that an invocation skins; the last ones may skin fewer. Perhaps with EVENLY_SPACED.
  uint instancesEach;
};
DERMIS_CONSTANT GROUP_WORDS = 12u;

// In GroupRecord::instancesEach: each word of the instance records changes by a constant amount
// from one record to the next. With snorm16 positions, all boxes are then also equal.
DERMIS_CONSTANT EVENLY_SPACED = 0x80000000u;

// An instance. Output offsets are those of the first vertex of the group, in bytes from the
// beginning of the range that the dispatch writes.
struct InstanceRecord {
  uint palette;  // unit of the palette's status; for linear, of the first joint matrix
  uint positions;
  uint normals;
  uint tangents;
  uint previousPositions;
  uint joints;     // number of joints in the palette, plus INSTANCE_* flags
  uint extension;  // word offset of its ExtensionRecord in the tables; 0 if it has none
  uint reserved;
};
DERMIS_CONSTANT INSTANCE_WORDS = 8u;
DERMIS_CONSTANT INSTANCE_JOINTS = 0xfffffu;     // the bits of `joints` that are the number
DERMIS_CONSTANT INSTANCE_RESTARTS = 0x100000u;  // previous positions are set to the new positions
// The instance is not skinned; its previous positions are set to the current positions.
DERMIS_CONSTANT INSTANCE_SETTLES = 0x200000u;
// Only for instances that are culled on the GPU:
DERMIS_CONSTANT INSTANCE_HAS_MOTION = 0x400000u;  // it has previous positions
// It has a result (ExtensionRecord::result), which is cleared when it is skinned.
DERMIS_CONSTANT INSTANCE_HAS_RESULT = 0x800000u;
// In this frame its previous positions are drawn: they are only settled if it becomes visible.
DERMIS_CONSTANT INSTANCE_HOLDS = 0x1000000u;

// Data that only some instances have.
struct ExtensionRecord {
  uint morphs;  // word offset of the active morph targets in the tables
  uint morphCount;
  uint result;  // index of its result
  uint reserved;
  float centerX;  // center of the box of snorm16 positions
  float centerY;
  float centerZ;
  float inverseX;  // 1 / half of the size of the box
  float inverseY;
  float inverseZ;
  uint reserved1;
  uint reserved2;
};
DERMIS_CONSTANT EXTENSION_WORDS = 12u;
DERMIS_CONSTANT EXTENSION_MORPH_COUNT = 1u;  // the word of `morphCount`

// An active morph target. The targets of an instance are sorted by `target`.
struct ActiveMorph {
  uint target;
  float weight;
};
DERMIS_CONSTANT ACTIVE_MORPH_WORDS = 2u;

// An instance whose morph weights are made on the GPU, and the place where its active targets are
// listed. Layers are those of a FigureRecord.
struct MorphListRecord {
  uint extension;    // word offset of its ExtensionRecord, whose `morphCount` is written
  uint list;         // word offset of the list behind those targets that the CPU has listed
  uint weightCount;  // the number of targets whose weights are read or sampled here
  uint weights;  // word offset of the weights in their buffer, or of those at rest in the meshes
  // The rest only if the weights are sampled. Words of the mesh buffer:
  uint clips;  // the bank, or MORPH_LIST_NO_CLIPS
  uint track;  // offset of the first track among those of a clip
  uint masks;  // for each mask the factor
  uint layerCount;
  float time0;
  uint layer0;
  float time1;
  uint layer1;
  float time2;
  uint layer2;
  float time3;
  uint layer3;
  // Then targets whose weights a rig has.
  uint listed;       // the number of those that the CPU has listed
  uint driven;       // the word of the first one's weight in the buffer of driven joints
  uint firstDriven;  // the first target
  uint drivenCount;
};
DERMIS_CONSTANT MORPH_LIST_WORDS = 20u;
DERMIS_CONSTANT MORPH_LIST_DRIVEN = 16u;  // the word of `listed`
DERMIS_CONSTANT MORPH_LIST_LAYERS = 8u;   // the word of `time0`
DERMIS_CONSTANT MORPH_LIST_NO_CLIPS = 0xffffffffu;

// The result of an instance: the bounds of its skinned positions, and the number of clamped
// vertices. The same as InstanceResult. Minimum and maximum are integers that compare like the
// floats.
struct ResultRecord {
  uint minX;
  uint minY;
  uint minZ;
  uint maxX;
  uint maxY;
  uint maxZ;
  uint clampedVertices;
  uint reserved;
};

// ---- Records for instances that are culled on the GPU. They follow the other records of the
// tables.

// One for each such instance, in the order of the instance records.
struct CandidateRecord {
  uint slot;  // index into the visibility and history buffers
  // Identifies the skinned state that the output should have. No two instances, and no two states
  // of one instance, have the same version.
  uint version;
  // What must be made if it is skinned: word offsets of its FigureRecord and PaletteRecord, or
  // CANDIDATE_NEEDS_NONE.
  uint figure;
  uint palette;
};
DERMIS_CONSTANT CANDIDATE_WORDS = 4u;
DERMIS_CONSTANT CANDIDATE_NEEDS_NONE = 0xffffffffu;

// One for each dispatch that skins such instances.
struct CulledDispatchRecord {
  uint groups;  // word offset of the first group record
  uint groupCount;
  uint instancesPerInvocation;  // at most
  uint reserved;
};
DERMIS_CONSTANT CULLED_DISPATCH_WORDS = 4u;

// The arguments of these dispatches, as VkDispatchIndirectCommand. The visibility kernel writes
// them.
struct IndirectRecord {
  uint x;
  uint y;
  uint z;
  uint reserved;
};
DERMIS_CONSTANT INDIRECT_WORDS = 4u;

// What the GPU remembers about a slot from frame to frame.
struct HistoryRecord {
  uint version;      // the version that was skinned last
  uint lastVisible;  // the last frame in which it was visible
  uint moves;        // 1 if its previous positions differ from its positions
};

// What the visibility kernel counts, for the engine's statistics.
struct CounterRecord {
  uint visible;
  uint skinned;
  uint settled;
  uint workgroups;
};

// Further bindings of the visibility kernel, which fits devices with MIN_BINDING_COUNT storage
// buffers. It also has BINDING_TABLES, which it reads and writes. The history buffer begins with a
// CounterRecord.
DERMIS_CONSTANT BINDING_VISIBILITY = 1u;
DERMIS_CONSTANT BINDING_HISTORY = 2u;
DERMIS_CONSTANT BINDING_VISIBLE_RESULTS = 3u;

// ---- Push constants of each kernel. Word offsets count from the beginning of the tables.

struct PalettePush {
  uint palettes;  // word offset of the palette records
  uint workgroupCount;
  uint driven;  // the same of DrivenRecords, with a rig
};
struct SamplePush {
  uint figures;         // word offset of the figure records
  uint workgroupCount;  // one for each figure
};
struct ComposePush {
  uint figures;
  uint workgroupCount;
  uint band;
};
struct RigPush {
  uint rig;    // word of the mesh buffer
  uint poses;  // word offset of the records
  uint poseCount;
  uint workgroupCount;
};
struct MorphListPush {
  uint lists;  // word offset of the records
  uint listCount;
  uint workgroupCount;
};
struct ClearPush {
  uint results;  // word offset of the list of result indices
  uint resultCount;
  uint workgroupCount;
};
struct SkinPush {
  uint groups;  // word offset of the group records
  uint groupCount;
  uint workgroupCount;
  uint instances;              // word offset of the instance records
  uint verticesPerInvocation;  // used only with texel buffers
};
struct VisibilityPush {
  uint pass;           // VISIBILITY_CHOOSES or VISIBILITY_COUNTS
  uint groups;         // word offset of the first group record
  uint candidates;     // word offset of the candidate records
  uint instances;      // word offset of the instance records
  uint firstInstance;  // number of the first instance that is culled on the GPU
  uint frame;          // 1 + the number of earlier frames that were committed and not abandoned
  uint dispatches;     // word offset of the CulledDispatchRecords
  uint arguments;      // word offset of the IndirectRecords
  uint maxWorkgroups;  // maximum workgroups in x
};
DERMIS_CONSTANT VISIBILITY_CHOOSES = 0u;  // one workgroup for each group
DERMIS_CONSTANT VISIBILITY_COUNTS = 1u;   // one workgroup for each dispatch

#ifdef __cplusplus
/// Reads a record from the words of a table or a packed mesh.
template <typename Record>
Record load(std::span<const uint> words, std::size_t first) {
  Record record;
  std::memcpy(&record, words.subspan(first, sizeof(Record) / 4).data(), sizeof(Record));
  return record;
}
/// Writes a record to the words of a table or a packed mesh.
template <typename Record>
void store(std::span<uint> words, std::size_t first, const Record& record) {
  std::memcpy(words.subspan(first, sizeof(Record) / 4).data(), &record, sizeof(Record));
}
/// Appends zeros up to a multiple of four words, at which records begin.
template <typename Words>
void alignToUnit(Words& words) {
  words.resize((words.size() + 3) / 4 * 4);
}

}  // namespace dermis::abi
#endif
#undef DERMIS_CONSTANT

#endif
