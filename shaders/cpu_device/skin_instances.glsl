// The loops of the skin kernel on lavapipe, which predicates instead of branching, executes the body of a loop once more if the
// test comes first, and reads what is uniform at every use.
#ifndef DERMIS_SKIN_INSTANCES_GLSL
#define DERMIS_SKIN_INSTANCES_GLSL

// The difference between consecutive instances that are evenly spaced. Such instances have the same box.
Instance stepBetween(InstanceRecord a, InstanceRecord b) {
  InstanceRecord step = a;
  step.palette = b.palette - a.palette;
  step.joints = b.joints - a.joints;
  step.extension = b.extension - a.extension;
  return Instance(step, placesOf(b) - placesOf(a), recordPlace(b.positions) - recordPlace(a.positions),
                  BoxScale(vec3(0.0), vec3(0.0)));
}

void advance(inout Instance instance, Instance by) {
  instance.record.palette += by.record.palette;
  instance.record.joints += by.record.joints;
  instance.record.extension += by.record.extension;
  instance.places += by.places;
  instance.recordPlace += by.recordPlace;
}

// Whether instances with scaling joints have their own loop. Without it, rigid instances pay for the scale, too. A second loop
// lengthens compilation. Comparison methods and invocations with few instances do without it.
#ifdef COMPARISON
const bool APART = false;
#else
const bool APART = SCALES && METHOD != METHOD_LINEAR && INSTANCES >= 8u;
#endif

// Skins the instances whose bits are set in `left`, in ascending order. Records are read once for a run of evenly spaced
// consecutive instances. A run has as many instances as there are consecutive bits, or one if instances are not evenly spaced.
void skinRuns(uint left, uint records, uvec4 offsets, bool even, Instance by, Work work, bool scales) {
  // Loops test their condition at the end. If the test comes first, lavapipe executes the rest of the body once more with all
  // lanes off, which doubles the work of an invocation with one instance.
  do {
    Instance instance = readInstance(records + uint(findLSB(left)) * INSTANCE_WORDS, offsets);
    uint lowest = left & (~left + 1u);
    uint after = left & (even ? left + lowest : left - 1u);  // the sum carries through the bits of the run
    int run = bitCount(left ^ after);
    left = after;
    do {
      skinInstance(instance, work, scales || (!APART && paletteScales(instance.record.palette)));
      advance(instance, by);
    } while (--run != 0);
  } while (left != 0u);
}

// Skins `VERTICES` vertices, a workgroup's size apart, for all instances of the share.
void skinInstances(GroupRecord group, Share share, uint run, uint vertex) {
  uint vertices = VERTICES;
  uint records = share.records;
  uint count = share.count;
  uvec4 strides = uvec4(group.positionStride, group.normalStride, group.tangentStride, group.previousStride);
  uint left = 0xffffffffu >> (32u - count);  // one bit per instance
  bool even = (group.instancesEach & EVENLY_SPACED) != 0u;
  Instance by = stepBetween(loadInstance(records), loadInstance(records + min(1u, count - 1u) * INSTANCE_WORDS));
  uint scaling = 0u;
  if (APART) {
    uint i = 0u;
    do {
      if (paletteScales(loadInstance(records + i * INSTANCE_WORDS).palette)) scaling |= 1u << i;
    } while (++i < count);
    left &= ~scaling;
  }
  Sections sections = sectionsOf(group.mesh);
  do {
    Work work = workOf(group.mesh, sections, vertex);
    uvec4 offsets = run * strides;
    if (!APART || left != 0u) skinRuns(left, records, offsets, even, by, work, false);
    if (APART && scaling != 0u) skinRuns(scaling, records, offsets, even, by, work, true);
    run += gl_WorkGroupSize.x;
    vertex += gl_WorkGroupSize.x;
  } while (--vertices != 0u && vertex < group.vertexEnd);
}

#endif
