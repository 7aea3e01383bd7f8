// The kernels that need nothing but what the compiler assumes. On arm64, these are the kernels for
// NEON. On x86 they are the fallback for processors without SSE4: for SSE2 or, with Highway 1.0,
// for EMU128, which is plain code. The fallback is made small, and samples figures and evaluates
// rigs by the code of core.
#include "cpu/kernels.h"

#ifdef DERMIS_CPU_HAS_BASELINE
#ifdef DERMIS_CPU_HAS_SSE4
#define DERMIS_CPU_SMALL
#define DERMIS_CPU_SSE2 (1LL << 14)  // HWY_SSE2, which Highway 1.0 does not define
#define HWY_DISABLED_TARGETS (~(DERMIS_CPU_SSE2 | HWY_EMU128 | HWY_SCALAR))
// Highway considers EMU128 broken with GCC before 12.3 (bug 106322). Dermis does not use the
// affected operations; tests compare the resulting bits.
#define HWY_BROKEN_EMU128 0
#else
#define HWY_DISABLED_TARGETS (HWY_SVE | HWY_SVE2 | HWY_SVE_256 | HWY_SVE2_128)  // no fixed size
#endif
#define HWY_COMPILE_ONLY_STATIC
#include "cpu/kernels_inl.h"
#ifndef DERMIS_CPU_SMALL
#include "cpu/rig_inl.h"
#include "cpu/sample_inl.h"
#endif

namespace dermis::cpu {
#ifdef DERMIS_CPU_SMALL
constinit const InstructionSet baseline{HWY_TARGET, HWY_NAMESPACE::skinTask, samplePlainly,
                                        evaluatePlainly};
#else
constinit const InstructionSet baseline{HWY_TARGET, HWY_NAMESPACE::skinTask,
                                        HWY_NAMESPACE::sampleFigure,
                                        HWY_NAMESPACE::rigs::evaluateRigs};
#endif
}  // namespace dermis::cpu
#endif
