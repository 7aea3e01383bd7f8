#include "cpu/thread_memory.h"

// GCC for Windows emulates `thread_local`. When a thread ends, it may free the memory of such an
// object before it calls the object's destructor (GCC bug 80881). So the memory is kept in a fiber
// local slot of Windows, which calls a function for each value.
#if defined(__MINGW32__)

#ifndef NOMINMAX
#define NOMINMAX
#endif
#include <windows.h>

#include <cstdlib>

namespace dermis::cpu {
namespace {

void WINAPI freeMemory(void* memory) {
  delete static_cast<ThreadMemory*>(memory);
}

struct Slot {
  DWORD number = FlsAlloc(freeMemory);
  Slot() {
    if (number == FLS_OUT_OF_INDEXES) std::abort();
  }
  ~Slot() { FlsFree(number); }  // also frees the memory of threads that have not ended
};

}  // namespace

ThreadMemory& threadMemory() {
  static const Slot slot;
  auto* memory = static_cast<ThreadMemory*>(FlsGetValue(slot.number));
  if (memory == nullptr) {
    memory = new ThreadMemory;
    FlsSetValue(slot.number, memory);
  }
  return *memory;
}

}  // namespace dermis::cpu

#else

namespace dermis::cpu {

ThreadMemory& threadMemory() {
  static thread_local ThreadMemory memory;
  return memory;
}

}  // namespace dermis::cpu

#endif
