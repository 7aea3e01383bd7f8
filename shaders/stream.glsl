// One output attribute: declares its buffer as words and, with TEXELS, as vectors. Included once for each attribute that has its own
// binding. STREAM, a name, and STREAM_BINDING must be defined before. Declares store##STREAM and, with STREAM_LOADS, load##STREAM.

#ifndef JOIN
#define JOIN_(a, b) a##b
#define JOIN(a, b) JOIN_(a, b)
#endif

layout(set = 0, binding = STREAM_BINDING, std430) buffer JOIN(Words, STREAM) { uint JOIN(words, STREAM)[]; };
#ifdef TEXELS
layout(set = 0, binding = STREAM_BINDING, scalar) buffer JOIN(Vectors2, STREAM) { uvec2 JOIN(vectors2, STREAM)[]; };
layout(set = 0, binding = STREAM_BINDING, scalar) buffer JOIN(Vectors3, STREAM) { uvec3 JOIN(vectors3, STREAM)[]; };
layout(set = 0, binding = STREAM_BINDING, scalar) buffer JOIN(Vectors4, STREAM) { uvec4 JOIN(vectors4, STREAM)[]; };
#endif

// Stores the first `size` bytes of `words` that are whole words, all at once if `wide`, and changes no other bytes. `place` is a
// byte offset; the first word is the one that contains it.
void JOIN(store, STREAM)(uint place, uvec4 words, uint size, bool wide) {
#ifdef TEXELS
  if (wide) {
    if (size == 8u) JOIN(vectors2, STREAM)[place / 8u] = words.xy;
    if (size == 12u) JOIN(vectors3, STREAM)[place / 12u] = words.xyz;
    if (size == 16u) JOIN(vectors4, STREAM)[place / 16u] = words;
    return;
  }
#endif
  uint word = place / 4u;
  if (size >= 4u) JOIN(words, STREAM)[word] = words.x;
  if (size >= 8u) JOIN(words, STREAM)[word + 1u] = words.y;
  if (size >= 12u) JOIN(words, STREAM)[word + 2u] = words.z;
  if (size >= 16u) JOIN(words, STREAM)[word + 3u] = words.w;
}

#ifdef STREAM_LOADS
// Loads what is stored at `place`.
uvec4 JOIN(load, STREAM)(uint place, uint size, bool wide) {
  uvec4 words = uvec4(0u);
#ifdef TEXELS
  if (wide) {
    if (size == 8u) words.xy = JOIN(vectors2, STREAM)[place / 8u];
    if (size == 12u) words.xyz = JOIN(vectors3, STREAM)[place / 12u];
    if (size == 16u) words = JOIN(vectors4, STREAM)[place / 16u];
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
