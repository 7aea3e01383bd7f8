// Memory that each thread keeps from one call to the next.
#pragma once

#include <vector>

#include "cpu/task.h"

namespace dermis::cpu {

struct ThreadMemory {
  std::vector<TaskInstance> instances;
  Scratch scratch[3];                ///< as `dispatchTask` takes it
  std::vector<Affine<float>> nodes;  ///< of a figure
};

/// That of this thread; it is freed when the thread ends.
ThreadMemory& threadMemory();

}  // namespace dermis::cpu
