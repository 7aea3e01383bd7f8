// Some test files belong to two programs: gpu_test, which every change runs, has a choice of their
// combinations, and exhaustive_test, which runs at night, has all.
#pragma once

namespace dermis::test {

#ifdef DERMIS_EXHAUSTIVE
inline constexpr bool isExhaustive = true;
#else
inline constexpr bool isExhaustive = false;
#endif

}  // namespace dermis::test
