#ifndef DERMIS_RENDER_TONE_GLSL
#define DERMIS_RENDER_TONE_GLSL

// Khronos 2024, "PBR Neutral": base colors are unchanged, only highlights are compressed.
vec3 toneMapped(vec3 color) {
  const float start = 0.8 - 0.04;
  const float desaturation = 0.15;
  float least = min(color.r, min(color.g, color.b));
  color -= least < 0.08 ? least - 6.25 * least * least : 0.04;
  float peak = max(color.r, max(color.g, color.b));
  if (peak < start) return color;
  float room = 1.0 - start;
  float compressed = 1.0 - room * room / (peak + room - start);
  color *= compressed / peak;
  float gray = 1.0 - 1.0 / (desaturation * (peak - compressed) + 1.0);
  return mix(color, vec3(compressed), gray);
}

#endif
