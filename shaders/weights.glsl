// Samples morph weights from clips. They are stored in groups of three, as tracks of translations.
#ifndef DERMIS_WEIGHTS_GLSL
#define DERMIS_WEIGHTS_GLSL

#include "abi.h"
#include "clips.glsl"
#include "tables.glsl"

// What a figure plays, and a node with weights. All but `layers` are words of the mesh buffer, or offsets there.
struct WeightSource {
  uint layers;  // word of the tables: time and bits of each layer
  uint layerCount;
  uint clips;
  uint weights;
  uint track;
  uint masks;
};

struct Layer {
  float time;
  uint bits;
  float factor;  // weight × mask
};

Layer layerOf(WeightSource source, uint number) {
  uvec4 two = tableUnit(source.layers + number / 2u * 4u);
  uvec2 own = number % 2u == 0u ? two.xy : two.zw;
  precise float factor = fromHalf(own.y >> 16u);
  uint mask = own.y >> 10u & 31u;
  if (mask != 0u) factor = factor * uintBitsToFloat(clipWord(source.masks + mask - 1u));
  return Layer(uintBitsToFloat(own.x), own.y, factor);
}

// The sum of the factors of layers that are not additive.
float sumOfFactors(WeightSource source) {
  precise float sum = 0.0;
  for (uint i = 0u; i < source.layerCount; ++i) {
    Layer layer = layerOf(source, i);
    if ((layer.bits & LAYER_ADDITIVE) == 0u) sum = sum + layer.factor;
  }
  return sum;
}

// Three weights: the mean of the layers, to which additive layers are added, which come last. `sum` is that of the factors.
vec3 sampleGroup(WeightSource source, float sum, uint group) {
  uint word = source.weights + 3u * group;
  vec4 rest = uintBitsToFloat(uvec4(clipWord(word), clipWord(word + 1u), clipWord(word + 2u), 0u));
  vec3 value = sum > 0.0 ? vec3(0.0) : rest.xyz;
  uint clips = source.clips + clipUnit((source.clips + CLIPS_OFFSETS) / 4u).z;
  for (uint i = 0u; i < source.layerCount; ++i) {
    Layer layer = layerOf(source, i);
    bool isAdditive = (layer.bits & LAYER_ADDITIVE) != 0u;
    if (!isAdditive && !(layer.factor > 0.0 && sum > 0.0)) continue;
    uint unit = (clips + (layer.bits & 1023u) * CLIP_WORDS) / 4u;
    uvec4 ofClip = clipUnit(unit + 1u);  // offsets of classes and tracks
    precise float frame = layer.time * uintBitsToFloat(clipUnit(unit).y);
    uint track = clipWord(source.clips + ofClip.y + source.track + group);
    vec3 x = isAdditive ? vec3(0.0) : rest.xyz;
    if (trackKind(track) != TRACK_AT_REST) x = sampleTrack(ClipTime(source.clips, ofClip.x, frame), track, false).xyz;
    float share = isAdditive ? layer.factor : quotient(layer.factor, sum);
    precise vec3 next = fma(vec3(share), x, value);
    value = next;
  }
  return value;
}

#endif
