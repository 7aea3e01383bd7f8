// The plan of one frame of a SkinningSystem. Where `makePlan` starts from jobs and finds out which
// belong together, this starts from instances that have known it since they were added: what is
// left for a frame is to count and to copy.
#pragma once

#include <array>
#include <cstdint>
#include <span>
#include <unordered_map>
#include <vector>

#include "abi.h"
#include "dermis/plan.h"
#include "plan/state.h"

namespace dermis {

/// A run of an instance's vertices: the group it belongs to, and its record in the tables but for
/// the palette, the flags and the extension.
struct PlacedRun {
  std::uint32_t group = notUsed;
  std::array<std::uint32_t, abi::INSTANCE_WORDS> record{};
};

/// What stands in the extension of an instance that has one.
struct InstanceExtras {
  std::vector<MorphWeight> morphs;  ///< in rising order, none of weight 0
  std::uint32_t result = notUsed;   ///< its number among the results
  Box box;
  bool hasBox = false;

  bool isNeeded() const { return !morphs.empty() || result != notUsed || hasBox; }
};

/// What the GPU has to know of an instance to choose whether it is skinned.
struct Candidate {
  std::uint32_t slot = 0;     ///< its place in the visibility and history buffers
  std::uint32_t version = 0;  ///< of what it should show; different for all instances and poses
};

/// Groups live as long as instances are in them.
class FrameGroups {
 public:
  std::uint32_t acquire(const GroupKey& key, const Variant& variant, std::uint32_t maxInfluences,
                        bool scales);
  void release(std::uint32_t group);

 private:
  friend class FrameBuilder;
  struct Entry {
    Group group;
    std::uint32_t users = 0;
    std::uint64_t frame = 0;       ///< the last one that it was used in …
    std::uint32_t frameGroup = 0;  ///< … and its number there
  };
  std::vector<Entry> entries_;
  std::vector<std::uint32_t> free_;
  std::unordered_map<GroupKey, std::uint32_t, GroupKeyHash> find_;
};

/// Where the tables of a frame have what the visibility kernel works on, in words.
struct CulledTables {
  std::uint32_t groups = 0;  ///< the first group record
  std::uint32_t groupCount = 0;
  std::uint32_t instances = 0;   ///< the instance records that groups count from
  std::uint32_t candidates = 0;  ///< CANDIDATE_WORDS for each, from the first culled instance on
  std::uint32_t firstInstance = 0;
  std::uint32_t dispatches = 0;  ///< CULLED_DISPATCH_WORDS each
  std::uint32_t dispatchCount = 0;
  std::uint32_t arguments = 0;  ///< of the indirect dispatches, INDIRECT_WORDS each
  std::uint32_t candidateCount = 0;
};

class FrameBuilder {
 public:
  FrameBuilder(FrameGroups& groups, const DeviceLimits& limits, const Tuning& tuning)
      : groups_(groups), limits_(limits), tuning_(tuning) {}

  /// The sizes of the buffers that stay.
  struct Sizes {
    std::uint64_t meshes = 0, matrices = 0, palettes = 0, results = 0;
    OutputSizes outputs;
  };
  void begin(const Sizes& sizes);

  /// A palette to be converted; all before the first instance's run is placed by `finish`.
  void addPalette(std::uint32_t matrixUnit, std::uint32_t outputUnit, std::uint32_t joints,
                  std::uint32_t flags) {
    plan_.state_->tables.insert(plan_.state_->tables.end(),
                                {matrixUnit, outputUnit, joints, flags});
    ++paletteCount_;
  }

  void clearResult(std::uint32_t result) { cleared_.push_back(result); }

  /// `run` and `extras` must stay until `finish`; `extras` is null where they are not needed.
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

  /// Fails with `limitExceeded` where the tables, or a dispatch, become too large.
  Result<void> finish();

  const Plan& plan() const { return plan_; }
  std::uint32_t paletteCount() const { return paletteCount_; }
  const CulledTables& culled() const { return culled_; }
  /// The dispatch's number among the indirect ones, or notUsed.
  std::uint32_t indirectNumber(std::size_t dispatch) const {
    return dispatch < firstIndirect_ ? notUsed
                                     : static_cast<std::uint32_t>(dispatch - firstIndirect_);
  }

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

  void count(std::uint32_t group) {
    FrameGroups::Entry& entry = groups_.entries_[group];
    if (entry.frame != frame_) startGroup(entry);
    ++plan_.state_->groups[entry.frameGroup].instances;
  }
  void startGroup(FrameGroups::Entry& entry);
  void writeInstances(std::uint32_t firstRecord);
  std::uint32_t appendExtension(const InstanceExtras& extras);
  void appendCandidates();
  void appendCulledDispatches();

  FrameGroups& groups_;
  DeviceLimits limits_;
  Tuning tuning_;
  Plan plan_;
  std::uint64_t frame_ = 0;
  std::uint32_t paletteCount_ = 0;
  std::vector<std::uint32_t> cleared_;
  std::vector<Entry> entries_;
  std::vector<CulledEntry> candidates_;
  std::vector<std::uint32_t> culledPlaces_;  ///< of each candidate, among the instance records
  std::size_t firstIndirect_ = 0;
  CulledTables culled_;
};

}  // namespace dermis
