#version 450
#extension GL_GOOGLE_include_directive : require

// Lists the active morph targets of instances whose weights are made on the GPU, as the CPU lists those of others: in ascending
// order, without weights of 0. Weights are in a buffer, or sampled from clips. An invocation for each instance.

#define TABLES_ARE_WRITTEN
#include "abi.h"
#include "clips.glsl"
#include "tables.glsl"

layout(local_size_x_id = CONSTANT_WORKGROUP_SIZE) in;

layout(push_constant) uniform Push { MorphListPush push; };

layout(set = 0, binding = BINDING_WEIGHTS, std430) restrict readonly buffer Weights { uint writtenWeights[]; };

struct Layer {
  float time;
  uint bits;
  float factor;  // weight × mask
};

Layer layerOf(uint record, MorphListRecord list, uint number) {
  uvec4 two = tableUnit(record + MORPH_LIST_LAYERS + number / 2u * 4u);
  uvec2 own = number % 2u == 0u ? two.xy : two.zw;
  precise float factor = fromHalf(own.y >> 16u);
  uint mask = own.y >> 10u & 31u;
  if (mask != 0u) factor = factor * uintBitsToFloat(clipWord(list.masks + mask - 1u));
  return Layer(uintBitsToFloat(own.x), own.y, factor);
}

// The sum of the factors of layers that are not additive.
float sumOfFactors(uint record, MorphListRecord list) {
  precise float sum = 0.0;
  for (uint i = 0u; i < list.layerCount; ++i) {
    Layer layer = layerOf(record, list, i);
    if ((layer.bits & LAYER_ADDITIVE) == 0u) sum = sum + layer.factor;
  }
  return sum;
}

// Three weights: the mean of the layers, to which additive layers are added, which come last.
vec3 sampleGroup(uint record, MorphListRecord list, float sum, uint group) {
  uint word = list.weights + 3u * group;
  vec4 rest = uintBitsToFloat(uvec4(clipWord(word), clipWord(word + 1u), clipWord(word + 2u), 0u));
  vec3 value = sum > 0.0 ? vec3(0.0) : rest.xyz;
  uint clips = list.clips + clipUnit((list.clips + CLIPS_OFFSETS) / 4u).z;
  for (uint i = 0u; i < list.layerCount; ++i) {
    Layer layer = layerOf(record, list, i);
    bool isAdditive = (layer.bits & LAYER_ADDITIVE) != 0u;
    if (!isAdditive && !(layer.factor > 0.0 && sum > 0.0)) continue;
    uint unit = (clips + (layer.bits & 1023u) * CLIP_WORDS) / 4u;
    uvec4 ofClip = clipUnit(unit + 1u);  // offsets of classes and tracks
    precise float frame = layer.time * uintBitsToFloat(clipUnit(unit).y);
    uint track = clipWord(list.clips + ofClip.y + list.track + group);
    vec3 x = sampleTrack(ClipTime(list.clips, ofClip.x, frame), track, false, isAdditive ? vec4(0.0) : rest).xyz;
    float share = isAdditive ? layer.factor : quotient(layer.factor, sum);
    precise vec3 next = fma(vec3(share), x, value);
    value = next;
  }
  return value;
}

void main() {
  uint number = workgroupNumber() * gl_WorkGroupSize.x + gl_LocalInvocationID.x;
  if (number >= push.listCount) return;
  uint record = push.lists + number * MORPH_LIST_WORDS;
  MorphListRecord list = loadMorphList(record);
  bool isSampled = list.clips != MORPH_LIST_NO_CLIPS;
  float sum = isSampled ? sumOfFactors(record, list) : 0.0;
  uvec3 group = uvec3(0u);
  uint word = list.list;
  for (uint target = 0u; target < list.weightCount; ++target) {
    uint weight;  // the bits of a float
    if (isSampled) {
      if (target % 3u == 0u) group = floatBitsToUint(sampleGroup(record, list, sum, target / 3u));
      weight = target % 3u == 0u ? group.x : target % 3u == 1u ? group.y : group.z;
    } else {
      weight = writtenWeights[list.weights + target];
    }
    if ((weight & 0x7fffffffu) == 0u) continue;
    tables[word] = target;
    tables[word + 1u] = weight;
    word += ACTIVE_MORPH_WORDS;
  }
  tables[list.extension + EXTENSION_MORPH_COUNT] = (word - list.list) / ACTIVE_MORPH_WORDS;
}
