// The kernels for Highway's target AVX2.
#include "cpu/kernels.h"

#ifdef DERMIS_CPU_HAS_AVX2
#define HWY_BASELINE_TARGETS HWY_AVX2
#define HWY_DISABLED_TARGETS (~HWY_AVX2)
#define HWY_BROKEN_TARGETS 0
#include "cpu/kernels_inl.h"
#include "cpu/rig_inl.h"
#include "cpu/sample_inl.h"

namespace dermis::cpu {
constinit const InstructionSet avx2{HWY_TARGET, HWY_NAMESPACE::skinTask,
                                    HWY_NAMESPACE::sampleFigure, HWY_NAMESPACE::rigs::evaluateRigs};
}
#endif
