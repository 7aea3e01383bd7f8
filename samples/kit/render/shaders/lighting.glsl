// Visibility of the lights; also the background and dithering. The key light has a penumbra that grows with the distance to the
// occluder. The sky consists of many weak lights, each with its own shadow map. Together they give ambient light with occlusion by
// nearby surfaces: dark under the chin, between the legs, and where a foot meets the ground.
#ifndef DERMIS_RENDER_LIGHTING_GLSL
#define DERMIS_RENDER_LIGHTING_GLSL

#include "view.glsl"

layout(set = 0, binding = 1) uniform sampler2DShadow keyShadow;
layout(set = 0, binding = 2) uniform sampler2D keyDepth;
layout(set = 0, binding = 3) uniform sampler2DArrayShadow skyShadows;

layout(constant_id = 0) const int blockerTaps = 20;
layout(constant_id = 1) const int penumbraTaps = 32;
layout(constant_id = 2) const int skyTaps = 4;

// Sample positions on a disc of radius 1, well separated from each other (Vogel 1979, "A better way
// to construct the sunflower head").
vec2 discTap(int index, int count) {
  float angle = float(index) * 2.39996323;
  return sqrt((float(index) + 0.5) / float(count)) * vec2(cos(angle), sin(angle));
}

// Moves a position away from the surface by about the width of a texel, more at grazing light, so
// that a coarse shadow map does not make a sloped surface shadow itself.
vec3 offsetFromSurface(vec3 position, vec3 normal, float cosine, float texel) {
  float sine = sqrt(max(1.0 - cosine * cosine, 0.0));
  return position + normal * texel * (0.6 + 1.4 * sine);
}

// Fernando 2005, "Percentage-closer soft shadows".
float keyVisibility(vec3 position, vec3 normal) {
  float cosine = max(dot(normal, view.keyDirection.xyz), 0.0);
  vec3 place = (view.keyMatrix * vec4(offsetFromSurface(position, normal, cosine, view.shadow.x), 1.0)).xyz;
  vec2 uv = place.xy * 0.5 + 0.5;
  if (any(lessThan(uv, vec2(0.0))) || any(greaterThan(uv, vec2(1.0)))) return 1.0;
  float texel = view.shadow.w;

  float reach = max(view.sky.z / view.shadow.x, 2.0) * texel;
  float sum = 0.0, count = 0.0;
  for (int i = 0; i < blockerTaps; ++i) {
    float depth = textureLod(keyDepth, uv + reach * discTap(i, blockerTaps), 0.0).r;
    if (depth < place.z) {
      sum += depth;
      count += 1.0;
    }
  }
  if (count == 0.0) return 1.0;
  float distance = (place.z - sum / count) * view.shadow.y;
  float radius = clamp(distance * view.keyDirection.w / view.shadow.x, 1.2, reach / texel) * texel;
  float visible = 0.0;
  for (int i = 0; i < penumbraTaps; ++i) {
    visible += texture(keyShadow, vec3(uv + radius * discTap(i, penumbraTaps), place.z));
  }
  return visible / float(penumbraTaps);
}

// `radius` is that of the filter, as a fraction of the map.
float skyVisibility(int light, vec3 position, vec3 normal, float cosine, float radius) {
  vec3 place =
      (view.skyMatrices[light] * vec4(offsetFromSurface(position, normal, cosine, view.shadow.z), 1.0)).xyz;
  vec2 uv = place.xy * 0.5 + 0.5;
  if (any(lessThan(uv, vec2(0.0))) || any(greaterThan(uv, vec2(1.0)))) return 1.0;
  float visible = 0.0;
  for (int i = 0; i < skyTaps; ++i) {
    visible += texture(skyShadows, vec4(uv + radius * discTap(i, skyTaps), float(light), place.z));
  }
  return visible / float(skyTaps);
}

// Sky light that reaches a surface: x with occlusion, y without.
vec2 skyLight(vec3 position, vec3 normal, float radius) {
  vec2 light = vec2(0.0);
  for (int i = 0; i < int(view.sky.x); ++i) {
    float cosine = dot(normal, view.skyDirections[i].xyz);
    if (cosine <= 0.0) continue;
    float share = cosine * view.skyDirections[i].w;
    light += share * vec2(skyVisibility(i, position, normal, cosine, radius), 1.0);
  }
  return light;
}

// The background as displayed, in linear values: a radial gradient from `horizonColor`, a little below the center, to
// `zenithColor`.
vec3 backgroundAt(vec2 pixel) {
  vec2 place = (pixel - view.viewport.xy) / view.viewport.zw;
  vec2 fromCenter = place - vec2(0.5, 0.62);
  float far = smoothstep(0.0, 1.0, length(fromCenter * vec2(0.75, 1.0)) * 1.1);
  return mix(view.horizonColor.rgb, view.zenithColor.rgb, far);
}

// Ordered dithering (Bayer 1973, "An optimum method for two-level rendition of continuous-tone pictures") by up to half a step of 8
// bits, so that gradients have no bands. In linear values; the target stores sRGB.
vec3 dithered(vec3 color, vec2 pixel) {
  uvec2 place = uvec2(pixel) & 1u;
  float amount = (float((place.x ^ place.y) << 1 | place.y) + 0.5) / 4.0 - 0.5;
  return color + amount * 2.2 / 255.0 * pow(max(color, vec3(1e-4)), vec3(0.545));
}

#endif
