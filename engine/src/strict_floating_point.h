// Stops a build whose flags let the compiler take NaN, infinities or signs of zeros for impossible,
// or change the order of operations: checks would pass silently, and error bounds would not hold.
// CMake's targets switch these flags off; a build from the list of files must do so itself.
// Included by Dermis' sources only. Flush-to-zero is not looked for: it is set when a program is
// linked or runs, and subnormal numbers are within the error bounds.
#pragma once

#if defined(__FAST_MATH__) || (defined(__FINITE_MATH_ONLY__) && __FINITE_MATH_ONLY__ != 0) || \
    defined(_M_FP_FAST) || defined(__NO_SIGNED_ZEROS__) || defined(__ASSOCIATIVE_MATH__) ||   \
    defined(__RECIPROCAL_MATH__)
#error "Dermis: compile without -ffast-math, -ffinite-math-only, -fno-signed-zeros, /fp:fast"
#endif
