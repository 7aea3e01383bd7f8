#version 450
#extension GL_GOOGLE_include_directive : require
#extension GL_EXT_control_flow_attributes : require

// Computes what a rig drives: joints and weights that follow from the joints of a pose (docs/rigs.md). An invocation for each pose of
// one rig.

#include "abi.h"
#include "clips.glsl"
#include "quaternion.glsl"
#include "rig_math.glsl"
#include "tables.glsl"
#include "weights.glsl"

layout(local_size_x_id = CONSTANT_WORKGROUP_SIZE) in;

layout(push_constant) uniform Push { RigPush push; };

#ifdef TEXELS
uvec4 jointUnit(uint unit) { return paletteBits(unit); }
#else
layout(set = 0, binding = BINDING_JOINTS, std430) readonly buffer Joints { uvec4 joints[]; };

uvec4 jointUnit(uint unit) { return joints[unit]; }
#endif
layout(set = 0, binding = BINDING_JOINTS, std430) readonly buffer JointWords { uint jointWords[]; };
// What an invocation reads of these, it has written.
layout(set = 0, binding = BINDING_DRIVEN, std430) buffer Driven { uvec4 driven[]; };
layout(set = 0, binding = BINDING_DRIVEN, std430) buffer DrivenWords { uint drivenWords[]; };

RigRecord pose;
uint writtenJoints;
uint weightWord;   // in the buffer of driven joints: of the first weight
uint scratchUnit;  // the same: behind the weights, a unit for each input of a corrective, then a word for each of its examples

uvec4 rigUnit(uint word) { return clipUnit((push.rig + word) / 4u); }
vec4 rigNumbers(uint word) { return uintBitsToFloat(rigUnit(word)); }
Transform rigTransform(uint word) { return loadTransform(push.rig + word); }

Transform jointAt(uint number) {
  uvec4 r0;
  uvec4 r1;
  uvec4 r2;
  if (number < writtenJoints) {
    uint unit = pose.joints + number * UNITS_OF_MATRIX;
    r0 = jointUnit(unit);
    r1 = jointUnit(unit + 1u);
    r2 = jointUnit(unit + 2u);
  } else {
    uint unit = pose.driven + (number - writtenJoints) * UNITS_OF_MATRIX;
    r0 = driven[unit];
    r1 = driven[unit + 1u];
    r2 = driven[unit + 2u];
  }
  return Transform(uintBitsToFloat(r0), uintBitsToFloat(r1), uintBitsToFloat(r2));
}

void setDriven(uint number, Transform matrix) {
  uint unit = pose.driven + number * UNITS_OF_MATRIX;
  driven[unit] = floatBitsToUint(matrix.r0);
  driven[unit + 1u] = floatBitsToUint(matrix.r1);
  driven[unit + 2u] = floatBitsToUint(matrix.r2);
}

void setRelative(uint number, uint parent, Transform matrix) {
  if (parent != RIG_NO_JOINT) matrix = multiply(jointAt(parent), matrix);
  setDriven(number, matrix);
}

// The rotation of a joint relative to its parent and its bind pose.
vec4 rotationAt(uint sensor) {
  uvec4 head = rigUnit(sensor);  // joint, parent
  mat3 m = linearOf(jointAt(head.x));
  if (head.y != RIG_NO_JOINT) m = relativeTo(linearOf(jointAt(head.y)), m);
  m = times(times(linearOf(rigTransform(sensor + 4u)), m), linearOf(rigTransform(sensor + 16u)));
  return quaternionOfColumns(orthonormalColumns(m));
}

void evaluateTwist(uint data) {
  vec4 q = rotationAt(data);
  data += RIG_SENSOR_WORDS;
  uvec4 head = rigUnit(data);  // driven, parent, share
  float s = dot3(rigNumbers(data + 4u).xyz, q.xyz);
  if (q.w < 0.0) s = -s;
  precise float sum = squareRoot(s * s + q.w * q.w) + abs(q.w);
  float tangent = sum > 0.0 ? quotient(s, sum) : 0.0;
  // Half of the angle is twice the arc whose tangent this is.
  precise float half_ = uintBitsToFloat(head.z) * (2.0 * arcTangent(tangent));
  precise vec3 turn = rigNumbers(data + 8u).xyz * sine(half_);
  mat3 rotation = rotationOf(vec4(turn, cosine(half_)));
  vec3 origin = rigNumbers(data + 12u).xyz;
  precise vec3 shift = origin - rotated(rotation, origin);
  setRelative(head.x, head.y, transformOf(rotation, shift));
}

// What there is of a corrective, beside its outputs.
struct Corrective {
  uint inputCount;
  uint examples;  // word: a quaternion for each input of each
  float factor;
  vec4 rotation;  // of the first input; those of several are in the scratch
};

// The function of an example.
float basisAt(Corrective corrective, uint example) {
  precise float square = 0.0;
  for (uint input_ = 0u; input_ < corrective.inputCount; ++input_) {
    vec4 rotation = corrective.rotation;
    if (corrective.inputCount != 1u) rotation = uintBitsToFloat(driven[scratchUnit + input_]);
    vec4 there = rigNumbers(corrective.examples + 4u * (example * corrective.inputCount + input_));
    vec4 between = quaternionProduct(conjugateOf(there), rotation);
    square = square + dot3(between.xyz, between.xyz);
  }
  precise float whole = 4.0 * square;
  precise float exponent = whole * corrective.factor;
  return corrective.factor == 0.0 ? squareRoot(whole) : exponential(exponent);
}

void evaluateCorrective(uint data) {
  uvec4 counts = rigUnit(data);     // inputs, examples, weights, joints
  uvec4 head = rigUnit(data + 4u);  // first weight, factor
  data += RIG_CORRECTIVE_WORDS;
  Corrective corrective = Corrective(counts.x, data + counts.x * RIG_SENSOR_WORDS, uintBitsToFloat(head.y), vec4(0.0));
  for (uint i = 0u; i < counts.x; ++i) {
    vec4 rotation = rotationAt(data + i * RIG_SENSOR_WORDS);
    corrective.rotation = rotation;
    if (counts.x != 1u) driven[scratchUnit + i] = floatBitsToUint(rotation);
  }
  uint basisWord = 4u * (scratchUnit + counts.x);
  for (uint example = 0u; example < counts.y; ++example)
    drivenWords[basisWord + example] = floatBitsToUint(basisAt(corrective, example));
  data = corrective.examples + 4u * counts.x * counts.y;
  for (uint first = 0u; first < counts.z; first += 4u) {
    precise vec4 sums = vec4(0.0);
    for (uint example = 0u; example < counts.y; ++example) {
      sums = fma(vec4(uintBitsToFloat(drivenWords[basisWord + example])), rigNumbers(data), sums);
      data += 4u;
    }
    [[dont_unroll]] for (uint i = 0u; i < min(4u, counts.z - first); ++i)
      drivenWords[weightWord + head.x + first + i] = floatBitsToUint(sums[i]);
  }
  for (uint i = 0u; i < counts.w; ++i) {
    uvec4 joint = rigUnit(data);  // driven, parent
    Transform bind = rigTransform(data + 4u);
    Transform inverse_ = rigTransform(data + 16u);
    data += RIG_OFFSET_JOINT_WORDS;
    precise vec4 shift = vec4(0.0);
    precise vec4 turn = vec4(0.0, 0.0, 0.0, 1.0);
    precise vec4 scale = vec4(1.0);
    for (uint example = 0u; example < counts.y; ++example) {
      vec4 basis = vec4(uintBitsToFloat(drivenWords[basisWord + example]));
      shift = fma(basis, rigNumbers(data), shift);
      turn = fma(basis, rigNumbers(data + 4u), turn);
      scale = fma(basis, rigNumbers(data + 8u), scale);
      data += RIG_OFFSET_WORDS;
    }
    mat3 rotation = rotationOf(unitOrIdentity(turn));
    precise vec3 s0 = rotation[0] * scale.xyz;
    precise vec3 s1 = rotation[1] * scale.xyz;
    precise vec3 s2 = rotation[2] * scale.xyz;
    Transform offset = transformOf(mat3(s0, s1, s2), shift.xyz);
    setRelative(joint.x, joint.y, multiply(multiply(bind, offset), inverse_));
  }
}

// The curve at a joint of a chain.
struct CurveNode {
  Frame frame;
  vec3 place;
  vec3 direction;
};

CurveNode nodeAt(uint node, Transform matrix, Frame frame) {
  vec3 origin = rigNumbers(node + 4u).xyz;
  vec3 direction = rigNumbers(node + 8u).xyz;
  precise vec3 place = rotated(linearOf(matrix), origin) + vec3(matrix.r0.w, matrix.r1.w, matrix.r2.w);
  return CurveNode(frame, place, rotated(linearOfFrame(frame.rotation, frame), direction));
}

Transform onCurve(uvec4 head, uint data, CurveNode begin, CurveNode end) {
  vec2 numbers = uintBitsToFloat(head.yz);  // share, h
  float a = uintBitsToFloat(head.w);
  vec4 others = rigNumbers(data + 4u);  // b, g, c, d
  precise float rest = 1.0 - numbers.y;
  precise vec3 place = begin.place * numbers.y + end.place * rest + begin.direction * a + end.direction * others.x;
  precise vec3 direction = (begin.place - end.place) * others.y + begin.direction * others.z + end.direction * others.w;
  Frame frame = mixed(begin.frame, end.frame, numbers.x);
  // Then the shortest turn from the direction that this rotation gives to that of the curve.
  vec3 from = rotated(rotationOf(frame.rotation), rigNumbers(data + 12u).xyz);
  vec3 to = unitVectorOr(direction, from);
  precise float cosine_ = 1.0 + dot3(from, to);
  vec4 swing = unitAbove(vec4(cross3(from, to), cosine_), 1e-8);
  mat3 linear = linearOfFrame(quaternionProduct(swing, frame.rotation), frame);
  precise vec3 shift = place - rotated(linear, rigNumbers(data + 8u).xyz);
  return transformOf(linear, shift);
}

void evaluateChain(uint data, uint count) {
  uvec4 node = rigUnit(data);  // joint, offset of driven joints, their number
  Transform matrix = jointAt(node.x);
  Frame frame = frameOf(linearOf(matrix));
  CurveNode begin = nodeAt(data, matrix, frame);
  for (uint i = 1u; i < count; ++i) {
    data += RIG_NODE_WORDS;
    uvec4 next = rigUnit(data);
    matrix = jointAt(next.x);
    Frame own = frameOf(linearOf(matrix));
    Frame mean = own;
    if (i + 1u != count) mean = mixed(frame, own, 0.5);
    CurveNode end = nodeAt(data, matrix, mean);
    for (uint joint = 0u; joint < node.z; ++joint) {
      uint record = node.y + joint * RIG_CHAIN_JOINT_WORDS;
      uvec4 head = rigUnit(record);
      setDriven(head.x, onCurve(head, record, begin, end));
    }
    node = next;
    frame = own;
    begin = end;
  }
}

void evaluateLinear(uint data, uint count) {
  uvec4 head = rigUnit(data);  // driven, parent
  data += RIG_LINEAR_WORDS;
  precise vec4 r0 = vec4(1.0, 0.0, 0.0, 0.0);
  precise vec4 r1 = vec4(0.0, 1.0, 0.0, 0.0);
  precise vec4 r2 = vec4(0.0, 0.0, 1.0, 0.0);
  for (uint i = 0u; i < count; ++i) {
    vec4 weight = vec4(uintBitsToFloat(drivenWords[weightWord + rigUnit(data).x]));
    Transform matrix = rigTransform(data + 4u);
    r0 = fma(weight, matrix.r0, r0);
    r1 = fma(weight, matrix.r1, r1);
    r2 = fma(weight, matrix.r2, r2);
    data += RIG_TERM_WORDS;
  }
  setRelative(head.x, head.y, Transform(r0, r1, r2));
}

// The weights that are given with the pose: read behind its joints, or sampled from clips.
void takeWeights(uint count, uint figure, uint layerCount) {
  uint from = 4u * (pose.joints + writtenJoints * UNITS_OF_MATRIX);
  WeightSource source = WeightSource(figure + 4u, layerCount, pose.clips, pose.weights, pose.track, pose.masks);
  bool isSampled = figure != RIG_NO_FIGURE;
  float sum = 0.0;
  if (isSampled) sum = sumOfFactors(source);
  uvec3 group = uvec3(0u);
  for (uint i = 0u; i < count; ++i) {
    uint weight;
    if (isSampled) {
      if (i % 3u == 0u) group = floatBitsToUint(sampleGroup(source, sum, i / 3u));
      weight = i % 3u == 0u ? group.x : i % 3u == 1u ? group.y : group.z;
    } else {
      weight = jointWords[from + i];
    }
    drivenWords[weightWord + i] = weight;
  }
}

// Kind, offset, number of parts; after the last one, no kind. `drivers`: the offset of all, and their number.
uvec4 driverAt(uvec4 drivers, uint number) {
  uvec4 driver = rigUnit(drivers.x + min(number, drivers.y - 1u) * RIG_DRIVER_WORDS);
  return number < drivers.y ? driver : uvec4(0xffffffffu);
}

void main() {
  uint number = workgroupNumber() * gl_WorkGroupSize.x + gl_LocalInvocationID.x;
  if (number >= push.poseCount) return;
  pose = loadRig(push.poses + number * RIG_WORDS);
  uint layerCount = 0u;
  if (pose.figure != RIG_NO_FIGURE) {
    uint layers = tableUnit(pose.figure).z;
    if ((layers & FIGURE_NEEDED) == 0u) return;
    layerCount = layers & ~FIGURE_NEEDED;
  }
  uvec4 counts = rigUnit(RIG_COUNTS);
  writtenJoints = counts.x;
  weightWord = 4u * (pose.driven + counts.y * UNITS_OF_MATRIX);
  scratchUnit = (weightWord + counts.z + counts.w + 3u) / 4u;
  takeWeights(counts.z, pose.figure, layerCount);
  uvec4 drivers = rigUnit(RIG_DRIVERS);  // offset, number
  // A loop for each kind, since lavapipe would execute all branches for every driver. Those of one kind mostly follow each other.
  uint i = 0u;
  while (i < drivers.y) {
    uvec4 driver = driverAt(drivers, i);
    while (driver.x == RIG_TWIST) {
      evaluateTwist(driver.y);
      driver = driverAt(drivers, ++i);
    }
    while (driver.x == RIG_CORRECTIVE) {
      evaluateCorrective(driver.y);
      driver = driverAt(drivers, ++i);
    }
    while (driver.x == RIG_CHAIN) {
      evaluateChain(driver.y, driver.z);
      driver = driverAt(drivers, ++i);
    }
    while (driver.x == RIG_LINEAR) {
      evaluateLinear(driver.y, driver.z);
      driver = driverAt(drivers, ++i);
    }
  }
}
