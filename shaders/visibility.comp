#version 450
#extension GL_GOOGLE_include_directive : require
#extension GL_KHR_memory_scope_semantics : require

// Instances that the GPU chooses: which of them are visible and have something new to show. In the first pass a workgroup goes over
// the instances of one group and moves the records of those that stay to the front, in their order (a prefix sum); in the second
// one goes over the groups of one dispatch, and writes how many workgroups it takes. With ONE_OUTPUT there are no results (4
// storage buffers in all).

#define TABLES_ARE_WRITTEN
#include "results.glsl"
#include "tables.glsl"

layout(local_size_x_id = CONSTANT_WORKGROUP_SIZE) in;

layout(set = 0, binding = BINDING_VISIBILITY, std430) restrict readonly buffer Visibility { uint visibility[]; };
layout(set = 0, binding = BINDING_HISTORY, std430) buffer History { HistoryRecord history[]; };
layout(set = 0, binding = BINDING_COUNTERS, std430) buffer Counters { CounterRecord counters; };

layout(push_constant) uniform Push { VisibilityPush push; };

const uint MOST_INVOCATIONS = 128u;
shared uint kept[MOST_INVOCATIONS];

// As barrier(), and what invocations have read of storage buffers before it others may overwrite behind it: barrier() orders
// shared memory only.
void barrierOfBuffers() {
  controlBarrier(gl_ScopeWorkgroup, gl_ScopeWorkgroup, gl_StorageSemanticsBuffer | gl_StorageSemanticsShared,
                 gl_SemanticsAcquireRelease);
}

uint wordOfInstance(uint number) { return push.instances + number * INSTANCE_WORDS; }

// Whether an instance has to be looked at by the skin kernel, and how: `instance.joints`.
//
// The history of a slot that another instance had before does no harm: no two instances share a version, so that what is new is
// skinned; and a new instance restarts its motion in the first frame that asks for it here. Where it is not visible in that frame,
// the slot's last visible frame lies before it, and motion restarts when it is seen.
bool choose(CandidateRecord candidate, inout InstanceRecord instance) {
  uint slot = candidate.slot;
  if (visibility[slot] == 0u) return false;
  atomicAdd(counters.visible, 1u);
  bool wasVisible = history[slot].lastVisible == push.frame - 1u;
  history[slot].lastVisible = push.frame;
  if (history[slot].version != candidate.version) {
    history[slot].version = candidate.version;
    atomicAdd(counters.skinned, 1u);
    if ((instance.joints & INSTANCE_HAS_RESULT) != 0u) clearResult(loadExtension(instance.extension).result);
    // What an instance showed before it was out of view is no motion.
    if (!wasVisible && (instance.joints & INSTANCE_HAS_MOTION) != 0u) instance.joints |= INSTANCE_RESTARTS;
    // Where motion restarts nothing is left to settle.
    history[slot].moves = (instance.joints & (INSTANCE_HAS_MOTION | INSTANCE_RESTARTS)) == INSTANCE_HAS_MOTION ? 1u : 0u;
    return true;
  }
  // It rests where it was, in view or since it was: its previous positions become the current ones, once.
  if (history[slot].moves == 0u) return false;
  history[slot].moves = 0u;
  atomicAdd(counters.settled, 1u);
  instance.joints |= INSTANCE_SETTLES;
  return true;
}

void keepChosen(uint word) {
  uint own = gl_LocalInvocationID.x;
  uint size = gl_WorkGroupSize.x;
  GroupRecord group = loadGroup(word);
  uint total = 0u;
  for (uint begin = 0u; begin < group.instanceCount; begin += size) {
    bool stays = false;
    InstanceRecord instance;
    if (begin + own < group.instanceCount) {
      uint number = group.firstInstance + begin + own;
      instance = loadInstance(wordOfInstance(number));
      stays = choose(loadCandidate(push.candidates + (number - push.firstInstance) * CANDIDATE_WORDS), instance);
    }
    kept[own] = stays ? 1u : 0u;
    // All records of this stretch, and the group's, have been read.
    barrierOfBuffers();
    for (uint step = 1u; step < size; step *= 2u) {
      uint before = own >= step ? kept[own - step] : 0u;
      barrier();
      kept[own] += before;
      barrier();
    }
    // Those that stay go to places in this stretch, or before it.
    if (stays) storeInstance(wordOfInstance(group.firstInstance + total + kept[own] - 1u), instance);
    total += kept[size - 1u];
    barrier();
  }
  if (own == 0u) {
    group.instanceCount = total;
    storeGroup(word, group);
  }
}

void countWorkgroups(uint word, uint arguments) {
  CulledDispatchRecord dispatch = loadCulledDispatch(word);
  uint workgroups = 0u;
  for (uint number = 0u; number < dispatch.groupCount; ++number) {
    uint place = dispatch.groups + number * GROUP_WORDS;
    GroupRecord group = loadGroup(place);
    uint rounds = (group.instanceCount + dispatch.instancesPerInvocation - 1u) / dispatch.instancesPerInvocation;
    workgroups += group.vertexGroups * rounds;
    group.workgroupEnd = workgroups;
    storeGroup(place, group);
  }
  uint most = push.mostWorkgroups;
  // `most` may be 2³² − 1; workgroups and rows are at most 2³¹ each (PlanBuilder::addDispatch).
  uint rows = workgroups / most + (workgroups % most != 0u ? 1u : 0u);
  storeIndirect(arguments, IndirectRecord(rows == 0u ? 0u : (workgroups + rows - 1u) / rows, rows, 1u, 0u));
  atomicAdd(counters.workgroups, workgroups);
}

void main() {
  uint number = gl_WorkGroupID.x;
  if (push.pass == VISIBILITY_CHOOSES) {
    keepChosen(push.groups + number * GROUP_WORDS);
  } else if (gl_LocalInvocationID.x == 0u) {
    countWorkgroups(push.dispatches + number * CULLED_DISPATCH_WORDS, push.arguments + number * INDIRECT_WORDS);
  }
}
