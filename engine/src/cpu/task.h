// Input of the SIMD code: checked jobs, and scratch memory.
#pragma once

#include <array>
#include <atomic>
#include <chrono>
#include <cstddef>
#include <cstdint>
#include <span>
#include <thread>
#include <vector>

#include "clips/sample.h"
#include "cpu/mesh_data.h"
#include "cpu/morph.h"
#include "dermis/cpu.h"
#include "dermis/rig.h"

namespace dermis::cpu {

/// As wide as the widest vectors.
struct alignas(64) CacheLine {
  float v[16];
};

/// Scratch memory of one thread, sized for the largest section that it has skinned.
struct Scratch {
  std::vector<CacheLine> dualQuaternions;  ///< of joints: real and dual part
  std::vector<CacheLine> scaleShears;      ///< of joints: diagonal and mixed entries, and two zeros
  std::vector<CacheLine> rows;             ///< of joints: 3×4, and four zeros
  std::vector<CacheLine> companyJoints;    ///< dual quaternions, a vector for each component
  std::vector<CacheLine> pairs;            ///< dual quaternions
  std::vector<CacheLine> scalePairs;       ///< the joint's scale/shear part minus the pivot's
  ActiveTargets morphs;
  std::vector<CacheLine> tile;  ///< what the stages hand to each other
};

struct ClipPlan;

/// Work of which several tasks need the result: the first of them does it.
class SharedWork {
 public:
  /// Nobody may need it meanwhile.
  void restart() { state_.store(State::waiting, std::memory_order_relaxed); }

  /// Returns when the work has been done. Any number of threads may call it. `prepare` is called
  /// before, and may be called in vain.
  template <typename Prepare, typename Work>
  void finish(const Prepare& prepare, const Work& work) {
    State found = state_.load(std::memory_order_acquire);
    if (found == State::waiting) {
      prepare();
      if (state_.compare_exchange_strong(found, State::busy, std::memory_order_acquire)) {
        work();
        state_.store(State::done, std::memory_order_release);
        return;
      }
    }
    // Not `wait`: where there is no futex, that of GCC 12 may miss the notification (MinGW). The
    // work takes microseconds, unless its thread was interrupted, which sleeping lets continue.
    for (int turn = 0; state_.load(std::memory_order_acquire) != State::done; ++turn) {
      if (turn < 1000) {
        std::this_thread::yield();
      } else {
        std::this_thread::sleep_for(std::chrono::microseconds(100));
      }
    }
  }

 private:
  enum class State : std::uint32_t { waiting, busy, done };
  std::atomic<State> state_ = State::waiting;
};

/// A figure, whose poses are sampled by the first task that needs one of them.
struct FigureTask {
  const ClipPlan* plan = nullptr;
  PackedLayers layers;
  std::span<JointMatrix> matrices;  ///< of all skins
  SharedWork work;

  void finish();
};

/// A pose of a rig, whose sizes are those that the rig says.
struct RigPose {
  std::span<const JointMatrix> written;
  std::span<const float> givenWeights;  ///< may be the first of `weights`
  std::span<JointMatrix> driven;
  std::span<float> weights;
};

/// As many poses of a rig as the widest vectors hold, or fewer. What the rig drives is computed by
/// the first task that needs one of them.
struct RigTask {
  static constexpr std::size_t most = 16;

  const PackedRig* rig = nullptr;
  /// The driven joints of each are behind memory for a copy of the written ones.
  std::array<RigPose, most> poses;
  /// Of each pose: what samples its written joints and given weights; may be null.
  std::array<FigureTask*, most> figures{};
  std::size_t count = 0;
  SharedWork work;

  void finish();
};

/// Memory of a thread that evaluates rigs.
struct RigScratch {
  std::vector<CacheLine> numbers;  ///< a vector in each line

  void prepare(const PackedRig& rig);
};

/// Computes what a rig drives in these poses, with the bits of `evaluateRig`. `scratch` was
/// prepared for the rig. Uses the instruction set that `dispatchTask` uses.
void dispatchRigs(const PackedRig& rig, std::span<const RigPose> poses, RigScratch& scratch);

/// The same by the code of core.
void evaluatePlainly(const PackedRig& rig, std::span<const RigPose> poses, RigScratch& scratch);

/// Counterpart of `Instance`.
struct TaskInstance {
  std::span<const JointMatrix> pose;
  FigureTask* figure = nullptr;  ///< to be finished before the pose is read
  RigTask* rig = nullptr;        ///< the same
  /// Address of each attribute of the mesh's first vertex, indexed by `Stream`.
  ByStream<std::byte*> outputs{};
  bool mayScale = true;  ///< whether its promise is `JointPromise::scaling`
  bool restartsMotion = false, settles = false;
  std::span<const MorphWeight> morphs;  ///< in ascending order of targets
  /// Of the targets after those, from `firstDrivenTarget` on: weights that `rig` computes.
  std::span<const float> drivenWeights;
  std::uint32_t firstDrivenTarget = 0;
  InstanceResult* result = nullptr;
  float boxCenter[3] = {}, boxInverse[3] = {};  ///< for snorm16 positions; `boxInverse` is 1 / half
                                                ///< the size
};

struct Task {
  const MeshData* mesh = nullptr;
  Method method = Method::dualQuaternion;
  VertexPlaces places;  ///< formats and strides
  std::uint32_t firstVertex = 0, vertexEnd = 0;
  std::span<const TaskInstance> instances;
};

/// Fails with `invalidArgument` for a method that is only for comparison. The message begins with
/// `subject`.
Result<void> checkMethod(Method method, const char* subject);

/// Skins with scratch memory of the thread.
void skinTask(const Task& task);

/// Uses the best instruction set of the processor, or the one that `setTarget` chose. `scratch`
/// points to three objects: for what is skinned, and for the joints of instances that wait for
/// others, those that do not scale and those that do.
void dispatchTask(const Task& task, Scratch* scratch);

}  // namespace dermis::cpu
