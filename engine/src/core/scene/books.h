// The state of a Scene: its objects by handle, the free ranges of its buffers, and the work of the
// next frame.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <deque>
#include <memory>
#include <optional>
#include <span>
#include <vector>

#include "clips/bank.h"
#include "clips/device_clips.h"
#include "clips/sample.h"
#include "dermis/clips.h"
#include "dermis/plan.h"
#include "dermis/result.h"
#include "dermis/rig.h"
#include "dermis/scene.h"
#include "plan/encode.h"
#include "plan/work.h"
#include "scene/range_allocator.h"
#include "scene/slot_map.h"
#include "scene/states.h"

namespace dermis {

/// What a scene is created for.
struct SceneSetup {
  SceneDescription scene;
  DeviceLimits limits;
  Tuning tuning;
  std::uint64_t outputOffset = 0;  ///< bytes before the output in its buffer
};

/// What a scene asks of its owner.
struct SceneOwner {
  void* user = nullptr;  ///< passed to all functions
  // As in `SceneCommandsDescription`.
  Result<void*> (*createBuffer)(void* user, const SceneBuffer& buffer) = nullptr;
  void (*releaseBuffer)(void* user, std::uint32_t number) = nullptr;
  /// Whether frames are executed by the CPU: each is complete when the next begins, and there are
  /// neither culling nor poses of the GPU, nor methods for comparison.
  bool isCpu = false;
  /// The frame was begun, and no result has been read yet. Optional.
  void (*frameBegun)(void* user, std::uint64_t completedFrame) = nullptr;
  void (*frameAbandoned)(void* user) = nullptr;  ///< optional
  /// Takes the bytes of a mesh. If null, the plan uploads them.
  Result<void> (*meshAdded)(void* user, std::uint64_t offset, const PackedMesh& mesh) = nullptr;
  void (*meshRemoved)(void* user, std::uint64_t offset) = nullptr;  ///< optional
  /// A bank was added, whose address stays the same until it is removed. Optional.
  void (*clipsAdded)(void* user, const PackedClips& clips) = nullptr;
  void (*clipsRemoved)(void* user, const PackedClips& clips) = nullptr;  ///< optional
};

DERMIS_CORE_API Result<void> checkSetup(const SceneSetup& setup);
/// With capacities that are whole units.
DERMIS_CORE_API SceneSetup rounded(SceneSetup setup);
/// The initial sizes of a scene's buffers; for poses, of the first buffer of each kind.
DERMIS_CORE_API PlanSizes sceneSizes(const SceneSetup& setup);

/// How many objects ahead a loop over many of them fetches: skinning on the CPU evicts them from
/// its caches.
inline constexpr std::size_t prefetchDistance = 8;

/// A buffer that the owner created.
struct SceneBufferMemory {
  std::uint32_t number = noIndex;
  std::uint64_t size = 0;
  std::byte* mapped = nullptr;

  bool exists() const { return number != noIndex; }
};

/// A buffer that may be replaced by a larger one with the same contents.
struct GrowingBuffer {
  SceneBufferMemory now;     ///< that the next frame uses
  SceneBufferMemory before;  ///< has the contents, until a frame copies them to `now`
  SceneBufferMemory copied;  ///< what the last frame copied, as long as it may be abandoned
};

/// The free ranges of a buffer that may grow.
struct Store {
  BufferRole role;
  Capacity capacity;            ///< in units
  std::uint64_t unitBytes = 1;  ///< what the ranges count
  std::uint64_t base = 0;       ///< bytes before it in its buffer
  GrowingBuffer buffer = {};
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
    std::uint64_t plannedIn = 0;   ///< the plan that converts it …
    PalettePlace place;            ///< … and its place among the palettes of the work
  };

  // The members that frames read come first, in the order in which they share cache lines.
  std::uint32_t jointCount = 0;  ///< of all, and …
  std::uint32_t slotJoints = 0;  ///< … of a slot: these, and room for given weights
  JointPromise promise = JointPromise::scaling;
  bool writtenByGpu = false;
  std::uint32_t figure = notUsed;  ///< to which it belongs
  std::uint32_t rig = notUsed;     ///< index
  std::uint32_t buffer = 0;        ///< its number
  /// The slot that has the current pose. Poses that the CPU writes have a slot for each frame in
  /// flight.
  std::uint32_t slot = 0;
  std::uint32_t firstInstance = notUsed;  ///< of the linked list of its instances
  std::uint32_t users = 0;                ///< instances
  std::uint64_t version = 1;
  std::uint64_t poseFrame = 0;  ///< the frame that it was last written in
  Range joints;                 ///< in its buffer, of all slots together
  std::array<Form, paletteFormCount> forms;

  std::uint64_t uploadedBy = 0;     ///< the plan that lists its upload
  std::uint32_t writtenJoints = 0;  ///< without those that a rig drives
  std::uint32_t drivenBuffer = 0;
  /// Where the driven joints are, and behind them all weights. On the CPU a copy of the others
  /// comes before them.
  Range driven;
  std::uint64_t drivenVersion = 0;  ///< of the pose, that is there; 0: it is computed again
  std::uint64_t drivenPlan = 0;     ///< the plan that computes it
};

struct SceneClips {
  /// Its address stays the same.
  struct Content {
    PackedClips bank;
    DeviceClips device;
    std::vector<bool> isRigid;  ///< of each skin
  };

  std::unique_ptr<const Content> content;
  Range bytes;  ///< in the mesh buffer: of the bank, then of `device`
  std::uint32_t users = 0;

  /// Of `device`, in the mesh buffer: at a whole unit.
  std::uint64_t deviceOffset() const {
    return bytes.offset + (content->bank.bytes().size() + unitBytes - 1) / unitBytes * unitBytes;
  }
};

struct SceneRig {
  std::unique_ptr<const PackedRig> rig;  ///< its address stays the same
  Range bytes;                           ///< in the mesh buffer
  std::uint32_t users = 0;
};

struct SceneFigure {
  ClipsHandle clips;
  std::vector<PoseHandle> poses;  ///< for each skin of the bank; their matrices are consecutive
  std::uint32_t buffer = 0;       ///< of the poses
  Range joints;                   ///< the same, of all slots together
  Range matrices;                 ///< those of the kernels, in palette units
  PackedLayers layers;
  std::uint64_t version = 1;    ///< of `layers`
  std::uint64_t sampled = 0;    ///< the version that the poses have; 0: to be sampled again
  std::uint64_t plannedIn = 0;  ///< the plan that samples it …
  std::uint32_t place = 0;      ///< … its place among those that the plan samples …
  bool isNeeded = false;        ///< … and whether it does so whatever the GPU culls
  std::uint64_t listedIn = 0;   ///< the plan before which its poses were listed as written
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
  std::uint32_t turned = 0;  ///< the record, modulo 2³², after which `view` changed last
  View view = View::shown;   ///< then; `viewOf` tells what has become of it
  Need need = Need::restart;
  bool isListed = false;  ///< among the pending
  bool isCulled = false;
  bool hasMotion = false;
  bool interpolates = false;
  bool isMoving = false;  ///< previous positions may differ, as of the last record
};

struct SceneInstance {
  // The members that a frame reads to skin an instance come first, in two cache lines, of which the
  // first begins the slot. With lavapipe, skinning evicts instances from the caches, so each cache
  // line must be fetched again in the next frame.
  bool isShifting = false;  ///< among the shifting
  bool isWritten = false;   ///< `InstanceOutput::isWritten`
  Method method = Method::dualQuaternion;
  std::uint32_t pose = 0;        ///< index
  std::uint64_t plannedIn = 0;   ///< the last plan that skins or settles it
  std::uint64_t firstFrame = 0;  ///< in which it was skinned
  std::uint32_t nextOfPose = notUsed;
  std::uint32_t vertexCount = 0;
  PlacedRun run;                  ///< the first, and mostly the only one
  std::uint32_t vertexBytes = 0;  ///< that are written for a vertex
  std::uint32_t previousOfPose = notUsed;
  std::vector<PlacedRun> furtherRuns;  ///< of instances that no single output range holds
  InstanceExtras extras;

  VertexLayout layout;
  Place target;  ///< where it is skinned to

  // Of those culled on the GPU.
  std::uint32_t version = 0;  ///< of what it should show, as of the last record
  /// The first version that the GPU skins to where it is shown.
  std::uint32_t firstVersion = 0;
  std::uint32_t culledIndex = notUsed;

  // Of those that interpolate.
  std::uint64_t updatedIn = 0;        ///< the last frame that skinned it or made a version
  std::uint32_t updatedInterval = 1;  ///< its update interval then
  std::uint64_t heldIn = 0;           ///< the last plan that did not settle it yet

  // Rarely read.
  MeshHandle mesh;
  PoseHandle poseHandle;
  bool bounds = false;
  MorphWriter morphWriter = MorphWriter::cpu;
  std::uint32_t weightsOf = notUsed;  ///< node of a skeleton
  std::uint32_t drivenTargets = 0;    ///< as in its description
  std::uint32_t weightsBuffer = 0;    ///< of poses, that has the weights which the GPU writes …
  Range weights;                      ///< … and where they are there, in joints
  std::optional<Place> shown;         ///< where it was last recorded

  const Place& place() const { return shown ? *shown : target; }
};

/// What a frame does with the previous positions of an instance that interpolates, by which its
/// box is known.
enum class BoxChange : std::uint8_t {
  moves,         ///< they become the current positions of the frame before
  rests,         ///< they become those of this frame
  mayBeSkinned,  ///< the GPU may skin the instance, which then restarts; otherwise they stay
};

struct SceneBooks {
  SceneBooks(const SceneSetup& setup, const SceneOwner& owner);

  struct Retired {
    std::uint64_t frame;
    RangeAllocator* store;
    Range range;
  };
  struct RetiredBuffer {
    std::uint64_t frame;
    std::uint32_t number;
  };
  struct NotedBox {
    std::uint32_t result;  ///< its number
    BoxChange change;
    std::uint64_t firstFrame;  ///< of the instance; a result of a frame before is another's
  };
  /// A buffer of poses. Addresses must stay the same: `Retired` has them.
  struct PoseStore {
    bool writtenByGpu;
    RangeAllocator joints;
    SceneBufferMemory buffer;
    std::vector<JointMatrix> staged;  ///< what the CPU writes where the buffer is not mapped
  };

  Result<void> checkDrivenTargets(const SceneInstance& instance, const ScenePose& pose,
                                  std::uint32_t targets) const;
  Result<void> checkMorphWriter(const SceneInstance& instance, const ScenePose& pose,
                                std::uint32_t targets) const;
  Result<void> check(const SceneInstance& instance, std::uint32_t updateInterval) const;
  Result<void> takeResult(SceneInstance& instance);
  void freeResult(const SceneInstance& instance);
  Result<void> reserveUnits(const SceneInstance& instance);
  Result<void> findRoom(SceneInstance& instance, bool isCulled);
  Result<void> makeRuns(SceneInstance& instance, bool isCulled);
  Result<void> remakeRuns(SceneInstance& instance, bool isCulled);
  Result<void> takeWeights(SceneInstance& instance);
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
  void shift(InstanceHandle handle);

  void raise(std::uint32_t index, Need need) {
    InstanceState& state = states_[index];
    state.need = std::max(state.need, need);
    makePending(state, index);
  }
  void makePending(InstanceState& state, std::uint32_t index) {
    if (state.isListed || !isDisplayed(state.view) || state.isCulled) return;
    state.isListed = true;
    pending_.push_back({index, state.generation});
  }
  /// It is shown again.
  void comeBack(InstanceState& state, InstanceHandle handle) {
    if (state.isMoving) moving_.push_back(handle);
    if (state.need != Need::none) makePending(state, handle.index);
  }
  /// Null if there is no instance with this handle.
  InstanceState* findState(InstanceHandle handle) {
    if (handle.index >= states_.size() || handle.generation == 0) return nullptr;
    InstanceState& state = states_[handle.index];
    return state.generation == handle.generation ? &state : nullptr;
  }

  // meshes_and_poses.cpp
  /// Keeps the bytes, or the owner does; null if the owner has them already.
  DERMIS_CORE_API Result<MeshHandle> addMesh(const MeshInfo& info, PackedMesh* mesh);
  Result<void> mayWrite() const;
  Result<void> checkWrite(PoseHandle handle, bool writtenByGpu) const;
  void markWritten(ScenePose& pose, PoseHandle handle);
  void dropPose(PoseHandle handle, bool isNew = false);
  /// Where the matrices of the current slot are in the buffer of the pose.
  std::uint64_t offsetOf(const ScenePose& pose) const {
    return (pose.joints.offset + std::uint64_t{pose.slot} * pose.slotJoints) * sizeof(JointMatrix);
  }
  /// Fails for a pose that the CPU writes.
  DERMIS_CORE_API Result<BufferPart> posePart(PoseHandle pose) const;
  /// Fails for an instance whose morph weights the CPU writes.
  DERMIS_CORE_API Result<BufferPart> weightsPart(InstanceHandle instance) const;
  /// Fails for a pose without a rig.
  DERMIS_CORE_API Result<BufferPart> drivenPart(PoseHandle pose) const;
  /// The memory that the CPU writes: joints, and room for given weights.
  DERMIS_CORE_API std::span<JointMatrix> matricesOf(const ScenePose& pose);
  /// Of a scene on the CPU: the memory of what a rig drives.
  DERMIS_CORE_API std::span<JointMatrix> drivenOf(const ScenePose& pose);
  /// The joints of all poses of a figure; of a scene on the CPU.
  DERMIS_CORE_API std::span<JointMatrix> matricesOf(const SceneFigure& figure);
  void upload(PoseHandle pose) {
    if (poseBuffers_[poses_.at(pose.index).buffer].buffer.mapped == nullptr)
      poseUploads_.push_back(pose);
  }

  // rigs.cpp
  Result<void> takeDriven(ScenePose& pose, std::uint32_t rig);
  void releaseDriven(const ScenePose& pose, bool isNew);
  void driveRig(std::uint32_t pose, std::uint32_t figure);
  std::uint64_t drivenWord(const ScenePose& pose, std::uint32_t weight) const;
  std::uint32_t drivenTargetsOf(const SceneInstance& instance) const;

  // figures.cpp
  void sampleFigure(std::uint32_t index, bool isNeeded);
  void gatherFigures();
  std::optional<BankMorphed> findMorphed(const SceneInstance& instance) const;
  void sampleMorphs(SceneInstance& instance);
  void listMorphs(const SceneInstance& instance);

  // stores.cpp
  Result<void> createFirstBuffers();
  Result<SceneBufferMemory> create(BufferRole role, const BufferRequirement& needed);
  Result<void> addPoseBuffer(bool writtenByGpu, std::uint64_t joints);
  void replace(GrowingBuffer& buffer, const SceneBufferMemory& larger);
  std::array<GrowingBuffer*, 4> keptBuffers() {
    return {&meshStore_.buffer, &outputStore_.buffer, &resultStore_.buffer, &history_};
  }
  void retire(RangeAllocator& store, const Range& range);
  void giveBack(RangeAllocator& store, const Range& range, bool isNew);
  void retire(const SceneBufferMemory& buffer);
  void freeRetired();
  PlanSizes sizes() const;
  static Error noRoom(const std::string& what, const Store& store, const char* unit);
  Result<std::optional<Range>> take(Store& store, std::uint64_t size, std::uint64_t alignment);
  Result<void> grow(Store& store, std::uint64_t least);
  Result<std::optional<Range>> takeJoints(std::uint64_t count, bool writtenByGpu,
                                          std::uint32_t& buffer);
  Error noJoints(std::size_t poses, std::uint64_t count, bool writtenByGpu) const;
  /// In joints.
  std::uint64_t largestPoseBuffer(bool writtenByGpu) const {
    return limits_.maxStorageBufferRange / sizeof(JointMatrix) / slotsOf(writtenByGpu);
  }
  const Capacity& jointCapacity(bool writtenByGpu) const {
    return writtenByGpu ? description_.gpuJointCapacity : description_.jointCapacity;
  }
  std::uint32_t slotsOf(bool writtenByGpu) const {
    return writtenByGpu ? 1 : description_.framesInFlight;
  }
  bool hasSlot() const;
  void makeSlot();
  Result<void> makeFrameBuffers(const PlanData& plan);
  void nameBuffers();

  // frame.cpp
  /// Collects all work (`work_`). None of it counts as done before `commit`.
  DERMIS_CORE_API Result<void> gather();
  /// `gather`, encoded as a plan. Its tables are written to `tables`, if they fit.
  DERMIS_CORE_API Result<void> plan(Plan& out, std::span<std::byte> tables);
  DERMIS_CORE_API Result<void> commit();
  DERMIS_CORE_API Result<void> readBack(std::uint64_t frame, std::span<const std::byte> bytes);
  void begin(std::uint64_t frame, std::uint64_t completedFrame);
  void readBackComplete();
  void listGrowth();
  void listUploads();
  void abandon();
  void gatherPoses();
  void gatherPending();
  void gatherSettling();
  void gatherCulled();
  void gatherMoves();
  void gatherResults();
  void readEarlierBoxes(std::span<const NotedBox> boxes);
  void readHistory(std::span<const std::byte> records);
  void addDue(std::uint32_t index, SceneInstance& instance, bool restarts);
  void addRuns(const SceneInstance& instance, std::uint32_t palette, std::uint32_t flags,
               const Candidate* candidate = nullptr);
  bool isOnBeat(std::uint32_t interval, std::uint32_t pose) const;
  bool holds(std::uint32_t index) const;
  void noteBox(std::uint32_t index, const SceneInstance& instance, BoxChange change) {
    if (states_[index].interpolates && instance.bounds)
      notedBoxes_.push_back({instance.extras.result, change, instance.firstFrame});
  }
  /// After record number `record`, modulo 2³².
  static View viewOf(const InstanceState& state, std::uint32_t record) {
    return state.turned == record ? state.view : after(state.view, ViewEvent::execute);
  }
  /// Whether the view has changed.
  static bool turn(InstanceState& state, std::uint32_t record, bool isVisible) {
    if (isDisplayed(state.view) == isVisible) return false;
    state.view = after(viewOf(state, record), isVisible ? ViewEvent::show : ViewEvent::hide);
    state.turned = record;
    return true;
  }
  std::uint32_t recordNumber() const { return static_cast<std::uint32_t>(record_); }
  /// What the next frame does with it, if `need` is what is out of date.
  Action actionOf(const InstanceState& state, std::uint32_t pose, Need need) const {
    return actionFor(viewOf(state, recordNumber()), need,
                     state.updateInterval == 1 || isOnBeat(state.updateInterval, pose));
  }
  std::uint32_t convertPalette(const SceneInstance& instance, bool isCulled);
  std::uint32_t paletteUnit(const SceneInstance& instance) const;
  bool commitShift(SceneInstance& instance, InstanceHandle handle);
  void commitInstance(std::uint32_t index);

  SceneOwner owner_;
  SceneDescription description_;
  DeviceLimits limits_;
  Tuning tuning_;
  std::uint32_t nextBuffer_ = visibilityBuffer + 1;  ///< number
  SlotMap<SceneMesh, MeshHandle> meshes_;
  SlotMap<ScenePose, PoseHandle> poses_;
  SlotMap<SceneInstance, InstanceHandle> instances_;
  SlotMap<SceneClips, ClipsHandle> clips_;
  SlotMap<SceneFigure, FigureHandle> figures_;
  SlotMap<SceneRig, RigHandle> rigs_;
  std::vector<InstanceState> states_;  ///< of each instance, by index
  Store meshStore_, unitStore_, outputStore_, resultStore_;
  GrowingBuffer history_;
  SceneBufferMemory tables_;
  std::uint32_t output_ = noIndex;  ///< the buffer of the last frame
  std::deque<PoseStore> poseBuffers_;
  std::uint64_t slotCapacity_ = 0;  ///< of instances
  Groups groups_;
  Work work_;
  Encoder encoder_;
  std::deque<Retired> retired_;
  std::deque<RetiredBuffer> retiredBuffers_;
  struct MeshUpload {
    MeshHandle mesh;
    PackedMesh bytes;
  };
  std::vector<MeshUpload> meshUploads_;     ///< of the next frame …
  std::vector<MeshUpload> uploadedMeshes_;  ///< … and of the last, as long as it may be abandoned
  std::vector<PoseHandle> poseUploads_, uploadedPoses_;   ///< the same
  std::vector<ClipsHandle> clipUploads_, uploadedClips_;  ///< the same
  std::vector<RigHandle> rigUploads_, uploadedRigs_;      ///< the same

  std::uint64_t frame_ = 0, completed_ = 0;
  std::uint64_t record_ = 0;         ///< the last that was committed
  std::uint64_t recordedFrame_ = 0;  ///< its frame …
  std::uint64_t earlierFrame_ = 0;   ///< … and that of the record before it
  bool mayAbandon_ = false;          ///< the last record
  bool hasBegun_ = false;
  std::uint32_t nextVersion_ = 0;
  std::vector<PlacedRun> runsScratch_;
  std::vector<MorphWeight> morphsScratch_;
  std::vector<float> weightsScratch_;
  std::vector<PackedLayers> layersScratch_;

  std::vector<PoseHandle> posed_;         ///< written since the last plan
  std::vector<InstanceHandle> pending_;   ///< stale, visible, and not culled
  std::vector<InstanceHandle> shifting_;  ///< `target` is not `shown`
  std::vector<std::uint32_t> culled_;     ///< all that are culled on the GPU
  std::vector<InstanceHandle> moving_;    ///< to settle if they are in view and not skinned; some
                                          ///< more than once

  // Of the plan.
  bool isPlanned_ = false;
  std::uint64_t planNumber_ = 0;
  struct Due {
    std::uint32_t index;
    bool restarts;
  };
  std::vector<Due> due_;  ///< to skin
  std::vector<std::uint32_t> settling_;
  std::vector<InstanceHandle> held_;  ///< of `moving_`: to be settled by a later frame
  struct Versioned {
    std::uint32_t index, version;
  };
  std::vector<Versioned> versioned_;  ///< culled, with something new to show
  struct Conversion {
    std::uint32_t pose;  ///< index
    PaletteForm form;
    bool isNeeded;  ///< whatever the GPU culls
  };
  std::vector<Conversion> conversions_;
  std::vector<std::uint32_t> sampling_;  ///< figures
  std::vector<std::uint32_t> driving_;   ///< poses whose rigs are computed
  std::vector<CopyCommand> moves_;
  std::vector<std::uint32_t> plannedResults_;  ///< their numbers, in no order
  std::vector<std::uint64_t> resultMarks_;     ///< scratch: a bit for each of them
  std::vector<NotedBox> notedBoxes_;
  std::vector<InstanceResult> replacedResults_;  ///< scratch: of these, before a frame is read back
  std::vector<CopyCommand> resultCopies_, growth_;
  CopyCommand historyCopy_ = {};  ///< what `ReadBack::history` becomes
  std::vector<UploadCommand> uploads_;
  PlanBuffers buffers_;  ///< that it names
  std::vector<InstanceHandle> skinned_, settled_;
  SceneStatistics::Frame planned_, committed_;

  /// The results that a frame reads back.
  struct ReadBack {
    std::uint64_t frame = 0;
    bool hasCounters = false;
    std::vector<CopyCommand> results;
    std::vector<NotedBox> boxes;
    CopyCommand history = {};  ///< no bytes if all that are culled on the GPU were written before
    SceneBufferMemory buffer;
  };

  std::uint32_t clearHistory_ = 0;  ///< records of the history that are clear, or in use
  ReadBack& readBackOf(std::uint64_t record) {
    return readBacks_[static_cast<std::size_t>(record % readBacks_.size())];
  }
  ReadBack& nextReadBack() { return readBackOf(record_ + 1); }
  std::vector<ReadBack> readBacks_;  ///< of the frames in flight
  SceneStatistics::Culling culling_;
  std::vector<InstanceResult> latestResults_;  ///< by number, as they were last read back …
  std::vector<InstanceResult> earlierResults_;  ///< … of previous positions, if it interpolates …
  std::vector<std::uint64_t> resultFrames_;     ///< … in these frames
};

/// How owners reach their scene.
struct SceneAccess {
  DERMIS_CORE_API static Result<std::unique_ptr<Scene>> create(const SceneSetup& setup,
                                                               const SceneOwner& owner);
  static SceneBooks& books(Scene& scene) { return *scene.books_; }
  /// After which the current plan can no longer be committed.
  static SceneBooks& changed(Scene& scene) { return scene.changed(); }
};

}  // namespace dermis
