#version 450
#extension GL_GOOGLE_include_directive : require
#extension GL_KHR_memory_scope_semantics : require

// Chooses, among the instances that are culled on the GPU, those that are visible and have something new to show. In the first pass
// (VISIBILITY_CHOOSES) a workgroup processes the instances of one group, and moves the records of the chosen ones to the front, in
// their order (a prefix sum). In the second pass (VISIBILITY_COUNTS) a workgroup processes the groups of one dispatch: it writes
// their `workgroupEnd`, and the arguments of the dispatch. The first also marks the figures and palettes that the chosen ones need.

#define TABLES_ARE_WRITTEN
#define RESULTS_BINDING BINDING_VISIBLE_RESULTS
#include "results.glsl"
#include "tables.glsl"

layout(local_size_x_id = CONSTANT_WORKGROUP_SIZE) in;

layout(set = 0, binding = BINDING_VISIBILITY, std430) restrict readonly buffer Visibility { uint visibility[]; };
layout(set = 0, binding = BINDING_HISTORY, std430) buffer History {
  CounterRecord counters;
  HistoryRecord history[];
};

layout(push_constant) uniform Push { VisibilityPush push; };

const uint MAX_INVOCATIONS = 128u;
shared uint kept[MAX_INVOCATIONS];

// Like barrier(), but it also orders storage buffers: after it, invocations may overwrite what others have read before it.
// barrier() orders shared memory only.
void barrierOfBuffers() {
  controlBarrier(gl_ScopeWorkgroup, gl_ScopeWorkgroup, gl_StorageSemanticsBuffer | gl_StorageSemanticsShared,
                 gl_SemanticsAcquireRelease);
}

uint wordOfInstance(uint number) { return push.instances + number * INSTANCE_WORDS; }

// Whether the skin kernel must process an instance. The flags in `instance.joints` say how.
//
// A slot may have the history of an earlier instance. This does no harm. No two instances have the same version, so a new instance
// is skinned. It restarts its motion in the first frame in which it is a candidate. If it is not visible then, the last visible
// frame of the slot is an earlier one, so motion restarts when it becomes visible.
bool choose(CandidateRecord candidate, inout InstanceRecord instance) {
  uint slot = candidate.slot;
  if (visibility[slot] == 0u) return false;
  atomicAdd(counters.visible, 1u);
  bool wasVisible = history[slot].lastVisible == push.frame - 1u;
  history[slot].lastVisible = push.frame;
  if (history[slot].version != candidate.version) {
    history[slot].version = candidate.version;
    // Several instances may have one pose.
    if (candidate.figure != CANDIDATE_NEEDS_NONE) atomicOr(tables[candidate.figure + FIGURE_LAYER_COUNT], FIGURE_NEEDED);
    if (candidate.palette != CANDIDATE_NEEDS_NONE) atomicOr(tables[candidate.palette + PALETTE_NEEDED], 1u);
    atomicAdd(counters.skinned, 1u);
    if ((instance.joints & INSTANCE_HAS_RESULT) != 0u) clearResult(loadExtension(instance.extension).result);
    // If the instance was not visible in the previous frame, its stored positions may not be those of that frame.
    if (!wasVisible && (instance.joints & INSTANCE_HAS_MOTION) != 0u) instance.joints |= INSTANCE_RESTARTS;
    // If motion restarts, previous positions are equal to positions: there is nothing to settle.
    history[slot].moves = (instance.joints & (INSTANCE_HAS_MOTION | INSTANCE_RESTARTS)) == INSTANCE_HAS_MOTION ? 1u : 0u;
    return true;
  }
  // The instance has not changed: its previous positions are set to the current ones, once. An instance that is held was skinned, if
  // not by a restart, when its version was new.
  if (history[slot].moves == 0u) return false;
  if (wasVisible && (instance.joints & INSTANCE_HOLDS) != 0u) return false;
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
    // Now all invocations have read their records, and the record of the group.
    barrierOfBuffers();
    for (uint step = 1u; step < size; step *= 2u) {
      uint before = own >= step ? kept[own - step] : 0u;
      barrier();
      kept[own] += before;
      barrier();
    }
    // The chosen ones are written to places that have been read.
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
    group.instancesEach = rounds == 0u ? 0u : (group.instanceCount + rounds - 1u) / rounds;
    workgroups += group.vertexGroups * rounds;
    group.workgroupEnd = workgroups;
    storeGroup(place, group);
  }
  uint maxWorkgroups = push.maxWorkgroups;
  // `maxWorkgroups` may be 2³² − 1, so adding it before the division could overflow. Workgroups and rows are at most 2³¹ each, so
  // adding these cannot (Encoder::addDispatch).
  uint rows = workgroups / maxWorkgroups + (workgroups % maxWorkgroups != 0u ? 1u : 0u);
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
