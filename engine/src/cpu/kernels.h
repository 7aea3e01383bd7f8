// The instruction sets that this build has code for. Each has a source file, kernels_*.cpp. With
// DERMIS_CPU_ONLY_SSE4 it is that one: for tests.
#pragma once

#include <cstdint>
#include <span>

#include "cpu/clip_plan.h"
#include "cpu/task.h"

#ifndef DERMIS_CPU_ONLY_SSE4
#define DERMIS_CPU_HAS_BASELINE
#endif
#if (defined(__x86_64__) || defined(_M_X64)) && !defined(DERMIS_CPU_ONLY_SSE4)
#define DERMIS_CPU_HAS_AVX2
#if !defined(_MSC_VER) || defined(__clang__)  // Highway considers it broken with cl
#define DERMIS_CPU_HAS_AVX3
#endif
#endif
#if defined(__x86_64__) || defined(_M_X64) || defined(__i386__) || defined(_M_IX86)
#define DERMIS_CPU_HAS_SSE4
#endif

namespace dermis::cpu {

struct InstructionSet {
  std::int64_t target;                               ///< Highway's bit
  void (*skin)(const Task& task, Scratch* scratch);  ///< see `dispatchTask`
  void (*sample)(const ClipPlan& plan, const PackedLayers& layers, ClipScratch& scratch,
                 std::span<JointMatrix> poses);  ///< see `dispatchSampling`
  void (*evaluate)(const PackedRig& rig, std::span<const RigPose> poses,
                   RigScratch& scratch);  ///< see `dispatchRigs`
};

extern const InstructionSet avx3, avx2, sse4;
/// Needs nothing but what the compiler assumes.
extern const InstructionSet baseline;

}  // namespace dermis::cpu
