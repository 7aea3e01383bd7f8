// The dispatches of a plan, for tests that look at nothing else.
#pragma once

#include <span>
#include <variant>
#include <vector>

#include "abi.h"
#include "dermis/plan.h"
#include "plan/variant.h"

namespace dermis::test {

struct PlannedDispatch : DispatchCommand {
  bool isAfterBarrier = false;  ///< a barrier of the plan stands before it
  Variant variant;              ///< of its pipeline

  abi::PalettePush palettePush() const { return abi::load<abi::PalettePush>(constants, 0); }
  abi::ClearPush clearPush() const { return abi::load<abi::ClearPush>(constants, 0); }
  abi::SkinPush skinPush() const { return abi::load<abi::SkinPush>(constants, 0); }
  /// What a storage buffer slot is bound to; nothing if the dispatch has no such slot.
  BufferPart partAt(std::uint32_t slot) const {
    for (const Binding& binding : bindings) {
      if (binding.slot == slot) return binding.part;
    }
    return {};
  }
  /// The part of an output that the skin kernel writes. Devices with few storage buffers have one.
  BufferPart outputPart(std::size_t stream) const {
    const BufferPart own = partAt(abi::BINDING_POSITIONS + static_cast<std::uint32_t>(stream));
    return own.buffer != noIndex ? own : partAt(abi::BINDING_POSITIONS);
  }
};

inline std::vector<Variant> variantsOf(std::span<const PipelineId> ids) {
  std::vector<Variant> variants;
  for (const PipelineId id : ids) variants.push_back(variantOf(id));
  return variants;
}

/// `pipelines` for a job or needs.
template <typename Subject>
Result<std::vector<Variant>> everyVariant(const Subject& subject, const DeviceLimits& limits,
                                          const Tuning& tuning) {
  const Result<std::vector<PipelineId>> all = pipelines(subject, limits, tuning);
  if (!all) return all.error();
  return variantsOf(*all);
}

inline std::vector<PlannedDispatch> dispatchesOf(const Plan& plan) {
  std::vector<PlannedDispatch> dispatches;
  bool isAfterBarrier = false;
  for (const Command& command : plan.commands()) {
    if (const auto* dispatch = std::get_if<DispatchCommand>(&command))
      dispatches.push_back({*dispatch, isAfterBarrier, variantOf(dispatch->pipeline)});
    isAfterBarrier |= std::holds_alternative<BarrierCommand>(command);
  }
  return dispatches;
}

}  // namespace dermis::test
