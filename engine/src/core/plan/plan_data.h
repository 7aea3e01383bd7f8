// The contents of a plan.
#pragma once

#include <algorithm>
#include <array>
#include <cstdint>
#include <memory>
#include <vector>

#include "abi.h"
#include "dermis/plan.h"
#include "dermis/result.h"
#include "plan/table_words.h"
#include "plan/variant.h"

namespace dermis {

/// Offsets of a frame's results and counters in its read-back buffer.
inline constexpr std::uint64_t readBackCounters = 0;
inline constexpr std::uint64_t readBackResults = sizeof(abi::CounterRecord);
/// Offset of the records in the history buffer: after the counters.
inline constexpr std::uint64_t historyRecords = sizeof(abi::CounterRecord);

class PlanMaker;

/// The sizes of the buffers that do not follow from a plan, in bytes.
struct PlanSizes {
  std::uint64_t meshes = 0, poses = 0, gpuPoses = 0, palettes = 0;
  std::uint32_t results = 0;  ///< their number
  ByStream<std::uint64_t> outputs{};
  bool isScene = false;  ///< the buffers of a scene exist
  std::uint32_t slots =
      0;  ///< of a scene: words of visibility, records of history; 0 if the GPU chooses nothing

  /// Of one buffer. `tables` is the size of the tables in bytes.
  DERMIS_CORE_API BufferRequirement requirement(BufferRole role, std::uint64_t tables,
                                                const DeviceLimits& limits) const;
};

/// The buffers that the commands of a plan name. Their sizes are at most storage buffer ranges, but
/// for outputs.
struct PlanBuffers {
  std::array<BufferPart, bufferRoleCount> parts;  ///< by role; `noIndex` if there is none
  std::vector<BufferPart> poses;                  ///< of a scene: of both kinds, by their index

  BufferPart& operator[](BufferRole role) { return parts[static_cast<std::size_t>(role)]; }
  const BufferPart& operator[](BufferRole role) const {
    return parts[static_cast<std::size_t>(role)];
  }
};

/// Alignment of the scene's output in its buffer. It is a multiple of every size that kernels store
/// at once: 8 bytes, and with wide stores also 12, 16, 24 and 32.
inline std::uint32_t outputRangeAlignment(const DeviceLimits& limits) {
  if (storesWidely(limits)) return 3 * std::max(limits.minStorageBufferOffsetAlignment, 32u);
  return std::max(limits.minStorageBufferOffsetAlignment, 16u);
}

struct PlanData {
  DERMIS_CORE_API PlanData();
  DERMIS_CORE_API ~PlanData();
  /// Created again if the plan was moved from.
  static PlanData& of(Plan& plan) {
    if (plan.data_ == nullptr) plan.data_ = std::make_unique<PlanData>();
    return *plan.data_;
  }
  static const PlanData& of(const Plan& plan) { return *plan.data_; }
  void clear();

  std::vector<Command> commands;
  std::vector<Binding> bindings;  ///< of all dispatches, one after the other
  std::vector<PipelineId> pipelines;
  /// Palette records, the numbers of results to clear, group records, instance records, extensions
  /// (each followed by its active morph targets). If the GPU culls: candidates, their dispatches,
  /// and indirect arguments.
  TableWords tables;
  /// Place of each palette in the palettes buffer, for each form, or notUsed.
  std::array<std::vector<std::uint32_t>, paletteFormCount> paletteUnits;
  std::vector<std::uint32_t> results;  ///< each job's number among the results, or notUsed
  PlanSizes sizes;
  DeviceLimits limits;
  std::uint32_t instanceCount = 0;
  std::uint64_t vertexCount = 0;

  std::unique_ptr<PlanMaker> maker;  ///< of `makePlan`, kept for its memory
};

}  // namespace dermis
