// Memory that each thread keeps from one call to the next.
#pragma once

#include <vector>

#include "cpu/clip_plan.h"
#include "cpu/task.h"

namespace dermis::cpu {

struct ThreadMemory {
  std::vector<TaskInstance> instances;
  std::vector<TaskInstance> drivenInstances;  ///< copies …
  std::vector<MorphWeight> drivenMorphs;      ///< … and all their targets
  Scratch scratch[3];                         ///< as `dispatchTask` takes it
  ClipScratch clips;
  RigScratch rigs;
};

/// That of this thread; it is freed when the thread ends.
ThreadMemory& threadMemory();

}  // namespace dermis::cpu
