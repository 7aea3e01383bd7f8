// Encodes work as tables for GPUs, and lists the commands that execute it.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include "abi.h"
#include "dermis/plan.h"
#include "plan/plan_data.h"
#include "plan/work.h"

namespace dermis {

/// What a frame of a scene does besides skinning.
struct FrameWork {
  std::uint32_t clearHistory = 0;          ///< records of the history that are clear, or in use
  std::span<const CopyCommand> growth;     ///< from buffers to larger ones
  std::span<const UploadCommand> uploads;  ///< but for the tables
  std::span<const CopyCommand> moves;      ///< of outputs
  std::span<const CopyCommand> results;    ///< to the read-back buffer
  CopyCommand history;                     ///< the same, if it has bytes
};

/// Call `encode`, then one of the functions that list commands.
class Encoder {
 public:
  /// Encodes work that was arranged: the tables, and the dispatches that read them. `record`: of a
  /// scene, its number, from 1. `lent`: where the tables are written, if they fit. Fails with
  /// `limitExceeded` if the tables, or a dispatch, become too large.
  Result<void> encode(const Work& work, const DeviceLimits& limits, const Tuning& tuning,
                      const PlanSizes& sizes, PlanData& plan, std::uint32_t record = 0,
                      std::span<std::byte> lent = {});
  void listBatch(const PlanBuffers& buffers);
  /// Whether the frame has no commands, so that its buffers need no names.
  bool listsNothing(const FrameWork& frame) const;
  void listFrame(const PlanBuffers& buffers, const FrameWork& frame);

 private:
  struct Dispatch {
    DispatchCommand command;
    Variant variant;
    /// It reads what dispatches of lower stages write. Results are cleared in stage 0.
    std::uint32_t stage = 0;
    BufferRole joints = BufferRole::palettes;  ///< that the kernel reads
    std::uint32_t poseBuffer = 0;              ///< of kernels of a scene that read or write poses
    std::uint32_t drivenBuffer = notUsed;      ///< the same of driven joints and weights
    ByStream<std::uint32_t> windows{};
    std::uint32_t instancesPerInvocation = 0;  ///< at most; of a skin kernel
  };

  /// Of an `abi::InstanceRecord`.
  using InstanceWords = std::array<std::uint32_t, abi::INSTANCE_WORDS>;

  /// The instance records of a group that were written.
  struct GroupProgress {
    std::uint32_t count = 0;
    bool isEven = true;        ///< each word differs by the same from record to record; one box
    const Box* box = nullptr;  ///< for positions in snorm16, which the kernel then reads once
    InstanceWords last{}, step{};

    void add(const InstanceWords& words, const InstanceExtras* extras);
  };

  Result<void> addFigureDispatches();
  Result<void> addRigDispatches();
  Result<void> addPaletteDispatches();
  Result<void> addPaletteDispatch(const Work::Poses& poses, std::uint32_t kind);
  Result<void> addClearDispatch();
  std::uint64_t vertexGroupsOf(const Group& group) const;
  void chooseVerticesPerInvocation(std::span<const std::uint32_t> groups);
  std::uint32_t instancesPerInvocation(std::span<const std::uint32_t> groups) const;
  Result<void> addDispatches();
  template <typename Push>
  Result<void> addDispatch(const Variant& variant, std::uint64_t workgroups, Push push,
                           PipelineId known = {});
  void writeInstances();
  void markEvenlySpaced(std::uint32_t firstRecord);
  std::uint32_t appendExtension(const InstanceExtras& extras);
  std::uint32_t figureWord(const Candidate& candidate) const;
  std::uint32_t paletteWord(const Candidate& candidate) const;
  void appendCandidates();
  void appendCulledDispatches();
  Result<void> addVisibilityDispatches(std::uint32_t record);
  Result<void> addMorphLists();
  void listDispatch(const Dispatch& dispatch, const PlanBuffers& buffers);
  void listDispatches(const PlanBuffers& buffers);

  PlanData* plan_ = nullptr;
  const Work* work_ = nullptr;
  Tuning tuning_;
  std::uint32_t paletteStage_ = 0;            ///< of the palette kernel
  std::vector<std::uint32_t> figureWords_;    ///< of the first record of each pose buffer
  std::vector<std::uint32_t> paletteWords_;   ///< the same of each list of palettes
  std::uint32_t verticesPerInvocation_ = 1;   ///< of the dispatch that is being planned
  std::vector<std::uint32_t> instancesEach_;  ///< of each group record
  std::vector<GroupProgress> progress_;       ///< of each group
  std::vector<std::uint32_t> culledPlaces_;   ///< of each candidate, among the instance records
  /// Of each of `Work::morphLists`.
  std::vector<abi::MorphListRecord> listRecords_;
  /// They write tables: those without driven weights before all other dispatches, those with them
  /// after the rigs.
  std::vector<Dispatch> lists_, drivenLists_;
  std::vector<Dispatch> dispatches_;
  std::array<Dispatch, 2> visibility_;  ///< the passes of the visibility kernel
  abi::VisibilityPush culled_{};        ///< push constants of the visibility kernel
  std::uint32_t culledGroups_ = 0;
};

}  // namespace dermis
