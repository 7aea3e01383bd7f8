#version 450
#extension GL_GOOGLE_include_directive : require
#extension GL_KHR_memory_scope_semantics : require

// Instances that the GPU chooses: which of them are visible and have something new to show. In the first pass a workgroup goes over
// the instances of one group and moves the records of those that stay to the front, in their order (a prefix sum); in the second
// one goes over the groups of one dispatch, and writes how many workgroups it takes. With ONE_OUTPUT there are no results (4
// storage buffers in all).

#include "abi.h"

layout(local_size_x_id = CONSTANT_WORKGROUP_SIZE) in;

layout(set = 0, binding = BINDING_TABLES, std430) buffer Tables { uint tables[]; };
layout(set = 0, binding = BINDING_VISIBILITY, std430) restrict readonly buffer Visibility { uint visibility[]; };
layout(set = 0, binding = BINDING_HISTORY, std430) buffer History { uint history[]; };
layout(set = 0, binding = BINDING_COUNTERS, std430) buffer Counters { uint counters[]; };
#ifndef ONE_OUTPUT
layout(set = 0, binding = BINDING_RESULTS, std430) writeonly buffer Results { uint results[]; };
#endif

layout(push_constant) uniform Push { uint push[PUSH_CULLED_WORDS]; };

const uint MOST_INVOCATIONS = 128u;
shared uint kept[MOST_INVOCATIONS];

// As barrier(), and what invocations have read of storage buffers before it others may overwrite behind it: barrier() orders
// shared memory only.
void barrierOfBuffers() {
  controlBarrier(gl_ScopeWorkgroup, gl_ScopeWorkgroup, gl_StorageSemanticsBuffer | gl_StorageSemanticsShared,
                 gl_SemanticsAcquireRelease);
}

uint instanceRecord(uint instance) { return push[PUSH_CULLED_INSTANCES] + instance * INSTANCE_WORDS; }

void clearResult(uint record) {
#ifndef ONE_OUTPUT
  uint extension = tables[record + INSTANCE_EXTENSION];
  if ((tables[record + INSTANCE_FLAGS] & INSTANCE_HAS_RESULT) == 0u) return;
  uint result = tables[extension + EXTENSION_RESULT];
  for (uint word = 0u; word < RESULT_WORDS; ++word) results[result + word] = 0u;
  for (uint axis = 0u; axis < 3u; ++axis) results[result + RESULT_MIN + axis] = 0xffffffffu;
#endif
}

// Whether an instance has to be looked at by the skin kernel; `flags` are those of its record.
//
// The history of a slot that another instance had before does no harm: no two instances share a version, so that what is new is
// skinned; and a new instance restarts its motion in the first frame that asks for it here. Where it is not visible in that frame,
// the slot's last visible frame lies before it, and motion restarts when it is seen.
bool choose(uint candidate, uint record, inout uint flags) {
  uint slot = tables[candidate + CANDIDATE_SLOT];
  if (visibility[slot] == 0u) return false;
  atomicAdd(counters[COUNTER_VISIBLE], 1u);
  uint frame = push[PUSH_CULLED_FRAME];
  uint remembered = slot * HISTORY_WORDS;
  bool wasVisible = history[remembered + HISTORY_LAST_VISIBLE] == frame - 1u;
  history[remembered + HISTORY_LAST_VISIBLE] = frame;
  uint version = tables[candidate + CANDIDATE_VERSION];
  if (history[remembered + HISTORY_VERSION] != version) {
    history[remembered + HISTORY_VERSION] = version;
    atomicAdd(counters[COUNTER_SKINNED], 1u);
    clearResult(record);
    // What an instance showed before it was out of view is no motion.
    if (!wasVisible && (flags & INSTANCE_HAS_MOTION) != 0u) flags |= INSTANCE_RESTARTS;
    // Where motion restarts nothing is left to settle.
    history[remembered + HISTORY_MOVES] = (flags & (INSTANCE_HAS_MOTION | INSTANCE_RESTARTS)) == INSTANCE_HAS_MOTION ? 1u : 0u;
    return true;
  }
  // It rests where it was, in view or since it was: its previous positions become the current ones, once.
  if (history[remembered + HISTORY_MOVES] == 0u) return false;
  history[remembered + HISTORY_MOVES] = 0u;
  atomicAdd(counters[COUNTER_SETTLED], 1u);
  flags |= INSTANCE_SETTLES;
  return true;
}

void keepChosen(uint group) {
  uint own = gl_LocalInvocationID.x;
  uint size = gl_WorkGroupSize.x;
  uint first = tables[group + GROUP_FIRST_INSTANCE];
  uint count = tables[group + GROUP_INSTANCE_COUNT];
  uint total = 0u;
  for (uint begin = 0u; begin < count; begin += size) {
    uint number = begin + own;
    bool stays = false;
    uint record[INSTANCE_WORDS];
    if (number < count) {
      uint place = instanceRecord(first + number);
      for (uint word = 0u; word < INSTANCE_WORDS; ++word) record[word] = tables[place + word];
      uint candidate =
          push[PUSH_CULLED_CANDIDATES] + (first + number - push[PUSH_CULLED_FIRST_INSTANCE]) * CANDIDATE_WORDS;
      stays = choose(candidate, place, record[INSTANCE_FLAGS]);
    }
    kept[own] = stays ? 1u : 0u;
    // All records of this stretch, and the group's count, have been read.
    barrierOfBuffers();
    for (uint step = 1u; step < size; step *= 2u) {
      uint before = own >= step ? kept[own - step] : 0u;
      barrier();
      kept[own] += before;
      barrier();
    }
    // Those that stay go to places in this stretch, or before it.
    if (stays) {
      uint place = instanceRecord(first + total + kept[own] - 1u);
      for (uint word = 0u; word < INSTANCE_WORDS; ++word) tables[place + word] = record[word];
    }
    total += kept[size - 1u];
    barrier();
  }
  if (own == 0u) tables[group + GROUP_INSTANCE_COUNT] = total;
}

void countWorkgroups(uint dispatch, uint arguments) {
  uint group = tables[dispatch + CULLED_DISPATCH_GROUPS];
  uint end = group + tables[dispatch + CULLED_DISPATCH_GROUP_COUNT] * GROUP_WORDS;
  uint perInvocation = tables[dispatch + CULLED_DISPATCH_INSTANCES];
  uint workgroups = 0u;
  for (; group < end; group += GROUP_WORDS) {
    uint rounds = (tables[group + GROUP_INSTANCE_COUNT] + perInvocation - 1u) / perInvocation;
    workgroups += tables[group + GROUP_VERTEX_GROUPS] * rounds;
    tables[group + GROUP_WORKGROUP_END] = workgroups;
  }
  uint most = push[PUSH_CULLED_FRAME];
  // `most` may be 2³² − 1; workgroups and rows are at most 2³¹ each (Plan::State::addDispatch).
  uint rows = workgroups / most + (workgroups % most != 0u ? 1u : 0u);
  tables[arguments] = rows == 0u ? 0u : (workgroups + rows - 1u) / rows;
  tables[arguments + 1u] = rows;
  tables[arguments + 2u] = 1u;
  atomicAdd(counters[COUNTER_WORKGROUPS], workgroups);
}

void main() {
  uint number = gl_WorkGroupID.x;
  if (push[PUSH_CULLED_PASS] == 0u) {
    keepChosen(push[PUSH_CULLED_GROUPS] + number * GROUP_WORDS);
  } else if (gl_LocalInvocationID.x == 0u) {
    countWorkgroups(push[PUSH_CULLED_GROUPS] + number * CULLED_DISPATCH_WORDS,
                    push[PUSH_CULLED_CANDIDATES] + number * INDIRECT_WORDS);
  }
}
