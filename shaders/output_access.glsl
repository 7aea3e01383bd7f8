// Stores skinned attributes. Each attribute has its own binding; several bindings may refer to the same buffer. With ONE_OUTPUT,
// all attributes use one binding, for devices that allow only a few storage buffers per stage.
#ifndef DERMIS_OUTPUT_ACCESS_GLSL
#define DERMIS_OUTPUT_ACCESS_GLSL

#include "abi.h"

// STORED(NAME, AT) declares the buffer of one attribute as words, with TEXELS as vectors too, and storeNAME, which stores the first
// `size` bytes of `words` that are whole words, all at once if `wide`, and changes no other bytes. `place` is a byte offset; the first
// word is the one that contains it. LOADED(NAME) declares loadNAME, which loads what is stored at `place`.
#ifdef TEXELS
#define WIDE_BUFFERS(NAME, AT) \
  layout(set = 0, binding = AT, scalar) buffer Vectors2##NAME { uvec2 vectors2##NAME[]; }; \
  layout(set = 0, binding = AT, scalar) buffer Vectors3##NAME { uvec3 vectors3##NAME[]; }; \
  layout(set = 0, binding = AT, scalar) buffer Vectors4##NAME { uvec4 vectors4##NAME[]; };
#define WIDE_STORE(NAME) \
  if (wide) { \
    if (size == 8u) vectors2##NAME[place / 8u] = words.xy; \
    if (size == 12u) vectors3##NAME[place / 12u] = words.xyz; \
    if (size == 16u) vectors4##NAME[place / 16u] = words; \
    return; \
  }
#define WIDE_LOAD(NAME) \
  if (wide) { \
    if (size == 8u) words.xy = vectors2##NAME[place / 8u]; \
    if (size == 12u) words.xyz = vectors3##NAME[place / 12u]; \
    if (size == 16u) words = vectors4##NAME[place / 16u]; \
    return words; \
  }
#else
#define WIDE_BUFFERS(NAME, AT)
#define WIDE_STORE(NAME)
#define WIDE_LOAD(NAME)
#endif
#define STORED(NAME, AT) \
  layout(set = 0, binding = AT, std430) buffer Words##NAME { uint words##NAME[]; }; \
  WIDE_BUFFERS(NAME, AT) \
  void store##NAME(uint place, uvec4 words, uint size, bool wide) { \
    WIDE_STORE(NAME) \
    uint word = place / 4u; \
    if (size >= 4u) words##NAME[word] = words.x; \
    if (size >= 8u) words##NAME[word + 1u] = words.y; \
    if (size >= 12u) words##NAME[word + 2u] = words.z; \
    if (size >= 16u) words##NAME[word + 3u] = words.w; \
  }
#define LOADED(NAME) \
  uvec4 load##NAME(uint place, uint size, bool wide) { \
    uvec4 words = uvec4(0u); \
    WIDE_LOAD(NAME) \
    uint word = place / 4u; \
    words.x = words##NAME[word]; \
    if (size > 4u) words.y = words##NAME[word + 1u]; \
    if (size > 8u) words.z = words##NAME[word + 2u]; \
    if (size > 12u) words.w = words##NAME[word + 3u]; \
    return words; \
  }

STORED(Positions, BINDING_POSITIONS)
#if defined(EXTRAS) || defined(ONE_OUTPUT)
LOADED(Positions)
#endif

// Attributes that follow each other without a gap may share a word, which is stored with the second of them. Whether they do depends
// on formats only: the attributes before it are then not whole words together.

// The bytes of an attribute and, if it begins in the middle of a word, of the half before it. `before`: bytes of the attributes
// before it.
uint bytesFromWord(uint before, uint format) { return before % 4u + formatBytes(format); }

// Puts the last two bytes of the attribute before it, which has this format, before an attribute.
uvec4 behindHalf(uvec4 before, uint format, uvec4 words) {
  uint first = formatBytes(format) - 2u;
  uint last = (before[first / 4u] >> (first % 4u * 8u)) & 0xffffu;
  return uvec4(last, words.xyz >> 16u) | (words << 16u);
}

// Makes all attributes begin at the beginning of a word.
void joinAttributes(uvec4 position, inout uvec4 normal, inout uvec4 tangent) {
  uint positions = formatBytes(POSITION_FORMAT);
  if ((positions + formatBytes(NORMAL_FORMAT)) % 4u != 0u) {
    if (NORMALS) {
      tangent = behindHalf(normal, NORMAL_FORMAT, tangent);
    } else {
      tangent = behindHalf(position, POSITION_FORMAT, tangent);
    }
  }
  if (positions % 4u != 0u) normal = behindHalf(position, POSITION_FORMAT, normal);
}

#if defined(TEXELS) || defined(STAGED)
// All attributes of a vertex, which are adjacent in memory and joined. Sizes are constants, so that only moves remain after
// compilation.
uint[12] recordWords(uvec4 position, uvec4 normal, uvec4 tangent) {
  uint words[12] = uint[12](position.x, position.y, position.z, position.w, 0u, 0u, 0u, 0u, 0u, 0u, 0u, 0u);
  uint positions = formatBytes(POSITION_FORMAT);
  uint normals = formatBytes(NORMAL_FORMAT);
  for (uint i = 0u; i < 4u; ++i) words[positions / 4u + i] = normal[i];
  for (uint i = 0u; i < 4u; ++i) words[(positions + normals) / 4u + i] = tangent[i];
  return words;
}
#endif

#ifdef TEXELS
#include "cpu_device/wide_stores.glsl"
#elif defined(STAGED)
layout(set = 0, binding = BINDING_POSITIONS, std430) writeonly buffer PositionsUnits { uvec4 positionsUnits[]; };
layout(set = 0, binding = BINDING_POSITIONS, std430) writeonly buffer PositionsPairs { uvec2 positionsPairs[]; };

// A GPU writes memory in units of 32 or 64 bytes. If each invocation stored the words of a record one by one, neighbors would write
// to the same units several times. So records are stored 16 or 8 bytes at a time. Where they begin elsewhere, the records of a
// workgroup are first gathered in shared memory. There is space for two sets: the next instance may be written while this one is
// read, so one barrier per instance is enough.
const uint RECORD_WORDS = RECORD / 4u;
const uint STAGED_WORDS = gl_WorkGroupSize.x * RECORD_WORDS + 3u;
shared uint staged[STAGED_WORDS * 2u];
uint stagedRecords;     // records of this workgroup: fewer than its invocations if fewer vertices are left in the group
uint firstStaged = 0u;  // start of the half that is filled next

// Stores a record of the workgroup whose records begin at the word `begin`, unless they begin at no multiple of 8 bytes.
bool storeUnits(uint begin, uint words[12]) {
  uint word = begin + gl_LocalInvocationID.x * RECORD_WORDS;
  bool byUnits = RECORD % 16u == 0u && begin % 4u == 0u;
  bool byPairs = RECORD % 8u == 0u && begin % 2u == 0u;
  if (gl_LocalInvocationID.x < stagedRecords) {
    if (byUnits) {
      for (uint i = 0u; i < RECORD_WORDS; i += 4u) {
        positionsUnits[word / 4u + i / 4u] = uvec4(words[i], words[i + 1u], words[i + 2u], words[i + 3u]);
      }
    } else if (byPairs) {
      for (uint i = 0u; i < RECORD_WORDS; i += 2u) positionsPairs[word / 2u + i / 2u] = uvec2(words[i], words[i + 1u]);
    }
  }
  return byUnits || byPairs;
}

// `place` is that of the first record of the workgroup, so that compilers see that it is the same for all invocations.
void storeRecord(uint place, uvec4 position, uvec4 normal, uvec4 tangent) {
  uint own = gl_LocalInvocationID.x;
  uint begin = place / 4u;  // word at which the workgroup's records begin
  uint first = begin % 4u;  // relative to the 16-byte unit that contains it
  uint words[12] = recordWords(position, normal, tangent);
  if (storeUnits(begin, words)) return;
  uint filled = firstStaged;
  firstStaged = STAGED_WORDS - filled;
  for (uint i = 0u; i < RECORD_WORDS; ++i) staged[filled + first + own * RECORD_WORDS + i] = words[i];
  barrier();
  uint end = first + stagedRecords * RECORD_WORDS;
  for (uint word = own * 4u; word < end; word += gl_WorkGroupSize.x * 4u) {
    uint from = filled + word;
    uint to = begin - first + word;
    if (word >= first && word + 4u <= end) {
      positionsUnits[to / 4u] = uvec4(staged[from], staged[from + 1u], staged[from + 2u], staged[from + 3u]);
    } else {
      for (uint i = 0u; i < 4u; ++i) {
        if (word + i >= first && word + i < end) wordsPositions[to + i] = staged[from + i];
      }
    }
  }
}
#else
void storeRecord(uint place, uvec4 position, uvec4 normal, uvec4 tangent) {}
#endif
#ifndef TEXELS
uint recordPlace(uint byte) { return byte; }
void storePositionAndNormal(uint place, uvec3 position, uvec3 normal) {}
#endif

#ifdef ONE_OUTPUT
#define storeNormals storePositions
#define storeTangents storePositions
#define storePrevious storePositions
#else
STORED(Normals, BINDING_NORMALS)
STORED(Tangents, BINDING_TANGENTS)
#ifdef EXTRAS
STORED(Previous, BINDING_PREVIOUS)
#endif
#endif

#endif
