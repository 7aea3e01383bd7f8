// What C++ and GLSL agree on: records, binding numbers, specialisation constants. The one file that
// both include.
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

// Bindings of descriptor set 0: storage buffers. The palette kernel reads MATRICES and writes
// PALETTES, the clear kernel clears RESULTS; the skin kernel reads MESHES and, as the palette,
// PALETTES (dual quaternions) or the joint matrices (linear), writes one buffer for each attribute,
// and RESULTS. A device with only the four storage buffers a stage that Vulkan guarantees has the
// first BINDING_COUNT_LEAST: all attributes go to POSITIONS there, and there are no results.
DERMIS_CONSTANT BINDING_TABLES = 0u;
DERMIS_CONSTANT BINDING_MESHES = 1u;  // palette kernel: the joint matrices
DERMIS_CONSTANT BINDING_PALETTES =
    2u;  // palette kernel: written; skin kernel: palettes or joint matrices
DERMIS_CONSTANT BINDING_POSITIONS = 3u;
DERMIS_CONSTANT BINDING_COUNT_LEAST = 4u;
DERMIS_CONSTANT BINDING_NORMALS = 4u;
DERMIS_CONSTANT BINDING_TANGENTS = 5u;
DERMIS_CONSTANT BINDING_PREVIOUS = 6u;
DERMIS_CONSTANT BINDING_RESULTS = 7u;
DERMIS_CONSTANT BINDING_COUNT = 8u;

// Uniform texel buffers, for variants that read through them: the same buffers again.
DERMIS_CONSTANT BINDING_TABLE_TEXELS = 8u;     // 16 bytes a texel
DERMIS_CONSTANT BINDING_MESH_TEXELS = 9u;      // likewise
DERMIS_CONSTANT BINDING_MESH_WORDS = 10u;      // 4 bytes a texel
DERMIS_CONSTANT BINDING_PALETTE_TEXELS = 11u;  // 16 bytes a texel
DERMIS_CONSTANT TEXEL_BINDING_COUNT = 4u;

// Specialisation constants.
DERMIS_CONSTANT CONSTANT_WORKGROUP_SIZE = 0u;
DERMIS_CONSTANT CONSTANT_METHOD = 1u;
DERMIS_CONSTANT CONSTANT_INFLUENCES = 2u;  // 1, 2, 4, or 0 for any number
DERMIS_CONSTANT CONSTANT_INSTANCES = 3u;   // maximum instances per invocation
DERMIS_CONSTANT CONSTANT_POSITION_FORMAT = 4u;
DERMIS_CONSTANT CONSTANT_NORMAL_FORMAT = 5u;
DERMIS_CONSTANT CONSTANT_TANGENT_FORMAT = 6u;
DERMIS_CONSTANT CONSTANT_POSITION_UNIT = 7u;  // bytes of one store: 1, 2, 4, 8, 12 or 16
DERMIS_CONSTANT CONSTANT_NORMAL_UNIT = 8u;
DERMIS_CONSTANT CONSTANT_TANGENT_UNIT = 9u;
DERMIS_CONSTANT CONSTANT_PREVIOUS_UNIT = 10u;
DERMIS_CONSTANT CONSTANT_MOTION = 11u;
DERMIS_CONSTANT CONSTANT_MORPHS = 12u;  // 0 or 1
DERMIS_CONSTANT CONSTANT_BOUNDS = 13u;  // 0 or 1
DERMIS_CONSTANT CONSTANT_SCALES = 14u;  // 0 or 1: whether palettes may be two-phase
DERMIS_CONSTANT CONSTANT_FULL = 15u;    // 0 or 1: every vertex has CONSTANT_INFLUENCES
DERMIS_CONSTANT CONSTANT_RECORD = 16u;  // bytes of one store of all attributes, or one of these:
DERMIS_CONSTANT CONSTANT_COUNT = 17u;
DERMIS_CONSTANT RECORD_APART = 0u;     // each attribute by itself
DERMIS_CONSTANT RECORD_IN_PAIRS = 1u;  // positions and normals, float32x3, by 8 bytes

// The numbers of Method.
DERMIS_CONSTANT METHOD_LINEAR = 0u;
DERMIS_CONSTANT METHOD_DUAL_QUATERNION = 1u;
DERMIS_CONSTANT METHOD_DUAL_QUATERNION_ITERATIVE = 2u;
DERMIS_CONSTANT METHOD_LOG_MATRIX = 3u;
DERMIS_CONSTANT METHOD_SPHERICAL_BLEND = 4u;
DERMIS_CONSTANT METHOD_QUATERNION_TRANSLATION = 5u;
DERMIS_CONSTANT METHOD_BLENDED = 6u;
DERMIS_CONSTANT METHOD_CENTER_OF_ROTATION = 7u;
DERMIS_CONSTANT METHOD_BULGE_CONTROLLED = 8u;

// The numbers of VertexFormat.
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

// The numbers of Motion.
DERMIS_CONSTANT MOTION_NONE = 0u;
DERMIS_CONSTANT MOTION_KEPT = 1u;
DERMIS_CONSTANT MOTION_RESKINNED = 2u;

// ---- Packed mesh: a header, then sections at word offsets from its start. What every vertex is
// read from begins at multiples of 4 words, which kernels read at once (a unit).
DERMIS_CONSTANT MESH_MAGIC = 0x4d4b5344u;  // "DSKM"
DERMIS_CONSTANT MESH_VERSION = 6u;
struct MeshHeader {
  uint magic;
  uint version;
  uint checksum;   // of all words after it: hash = rotl((hash ^ word) * 16777619, 15), from
                   // 2166136261
  uint wordCount;  // of the packed mesh
  uint vertexCount;
  uint requiredJoints;  // the highest joint index + 1
  uint maxInfluences;   // of a vertex
  uint morphCount;
  // Word offsets of sections. The first four are one unit.
  uint positions;   // PositionRecord: one for each vertex, and one more
  uint normals;     // 4 words for each vertex: 3 floats and a 0; offset 0: there are none
  uint tangents;    // the same with the handedness as a fourth float
  uint influences;  // InfluenceRecord
  uint centers;     // of rotation; as normals
  uint morphs;      // MorphRecord
  uint dualQuaternionWeights;  // a float for each vertex; 0: all have …
  float dualQuaternionWeight;  // … this one
  uint bulgeStrengths;         // the same
  float bulgeStrength;
  uint minInfluences;  // of a vertex
  uint reserved;
};
DERMIS_CONSTANT MESH_HEADER_WORDS = 20u;

// The influences of a vertex end where those of the next begin; the record after the last vertex
// ends its influences.
struct PositionRecord {
  float x;
  float y;
  float z;
  uint influences;  // the number of their first unit, times 2, plus 1 if the last one is padding
};
DERMIS_CONSTANT VERTEX_WORDS = 4u;

// Influences of a vertex stand together, two in a unit. The first is the pivot of the vertex; a
// vertex without influences stays in bind pose.
struct InfluenceRecord {
  float weight;  // those of a vertex sum to exactly 1; padding: 0
  uint joint;
};
DERMIS_CONSTANT INFLUENCE_WORDS = 2u;

// A morph target displaces some vertices of some blocks of MORPH_BLOCK_VERTICES: a record a block,
// from the first such block to the last. A displacement has 3 floats for each attribute of the
// target, in the order of MORPH_HAS_*. Both records begin at multiples of 4 words.
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
  uint maskLow;  // a bit a vertex: whether it is displaced
  uint maskHigh;
  uint displacements;  // word offset of the first one; those of further vertices follow
  uint reserved;
};
DERMIS_CONSTANT MORPH_BLOCK_WORDS = 4u;

// ---- Records. A struct of scalars has the same layout in C++ and in std430; tables.glsl has a
// loader for each. NAME_WORDS is its size. Tables are one buffer of words; records in them begin at
// multiples of four words.

// A palette to be converted. Offsets into the matrices and palettes buffers count 16-byte units.
struct PaletteRecord {
  uint matrices;  // the first joint matrix: 3 units each
  uint place;     // of the palette: a status, the joints, 2 more units a joint where it may scale
  uint jointCount;
  uint reserved;
};
DERMIS_CONSTANT PALETTE_WORDS = 4u;
DERMIS_CONSTANT UNITS_OF_DUAL_QUATERNION = 2u;
DERMIS_CONSTANT UNITS_OF_LOGARITHM = 3u;  // the rows of a 3×4 matrix
DERMIS_CONSTANT UNITS_OF_MATRIX = 3u;
DERMIS_CONSTANT UNITS_OF_SCALE_SHEAR = 2u;

// The unit at the beginning of a palette, as PoseStatus has it.
struct StatusRecord {
  uint twoPhase;
  uint nonRigidJoints;
  uint undeclaredScale;
  uint nonFiniteJoints;
};

// A group: the instances of one mesh with one output layout, in one dispatch.
struct GroupRecord {
  uint workgroupEnd;  // workgroups of this dispatch up to and with this group
  uint mesh;          // word offset of the packed mesh in the mesh buffer
  uint firstVertex;
  uint vertexEnd;
  uint vertexGroups;  // workgroups that cover the vertices once
  uint firstInstance;
  uint instanceCount;
  uint positionStride;  // bytes, as the following
  uint normalStride;
  uint tangentStride;
  uint previousStride;
  uint evenlySpaced;  // 1: each word of its instance records rises by the same from one to the next
};
DERMIS_CONSTANT GROUP_WORDS = 12u;

// An instance. Output offsets are bytes from the start of the output range that the dispatch
// writes, for the group's first vertex.
struct InstanceRecord {
  uint palette;  // unit of the palette's status, or of the first joint matrix for linear
  uint positions;
  uint normals;
  uint tangents;
  uint previousPositions;
  uint joints;           // their number in the palette, plus INSTANCE_*
  uint previousPalette;  // reskinned: as `palette`
  uint extension;        // word offset of its extension in the tables, where it has one
};
DERMIS_CONSTANT INSTANCE_WORDS = 8u;
DERMIS_CONSTANT INSTANCE_JOINTS = 0xfffffu;     // of `joints`, those bits that are the number
DERMIS_CONSTANT INSTANCE_RESTARTS = 0x100000u;  // previous positions are the current ones
DERMIS_CONSTANT INSTANCE_SETTLES =
    0x200000u;  // not skinned; previous positions become the current ones
// Of instances that the GPU chooses:
DERMIS_CONSTANT INSTANCE_HAS_MOTION = 0x400000u;  // it has previous positions
DERMIS_CONSTANT INSTANCE_HAS_RESULT =
    0x800000u;  // its extension names one, to be cleared when it is skinned

// What only some instances have.
struct ExtensionRecord {
  uint previousJointCount;  // of the previous palette
  uint morphs;              // word offset of the active morph targets in the tables
  uint morphCount;
  uint previousMorphs;
  uint previousMorphCount;
  uint reserved;
  uint reserved1;
  uint reserved2;
  float centreX;  // of the box of snorm16 positions
  float centreY;
  float centreZ;
  float inverseX;  // 1 / half its size
  float inverseY;
  float inverseZ;
  uint result;  // number of its result; read with the box
  uint reserved3;
};
DERMIS_CONSTANT EXTENSION_WORDS = 16u;

// An active morph target. They stand two by two, in rising order.
struct ActiveMorph {
  uint target;
  float weight;
};
DERMIS_CONSTANT ACTIVE_MORPH_WORDS = 2u;

// What is found out about an instance's skinned positions, as InstanceResult has it. Extremes are
// numbers in the order of the floats.
struct ResultRecord {
  uint minX;
  uint minY;
  uint minZ;
  uint clampedVertices;
  uint maxX;
  uint maxY;
  uint maxZ;
  uint reserved;
};

// Instances that the GPU chooses. Behind the records of a frame's tables stand, for each such
// instance, in the order of the instance records, what the visibility kernel has to know of it …
struct CandidateRecord {
  uint slot;     // its place in the visibility and history buffers
  uint version;  // of what it should show; different for all instances and poses
};
DERMIS_CONSTANT CANDIDATE_WORDS = 2u;
// … for each of their dispatches its groups …
struct CulledDispatchRecord {
  uint groups;  // word offset of the first group record
  uint groupCount;
  uint instancesPerInvocation;
  uint reserved;
};
DERMIS_CONSTANT CULLED_DISPATCH_WORDS = 4u;
// … and the arguments of the indirect dispatches, as VkDispatchIndirectCommand, which the kernel
// writes.
struct IndirectRecord {
  uint x;
  uint y;
  uint z;
  uint reserved;
};
DERMIS_CONSTANT INDIRECT_WORDS = 4u;

// What the GPU remembers of a slot.
struct HistoryRecord {
  uint version;      // that was last skinned
  uint lastVisible;  // frame
  uint moves;        // 1: its previous positions are not its positions
};

// What the visibility kernel counts, for the engine's statistics.
struct CounterRecord {
  uint visible;
  uint skinned;
  uint settled;
  uint workgroups;
};

// Bindings of the visibility kernel; the tables are written too.
DERMIS_CONSTANT BINDING_VISIBILITY = 1u;
DERMIS_CONSTANT BINDING_HISTORY = 2u;
DERMIS_CONSTANT BINDING_COUNTERS = 3u;

// ---- Push constants, of each kernel its own. Word offsets count from the beginning of the tables.

struct PalettePush {
  uint palettes;  // PaletteRecord
  uint workgroupCount;
};
struct ClearPush {
  uint results;  // numbers of results
  uint resultCount;
  uint workgroupCount;
};
struct SkinPush {
  uint groups;  // word offset of the group records
  uint groupCount;
  uint workgroupCount;
  uint instances;               // word offset of the instance records
  uint instancesPerInvocation;  // 1 to CONSTANT_INSTANCES
};
struct VisibilityPush {
  uint pass;  // VISIBILITY_CHOOSES: a workgroup a group; VISIBILITY_COUNTS: a workgroup a dispatch
  uint groups;          // word offset of the first group
  uint candidates;      // word offset
  uint instances;       // word offset of the instance records
  uint firstInstance;   // the number of the first that the GPU chooses
  uint frame;           // counts records
  uint dispatches;      // word offset
  uint arguments;       // word offset
  uint mostWorkgroups;  // in x
};
DERMIS_CONSTANT VISIBILITY_CHOOSES = 0u;
DERMIS_CONSTANT VISIBILITY_COUNTS = 1u;

#ifdef __cplusplus
/// Records as words of a table or a packed mesh.
template <typename Record>
Record load(std::span<const uint> words, std::size_t first) {
  Record record;
  std::memcpy(&record, words.subspan(first, sizeof(Record) / 4).data(), sizeof(Record));
  return record;
}
template <typename Record>
void store(std::span<uint> words, std::size_t first, const Record& record) {
  std::memcpy(words.subspan(first, sizeof(Record) / 4).data(), &record, sizeof(Record));
}

}  // namespace dermis::abi
#endif
#undef DERMIS_CONSTANT

#endif
