#version 450
#extension GL_GOOGLE_include_directive : require

// Samples the local transforms of figures: for each node the weighted mean of its layers, to which additive layers are added. A
// workgroup for each figure, an invocation for each of its nodes (docs/clips.md).

#include "abi.h"
#include "clips.glsl"
#include "tables.glsl"

layout(local_size_x_id = CONSTANT_WORKGROUP_SIZE) in;

layout(push_constant) uniform Push { SamplePush push; };

layout(set = 0, binding = BINDING_PALETTES, std430) restrict writeonly buffer Transforms { uvec4 transforms[]; };

// Loops test at their end, for lavapipe (cpu_device/skin_instances.glsl).

// Of a figure.
struct Layers {
  uvec4 first;  // the time and the bits of two layers
  uvec4 last;
  uint count;
};

uvec2 layerAt(Layers layers, uint number) {
  uvec4 two = number < 2u ? layers.first : layers.last;
  return (number & 1u) == 0u ? two.xy : two.zw;
}

// Of a layer, for a node. `masks`: the offset of the masks in the bank.
float weightOf(uint bits, BankRecord bank, uint masks, uint node) {
  uint mask = bits >> 10u & 31u;
  precise float weight = fromHalf(bits >> 16u);
  if (mask != 0u) weight = weight * uintBitsToFloat(clipWord(bank.clips + masks + (mask - 1u) * bank.nodeCount + node));
  return weight;
}

vec4 addedRotation(vec4 value, vec4 difference, float weight) {
  if (difference.w < 0.0) difference = -difference;
  precise vec4 turn = weight * difference;
  precise float unturned = 1.0 - weight;
  turn.w = turn.w + unturned;
  return unitOrIdentity(quaternionProduct(value, unitOrIdentity(turn)));
}

struct Local {
  vec4 translation;
  vec4 rotation;
  vec4 scale;
};

// The weighted mean of layers, from the sum of their shares.
Local meanOf(Local sum, bool hasWeight, Local rest) {
  if (!hasWeight) return rest;
  return Local(sum.translation, unitOrIdentity(sum.rotation), sum.scale);
}

// `tracks`: the word of the first of a node's three. `still`: what tracks without numbers have.
Local sampleTracks(ClipTime at, uint tracks, Local still) {
  Local value = still;
  uvec3 words = clipThreeWords(tracks);  // translation, rotation, scale
  bvec3 isLeft = notEqual(words >> 30u, uvec3(TRACK_AT_REST));
  // Rarely more than the rotation: once for most nodes.
  if (any(isLeft)) do {
    bool isRotation = isLeft.y;
    bool isTranslation = !isLeft.y && isLeft.x;
    uint word = isRotation ? words.y : isTranslation ? words.x : words.z;
    vec4 x = sampleTrack(at, word, isRotation);
    if (isRotation) {
      value.rotation = x;
      isLeft.y = false;
    } else if (isTranslation) {
      value.translation = x;
      isLeft.x = false;
    } else {
      value.scale = x;
      isLeft.z = false;
    }
  } while (any(isLeft));
  return value;
}

// `offsets` are those of the bank.
Local sampleNode(Layers layers, BankRecord bank, uvec4 offsets, uint node, Local rest) {
  if (layers.count == 0u) return rest;
  precise float weights = 0.0;
  uint number = 0u;
  do {
    uint bits = layerAt(layers, number).y;
    if ((bits & LAYER_ADDITIVE) == 0u) weights = weights + weightOf(bits, bank, offsets.w, node);
  } while (++number < layers.count);
  Local value = Local(vec4(0.0), vec4(0.0), vec4(0.0));
  vec4 first = vec4(0.0);
  bool hasWeight = false;
  bool isMean = false;
  number = 0u;
  do {
    uvec2 layer = layerAt(layers, number++);
    bool isAdditive = (layer.y & LAYER_ADDITIVE) != 0u;
    float weight = weightOf(layer.y, bank, offsets.w, node);
    if (isAdditive && !isMean) {
      value = meanOf(value, hasWeight, rest);
      isMean = true;
    }
    if (!isAdditive && !(weight > 0.0)) continue;
    float share = isAdditive ? weight : quotient(weight, weights);
    uint unit = (bank.clips + offsets.z + (layer.y & 1023u) * CLIP_WORDS) / 4u;
    uvec4 ofClip = clipUnit(unit + 1u);  // offsets of classes and tracks
    precise float frame = uintBitsToFloat(layer.x) * uintBitsToFloat(clipUnit(unit).y);
    Local still = rest;
    if (isAdditive) still = Local(vec4(0.0), vec4(0.0, 0.0, 0.0, 1.0), vec4(1.0));
    Local x = sampleTracks(ClipTime(bank.clips, ofClip.x, frame), bank.clips + ofClip.y + 3u * node, still);
    precise vec4 translation = fma(vec4(share), x.translation, value.translation);
    value.translation = translation;
    if (isAdditive) {
      value.rotation = addedRotation(value.rotation, x.rotation, weight);
      precise vec4 scale = value.scale * (1.0 + share * (x.scale - 1.0));
      value.scale = scale;
    } else {
      if (!hasWeight) first = x.rotation;
      precise vec4 rotation = fma(vec4(dot4(first, x.rotation) < 0.0 ? -share : share), x.rotation, value.rotation);
      precise vec4 scale = fma(vec4(share), x.scale, value.scale);
      value.rotation = rotation;
      value.scale = scale;
    }
    hasWeight = true;
  } while (number < layers.count);
  return isMean ? value : meanOf(value, hasWeight, rest);
}

void main() {
  uint number = workgroupNumber();
  if (number >= push.workgroupCount) return;
  uint record = push.figures + number * FIGURE_WORDS;
  uvec4 figure = tableUnit(record);  // the first words of a FigureRecord
  if ((figure.z & FIGURE_NEEDED) == 0u) return;
  Layers layers = Layers(tableUnit(record + 4u), tableUnit(record + 8u), figure.z & ~FIGURE_NEEDED);
  BankRecord bank = loadBank(figure.w);
  uvec4 offsets = clipUnit((bank.clips + CLIPS_OFFSETS) / 4u);
  uint node = gl_LocalInvocationID.x;
  if (node < bank.nodeCount) do {
    uint unit = (bank.clips + offsets.x + node * CLIP_NODE_WORDS) / 4u;
    uvec4 a = clipUnit(unit);
    vec4 b = uintBitsToFloat(clipUnit(unit + 1u));
    vec4 c = uintBitsToFloat(clipUnit(unit + 2u));
    Local rest = Local(vec4(uintBitsToFloat(a.w), b.xy, 0.0), vec4(b.zw, c.xy),
                       vec4(c.zw, uintBitsToFloat(clipUnit(unit + 3u).x), 0.0));
    Local sampled = sampleNode(layers, bank, offsets, node, rest);
    vec3 r0;
    vec3 r1;
    vec3 r2;
    rowsOfQuaternion(sampled.rotation, r0, r1, r2);
    precise vec3 s0 = r0 * sampled.scale.xyz;
    precise vec3 s1 = r1 * sampled.scale.xyz;
    precise vec3 s2 = r2 * sampled.scale.xyz;
    Transform local = Transform(vec4(s0, sampled.translation.x), vec4(s1, sampled.translation.y), vec4(s2, sampled.translation.z));
    if (a.z != 0u) local = multiply(loadTransform(bank.clips + a.z), local);
    uint place = figure.x + node * UNITS_OF_TRANSFORM;
    transforms[place] = floatBitsToUint(local.r0);
    transforms[place + 1u] = floatBitsToUint(local.r1);
    transforms[place + 2u] = floatBitsToUint(local.r2);
    node += gl_WorkGroupSize.x;
  } while (node < bank.nodeCount);
}
