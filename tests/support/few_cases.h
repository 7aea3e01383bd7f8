// How many cases tests have in the sanitized half of CI. Sanitizers look at the ways through the
// code, and a thousand cases take the same ones as ten thousand. NUMERIC tests (CMakeLists.txt)
// have all cases in the other half, the others in the nightly parts clang and asan-rest.
#pragma once

namespace dermis::test {

#ifdef DERMIS_FEW_CASES
inline constexpr bool hasFewCases = true;
#else
inline constexpr bool hasFewCases = false;
#endif

/// A number of random cases, divided in the sanitized half.
template <typename Count>
constexpr Count fewer(Count count, Count divisor = 10) {
  return hasFewCases ? (count + divisor - 1) / divisor : count;
}

}  // namespace dermis::test
