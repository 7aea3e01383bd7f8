// One output attribute: declares its buffer as words and, if the kernel may store smaller or larger units, as halves, bytes and
// vectors. Included once for each attribute that has its own binding. STREAM_BINDING and the names to declare must be defined
// before.

layout(set = 0, binding = STREAM_BINDING, std430) buffer STREAM_WORDS_BLOCK { uint STREAM_WORDS[]; };
#ifdef HALVES
layout(set = 0, binding = STREAM_BINDING, std430) buffer STREAM_HALVES_BLOCK { uint16_t STREAM_HALVES[]; };
#endif
#ifdef BYTES
layout(set = 0, binding = STREAM_BINDING, std430) buffer STREAM_BYTES_BLOCK { uint8_t STREAM_BYTES[]; };
#endif

#ifdef WIDE
layout(set = 0, binding = STREAM_BINDING, scalar) buffer STREAM_VECTORS_2_BLOCK { uvec2 STREAM_VECTORS_2[]; };
layout(set = 0, binding = STREAM_BINDING, scalar) buffer STREAM_VECTORS_3_BLOCK { uvec3 STREAM_VECTORS_3[]; };
layout(set = 0, binding = STREAM_BINDING, scalar) buffer STREAM_VECTORS_4_BLOCK { uvec4 STREAM_VECTORS_4[]; };
#endif

// Stores the first `size` bytes of `words`, `unit` bytes at a time, and changes no other bytes. `place` is a byte offset.
void STREAM_STORE(uint place, uvec4 words, uint size, uint unit) {
#ifdef BYTES
  if (unit == 1u) {
    for (uint i = 0u; i < size; ++i) STREAM_BYTES[place + i] = uint8_t((words[i / 4u] >> (i % 4u * 8u)) & 0xffu);
    return;
  }
#endif
#ifdef HALVES
  if (unit == 2u) {
    uint first = place / 2u;
    for (uint i = 0u; i < size / 2u; ++i) STREAM_HALVES[first + i] = uint16_t((words[i / 2u] >> (i % 2u * 16u)) & 0xffffu);
    return;
  }
#endif
#ifdef WIDE
  if (unit > 4u) {
    if (unit == 8u) STREAM_VECTORS_2[place / 8u] = words.xy;
    if (unit == 12u) STREAM_VECTORS_3[place / 12u] = words.xyz;
    if (unit == 16u) STREAM_VECTORS_4[place / 16u] = words;
    return;
  }
#endif
  uint word = place / 4u;
  STREAM_WORDS[word] = words.x;
  if (size > 4u) STREAM_WORDS[word + 1u] = words.y;
  if (size > 8u) STREAM_WORDS[word + 2u] = words.z;
  if (size > 12u) STREAM_WORDS[word + 3u] = words.w;
}

#ifdef STREAM_LOAD
// Loads what is stored at `place`.
uvec4 STREAM_LOAD(uint place, uint size, uint unit) {
  uvec4 words = uvec4(0u);
#ifdef BYTES
  if (unit == 1u) {
    for (uint i = 0u; i < size; ++i) words[i / 4u] |= uint(STREAM_BYTES[place + i]) << (i % 4u * 8u);
    return words;
  }
#endif
#ifdef HALVES
  if (unit == 2u) {
    uint first = place / 2u;
    for (uint i = 0u; i < size / 2u; ++i) words[i / 2u] |= uint(STREAM_HALVES[first + i]) << (i % 2u * 16u);
    return words;
  }
#endif
#ifdef WIDE
  if (unit > 4u) {
    if (unit == 8u) words.xy = STREAM_VECTORS_2[place / 8u];
    if (unit == 12u) words.xyz = STREAM_VECTORS_3[place / 12u];
    if (unit == 16u) words = STREAM_VECTORS_4[place / 16u];
    return words;
  }
#endif
  uint word = place / 4u;
  words.x = STREAM_WORDS[word];
  if (size > 4u) words.y = STREAM_WORDS[word + 1u];
  if (size > 8u) words.z = STREAM_WORDS[word + 2u];
  if (size > 12u) words.w = STREAM_WORDS[word + 3u];
  return words;
}
#undef STREAM_LOAD
#endif

#undef STREAM_BINDING
#undef STREAM_VECTORS_2_BLOCK
#undef STREAM_VECTORS_2
#undef STREAM_VECTORS_3_BLOCK
#undef STREAM_VECTORS_3
#undef STREAM_VECTORS_4_BLOCK
#undef STREAM_VECTORS_4
#undef STREAM_WORDS_BLOCK
#undef STREAM_WORDS
#undef STREAM_HALVES_BLOCK
#undef STREAM_HALVES
#undef STREAM_BYTES_BLOCK
#undef STREAM_BYTES
#undef STREAM_STORE
