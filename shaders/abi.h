// What C++ and GLSL agree on: records, binding numbers, specialisation constants. The one file that
// both include. Every record is made of 32-bit words and read by word, so that no layout rule comes
// between the two languages.
#ifndef DERMIS_ABI_H
#define DERMIS_ABI_H

#ifdef __cplusplus
#include <cstdint>
namespace dermis::abi {
using uint = std::uint32_t;
#define DERMIS_CONSTANT inline constexpr uint
#else
#define DERMIS_CONSTANT const uint
#endif

// Bindings of descriptor set 0: storage buffers. The palette kernel reads MATRICES, writes PALETTES
// and clears RESULTS; the skin kernel reads MESHES and, as the palette, PALETTES (dual quaternions)
// or the joint matrices (linear), writes one buffer for each attribute, and RESULTS. A device with
// only the four storage buffers a stage that Vulkan guarantees has the first BINDING_COUNT_LEAST:
// all attributes go to POSITIONS there, and there are no results.
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
DERMIS_CONSTANT CONSTANT_INSTANCES = 3u;   // instances per invocation
DERMIS_CONSTANT CONSTANT_POSITION_FORMAT = 4u;
DERMIS_CONSTANT CONSTANT_NORMAL_FORMAT = 5u;
DERMIS_CONSTANT CONSTANT_TANGENT_FORMAT = 6u;
DERMIS_CONSTANT CONSTANT_POSITION_UNIT = 7u;  // bytes of one store: 4, 2 or 1
DERMIS_CONSTANT CONSTANT_NORMAL_UNIT = 8u;
DERMIS_CONSTANT CONSTANT_TANGENT_UNIT = 9u;
DERMIS_CONSTANT CONSTANT_PREVIOUS_UNIT = 10u;
DERMIS_CONSTANT CONSTANT_MOTION = 11u;
DERMIS_CONSTANT CONSTANT_MORPHS = 12u;  // 0 or 1
DERMIS_CONSTANT CONSTANT_BOUNDS = 13u;  // 0 or 1
DERMIS_CONSTANT CONSTANT_SCALES = 14u;  // 0 or 1: whether palettes may be two-phase
DERMIS_CONSTANT CONSTANT_COUNT = 15u;

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

// Packed mesh: a header, then sections at word offsets from the blob's start.
DERMIS_CONSTANT MESH_MAGIC = 0x4d4b5344u;  // "DSKM"
DERMIS_CONSTANT MESH_VERSION = 4u;
DERMIS_CONSTANT MESH_HEADER_MAGIC = 0u;
DERMIS_CONSTANT MESH_HEADER_VERSION = 1u;
DERMIS_CONSTANT MESH_HEADER_CHECKSUM =
    2u;  // of all words that follow it: hash = rotl((hash ^ word) * 16777619, 15) from 2166136261
DERMIS_CONSTANT MESH_HEADER_WORDS_TOTAL = 3u;
DERMIS_CONSTANT MESH_HEADER_VERTEX_COUNT = 4u;
DERMIS_CONSTANT MESH_HEADER_REQUIRED_JOINTS = 5u;
DERMIS_CONSTANT MESH_HEADER_MAX_INFLUENCES = 6u;
DERMIS_CONSTANT MESH_HEADER_MORPH_COUNT = 7u;
// What every vertex is read from, at multiples of 4 words, a unit of 4 words at a time: these four
// offsets are one unit themselves.
DERMIS_CONSTANT MESH_HEADER_POSITIONS = 8u;    // VERTEX_WORDS each, and one more record
DERMIS_CONSTANT MESH_HEADER_NORMALS = 9u;      // likewise, 0 where there are none
DERMIS_CONSTANT MESH_HEADER_TANGENTS = 10u;    // likewise
DERMIS_CONSTANT MESH_HEADER_INFLUENCES = 11u;  // INFLUENCE_WORDS each
DERMIS_CONSTANT MESH_HEADER_CENTERS = 12u;     // of rotation: VERTEX_WORDS each, 0 for none
DERMIS_CONSTANT MESH_HEADER_MORPHS = 13u;      // MORPH_WORDS a morph target
DERMIS_CONSTANT MESH_HEADER_DUAL_QUATERNION_WEIGHTS = 14u;  // a float a vertex, 0 where all have …
DERMIS_CONSTANT MESH_HEADER_DUAL_QUATERNION_WEIGHT = 15u;   // … this one
DERMIS_CONSTANT MESH_HEADER_BULGE_STRENGTHS = 16u;          // likewise
DERMIS_CONSTANT MESH_HEADER_BULGE_STRENGTH = 17u;
DERMIS_CONSTANT MESH_HEADER_WORDS = 20u;

// A position, a normal, a tangent or a centre of rotation of a vertex: three floats, and a word
// that is the handedness of a tangent, 0 of a normal and a centre, and of a position where the
// influences of the vertex begin: the number of their first unit, times 2, plus 1 where the last of
// them is padding. Those of the next vertex follow; the record behind the last vertex says where
// they end.
DERMIS_CONSTANT VERTEX_WORDS = 4u;
DERMIS_CONSTANT VERTEX_INFLUENCES = 3u;

// Influences stand vertex by vertex, as many as each has, two in a unit. The first of a vertex is
// its pivot; a vertex without influences stays in bind pose.
DERMIS_CONSTANT INFLUENCE_WEIGHT = 0u;  // float; those of a vertex sum to exactly 1; padding: 0
DERMIS_CONSTANT INFLUENCE_JOINT = 1u;
DERMIS_CONSTANT INFLUENCE_WORDS = 2u;

// A morph target displaces some vertices of some blocks of MORPH_BLOCK_VERTICES: a record a block,
// from the first such block to the last, with a mask of the displaced vertices and the place of the
// first one's displacement; those of the others follow. A displacement has 3 floats for each
// attribute of the target, in the order of MORPH_HAS_*.
DERMIS_CONSTANT MORPH_FIRST_BLOCK = 0u;
DERMIS_CONSTANT MORPH_BLOCK_COUNT = 1u;
DERMIS_CONSTANT MORPH_BLOCKS = 2u;  // word offset of the block records
DERMIS_CONSTANT MORPH_ATTRIBUTES = 3u;
DERMIS_CONSTANT MORPH_WORDS = 4u;
DERMIS_CONSTANT MORPH_HAS_POSITIONS = 1u;
DERMIS_CONSTANT MORPH_HAS_NORMALS = 2u;
DERMIS_CONSTANT MORPH_HAS_TANGENTS = 4u;
DERMIS_CONSTANT MORPH_BLOCK_VERTICES = 64u;
DERMIS_CONSTANT MORPH_BLOCK_MASK = 0u;           // 2 words, the low one first
DERMIS_CONSTANT MORPH_BLOCK_DISPLACEMENTS = 2u;  // word offset
DERMIS_CONSTANT MORPH_BLOCK_WORDS = 3u;

// Table record of a palette. Offsets into the matrices and palettes buffers count 16-byte units.
DERMIS_CONSTANT PALETTE_MATRICES = 0u;  // the first joint matrix: 3 units each
DERMIS_CONSTANT PALETTE_OUTPUT =
    1u;  // the palette: a status unit, the joints, 2 more units a joint where it may scale
DERMIS_CONSTANT PALETTE_JOINTS = 2u;
DERMIS_CONSTANT PALETTE_FLAGS = 3u;
DERMIS_CONSTANT PALETTE_WORDS = 4u;
DERMIS_CONSTANT PALETTE_MAY_SCALE = 1u;
DERMIS_CONSTANT PALETTE_LOGARITHMS = 2u;  // joints are logarithms instead of dual quaternions
DERMIS_CONSTANT UNITS_OF_DUAL_QUATERNION = 2u;
DERMIS_CONSTANT UNITS_OF_LOGARITHM = 3u;  // the rows of a 3×4 matrix

// Words of the status unit at the start of a palette.
DERMIS_CONSTANT STATUS_TWO_PHASE = 0u;
DERMIS_CONSTANT STATUS_NON_RIGID = 1u;
DERMIS_CONSTANT STATUS_UNDECLARED_SCALE = 2u;
DERMIS_CONSTANT STATUS_NON_FINITE = 3u;

// Table record of a group: the instances of one mesh with one output layout, in one dispatch.
DERMIS_CONSTANT GROUP_WORKGROUP_END = 0u;  // workgroups of this dispatch up to and with this group
DERMIS_CONSTANT GROUP_MESH = 1u;           // word offset of the packed mesh in the mesh buffer
DERMIS_CONSTANT GROUP_FIRST_VERTEX = 2u;
DERMIS_CONSTANT GROUP_VERTEX_END = 3u;
DERMIS_CONSTANT GROUP_VERTEX_GROUPS = 4u;  // workgroups that cover the vertices once
DERMIS_CONSTANT GROUP_FIRST_INSTANCE = 5u;
DERMIS_CONSTANT GROUP_INSTANCE_COUNT = 6u;
DERMIS_CONSTANT GROUP_POSITION_STRIDE = 7u;  // bytes, as the following
DERMIS_CONSTANT GROUP_NORMAL_STRIDE = 8u;
DERMIS_CONSTANT GROUP_TANGENT_STRIDE = 9u;
DERMIS_CONSTANT GROUP_PREVIOUS_STRIDE = 10u;
DERMIS_CONSTANT GROUP_WORDS = 12u;

// Table record of an instance. Output offsets are bytes from the start of the output range that the
// dispatch writes, for the group's first vertex.
DERMIS_CONSTANT INSTANCE_PALETTE =
    0u;  // unit of the palette's status, or of the first joint matrix for linear
DERMIS_CONSTANT INSTANCE_POSITIONS = 1u;
DERMIS_CONSTANT INSTANCE_NORMALS = 2u;
DERMIS_CONSTANT INSTANCE_TANGENTS = 3u;
DERMIS_CONSTANT INSTANCE_PREVIOUS = 4u;  // from here on what many variants need not read
DERMIS_CONSTANT INSTANCE_JOINTS = 5u;    // joints of the palette
DERMIS_CONSTANT INSTANCE_FLAGS = 6u;
DERMIS_CONSTANT INSTANCE_EXTENSION =
    7u;  // word offset of its extension in the tables, where it has one
DERMIS_CONSTANT INSTANCE_WORDS = 8u;

DERMIS_CONSTANT INSTANCE_RESTARTS = 1u;  // previous positions are the current ones
DERMIS_CONSTANT INSTANCE_SETTLES = 2u;   // not skinned; previous positions become the current ones
// Of instances that the GPU chooses:
DERMIS_CONSTANT INSTANCE_HAS_MOTION = 4u;  // it has previous positions
DERMIS_CONSTANT INSTANCE_HAS_RESULT =
    8u;  // its extension names one, to be cleared when it is skinned

// What only some instances have.
DERMIS_CONSTANT EXTENSION_PREVIOUS_PALETTE = 0u;  // as INSTANCE_PALETTE
DERMIS_CONSTANT EXTENSION_PREVIOUS_JOINTS = 1u;
DERMIS_CONSTANT EXTENSION_MORPHS = 2u;  // word offset of the active morph targets in the tables
DERMIS_CONSTANT EXTENSION_MORPH_COUNT = 3u;
DERMIS_CONSTANT EXTENSION_PREVIOUS_MORPHS = 4u;
DERMIS_CONSTANT EXTENSION_PREVIOUS_MORPH_COUNT = 5u;
DERMIS_CONSTANT EXTENSION_RESULT = 6u;    // word offset in the results
DERMIS_CONSTANT EXTENSION_CENTRE = 8u;    // of the box of snorm16 positions: 3 floats
DERMIS_CONSTANT EXTENSION_INVERSE = 12u;  // 1 / half its size: 3 floats
DERMIS_CONSTANT EXTENSION_WORDS = 16u;

// An active morph target.
DERMIS_CONSTANT ACTIVE_TARGET = 0u;
DERMIS_CONSTANT ACTIVE_WEIGHT = 1u;  // float
DERMIS_CONSTANT ACTIVE_WORDS = 2u;

// What is found out about an instance's skinned positions, as InstanceResult has it.
DERMIS_CONSTANT RESULT_MIN = 0u;  // 3 ordered numbers
DERMIS_CONSTANT RESULT_CLAMPED = 3u;
DERMIS_CONSTANT RESULT_MAX = 4u;  // likewise
DERMIS_CONSTANT RESULT_WORDS = 8u;

// Instances that the GPU chooses. Behind the records of a frame's tables stand, for each such
// instance, in the order of the instance records, what the visibility kernel has to know of it …
DERMIS_CONSTANT CANDIDATE_SLOT = 0u;  // its place in the visibility and history buffers
DERMIS_CONSTANT CANDIDATE_VERSION =
    1u;  // of what it should show; different for all instances and poses
DERMIS_CONSTANT CANDIDATE_WORDS = 2u;
// … for each of their dispatches its groups …
DERMIS_CONSTANT CULLED_DISPATCH_GROUPS = 0u;  // word offset of the first group record
DERMIS_CONSTANT CULLED_DISPATCH_GROUP_COUNT = 1u;
DERMIS_CONSTANT CULLED_DISPATCH_INSTANCES = 2u;  // instances per invocation
DERMIS_CONSTANT CULLED_DISPATCH_WORDS = 4u;
// … and the arguments of the indirect dispatches, as VkDispatchIndirectCommand, which the kernel
// writes.
DERMIS_CONSTANT INDIRECT_WORDS = 4u;

// What the GPU remembers of a slot.
DERMIS_CONSTANT HISTORY_VERSION = 0u;       // that was last skinned
DERMIS_CONSTANT HISTORY_LAST_VISIBLE = 1u;  // frame
DERMIS_CONSTANT HISTORY_MOVES = 2u;         // 1: its previous positions are not its positions
DERMIS_CONSTANT HISTORY_WORDS = 3u;

// What the visibility kernel counts, for the engine's statistics.
DERMIS_CONSTANT COUNTER_VISIBLE = 0u;
DERMIS_CONSTANT COUNTER_SKINNED = 1u;
DERMIS_CONSTANT COUNTER_SETTLED = 2u;
DERMIS_CONSTANT COUNTER_WORKGROUPS = 3u;
DERMIS_CONSTANT COUNTER_WORDS = 4u;

// Bindings of the visibility kernel; the tables are written too.
DERMIS_CONSTANT BINDING_VISIBILITY = 1u;
DERMIS_CONSTANT BINDING_HISTORY = 2u;
DERMIS_CONSTANT BINDING_COUNTERS = 3u;

// Push constants of the visibility kernel, by word.
DERMIS_CONSTANT PUSH_CULLED_GROUPS = 0u;      // word offset of the first group, or culled dispatch
DERMIS_CONSTANT PUSH_CULLED_CANDIDATES = 1u;  // word offset, or that of the indirect arguments
DERMIS_CONSTANT PUSH_CULLED_FRAME = 2u;       // number of the frame, or the most workgroups in x
DERMIS_CONSTANT PUSH_CULLED_INSTANCES = 3u;   // word offset of the instance records
DERMIS_CONSTANT PUSH_CULLED_FIRST_INSTANCE = 4u;  // the number of the first culled one
DERMIS_CONSTANT PUSH_CULLED_COUNT = 5u;           // of groups or dispatches: one workgroup each
DERMIS_CONSTANT PUSH_CULLED_PASS = 6u;            // 0: instances, 1: dispatches
DERMIS_CONSTANT PUSH_CULLED_WORDS = 8u;

// Push constants, by word.
DERMIS_CONSTANT PUSH_FIRST_RECORD = 0u;
DERMIS_CONSTANT PUSH_RECORD_COUNT = 1u;
DERMIS_CONSTANT PUSH_WORKGROUP_COUNT = 2u;
DERMIS_CONSTANT PUSH_INSTANCE_RECORDS =
    3u;  // palette kernel: how many results to clear; their numbers follow the palette records
DERMIS_CONSTANT PUSH_WORDS = 4u;

#ifdef __cplusplus
}  // namespace dermis::abi
#endif
#undef DERMIS_CONSTANT

#endif
