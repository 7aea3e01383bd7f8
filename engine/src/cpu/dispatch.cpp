// The choice among the instruction sets of kernels.h. Dermis has its own: Highway's is shared by
// the whole process, and the engine may use it too.
#include <algorithm>
#include <atomic>
#include <iterator>
#include <string>

#include "cpu/kernels.h"
#include "hwy/targets.h"

namespace dermis::cpu {
namespace {

/// The best first.
constexpr const InstructionSet* instructionSets[] = {
#ifdef DERMIS_CPU_HAS_AVX3
    &avx3,
#endif
#ifdef DERMIS_CPU_HAS_AVX2
    &avx2,
#endif
#ifdef DERMIS_CPU_HAS_SSE4
    &sse4,
#endif
#ifdef DERMIS_CPU_HAS_BASELINE
    &baseline,
#endif
};

bool isUsable(const InstructionSet& set) {
  return &set == *std::prev(std::end(instructionSets)) ||
         (hwy::SupportedTargets() & set.target) != 0;
}

const InstructionSet* best() {
  return *std::ranges::find_if(instructionSets,
                               [](const InstructionSet* set) { return isUsable(*set); });
}

std::atomic<const InstructionSet*>& chosen() {
  static std::atomic<const InstructionSet*> set{best()};
  return set;
}

}  // namespace

void dispatchTask(const Task& task, Scratch* scratch) {
  chosen().load(std::memory_order_relaxed)->skin(task, scratch);
}

void dispatchSampling(const ClipPlan& plan, const PackedLayers& layers, ClipScratch& scratch,
                      std::span<JointMatrix> poses) {
  chosen().load(std::memory_order_relaxed)->sample(plan, layers, scratch, poses);
}

void dispatchRigs(const PackedRig& rig, std::span<const RigPose> poses, RigScratch& scratch) {
  chosen().load(std::memory_order_relaxed)->evaluate(rig, poses, scratch);
}

std::vector<std::string_view> targetNames() {
  std::vector<std::string_view> names;
  for (const InstructionSet* const set : instructionSets) {
    if (isUsable(*set)) names.emplace_back(hwy::TargetName(set->target));
  }
  return names;
}

Result<void> setTarget(std::string_view name) {
  if (name.empty()) {
    chosen() = best();
    return {};
  }
  std::string all;
  for (const InstructionSet* const set : instructionSets) {
    if (!isUsable(*set)) continue;
    const std::string_view own = hwy::TargetName(set->target);
    if (name == own) {
      chosen() = set;
      return {};
    }
    if (!all.empty()) all.append(", ");
    all.append(own);
  }
  std::string message = "the instruction set '";
  message.append(name).append("' is not available; available here and in this build: ");
  return Error{ErrorCode::invalidArgument, message + all};
}

}  // namespace dermis::cpu
