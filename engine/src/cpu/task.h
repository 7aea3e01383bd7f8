// Input of the SIMD code: checked jobs, and scratch memory.
#pragma once

#include <array>
#include <atomic>
#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include "clips/sample.h"
#include "cpu/mesh_data.h"
#include "dermis/cpu.h"

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
  std::vector<CacheLine> pairs;            ///< dual quaternions, of up to four instances
  std::vector<CacheLine> scalePairs;       ///< the joint's scale/shear part minus the pivot's
  std::vector<abi::MorphRecord> targets;   ///< the active ones of each instance
  std::vector<CacheLine> tile;             ///< what the stages hand to each other
};

struct ClipPlan;

/// A figure, whose poses are sampled by the first task that needs one of them.
struct FigureTask {
  enum class State : std::uint32_t { waiting, busy, done };

  const ClipPlan* plan = nullptr;
  PackedLayers layers;
  std::span<JointMatrix> matrices;  ///< of all skins
  std::atomic<State> state = State::waiting;

  /// Returns when the poses have been sampled. Any number of threads may call it.
  void finish();
};

/// Counterpart of `Instance`.
struct TaskInstance {
  std::span<const JointMatrix> pose;
  FigureTask* figure = nullptr;  ///< to be finished before the pose is read
  /// Address of each attribute of the mesh's first vertex, indexed by `Stream`.
  ByStream<std::byte*> outputs{};
  bool mayScale = true;  ///< whether its promise is `JointPromise::scaling`
  bool restartsMotion = false, settles = false;
  std::span<const MorphWeight> morphs;  ///< in ascending order of targets
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
