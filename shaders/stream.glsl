// One output attribute: declares its buffer as words and, if the kernel may store smaller or larger units, as halves, bytes and
// vectors. Included once for each attribute that has its own binding. STREAM, a name, and STREAM_BINDING must be defined before.
// Declares store##STREAM and, with STREAM_LOADS, load##STREAM.

#ifndef JOIN
#define JOIN_(a, b) a##b
#define JOIN(a, b) JOIN_(a, b)
#endif

layout(set = 0, binding = STREAM_BINDING, std430) buffer JOIN(Words, STREAM) { uint JOIN(words, STREAM)[]; };
#ifdef HALVES
layout(set = 0, binding = STREAM_BINDING, std430) buffer JOIN(Halves, STREAM) { uint16_t JOIN(halves, STREAM)[]; };
#endif
#ifdef BYTES
layout(set = 0, binding = STREAM_BINDING, std430) buffer JOIN(Bytes, STREAM) { uint8_t JOIN(bytes, STREAM)[]; };
#endif

#ifdef TEXELS
layout(set = 0, binding = STREAM_BINDING, scalar) buffer JOIN(Vectors2, STREAM) { uvec2 JOIN(vectors2, STREAM)[]; };
layout(set = 0, binding = STREAM_BINDING, scalar) buffer JOIN(Vectors3, STREAM) { uvec3 JOIN(vectors3, STREAM)[]; };
layout(set = 0, binding = STREAM_BINDING, scalar) buffer JOIN(Vectors4, STREAM) { uvec4 JOIN(vectors4, STREAM)[]; };
#endif

// Stores the first `size` bytes of `words`, `unit` bytes at a time, and changes no other bytes. `place` is a byte offset.
void JOIN(store, STREAM)(uint place, uvec4 words, uint size, uint unit) {
#ifdef BYTES
  if (unit == 1u) {
    for (uint i = 0u; i < size; ++i) JOIN(bytes, STREAM)[place + i] = uint8_t((words[i / 4u] >> (i % 4u * 8u)) & 0xffu);
    return;
  }
#endif
#ifdef HALVES
  if (unit == 2u) {
    uint first = place / 2u;
    for (uint i = 0u; i < size / 2u; ++i) JOIN(halves, STREAM)[first + i] = uint16_t((words[i / 2u] >> (i % 2u * 16u)) & 0xffffu);
    return;
  }
#endif
#ifdef TEXELS
  if (unit > 4u) {
    if (unit == 8u) JOIN(vectors2, STREAM)[place / 8u] = words.xy;
    if (unit == 12u) JOIN(vectors3, STREAM)[place / 12u] = words.xyz;
    if (unit == 16u) JOIN(vectors4, STREAM)[place / 16u] = words;
    return;
  }
#endif
  uint word = place / 4u;
  JOIN(words, STREAM)[word] = words.x;
  if (size > 4u) JOIN(words, STREAM)[word + 1u] = words.y;
  if (size > 8u) JOIN(words, STREAM)[word + 2u] = words.z;
  if (size > 12u) JOIN(words, STREAM)[word + 3u] = words.w;
}

#ifdef STREAM_LOADS
// Loads what is stored at `place`.
uvec4 JOIN(load, STREAM)(uint place, uint size, uint unit) {
  uvec4 words = uvec4(0u);
#ifdef BYTES
  if (unit == 1u) {
    for (uint i = 0u; i < size; ++i) words[i / 4u] |= uint(JOIN(bytes, STREAM)[place + i]) << (i % 4u * 8u);
    return words;
  }
#endif
#ifdef HALVES
  if (unit == 2u) {
    uint first = place / 2u;
    for (uint i = 0u; i < size / 2u; ++i) words[i / 2u] |= uint(JOIN(halves, STREAM)[first + i]) << (i % 2u * 16u);
    return words;
  }
#endif
#ifdef TEXELS
  if (unit > 4u) {
    if (unit == 8u) words.xy = JOIN(vectors2, STREAM)[place / 8u];
    if (unit == 12u) words.xyz = JOIN(vectors3, STREAM)[place / 12u];
    if (unit == 16u) words = JOIN(vectors4, STREAM)[place / 16u];
    return words;
  }
#endif
  uint word = place / 4u;
  words.x = JOIN(words, STREAM)[word];
  if (size > 4u) words.y = JOIN(words, STREAM)[word + 1u];
  if (size > 8u) words.z = JOIN(words, STREAM)[word + 2u];
  if (size > 12u) words.w = JOIN(words, STREAM)[word + 3u];
  return words;
}
#undef STREAM_LOADS
#endif

#undef STREAM
#undef STREAM_BINDING
