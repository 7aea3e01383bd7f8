// Samples the poses of figures.
#include <atomic>
#include <cstdint>

#include "cpu/clip_plan.h"
#include "cpu/task.h"
#include "cpu/thread_memory.h"

namespace dermis::cpu {

void FigureTask::finish() {
  State found = state.load(std::memory_order_acquire);
  if (found == State::waiting) {
    ClipScratch& scratch = threadMemory().clips;
    scratch.prepare(*plan);
    if (state.compare_exchange_strong(found, State::busy, std::memory_order_acquire)) {
      dispatchSampling(*plan, layers, scratch, matrices);
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
