// Skinning for a whole scene on the CPU: the same handles, intervals, visibility, motion and bounds
// as vulkan::SkinningSystem, without Vulkan. It has a Scene (scene.h), packed meshes, poses and the
// output. A frame becomes jobs, which the engine's threads do.
//
// One frame:
//
//   system.beginFrame();                                  // the jobs of the last frame are done
//   std::span<JointMatrix> matrices = *system.writePose(pose);   // for poses that change
//   ... add, remove, change ...
//   for (const cpu::PlannedJob& job : *system.jobs()) threadPool.run([&] { cpu::skin(job); });
//   ... wait for them, and use system.outputBytes() at system.output(instance)
#pragma once

#include <cstddef>
#include <cstdint>
#include <memory>
#include <optional>
#include <span>

#include "dermis/cpu/mesh.h"
#include "dermis/export.h"
#include "dermis/handle.h"
#include "dermis/pack.h"
#include "dermis/result.h"
#include "dermis/scene.h"
#include "dermis/types.h"

namespace dermis::cpu {

struct PlannedTask;

/// Some vertices of some instances that are skinned alike, as `SkinningSystem::jobs` lists them.
/// Only those may be done.
class PlannedJob {
 public:
  /// Of all its instances: how long it takes, beside other jobs.
  std::uint64_t vertexCount() const { return vertexCount_; }

 private:
  friend class SkinningSystem;
  friend DERMIS_CPU_API void skin(const PlannedJob& job);
  const PlannedTask* task_ = nullptr;
  std::uint64_t vertexCount_ = 0;
};

/// Does the job. Jobs of a frame may be done by any threads, in any order and at the same time.
DERMIS_CPU_API void skin(const PlannedJob& job);

struct SkinningSystemDescription {
  /// The capacities of `SceneDescription`. What grows is copied at once.
  Capacity jointCapacity = SceneDescription().jointCapacity;
  Capacity outputCapacity = SceneDescription().outputCapacity;  ///< bytes
  Capacity instanceCapacity = SceneDescription().instanceCapacity;
  Capacity boundsCapacity = SceneDescription().boundsCapacity;
  /// The engine's memory for the output, which outlives the system: its size is the capacity, and
  /// it does not grow. Empty: the system's own. Skinning is fastest from a multiple of 64 bytes on.
  std::span<std::byte> output;
};

/// One thread at a time may call a member function. From `jobs` until its jobs are done, only these
/// may be called: `output`, `outputBytes`, `statistics`, and those that list instances. If none of
/// them is ever done, anything may be called, and `abandonFrame` before the next `beginFrame`.
class DERMIS_CPU_API SkinningSystem {
 public:
  /// Fails as `Scene::create`, and with `invalidArgument` for an output of less than 4 bytes.
  static Result<SkinningSystem> create(const SkinningSystemDescription& description = {});
  ~SkinningSystem();
  SkinningSystem(SkinningSystem&&) noexcept;
  SkinningSystem& operator=(SkinningSystem&&) noexcept;

  // -- Meshes, poses, instances: as those of `Scene` (scene.h). What is said there of `plan` and
  // `commit` is true of `jobs`.

  /// A mesh that was made before, by any thread. Fails as `Scene::addMesh`.
  Result<MeshHandle> addMesh(Mesh mesh);
  /// Makes a Mesh of it, and fails as `Mesh::create` too.
  Result<MeshHandle> addMesh(const PackedMesh& mesh);
  Result<void> removeMesh(MeshHandle mesh);
  /// All joint matrices are the identity until `writePose`. Fails with `invalidArgument` for
  /// `PoseWriter::gpu`.
  Result<PoseHandle> addPose(std::uint32_t jointCount, const PoseOptions& options = {});
  Result<void> addPoses(std::span<PoseHandle> poses, std::uint32_t jointCount,
                        const PoseOptions& options = {});
  Result<void> removePose(PoseHandle pose);
  /// Fails with `invalidArgument` for an instance that is `culledOnGpu`, and for comparison
  /// methods.
  Result<InstanceHandle> addInstance(const InstanceDescription& description);
  Result<void> removeInstance(InstanceHandle instance);

  // -- What changes: as `Scene`.

  /// Begins the next frame; frames count from 1. All jobs of the last one are done, or it was
  /// abandoned.
  void beginFrame();
  std::uint64_t frame() const;
  /// Where to write the joint matrices of this frame: all of them, before `jobs`. They are read by
  /// the jobs of this frame and of later ones, so the memory stays as it is until the next
  /// `writePose`.
  Result<std::span<JointMatrix>> writePose(PoseHandle pose);
  Result<void> change(const InstanceChange& change);
  Result<void> change(std::span<const InstanceChange> changes);
  Result<void> setVisibility(std::span<const InstanceVisibility> instances);
  Result<bool> isDue(InstanceHandle instance) const;
  std::uint64_t compact(std::uint64_t maxBytes);

  // -- Frames.

  /// The jobs for everything that changed; none if nothing did. Once after each `beginFrame` and
  /// `abandonFrame`. They are there until the next call of `beginFrame` or `abandonFrame`. What
  /// `compact` moves is moved by this call. Short jobs are spread better over threads; but a pose
  /// is converted for each job that needs it, and instances of one mesh take less time together.
  /// `verticesPerJob` is a guess that suits most. Fails with `invalidArgument` without
  /// `beginFrame`, and as `Scene::plan`.
  Result<std::span<const PlannedJob>> jobs(std::uint32_t verticesPerJob = 1 << 16);
  /// None of the jobs of this frame was done, nor will be. As `Scene::abandonFrame`.
  Result<void> abandonFrame();

  // -- Results, as of the last `jobs`: as `Scene`. `beginFrame` reads back the bounds.

  /// All outputs are in this memory. It is elsewhere when it has grown; all offsets stay.
  std::span<const std::byte> outputBytes() const;
  Result<InstanceOutput> output(InstanceHandle instance) const;
  std::span<const InstanceHandle> skinnedInstances() const;
  std::span<const InstanceHandle> settledInstances() const;
  std::span<const InstanceHandle> movedInstances() const;
  Result<std::optional<Box>> bounds(InstanceHandle instance) const;
  SceneStatistics statistics() const;

 private:
  SkinningSystem();
  struct State;
  std::unique_ptr<State> state_;
};

}  // namespace dermis::cpu
