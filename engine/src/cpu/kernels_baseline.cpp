// The kernels for what every processor has that runs the program: NEON on arm64. On x86, where
// nearly all processors have more, only the general path: of SSE2 or, with a Highway that lacks it,
// of plain code.
#include "cpu/kernels.h"

#ifdef DERMIS_CPU_HAS_SSE4
#define DERMIS_CPU_GENERAL_ONLY
#define HWY_DISABLED_TARGETS (~((1LL << 14) | HWY_EMU128 | HWY_SCALAR))  // the first is SSE2
// Highway considers EMU128 broken with GCC before 12.3 (bug 106322). Dermis does not use the
// affected operations; tests compare the resulting bits.
#define HWY_BROKEN_EMU128 0
#else
#define HWY_DISABLED_TARGETS (HWY_SVE | HWY_SVE2 | HWY_SVE_256 | HWY_SVE2_128)  // no fixed size
#endif
#define HWY_COMPILE_ONLY_STATIC
#include "cpu/kernels_inl.h"

namespace dermis::cpu {
const InstructionSet baseline{HWY_TARGET, HWY_NAMESPACE::skinTask};
}
