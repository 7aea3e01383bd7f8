#version 450
#extension GL_GOOGLE_include_directive : require
#extension GL_EXT_control_flow_attributes : require

// Samples the local transforms of figures: for each node the weighted mean of its layers, to which additive layers are added. A
// workgroup for each figure, an invocation for each of its nodes (docs/clips.md).

#include "abi.h"
#include "clips.glsl"
#include "tables.glsl"

layout(local_size_x_id = CONSTANT_WORKGROUP_SIZE) in;

layout(push_constant) uniform Push { SamplePush push; };

layout(set = 0, binding = BINDING_PALETTES, std430) restrict writeonly buffer Transforms { uvec4 transforms[]; };

// The time and the bits of a layer.
uvec2 layerAt(uint word) {
  uvec4 two = tableUnit(word);
  return word % 4u == 0u ? two.xy : two.zw;
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

// `offsets` are those of the bank.
Local sampleNode(uint firstLayer, uint layersEnd, BankRecord bank, uvec4 offsets, uint node, Local rest) {
  precise float weights = 0.0;
  for (uint word = firstLayer; word < layersEnd; word += 2u) {
    uint bits = layerAt(word).y;
    if ((bits & LAYER_ADDITIVE) == 0u) weights = weights + weightOf(bits, bank, offsets.w, node);
  }
  Local value = Local(vec4(0.0), vec4(0.0), vec4(0.0));
  vec4 first = vec4(0.0);
  bool hasWeight = false;
  bool isMean = false;
  for (uint word = firstLayer; word < layersEnd; word += 2u) {
    uvec2 layer = layerAt(word);
    bool isAdditive = (layer.y & LAYER_ADDITIVE) != 0u;
    float weight = weightOf(layer.y, bank, offsets.w, node);
    if (!isAdditive && !(weight > 0.0)) continue;
    if (isAdditive && !isMean) {
      value = meanOf(value, hasWeight, rest);
      isMean = true;
    }
    float share = isAdditive ? weight : quotient(weight, weights);
    uint unit = (bank.clips + offsets.z + (layer.y & 1023u) * CLIP_WORDS) / 4u;
    uvec4 ofClip = clipUnit(unit + 1u);  // offsets of classes and tracks
    precise float frame = uintBitsToFloat(layer.x) * uintBitsToFloat(clipUnit(unit).y);
    ClipTime at = ClipTime(bank.clips, ofClip.x, frame);
    uint tracks = bank.clips + ofClip.y + 3u * node;
    [[dont_unroll]] for (uint path = 0u; path < 3u; ++path) {
      vec4 still = path == PATH_ROTATION ? rest.rotation : path == PATH_SCALE ? rest.scale : rest.translation;
      if (isAdditive) still = path == PATH_ROTATION ? vec4(0.0, 0.0, 0.0, 1.0) : vec4(path == PATH_SCALE ? 1.0 : 0.0);
      vec4 x = sampleTrack(at, clipWord(tracks + path), path == PATH_ROTATION, still);
      if (path == PATH_ROTATION) {
        if (!hasWeight) first = x;
        precise vec4 sum = fma(vec4(dot4(first, x) < 0.0 ? -share : share), x, value.rotation);
        value.rotation = isAdditive ? addedRotation(value.rotation, x, weight) : sum;
      } else if (path == PATH_SCALE) {
        precise vec4 sum = fma(vec4(share), x, value.scale);
        precise vec4 grown = value.scale * (1.0 + share * (x - 1.0));
        value.scale = isAdditive ? grown : sum;
      } else {
        precise vec4 sum = fma(vec4(share), x, value.translation);
        value.translation = sum;
      }
    }
    hasWeight = true;
  }
  return isMean ? value : meanOf(value, hasWeight, rest);
}

void main() {
  uint number = workgroupNumber();
  if (number >= push.workgroupCount) return;
  uint record = push.figures + number * FIGURE_WORDS;
  uvec4 figure = tableUnit(record);  // the first words of a FigureRecord
  if ((figure.z & FIGURE_NEEDED) == 0u) return;
  uint firstLayer = record + 4u;
  uint layersEnd = firstLayer + 2u * (figure.z & ~FIGURE_NEEDED);
  BankRecord bank = loadBank(figure.w);
  uvec4 offsets = clipUnit((bank.clips + CLIPS_OFFSETS) / 4u);
  for (uint node = gl_LocalInvocationID.x; node < bank.nodeCount; node += gl_WorkGroupSize.x) {
    uint unit = (bank.clips + offsets.x + node * CLIP_NODE_WORDS) / 4u;
    uvec4 a = clipUnit(unit);
    vec4 b = uintBitsToFloat(clipUnit(unit + 1u));
    vec4 c = uintBitsToFloat(clipUnit(unit + 2u));
    Local rest = Local(vec4(uintBitsToFloat(a.w), b.xy, 0.0), vec4(b.zw, c.xy),
                       vec4(c.zw, uintBitsToFloat(clipUnit(unit + 3u).x), 0.0));
    Local sampled = sampleNode(firstLayer, layersEnd, bank, offsets, node, rest);
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
  }
}
