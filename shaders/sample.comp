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

struct Layer {
  ClipTime at;
  uint tracks;   // word offset in the bank
  float weight;  // of the node
  bool isAdditive;
};

// `offsets` are those of the bank.
Layer layerOf(uint word, uvec4 offsets, uint node) {
  float time = uintBitsToFloat(tables[word]);
  uint bits = tables[word + 1u];
  uint unit = (push.clips + offsets.z + (bits & 1023u) * CLIP_WORDS) / 4u;
  uvec4 a = clipUnits[unit];       // duration, rate, flags, number of classes
  uvec4 b = clipUnits[unit + 1u];  // classes, tracks
  uint mask = bits >> 10u & 31u;
  precise float weight = fromHalf(bits >> 16u);
  if (mask != 0u) weight = weight * uintBitsToFloat(clipWords[push.clips + offsets.w + (mask - 1u) * push.nodeCount + node]);
  precise float frame = time * uintBitsToFloat(a.y);
  return Layer(ClipTime(push.clips, b.x, frame), b.y, weight, (a.z & CLIP_ADDITIVE) != 0u);
}

vec4 noDifference(uint path) {
  if (path == PATH_ROTATION) return vec4(0.0, 0.0, 0.0, 1.0);
  return path == PATH_SCALE ? vec4(1.0) : vec4(0.0);
}

vec4 meanOf(vec4 sum, bool hasWeight, uint path, vec4 rest) {
  if (!hasWeight) return rest;
  return path == PATH_ROTATION ? unitOrIdentity(sum) : sum;
}

vec4 added(vec4 value, vec4 difference, float weight, uint path) {
  if (path == PATH_ROTATION) {
    if (difference.w < 0.0) difference = -difference;
    precise vec4 turn = weight * difference;
    precise float unturned = 1.0 - weight;
    turn.w = turn.w + unturned;
    return unitOrIdentity(quaternionProduct(value, unitOrIdentity(turn)));
  }
  precise vec4 shifted = value + weight * difference;
  precise vec4 grown = value * (1.0 + weight * (difference - 1.0));
  return path == PATH_SCALE ? grown : shifted;
}

// One property of a node. `weights`: the sum of those of layers that are not additive.
vec4 sampleProperty(uint firstLayer, uint layersEnd, uvec4 offsets, uint node, uint path, vec4 rest, float weights) {
  vec4 value = vec4(0.0);
  vec4 first = vec4(0.0);
  bool hasWeight = false;
  bool isMean = false;
  for (uint word = firstLayer; word < layersEnd; word += 2u) {
    Layer layer = layerOf(word, offsets, node);
    if (!layer.isAdditive && !(layer.weight > 0.0)) continue;
    if (layer.isAdditive && !isMean) {
      value = meanOf(value, hasWeight, path, rest);
      isMean = true;
    }
    uint track = clipWords[push.clips + layer.tracks + 3u * node + path];
    vec4 x = sampleTrack(layer.at, track, path == PATH_ROTATION, layer.isAdditive ? noDifference(path) : rest);
    if (layer.isAdditive) {
      value = added(value, x, layer.weight, path);
    } else {
      if (!hasWeight) first = x;
      hasWeight = true;
      float share = quotient(layer.weight, weights);
      if (path == PATH_ROTATION && dot4(first, x) < 0.0) share = -share;
      precise vec4 sum = fma(vec4(share), x, value);
      value = sum;
    }
  }
  return isMean ? value : meanOf(value, hasWeight, path, rest);
}

void main() {
  uint number = workgroupNumber();
  if (number >= push.workgroupCount) return;
  uint record = push.figures + number * FIGURE_WORDS;
  uvec4 figure = tableUnit(record);  // the first words of a FigureRecord
  uint firstLayer = record + 4u;
  uint layersEnd = firstLayer + 2u * figure.z;
  uvec4 offsets = clipUnits[(push.clips + CLIPS_OFFSETS) / 4u];
  for (uint node = gl_LocalInvocationID.x; node < push.nodeCount; node += gl_WorkGroupSize.x) {
    precise float weights = 0.0;
    for (uint word = firstLayer; word < layersEnd; word += 2u) {
      Layer layer = layerOf(word, offsets, node);
      if (!layer.isAdditive) weights = weights + layer.weight;
    }
    uint unit = (push.clips + offsets.x + node * CLIP_NODE_WORDS) / 4u;
    uvec4 a = clipUnits[unit];
    vec4 b = uintBitsToFloat(clipUnits[unit + 1u]);
    vec4 c = uintBitsToFloat(clipUnits[unit + 2u]);
    vec4 translation = vec4(uintBitsToFloat(a.w), b.xy, 0.0);
    vec4 rotation = vec4(b.zw, c.xy);
    vec4 scale = vec4(c.zw, uintBitsToFloat(clipUnits[unit + 3u].x), 0.0);
    [[dont_unroll]] for (uint path = 0u; path < 3u; ++path) {
      vec4 rest = path == PATH_ROTATION ? rotation : path == PATH_SCALE ? scale : translation;
      vec4 value = sampleProperty(firstLayer, layersEnd, offsets, node, path, rest, weights);
      if (path == PATH_TRANSLATION) translation = value;
      if (path == PATH_ROTATION) rotation = value;
      if (path == PATH_SCALE) scale = value;
    }
    vec3 r0;
    vec3 r1;
    vec3 r2;
    rowsOfQuaternion(rotation, r0, r1, r2);
    precise vec3 s0 = r0 * scale.xyz;
    precise vec3 s1 = r1 * scale.xyz;
    precise vec3 s2 = r2 * scale.xyz;
    Transform local = Transform(vec4(s0, translation.x), vec4(s1, translation.y), vec4(s2, translation.z));
    if (a.z != 0u) local = multiply(loadTransform(push.clips + a.z), local);
    uint place = figure.x + node * UNITS_OF_TRANSFORM;
    transforms[place] = floatBitsToUint(local.r0);
    transforms[place + 1u] = floatBitsToUint(local.r1);
    transforms[place + 2u] = floatBitsToUint(local.r2);
  }
}
