// Stores a vertex, or a position and a normal, at once: lavapipe stores each lane separately, so that fewer stores take less time.
#ifndef DERMIS_WIDE_STORES_GLSL
#define DERMIS_WIDE_STORES_GLSL

layout(set = 0, binding = BINDING_POSITIONS, std430) writeonly buffer PositionsPairs { uint64_t positionsPairs[]; };

// Stores a position and the normal after it, two words at a time.
void storePositionAndNormal(uint place, uvec3 position, uvec3 normal) {
  uint pair = place / 8u;
  positionsPairs[pair] = packUint2x32(position.xy);
  positionsPairs[pair + 1u] = packUint2x32(uvec2(position.z, normal.x));
  positionsPairs[pair + 2u] = packUint2x32(normal.yz);
}

layout(set = 0, binding = BINDING_POSITIONS, scalar) buffer Records24 { u64vec3 records24[]; };
layout(set = 0, binding = BINDING_POSITIONS, scalar) writeonly buffer Records32 { u64vec4 records32[]; };

// The index of the record at a byte offset. Between evenly spaced instances, `advance` (skin_instances.glsl) adds a constant to the
// index instead, because lavapipe divides slowly.
uint recordPlace(uint byte) { return byte / max(RECORD, 1u); }

// Loads the float32x3 position at the beginning of a 24-byte record.
uvec4 loadRecordPosition(uint index) {
  uvec2 high = unpackUint2x32(records24[index].y);
  return uvec4(unpackUint2x32(records24[index].x), high.x, 0u);
}

// Stores RECORD bytes at once.
void storeRecord(uint index, uvec4 position, uvec4 normal, uvec4 tangent) {
  uint words[12] = recordWords(position, normal, tangent);
  uvec4 low = uvec4(words[0], words[1], words[2], words[3]);
  uvec4 high = uvec4(words[4], words[5], words[6], words[7]);
  switch (RECORD) {
    case 8u:
      vectors2Positions[index] = low.xy;
      break;
    case 12u:
      vectors3Positions[index] = low.xyz;
      break;
    case 16u:
      vectors4Positions[index] = low;
      break;
    case 24u:
      records24[index] = u64vec3(packUint2x32(low.xy), packUint2x32(low.zw), packUint2x32(high.xy));
      break;
    default:
      records32[index] = u64vec4(packUint2x32(low.xy), packUint2x32(low.zw), packUint2x32(high.xy), packUint2x32(high.zw));
  }
}

#endif
