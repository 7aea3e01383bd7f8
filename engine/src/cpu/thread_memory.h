// Memory that each thread keeps from one call to the next.
#pragma once

#include <vector>

#include "cpu/clip_plan.h"
#include "cpu/task.h"

namespace dermis::cpu {

struct ThreadMemory {
  std::vector<TaskInstance> instances;
  Scratch scratch[3];  ///< as `dispatchTask` takes it
  ClipScratch clips;
};

/// That of this thread; it is freed when the thread ends.
ThreadMemory& threadMemory();

}  // namespace dermis::cpu
