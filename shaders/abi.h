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

// Bindings of descriptor set 0. The palette kernel reads MATRICES and writes PALETTES; the skin
// kernel reads MESHES and, as the palette, PALETTES (dual quaternions) or MATRICES (linear), and
// writes OUTPUT. Four storage buffers each.
DERMIS_CONSTANT BINDING_TABLES = 0u;
DERMIS_CONSTANT BINDING_MESHES = 1u;  // palette kernel: the joint matrices
DERMIS_CONSTANT BINDING_PALETTES =
    2u;  // palette kernel: written; skin kernel: palettes or joint matrices
DERMIS_CONSTANT BINDING_OUTPUT = 3u;  // skin kernel only
DERMIS_CONSTANT BINDING_COUNT = 4u;

// Specialisation constants.
DERMIS_CONSTANT CONSTANT_WORKGROUP_SIZE = 0u;
DERMIS_CONSTANT CONSTANT_METHOD = 1u;
DERMIS_CONSTANT CONSTANT_NORMALS = 2u;
DERMIS_CONSTANT CONSTANT_INFLUENCES = 3u;  // 1, 2, 4, or 0 for any number
DERMIS_CONSTANT CONSTANT_INSTANCES = 4u;   // instances per invocation
DERMIS_CONSTANT CONSTANT_COUNT = 5u;

DERMIS_CONSTANT METHOD_LINEAR = 0u;
DERMIS_CONSTANT METHOD_DUAL_QUATERNION = 1u;

// Packed mesh: a header, then sections at word offsets from the blob's start.
DERMIS_CONSTANT MESH_MAGIC = 0x4d4b5344u;  // "DSKM"
DERMIS_CONSTANT MESH_VERSION = 1u;
DERMIS_CONSTANT MESH_HEADER_MAGIC = 0u;
DERMIS_CONSTANT MESH_HEADER_VERSION = 1u;
DERMIS_CONSTANT MESH_HEADER_CHECKSUM = 2u;  // FNV-1a, by words, of all that follow it
DERMIS_CONSTANT MESH_HEADER_WORDS_TOTAL = 3u;
DERMIS_CONSTANT MESH_HEADER_VERTEX_COUNT = 4u;
DERMIS_CONSTANT MESH_HEADER_REQUIRED_JOINTS = 5u;
DERMIS_CONSTANT MESH_HEADER_MAX_INFLUENCES = 6u;
DERMIS_CONSTANT MESH_HEADER_POSITIONS = 7u;  // word offset: 3 floats a vertex
DERMIS_CONSTANT MESH_HEADER_NORMALS = 8u;    // likewise, 0 where there are none
DERMIS_CONSTANT MESH_HEADER_BLOCKS = 9u;     // word offset: BLOCK_WORDS words a block
DERMIS_CONSTANT MESH_HEADER_WORDS = 12u;

// Influences are stored in blocks of 64 vertices. A block has as many slots as its most-influenced
// vertex has influences: first `slots` rows of 64 float weights, then (slots + 1) / 2 rows of 64
// pairs of 16-bit joint indices, the even slot in the low half. Slot 0 is the pivot. A slot of
// weight 0 is empty; slot 0 empty means that the vertex stays in bind pose.
DERMIS_CONSTANT BLOCK_VERTICES = 64u;
DERMIS_CONSTANT BLOCK_OFFSET = 0u;  // word offset of the rows from the blob's start
DERMIS_CONSTANT BLOCK_SLOTS = 1u;
DERMIS_CONSTANT BLOCK_WORDS = 2u;

// Table record of a palette. Offsets into the matrices and palettes buffers count 16-byte units.
DERMIS_CONSTANT PALETTE_MATRICES = 0u;  // the first joint matrix: 3 units each
DERMIS_CONSTANT PALETTE_OUTPUT =
    1u;  // the palette: a status unit, 2 units a joint, 2 more a joint where it may scale
DERMIS_CONSTANT PALETTE_JOINTS = 2u;
DERMIS_CONSTANT PALETTE_MAY_SCALE = 3u;
DERMIS_CONSTANT PALETTE_WORDS = 4u;

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
DERMIS_CONSTANT GROUP_POSITION_STRIDE = 7u;  // words
DERMIS_CONSTANT GROUP_NORMAL_STRIDE = 8u;    // words
DERMIS_CONSTANT GROUP_WORDS = 12u;

// Table record of an instance. Output offsets are words from the start of the output range that the
// dispatch writes, for the group's first vertex.
DERMIS_CONSTANT INSTANCE_PALETTE =
    0u;  // unit of the palette's status, or of the first joint matrix for linear
DERMIS_CONSTANT INSTANCE_JOINTS = 1u;  // joints of the palette
DERMIS_CONSTANT INSTANCE_POSITIONS = 2u;
DERMIS_CONSTANT INSTANCE_NORMALS = 3u;
DERMIS_CONSTANT INSTANCE_WORDS = 4u;

// Push constants, by word.
DERMIS_CONSTANT PUSH_FIRST_RECORD = 0u;
DERMIS_CONSTANT PUSH_RECORD_COUNT = 1u;
DERMIS_CONSTANT PUSH_WORKGROUP_COUNT = 2u;
DERMIS_CONSTANT PUSH_INSTANCE_RECORDS = 3u;
DERMIS_CONSTANT PUSH_WORDS = 4u;

#ifdef __cplusplus
}  // namespace dermis::abi
#endif
#undef DERMIS_CONSTANT

#endif
