// The contents of a plan, and how they are made. `makePlan` and the scene pass palettes and
// instances; only this code writes their records.
#pragma once

#include <algorithm>
#include <array>
#include <bit>
#include <cstdint>
#include <memory>
#include <optional>
#include <span>
#include <vector>

#include "abi.h"
#include "dermis/export.h"
#include "dermis/plan.h"
#include "plan/check.h"
#include "plan/placement.h"

namespace dermis {

inline constexpr std::uint64_t unitBytes = 16;  ///< offsets into palettes and matrices count these
inline constexpr std::uint32_t notUsed = 0xffffffffu;

// -- Palettes.

/// Units of a palette: its status, its joints, and their scale/shear parts; or its matrices alone.
inline std::uint64_t paletteSize(PaletteForm form, std::uint32_t jointCount, bool mayScale) {
  if (form == PaletteForm::matrices) return std::uint64_t{jointCount} * abi::UNITS_OF_MATRIX;
  const std::uint32_t joint =
      form == PaletteForm::logarithms ? abi::UNITS_OF_LOGARITHM : abi::UNITS_OF_DUAL_QUATERNION;
  return 1 + std::uint64_t{jointCount} * (joint + (mayScale ? 2 : 0));
}

// -- Groups.

/// Runs of instances with equal keys form a group: one mesh or a part of its vertices, one variant,
/// one output layout. A dispatch skins one or more groups. The instance records of a group are
/// consecutive in the tables.
struct GroupKey {
  std::uint64_t mesh = 0;     ///< bytes into the mesh buffer
  std::uint64_t variant = 0;  ///< its key
  std::array<std::uint32_t, streamCount> windows{};
  std::array<std::uint32_t, streamCount> strides{};
  std::uint32_t firstVertex = 0;
  std::uint32_t vertexEnd = 0;
  bool isCulled = false;  ///< its instances are chosen on the GPU

  friend bool operator==(const GroupKey&, const GroupKey&) = default;
};

struct Group {
  GroupKey key;
  Variant variant;  ///< of its dispatch
  std::uint32_t instances = 0;
  std::uint32_t firstInstance = 0;
  std::uint32_t filled = 0;
};

/// A run of an instance's vertices: its group, and its record in the tables without palettes, flags
/// and extension.
struct PlacedRun {
  std::uint32_t group = notUsed;
  abi::InstanceRecord record{};
};

/// What the place of an instance depends on, besides its job.
struct Placing {
  Subject subject;
  OutputWindows windows;
  std::uint32_t jointCount = 0;  ///< of its palette
  bool mayScale = false;         ///< a palette that it reads may scale
  bool isCulled = false;         ///< the GPU chooses whether it is skinned
};

/// Groups exist as long as they contain instances.
class Groups {
 public:
  /// Cuts the vertices of a job into runs (`cutIntoRuns`), appends them, and acquires their groups.
  /// Fails with `limitExceeded` if a kernel cannot see all windows of a run, or if the instance is
  /// culled on the GPU and needs more than one run; nothing is appended then.
  Result<void> place(const Job& job, const OutputStreams& streams, const Placing& placing,
                     const DeviceLimits& limits, const Tuning& tuning,
                     std::vector<PlacedRun>& runs);
  void release(std::uint32_t group);
  void clear();

 private:
  friend class PlanBuilder;
  struct Entry {
    Group group;
    std::uint32_t users = 0;
    std::uint32_t next = notUsed;  ///< of those with the same head
    std::uint64_t plan = 0;        ///< the last one that it was used in …
    std::uint32_t planGroup = 0;   ///< … and its number there
  };
  void chooseVariant(const Job& job, const OutputStreams& streams, bool mayScale,
                     const DeviceLimits& limits, const Tuning& tuning);
  std::uint32_t acquire(const GroupKey& key, const Variant& variant);
  std::uint32_t findOrAdd(const GroupKey& key, const Variant& variant);
  std::uint32_t& headOf(const GroupKey& key);
  void growHeads();

  std::vector<Entry> entries_;
  std::vector<std::uint32_t> free_;
  std::vector<std::uint32_t> heads_;  ///< hash table: lists of entries; its size is a power of two
  /// The group that was acquired last: consecutive instances mostly have the same one.
  std::uint32_t last_ = notUsed;
  LayoutNeeds lastLayout_;  ///< of the job that was placed last …
  FormNeeds lastForm_;
  Variant lastVariant_;        ///< … its variant …
  std::uint64_t lastKey_ = 0;  ///< … and the key of that; 0: there is none
  std::vector<VertexRun> vertexRuns_;
};

// -- Instances.

/// The contents of an instance's extension record.
struct InstanceExtras {
  std::vector<MorphWeight> morphs;  ///< in ascending order, without weights of 0
  std::uint32_t result = notUsed;   ///< its number among the results
  Box box;
  bool hasBox = false;

  bool isNeeded() const { return !morphs.empty() || result != notUsed || hasBox; }
};

/// The targets whose weight is not 0, in ascending order, since the order of a sum affects its last
/// bits.
void assignActive(std::span<const MorphWeight> morphs, std::vector<MorphWeight>& active);

/// The data with which the GPU decides whether an instance is skinned.
struct Candidate {
  std::uint32_t slot = 0;     ///< its place in the visibility and history buffers
  std::uint32_t version = 0;  ///< of the state that it should show; unique within a scene
};

/// Offsets of a frame's results and counters in its read-back buffer.
inline constexpr std::uint64_t readBackCounters = 0;
inline constexpr std::uint64_t readBackResults = sizeof(abi::CounterRecord);

// -- Plans.

/// The joint matrices that are converted to a palette.
struct PoseSource {
  std::uint32_t unit = 0;  ///< of the first
  std::uint32_t buffer = 0;
  BufferRole role = BufferRole::poses;
};

class PlanMaker;

/// The sizes of the buffers that do not follow from a plan, in bytes.
struct PlanSizes {
  std::uint64_t meshes = 0, poses = 0, gpuPoses = 0, palettes = 0;
  std::uint32_t results = 0;  ///< their number
  OutputSizes outputs;
  bool isScene = false;  ///< the buffers of a scene exist
  std::uint32_t slots =
      0;  ///< of a scene: words of visibility, records of history; 0 if the GPU chooses nothing

  /// Of one buffer. `tables` is the size of the tables in bytes.
  BufferRequirement requirement(BufferRole role, std::uint64_t tables,
                                const DeviceLimits& limits) const;
};

/// Alignment of the scene's output in its buffer. It is a multiple of every size that kernels store
/// at once: 8 bytes, and with wide stores also 12, 16, 24 and 32.
inline std::uint32_t outputRangeAlignment(const DeviceLimits& limits) {
  if (storesWidely(limits)) return 3 * std::max(limits.minStorageBufferOffsetAlignment, 32u);
  return std::max(limits.minStorageBufferOffsetAlignment, 16u);
}

/// The work of a frame of a scene, besides skinning.
struct FrameWork {
  std::uint32_t frame = 0;               ///< counts records, from 1
  std::uint32_t clearHistory = 0;        ///< records of the history that are clear, or in use
  std::span<const CopyCommand> moves;    ///< of outputs
  std::span<const CopyCommand> results;  ///< to the read-back buffer
};

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
  std::vector<Variant> variants;
  /// Palette records, the numbers of results to clear, group records, instance records, extensions
  /// (each followed by its active morph targets). If the GPU culls: candidates, their dispatches,
  /// and indirect arguments.
  std::vector<std::uint32_t> tables;
  /// Place of each palette in the palettes buffer, for each form, or notUsed.
  std::array<std::vector<std::uint32_t>, paletteFormCount> paletteUnits;
  std::vector<std::uint32_t> results;  ///< each job's number among the results, or notUsed
  PlanSizes sizes;
  DeviceLimits limits;
  std::uint32_t instanceCount = 0;
  std::uint64_t vertexCount = 0;
  std::uint32_t candidateCount = 0;  ///< instances that the GPU may choose

  std::unique_ptr<PlanMaker> maker;  ///< of `makePlan`, kept for its memory
};

/// Fills a plan: call `begin`, add palettes and instances, then `finish`.
class PlanBuilder {
 public:
  void begin(PlanData& plan, Groups& groups, const DeviceLimits& limits, const Tuning& tuning,
             const PlanSizes& sizes);

  /// A palette to be converted, from one of the pose buffers (a batch has only number 0). Palettes
  /// and instances may be added in any order.
  void addPalette(const PoseSource& source, std::uint32_t outputUnit, std::uint32_t joints,
                  PaletteForm form, bool mayScale) {
    while (palettes_.size() <= source.buffer) palettes_.emplace_back();
    PaletteLists& lists = palettes_[source.buffer];
    lists.joints = source.role;
    lists.records[static_cast<std::size_t>(form)][mayScale].push_back(
        {source.unit, outputUnit, joints, 0});
    ++paletteCount_;
  }

  void clearResult(std::uint32_t result) { cleared_.push_back(result); }

  /// `run` and `extras` must stay valid until `finish`; `extras` is null if they are not needed.
  void add(const PlacedRun& run, std::uint32_t palette, std::uint32_t flags,
           const InstanceExtras* extras) {
    count(run.group);
    entries_.push_back({&run, extras, palette, flags});
  }
  void addCulled(const PlacedRun& run, std::uint32_t palette, std::uint32_t flags,
                 const InstanceExtras* extras, const Candidate& candidate) {
    add(run, palette, flags, extras);
    candidates_.push_back({static_cast<std::uint32_t>(entries_.size() - 1), candidate});
  }

  /// The commands of a batch; with `frame`, those of a scene. Fails with `limitExceeded` if the
  /// tables, or a dispatch, become too large.
  Result<void> finish(const FrameWork* frame = nullptr);

  std::uint32_t paletteCount() const { return paletteCount_; }

 private:
  struct Entry {
    const PlacedRun* run;
    const InstanceExtras* extras;
    std::uint32_t palette;
    std::uint32_t flags;
  };
  struct CulledEntry {
    std::uint32_t entry;
    Candidate candidate;
  };
  /// Of one pose buffer: a dispatch for each form, with and without scale.
  struct PaletteLists {
    BufferRole joints = BufferRole::poses;
    std::array<std::array<std::vector<abi::PaletteRecord>, 2>, paletteFormCount> records;
  };
  struct Dispatch {
    DispatchCommand command;
    /// It reads what the palette kernel writes, or adds to results that the clear kernel clears.
    bool isAfterPalettes = false;
  };

  void count(std::uint32_t group) {
    Groups::Entry& entry = groups_->entries_[group];
    if (entry.plan != number_) startGroup(entry);
    ++planGroups_[entry.planGroup].instances;
  }
  void startGroup(Groups::Entry& entry);
  Result<void> addPaletteDispatches();
  Result<void> addPaletteDispatch(const Variant& variant,
                                  std::span<const abi::PaletteRecord> records, BufferRole joints,
                                  std::uint32_t buffer);
  Result<void> addClearDispatch();
  std::uint64_t vertexGroupsOf(const Group& group) const;
  void chooseVerticesPerInvocation(std::span<const std::uint32_t> groups);
  std::uint32_t instancesPerInvocation(std::span<const std::uint32_t> groups) const;
  Result<void> addDispatches();
  template <typename Push>
  Result<void> addDispatch(const Variant& variant, std::uint64_t workgroups, Push push);
  void writeInstances();
  void markEvenlySpaced(std::uint32_t firstRecord);
  std::uint32_t appendMorphs(std::span<const MorphWeight> morphs);
  std::uint32_t appendExtension(const InstanceExtras& extras);
  void appendCandidates();
  void appendCulledDispatches();
  Result<void> addVisibilityDispatches(std::uint32_t frame);
  void listDispatches();
  void listFrame(const FrameWork& frame);

  PlanData* plan_ = nullptr;
  Groups* groups_ = nullptr;
  DeviceLimits limits_;
  Tuning tuning_;
  std::uint32_t verticesPerInvocation_ = 1;  ///< of the dispatch that is being planned
  std::uint64_t number_ = 0;                 ///< of the plan, among those of this builder
  std::uint32_t paletteCount_ = 0;
  std::vector<PaletteLists> palettes_;  ///< by pose buffer
  std::vector<std::uint32_t> cleared_;
  std::vector<Entry> entries_;
  std::vector<CulledEntry> candidates_;
  std::vector<std::uint32_t> culledPlaces_;  ///< of each candidate, among the instance records
  std::vector<Group> planGroups_;            ///< those in use, in the order of their first instance
  std::vector<std::uint32_t> order_;
  std::vector<Dispatch> dispatches_;
  std::array<DispatchCommand, 2> visibility_;  ///< the passes of the visibility kernel
  abi::VisibilityPush culled_{};               ///< push constants of the visibility kernel
  std::uint32_t culledGroups_ = 0;
};

}  // namespace dermis
