// What is to be skinned in a batch or in a frame of a scene, as plain data: poses to convert,
// groups, and the instances of each group. GPUs get it encoded as tables (encode.h); the CPU path
// reads it as it is. Before that: the groups of an instance, and the output windows that its
// vertices are written to, which do not depend on a frame.
#pragma once

#include <array>
#include <cstdint>
#include <span>
#include <vector>

#include "abi.h"
#include "clips/device_clips.h"
#include "dermis/mesh.h"
#include "dermis/plan.h"
#include "dermis/result.h"
#include "plan/check.h"
#include "plan/variant.h"

namespace dermis {

inline constexpr std::uint32_t notUsed = 0xffffffffu;
inline constexpr std::uint64_t unitBytes = 16;  ///< offsets into palettes and matrices count these

// -- Windows: ranges through which an output larger than `maxStorageBufferRange` is written.

/// Bytes from the beginning of one output window to the beginning of the next. A window has at most
/// `maxStorageBufferRange` bytes. Windows overlap, so that each instance, or each part of a large
/// instance, lies in one window.
DERMIS_CORE_API std::uint64_t outputWindowStep(const DeviceLimits& limits);

/// What the windows of the outputs depend on, besides jobs.
struct OutputWindows {
  OutputWindows() = default;
  OutputWindows(const ByStream<std::uint64_t>& outputSizes, const DeviceLimits& limits);

  std::uint64_t range = 0;      ///< bytes of the largest window
  std::uint64_t step = 0;       ///< `outputWindowStep`
  ByStream<bool> oversized{};   ///< the output is larger than a window
  bool isAnyOversized = false;  ///< usually false
};

/// Consecutive vertices of one job. Each of their attributes lies in one window of its buffer.
struct VertexRun {
  std::uint32_t firstVertex = 0;
  std::uint32_t vertexEnd = 0;
  ByStream<std::uint32_t> windows{};
};

// -- Groups of instances that one part of a dispatch skins: one mesh or a part of its vertices, one
// variant, one output layout.

/// Runs of instances with equal keys form a group.
struct GroupKey {
  std::uint64_t mesh = 0;  ///< bytes into the mesh buffer
  PipelineId pipeline{};
  ByStream<std::uint32_t> windows{};
  ByStream<std::uint32_t> strides{};
  std::uint32_t firstVertex = 0;
  std::uint32_t vertexEnd = 0;
  bool isCulled = false;  ///< its instances are chosen on the GPU

  friend bool operator==(const GroupKey&, const GroupKey&) = default;
};

struct Group {
  GroupKey key;
  Variant variant;  ///< of its dispatch
  std::uint32_t instances = 0;
  std::uint32_t firstInstance = 0;  ///< among all, in the order of the dispatches
};

/// A run of an instance's vertices: its group, and where the first vertex of each attribute is.
struct PlacedRun {
  std::uint32_t group = notUsed;
  std::uint32_t joints = 0;           ///< of its pose
  ByStream<std::uint32_t> offsets{};  ///< bytes from the beginning of the window
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
  /// Cuts the vertices of a job into runs (`VertexRun`), appends them, and acquires their groups.
  /// Fails with `limitExceeded` if a kernel cannot see all windows of a run, or if the instance is
  /// culled on the GPU and needs more than one run; nothing is appended then.
  Result<void> place(const Job& job, const OutputStreams& streams, const Placing& placing,
                     const DeviceLimits& limits, const Tuning& tuning,
                     std::vector<PlacedRun>& runs);
  void release(std::uint32_t group);
  void clear();

 private:
  friend struct Work;
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
  PipelineId lastPipeline_{};  ///< … and the ID of that; 0: there is none
  std::vector<VertexRun> vertexRuns_;
};

// -- What is skinned.

/// Units of a palette: its status, its joints, and their scale/shear parts; or its matrices alone.
inline std::uint64_t paletteSize(PaletteForm form, std::uint32_t jointCount, JointPromise promise) {
  if (form == PaletteForm::matrices) return std::uint64_t{jointCount} * abi::UNITS_OF_MATRIX;
  const std::uint32_t joint =
      form == PaletteForm::logarithms ? abi::UNITS_OF_LOGARITHM : abi::UNITS_OF_DUAL_QUATERNION;
  return 1 + std::uint64_t{jointCount} *
                 (joint + (promise == JointPromise::scaling ? abi::UNITS_OF_SCALE_SHEAR : 0));
}

/// The joints whose memory has room for so many 32-bit words.
inline std::uint32_t jointsFor(std::uint64_t words) {
  constexpr std::uint64_t each = sizeof(JointMatrix) / sizeof(float);
  return static_cast<std::uint32_t>((words + each - 1) / each);
}

/// What only some instances have.
struct InstanceExtras {
  std::uint32_t result = notUsed;   ///< its number among the results
  std::uint32_t writtenMorphs = 0;  ///< targets whose weights are made on the GPU …
  std::uint32_t drivenMorphs = 0;   ///< … and those after them that a rig drives
  bool hasBox = false;
  std::vector<MorphWeight> morphs;  ///< in ascending order, without weights of 0
  Box box;
  std::uint32_t firstDrivenWeight = 0;  ///< of those that a rig drives

  bool isNeeded() const {
    return !morphs.empty() || result != notUsed || hasBox || writtenMorphs != 0 ||
           drivenMorphs != 0;
  }
};

/// The targets whose weight is not 0, in ascending order, since the order of a sum affects its last
/// bits.
void assignActive(std::span<const MorphWeight> morphs, std::vector<MorphWeight>& active);

/// Palettes are converted by form and promise: `form` × `jointPromiseCount` + `promise`.
inline constexpr std::uint32_t paletteKindCount = paletteFormCount * jointPromiseCount;

/// Where a palette that is converted is in the work.
struct PalettePlace {
  std::uint32_t list = 0;         ///< index into `Work::poses` × `paletteKindCount` + kind
  std::uint32_t index = notUsed;  ///< in this list
};

/// The data with which the GPU decides whether an instance is skinned.
struct Candidate {
  std::uint32_t slot = 0;     ///< its place in the visibility and history buffers
  std::uint32_t version = 0;  ///< of the state that it should show; unique within a scene
  // What is made only if such an instance is skinned: its figure, by the order in which figures are
  // added to the work, and its palette; `notUsed`: none.
  std::uint32_t figure = notUsed;
  PalettePlace palette = {};
};

/// The joint matrices that are converted to a palette. Of those that a rig drives, which come last:
/// their buffer and first unit, and the number of the others.
struct PoseSource {
  std::uint32_t unit = 0;  ///< of the first
  std::uint32_t buffer = 0;
  BufferRole role = BufferRole::poses;
  std::uint32_t drivenBuffer = notUsed, drivenUnit = 0, writtenJoints = 0;
};

/// Call `begin`, add palettes and instances in any order, then `arrange`.
struct Work {
  /// Poses of one pose buffer; with a rig, those whose driven joints are in one buffer.
  struct Poses {
    struct List {
      std::vector<abi::PaletteRecord> records;
      std::vector<abi::DrivenRecord> driven;  ///< of the same palettes; only with a rig
    };
    std::uint32_t buffer = 0, drivenBuffer = notUsed;
    BufferRole joints = BufferRole::poses;
    std::uint32_t filled = 0;  ///< bit `kind`: the list has poses
    std::array<List, paletteKindCount> lists;
  };
  /// A bank that figures play.
  struct Bank {
    const DeviceClips* clips;
    std::uint32_t words;        ///< where it is in the mesh buffer
    std::uint32_t deviceWords;  ///< the same of `DeviceClips::words`
  };
  struct Instance {
    PlacedRun run;
    std::uint32_t group = 0;                 ///< its number in `groups`
    std::uint32_t pose = 0;                  ///< index
    const InstanceExtras* extras = nullptr;  ///< null if it has none
    std::uint32_t palette = 0;               ///< the unit where it begins
    std::uint32_t flags = 0;                 ///< abi::INSTANCE_RESTARTS and the like
  };
  /// Poses of one rig whose joints are in one buffer, and driven joints in another.
  struct Rig {
    std::uint32_t words;  ///< where the rig is in the mesh buffer
    std::uint32_t buffer, drivenBuffer;
    BufferRole joints;
    std::vector<abi::RigRecord> poses;   ///< but for `figure`
    std::vector<std::uint32_t> figures;  ///< for each: by the order of figures, or `notUsed`
  };
  /// Active morph targets that the GPU lists: of an instance with `InstanceExtras::writtenMorphs`
  /// or `drivenMorphs`.
  struct MorphList {
    std::uint32_t instance;       ///< index into `instances`
    std::uint32_t buffer;         ///< of poses, that has the weights; `notUsed`: they are sampled
    std::uint32_t drivenBuffer;   ///< that has driven weights, or `notUsed`
    abi::MorphListRecord record;  ///< but for `extension`, `list`, `listed` and counts
  };
  struct Culled {
    std::uint32_t instance;  ///< index into `instances`
    Candidate candidate;
  };

  std::vector<Bank> banks;
  /// Whose poses are sampled before they are converted, by pose buffer. `FigureRecord::bank` is an
  /// index into `banks`.
  std::vector<std::vector<abi::FigureRecord>> figures;
  /// Of each figure, in the order in which they were added: pose buffer, and place in its list.
  std::vector<std::array<std::uint32_t, 2>> figurePlaces;
  std::vector<Poses> poses;
  std::vector<Rig> rigs;
  std::uint32_t poseCount = 0;
  std::vector<std::uint32_t> clearedResults;  ///< the numbers of results to be cleared
  std::vector<Instance> instances;            ///< in the order in which they were added
  std::vector<Culled> culled;                 ///< those that the GPU may choose
  std::vector<MorphList> morphLists;          ///< in the order of `instances`
  std::vector<Group> groups;                  ///< in the order of their first instance
  /// Of the groups, in the order of their dispatches. A dispatch skins groups of one variant, one
  /// output window each, culled or not.
  std::vector<std::uint32_t> order;

  void addFigure(std::uint32_t poseBuffer, const Bank& bank, abi::FigureRecord record);
  /// `figure`: of the pose, by the order in which figures are added, or `notUsed`.
  void addRig(std::uint32_t words, const PoseSource& source, const abi::RigRecord& record,
              std::uint32_t figure);
  void begin(Groups& groupsInUse);
  bool isEmpty() const { return poseCount == 0 && clearedResults.empty() && instances.empty(); }

  /// A batch has only pose buffer 0. If it is not needed, the GPU decides whether it is.
  PalettePlace addPose(const PoseSource& source, std::uint32_t outputUnit, std::uint32_t joints,
                       PaletteForm form, JointPromise promise, bool isNeeded = true) {
    const std::uint32_t buffers = buffersOf(source);
    const std::uint32_t kind =
        static_cast<std::uint32_t>(form) * jointPromiseCount + static_cast<std::uint32_t>(promise);
    Poses& of = poses[buffers];
    of.joints = source.role;
    of.filled |= 1u << kind;
    Poses::List& list = of.lists[kind];
    auto& record = list.records.emplace_back();  // written in place, not copied
    record.matrices = source.unit;
    record.place = outputUnit;
    record.jointCount = joints;
    record.needed = isNeeded ? 1 : 0;
    if (source.drivenBuffer != notUsed)
      list.driven.push_back({source.drivenUnit, source.writtenJoints, 0, 0});
    ++poseCount;
    return {buffers * paletteKindCount + kind, static_cast<std::uint32_t>(list.records.size() - 1)};
  }
  /// The caller sets the rest. What it points to must stay valid while the work is read.
  Instance& add(const PlacedRun& run) {
    Groups::Entry& entry = groups_->entries_[run.group];
    if (entry.plan != number_) startGroup(entry);
    ++groups[entry.planGroup].instances;
    Instance& added = instances.emplace_back();
    added.run = run;
    added.group = entry.planGroup;
    return added;
  }
  /// The GPU may choose the instance that was added last.
  void cull(const Candidate& candidate) {
    culled.push_back({static_cast<std::uint32_t>(instances.size() - 1), candidate});
  }

  /// Sets `order`, and `Group::firstInstance`.
  void arrange();
  /// Whether two groups are skinned by one dispatch.
  bool shareDispatch(std::uint32_t group, std::uint32_t other) const;

 private:
  void startGroup(Groups::Entry& entry);
  /// The index of its list in `poses`, mostly the first.
  std::uint32_t buffersOf(const PoseSource& source) {
    for (std::uint32_t index = 0; index < poses.size(); ++index) {
      if (poses[index].buffer == source.buffer && poses[index].drivenBuffer == source.drivenBuffer)
        return index;
    }
    Poses& added = poses.emplace_back();
    added.buffer = source.buffer;
    added.drivenBuffer = source.drivenBuffer;
    return static_cast<std::uint32_t>(poses.size() - 1);
  }

  Groups* groups_ = nullptr;
  std::uint64_t number_ = 0;  ///< of the work, among those of this object
};

}  // namespace dermis
