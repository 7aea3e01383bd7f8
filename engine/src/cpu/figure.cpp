// Samples the poses of figures.
#include <atomic>
#include <cstdint>
#include <vector>

#include "clips/sample.h"
#include "cpu/task.h"
#include "cpu/thread_memory.h"
#include "strict_floating_point.h"

namespace dermis::cpu {

void FigureTask::finish() {
  State found = state.load(std::memory_order_acquire);
  if (found == State::waiting) {
    std::vector<Affine<float>>& nodes = threadMemory().nodes;
    nodes.resize(clips->nodeCount());
    if (state.compare_exchange_strong(found, State::busy, std::memory_order_acquire)) {
      sampleNodes(*clips, layers, nodes);
      std::size_t first = 0;
      for (std::uint32_t skin = 0; skin < clips->skinCount(); ++skin) {
        poseSkin(*clips, skin, nodes, matrices.subspan(first, clips->jointCount(skin)));
        first += clips->jointCount(skin);
      }
      state.store(State::done, std::memory_order_release);
      state.notify_all();
      return;
    }
  }
  while (found != State::done) {
    state.wait(found, std::memory_order_acquire);
    found = state.load(std::memory_order_acquire);
  }
}

}  // namespace dermis::cpu
