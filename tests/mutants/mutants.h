// Included by each file that run.py plants a mistake in. The environment chooses at most one, for
// the whole process.
#pragma once

#include <cstdio>
#include <cstdlib>

namespace mutants {

constexpr int numbers = 1000;  // maximum, exclusive

inline const int chosen = [] {
  const char* const number = std::getenv("DERMIS_MUTANT");
  return number == nullptr ? 0 : std::atoi(number);
}();

// The numbers that a process came across. It appends them to $DERMIS_MUTANTS_REACHED when it exits.
struct Reached {
  bool mark[numbers] = {};

  ~Reached() {
    const char* const name = std::getenv("DERMIS_MUTANTS_REACHED");
    std::FILE* const file = name == nullptr ? nullptr : std::fopen(name, "a");
    if (file == nullptr) return;
    for (int number = 0; number < numbers; ++number) {
      if (mark[number]) std::fprintf(file, "%d\n", number);
    }
    std::fclose(file);
  }
};
inline Reached reached;

// Inlined always: the kernels of the CPU path are compiled for several instruction sets.
[[gnu::always_inline]] inline bool isChosen(int number) {
  reached.mark[number] = true;
  return number == chosen;
}

}  // namespace mutants
