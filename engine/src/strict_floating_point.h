// Stops a build with flags such as -ffast-math. With them, compilers assume that NaN, infinities
// and signed zeros do not occur, and reorder operations. Checks would pass silently, and error
// bounds would not hold.
// The x87 unit of 32-bit x86 would round to `float` only when a value is stored.
// CMake's targets switch these flags off; a build from the list of files must do so itself.
// Included by Dermis' sources only. Flush-to-zero is not checked: it is set when a program is
// linked or runs, and subnormal numbers are within the error bounds.
#pragma once

#if defined(__FAST_MATH__) || (defined(__FINITE_MATH_ONLY__) && __FINITE_MATH_ONLY__ != 0) || \
    defined(_M_FP_FAST) || defined(__NO_SIGNED_ZEROS__) || defined(__ASSOCIATIVE_MATH__) ||   \
    defined(__RECIPROCAL_MATH__)
#error "Dermis: compile without -ffast-math, -ffinite-math-only, -fno-signed-zeros, /fp:fast"
#endif

// 0: `float` and larger types are evaluated in their own precision. 16: the 16-bit type too.
#if (defined(__FLT_EVAL_METHOD__) && __FLT_EVAL_METHOD__ != 0 && __FLT_EVAL_METHOD__ != 16) || \
    (defined(_M_IX86_FP) && _M_IX86_FP < 2)
#error "Dermis: compile for SSE2 and not for the x87 unit: -msse2 -mfpmath=sse, /arch:SSE2"
#endif
