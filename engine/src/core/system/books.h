// The state of a Scene: its objects by handle, the free ranges of its buffers, and the work of the
// next frame.
#pragma once

#include <array>
#include <cstdint>
#include <deque>
#include <optional>
#include <span>
#include <utility>
#include <vector>

#include "dermis/handle.h"
#include "dermis/plan.h"
#include "dermis/result.h"
#include "dermis/scene.h"
#include "plan/encode.h"
#include "plan/work.h"
#include "system/range_allocator.h"
#include "system/slot_map.h"

namespace dermis {

/// The initial sizes of a scene's buffers; for poses, of the first buffer of each kind.
PlanSizes sceneSizes(const SceneDescription& description);

/// The free ranges of a buffer that may grow.
struct Store {
  BufferRole role;
  Capacity capacity;            ///< in units
  std::uint64_t unitBytes = 1;  ///< what the ranges count
  std::uint64_t base = 0;       ///< bytes before it in its buffer
  RangeAllocator ranges{capacity.initial, base};
};

struct SceneMesh {
  MeshInfo info;
  Range bytes;
  std::uint32_t users = 0;
};

struct ScenePose {
  /// The pose as it was last converted to one of the forms that methods read.
  struct Form {
    std::uint32_t unit = notUsed;  ///< the first of its palette
    std::uint64_t version = 0;     ///< of the pose; 0 if it is to be converted again
    std::uint64_t plannedIn = 0;   ///< the plan that converts it
  };

  std::uint32_t jointCount = 0;
  bool mayScale = true;
  PoseWriter writer = PoseWriter::cpu;
  std::uint32_t buffer = 0;  ///< its number
  Range joints;              ///< in that buffer, of all slots together
  /// The slot that has the current pose. Poses that the CPU writes have a slot for each frame in
  /// flight.
  std::uint32_t slot = 0;
  std::uint64_t poseFrame = 0;  ///< the frame that it was last written in
  std::uint64_t version = 1;
  std::array<Form, paletteFormCount> forms;
  std::uint32_t users = 0;
  std::uint32_t firstInstance = notUsed;  ///< of the linked list of its instances
};

/// Where an instance's vertices are, or will be.
struct Place {
  Range bytes;
  MeshHandle mesh;
  std::uint32_t vertexCount = 0;

  friend bool operator==(const Place&, const Place&) = default;
};

/// The part of an instance that `change`, `setVisibility` and `plan` read for many instances. It is
/// separate from the rest, so that caches hold it for many instances.
struct InstanceState {
  std::uint32_t generation = 0;  ///< of its handle; 0: there is none
  std::uint32_t updateInterval = 1;
  bool isStale = false;   ///< something changed since it was skinned
  bool isListed = false;  ///< among the pending
  bool isVisible = true;
  bool isCulled = false;
  bool hasMotion = false;
  bool restartsMotion = true;     ///< when it is skinned next
  bool isUrgent = true;           ///< skinned at once, regardless of its interval
  bool isMoving = false;          ///< previous positions may differ, as of the last record
  std::uint64_t visibleFrom = 0;  ///< the first record that displays it again
  std::uint64_t hiddenAfter = 0;  ///< the last record that displayed it before it was hidden
};

struct SceneInstance {
  // The members that a frame reads to skin an instance come first, the first of them in the cache
  // line that begins the slot. With lavapipe, skinning evicts instances from the caches, so each
  // cache line must be fetched again in the next frame.
  bool isShifting = false;  ///< among the shifting
  Method method = Method::dualQuaternion;
  std::uint32_t pose = 0;  ///< index
  std::uint32_t vertexCount = 0;
  std::uint32_t vertexBytes = 0;  ///< that are written for a vertex
  std::uint64_t plannedIn = 0;    ///< the last plan that skins it …
  std::uint64_t settledIn = 0;    ///< … and the last that settles it
  std::uint32_t nextOfPose = notUsed, previousOfPose = notUsed;
  std::uint64_t firstFrame = 0;  ///< in which it was skinned
  PlacedRun run;                 ///< the first, and mostly the only one
  VertexLayout layout;
  Place target;  ///< where it is skinned to
  InstanceExtras extras;
  std::vector<PlacedRun> furtherRuns;  ///< of instances that no single output range holds

  // Of those culled on the GPU.
  std::uint32_t version = 0;  ///< of what it should show, as of the last record
  std::uint32_t culledIndex = notUsed;

  // Rarely read.
  MeshHandle mesh;
  PoseHandle poseHandle;
  bool bounds = false;
  std::optional<Place> shown;  ///< where it was last recorded
};

class SceneBooks {
 public:
  explicit SceneBooks(const SceneDescription& description);

  Result<MeshHandle> addMesh(const MeshInfo& info);
  Result<void> removeMesh(MeshHandle mesh);
  Result<void> addPoses(std::span<PoseHandle> poses, std::uint32_t jointCount,
                        const PoseOptions& options);
  Result<void> removePose(PoseHandle pose);
  Result<InstanceHandle> addInstance(const InstanceDescription& description);
  Result<void> removeInstance(InstanceHandle instance);

  Result<void> beginFrame(std::uint64_t frame, std::uint64_t completedFrame);
  Result<PosePlace> writePose(PoseHandle pose);
  Result<void> markWritten(std::span<const PoseHandle> poses);
  Result<void> markAllWritten();
  Result<void> change(const InstanceChange& change);
  Result<void> change(std::span<const InstanceChange> changes);
  Result<void> setVisibility(std::span<const InstanceVisibility> instances);
  Result<bool> isDue(InstanceHandle instance) const;
  std::uint64_t compact(std::uint64_t maxBytes);

  /// Collects all work. None of it counts as done before `commit`.
  Result<void> gather();
  /// `gather`, encoded as a plan.
  Result<void> plan(Plan& out);
  Result<void> commit();
  Result<void> abandonFrame(std::uint64_t frame);
  /// Called if something changes: the current plan can no longer be committed.
  void unplan() { isPlanned_ = false; }
  Result<void> readBack(std::uint64_t frame, std::span<const std::byte> bytes);

  const SlotMap<SceneMesh, MeshHandle>& meshes() const { return meshes_; }
  const SlotMap<ScenePose, PoseHandle>& poses() const { return poses_; }
  const SlotMap<SceneInstance, InstanceHandle>& instances() const { return instances_; }
  static PosePlace placeOf(const ScenePose& pose);
  std::uint32_t poseBufferCount() const { return static_cast<std::uint32_t>(poseBuffers_.size()); }
  PoseBuffer poseBuffer(std::uint32_t number) const;
  PlanSizes sizes() const;
  Result<InstanceOutput> output(InstanceHandle instance) const;
  Result<std::optional<Box>> bounds(InstanceHandle instance) const;
  const SceneDescription& description() const { return description_; }
  SceneStatistics statistics() const;

  /// Of the last `gather`.
  const Work& work() const { return work_; }
  std::span<const CopyCommand> moves() const { return moves_; }

  std::span<const InstanceHandle> skinned() const { return skinned_; }
  std::span<const InstanceHandle> settled() const { return settled_; }
  std::span<const InstanceHandle> moved() const { return moved_; }

 private:
  struct Retired {
    std::uint64_t frame;
    RangeAllocator* store;
    Range range;
  };
  /// A buffer of poses. Addresses must stay the same: `Retired` has them.
  struct PoseStore {
    PoseWriter writer;
    RangeAllocator joints;
  };

  Result<void> check(const SceneInstance& instance, std::uint32_t updateInterval) const;
  Result<void> takeResult(SceneInstance& instance);
  void freeResult(const SceneInstance& instance);
  Result<void> reserveUnits(const SceneInstance& instance);
  Result<void> findRoom(SceneInstance& instance, bool isCulled);
  Result<void> makeRuns(SceneInstance& instance, bool isCulled);
  Result<void> remakeRuns(SceneInstance& instance, bool isCulled);
  void releaseRuns(SceneInstance& instance);
  void releaseTarget(SceneInstance& instance);
  void link(std::uint32_t index);
  void unlink(std::uint32_t index);

  // instances.cpp
  Result<void> takeBackOrFindRoom(SceneInstance& changed, bool isCulled);
  Result<void> rebuild(SceneInstance& instance, const InstanceChange& change);
  Result<void> setBox(InstanceHandle handle, const Box& box);
  Result<void> setMorphWeights(InstanceHandle handle, std::span<const MorphWeight> morphs);
  Result<void> changeSkinning(const InstanceChange& change);
  void changeState(InstanceState& state, const InstanceChange& change);
  void show(InstanceState& state, InstanceHandle handle);
  void hide(InstanceState& state) const {
    state.isVisible = false;
    if (state.visibleFrom != record_ + 1) state.hiddenAfter = record_;
  }
  void shift(InstanceHandle handle);

  // scene.cpp
  void makeStale(std::uint32_t index) {
    InstanceState& state = states_[index];
    state.isStale = true;
    makePending(state, index);
  }
  void makePending(InstanceState& state, std::uint32_t index) {
    if (state.isListed || !state.isVisible || state.isCulled) return;
    state.isListed = true;
    pending_.push_back({index, state.generation});
  }
  /// Null if there is no instance with this handle.
  InstanceState* findState(InstanceHandle handle) {
    if (handle.index >= states_.size() || handle.generation == 0) return nullptr;
    InstanceState& state = states_[handle.index];
    return state.generation == handle.generation ? &state : nullptr;
  }
  void retire(RangeAllocator& store, const Range& range);
  Result<void> checkWrite(PoseHandle handle, PoseWriter writer) const;
  void markWritten(ScenePose& pose, PoseHandle handle);
  void freeRetired();

  // stores.cpp
  static Error noRoom(const std::string& what, const Store& store, const char* unit);
  Result<std::optional<Range>> take(Store& store, std::uint64_t size, std::uint64_t alignment);
  Result<void> grow(Store& store, std::uint64_t least);
  Result<void> growBuffer(BufferRole role, const PlanSizes& sizes, std::uint32_t poseBuffer = 0);
  Result<std::optional<Range>> takeJoints(std::uint64_t count, PoseWriter writer,
                                          std::uint32_t& buffer);
  Error noJoints(std::size_t poses, std::uint64_t count, PoseWriter writer) const;
  /// In joints.
  std::uint64_t largestPoseBuffer(PoseWriter writer) const {
    return description_.limits.maxStorageBufferRange / sizeof(JointMatrix) / slotsOf(writer);
  }
  std::uint32_t slotsOf(PoseWriter writer) const {
    return writer == PoseWriter::cpu ? description_.framesInFlight : 1;
  }
  bool hasSlot() const;
  void makeSlot();

  // gather.cpp
  void gatherPoses();
  void gatherPending();
  void gatherSettling();
  void gatherCulled();
  void gatherMoves();
  void gatherResults();
  void addDue(std::uint32_t index);
  void addRuns(const SceneInstance& instance, std::uint32_t flags, const Candidate* candidate);
  bool isDue(const InstanceState& state, std::uint32_t pose) const;
  /// Whether its previous positions become its current ones, if that record skins it.
  static bool restarts(const InstanceState& state, std::uint64_t record) {
    return state.restartsMotion || state.visibleFrom == record;
  }
  void convertPalette(const SceneInstance& instance);
  std::uint32_t paletteUnit(const SceneInstance& instance) const;
  bool commitShift(SceneInstance& instance, InstanceHandle handle);
  void commitInstance(std::uint32_t index);
  void keepForAbandoning();
  void abandonInstances();
  void abandonShifts();

  SceneDescription description_;
  SlotMap<SceneMesh, MeshHandle> meshes_;
  SlotMap<ScenePose, PoseHandle> poses_;
  SlotMap<SceneInstance, InstanceHandle> instances_;
  std::vector<InstanceState> states_;  ///< of each instance, by index
  Store meshStore_, unitStore_, outputStore_, resultStore_;
  std::deque<PoseStore> poseBuffers_;
  std::uint64_t slotCapacity_ = 0;  ///< of instances
  Groups groups_;
  Work work_;
  Encoder encoder_;
  std::deque<Retired> retired_;

  std::uint64_t frame_ = 0, completed_ = 0;
  std::uint64_t record_ = 0;         ///< the last that was committed
  std::uint64_t recordedFrame_ = 0;  ///< its frame
  bool hasBegun_ = false;
  std::uint32_t nextVersion_ = 0;
  std::vector<PlacedRun> runsScratch_;
  std::vector<MorphWeight> morphsScratch_;

  std::vector<PoseHandle> posed_;         ///< written since the last plan
  std::vector<InstanceHandle> pending_;   ///< stale, visible, and not culled
  std::vector<InstanceHandle> shifting_;  ///< `target` is not `shown`
  std::vector<std::uint32_t> culled_;     ///< all that are culled on the GPU
  std::vector<InstanceHandle> moving_;    ///< to settle if they are in view and not skinned; some
                                          ///< more than once

  // Of the plan.
  bool isPlanned_ = false;
  std::uint64_t planNumber_ = 0;
  std::vector<std::uint32_t> due_;
  std::vector<std::uint32_t> settling_;
  struct Versioned {
    std::uint32_t index, version;
  };
  std::vector<Versioned> versioned_;  ///< culled, with something new to show
  struct Conversion {
    PoseHandle pose;
    std::size_t form;
  };
  std::vector<Conversion> conversions_;
  std::vector<CopyCommand> moves_;
  std::vector<std::uint32_t> plannedResults_;  ///< their numbers, in no order
  std::vector<std::uint64_t> resultMarks_;     ///< scratch: a bit for each of them
  std::vector<CopyCommand> resultCopies_;
  std::vector<InstanceHandle> skinned_, settled_, moved_;
  FrameWorkStatistics planned_, committed_;

  /// The results that a frame reads back.
  struct ReadBack {
    std::uint64_t frame = 0;
    bool hasCounters = false;
    std::vector<CopyCommand> results;

    void swap(ReadBack& other) {
      std::swap(frame, other.frame);
      std::swap(hasCounters, other.hasCounters);
      results.swap(other.results);
    }
  };

  /// The state before the last `commit`, so that `abandonFrame` can restore it. `conversions_` and
  /// `settled_` last until the next plan and are not repeated here.
  struct Abandonable {
    struct Instance {
      InstanceHandle handle;
      bool restartsMotion, isUrgent, isMoving, isFirst;
      std::uint32_t version;
    };
    struct Shift {
      InstanceHandle handle;
      std::optional<Place> shown;
    };
    bool isPossible = false;
    std::uint64_t recordedFrame = 0;
    std::uint32_t clearHistory = 0;
    std::vector<Instance> instances;
    std::vector<Shift> shifts;
    ReadBack readBack;
  } abandonable_;

  std::uint32_t clearHistory_ = 0;   ///< records of the history that are clear, or in use
  std::vector<ReadBack> readBacks_;  ///< of the frames in flight
  CullingStatistics culling_;
  std::vector<InstanceResult> latestResults_;  ///< by number, as they were last read back …
  std::vector<std::uint64_t> resultFrames_;    ///< … in these frames
};

/// How an executor of this repository reaches the books of a scene.
struct SceneAccess {
  static SceneBooks& books(Scene& scene) { return *scene.books_; }
};

}  // namespace dermis
