#version 450
#extension GL_GOOGLE_include_directive : require

// Makes the poses of figures from the local transforms of their nodes: global transforms × inverse bind matrices. A dispatch finds
// the joints of one band, nodes at most 8 deep below those whose global transforms an earlier dispatch has stored, and stores those
// that the next one needs. A workgroup for each figure, an invocation for each of its steps.

#include "abi.h"
#include "clips.glsl"
#include "tables.glsl"

layout(local_size_x_id = CONSTANT_WORKGROUP_SIZE) in;

layout(push_constant) uniform Push { ComposePush push; };

// Those that this dispatch stores are not read by it.
layout(set = 0, binding = BINDING_PALETTES, std430) buffer Transforms { uvec4 transforms[]; };
layout(set = 0, binding = BINDING_POSITIONS, std430) restrict writeonly buffer Joints { uvec4 joints[]; };

#ifdef TEXELS
uvec4 transformUnit(uint unit) { return paletteBits(unit); }
#else
uvec4 transformUnit(uint unit) { return transforms[unit]; }
#endif

Transform transformOf(uint figure, uint matrix) {
  uint unit = figure + matrix * UNITS_OF_TRANSFORM;
  return Transform(uintBitsToFloat(transformUnit(unit)), uintBitsToFloat(transformUnit(unit + 1u)),
                   uintBitsToFloat(transformUnit(unit + 2u)));
}

void main() {
  uint number = workgroupNumber();
  if (number >= push.workgroupCount) return;
  uvec4 figure = tableUnit(push.figures + number * FIGURE_WORDS);  // the first words of a FigureRecord
  if ((figure.z & FIGURE_NEEDED) == 0u) return;
  BankRecord bank = loadBank(figure.w);
  BandRecord band = loadBand(figure.w + BANK_WORDS + push.band * BAND_WORDS);
  uint index = gl_LocalInvocationID.x;
  // Loops test at their end, for lavapipe (cpu_device/skin_instances.glsl).
  if (index < band.stepCount) do {
    uint word = band.steps + index * STEP_WORDS;
    uvec4 step = clipUnit(word / 4u);  // the first words of a StepRecord
    uvec4 chain0 = clipUnit(word / 4u + 1u);
    uvec4 chain1 = clipUnit(word / 4u + 2u);
    bool isJoint = step.x != 0u;
    Transform product = Transform(vec4(1.0, 0.0, 0.0, 0.0), vec4(0.0, 1.0, 0.0, 0.0), vec4(0.0, 0.0, 1.0, 0.0));
    if (isJoint) product = loadTransform(bank.clips + step.x);
    uint matrix = step.w;
    uint left = step.z;
    if (left != 0u) do {
      product = multiply(transformOf(figure.x, matrix), product);
      matrix = chain0.x;
      chain0 = uvec4(chain0.yzw, chain1.x);
      chain1 = chain1.yzww;
    } while (--left != 0u);
    uvec4 r0 = floatBitsToUint(product.r0);
    uvec4 r1 = floatBitsToUint(product.r1);
    uvec4 r2 = floatBitsToUint(product.r2);
    uint place = (isJoint ? figure.y : figure.x) + step.y * UNITS_OF_TRANSFORM;
    if (isJoint) {
      joints[place] = r0;
      joints[place + 1u] = r1;
      joints[place + 2u] = r2;
    } else {
      transforms[place] = r0;
      transforms[place + 1u] = r1;
      transforms[place + 2u] = r2;
    }
    index += gl_WorkGroupSize.x;
  } while (index < band.stepCount);
}
