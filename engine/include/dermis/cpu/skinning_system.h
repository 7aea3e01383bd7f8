// Skins a whole scene on the CPU: the same handles, update intervals, visibility, motion and bounds
// as vulkan::SkinningSystem, without Vulkan. A system contains a Scene (scene.h). It owns meshes,
// poses and, unless the engine lends memory for it, the output. It turns each frame into jobs,
// which the engine runs on its threads.
//
// One frame:
//
//     system.beginFrame();                                  // the jobs of the last frame are done
//     std::span<JointMatrix> matrices = *system.writePose(pose);   // for each pose that changes
//     ... add, remove, change ...
//     for (const cpu::PlannedJob& job : *system.jobs()) threadPool.run([&] { cpu::skin(job); });
//     ... wait for them, and use system.outputBytes() at system.output(instance)
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

/// A part of the work of a frame. `SkinningSystem::jobs` makes it; a default-constructed one must
/// not be run.
class PlannedJob {
 public:
  /// Vertices of all its instances: a measure of how long the job takes.
  std::uint64_t vertexCount() const { return vertexCount_; }

 private:
  friend class SkinningSystem;
  friend DERMIS_CPU_API void skin(const PlannedJob& job);
  const PlannedTask* task_ = nullptr;
  std::uint64_t vertexCount_ = 0;
};

/// Runs a job. The jobs of a frame may run on any threads, in any order and at the same time.
DERMIS_CPU_API void skin(const PlannedJob& job);

/// What `SkinningSystem::create` needs to know.
struct SkinningSystemDescription {
  // -- Capacities, as in `SceneDescription`. If the output grows, its contents are copied at once.
  Capacity jointCapacity = SceneDescription().jointCapacity;
  Capacity outputCapacity = SceneDescription().outputCapacity;  ///< bytes
  Capacity instanceCapacity = SceneDescription().instanceCapacity;
  Capacity boundsCapacity = SceneDescription().boundsCapacity;
  /// Optional: memory of the engine for the output. It must outlive the system. It does not grow:
  /// its size is the capacity. Skinning is fastest if it is aligned to 64 bytes. If empty, the
  /// system allocates the output.
  std::span<std::byte> output;
};

/// A scene and the memory for it.
///
/// One thread at a time may call a member function. From `jobs` until its jobs are done, only
/// `output`, `outputBytes`, `statistics`, `skinnedInstances`, `settledInstances` and
/// `movedInstances` may be called. If
/// the engine runs none of the jobs, it may call any function, and calls `abandonFrame` before the
/// next `beginFrame`.
class DERMIS_CPU_API SkinningSystem {
 public:
  /// Fails as `Scene::create` does, and with `invalidArgument` if `output` is not empty and has
  /// less than 4 bytes.
  static Result<SkinningSystem> create(const SkinningSystemDescription& description = {});
  ~SkinningSystem();
  SkinningSystem(SkinningSystem&&) noexcept;
  SkinningSystem& operator=(SkinningSystem&&) noexcept;

  // -- Meshes, poses, instances: as in `Scene` (scene.h), with `jobs` in the place of `plan` and
  // `commit`.

  /// As `Scene::addMesh`. The mesh may have been made before, by any thread.
  Result<MeshHandle> addMesh(Mesh mesh);
  /// The same for a packed mesh. Fails as `Mesh::create` does, too.
  Result<MeshHandle> addMesh(const PackedMesh& mesh);
  /// As `Scene::removeMesh`.
  Result<void> removeMesh(MeshHandle mesh);
  /// As `Scene::addPose`. All joint matrices are identities until `writePose`. Fails with
  /// `invalidArgument` for `PoseWriter::gpu`.
  Result<PoseHandle> addPose(std::uint32_t jointCount, const PoseOptions& options = {});
  /// As `Scene::addPoses`, and as `addPose`.
  Result<void> addPoses(std::span<PoseHandle> poses, std::uint32_t jointCount,
                        const PoseOptions& options = {});
  /// As `Scene::removePose`.
  Result<void> removePose(PoseHandle pose);
  /// As `Scene::addInstance`. Also fails with `invalidArgument` for an instance that is
  /// `culledOnGpu`, and for methods that are `isForComparison`.
  Result<InstanceHandle> addInstance(const InstanceDescription& description);
  /// As `Scene::removeInstance`.
  Result<void> removeInstance(InstanceHandle instance);

  // -- What changes: as in `Scene`.

  /// Begins the next frame. Frames are numbered from 1. All jobs of the last frame must be done, or
  /// the last frame must have been abandoned. Also reads back `bounds`.
  void beginFrame();
  /// The number of the current frame; 0 before the first.
  std::uint64_t frame() const;
  /// As `Scene::writePose`. Returns memory for the joint matrices of this frame. The engine writes
  /// all of it before `jobs`. The jobs of this frame and of later ones read it, so it must not be
  /// written again before the next `writePose`.
  Result<std::span<JointMatrix>> writePose(PoseHandle pose);
  /// As `Scene::change`. Also fails with `invalidArgument` for methods that are `isForComparison`.
  Result<void> change(const InstanceChange& change);
  /// The same for many changes.
  Result<void> change(std::span<const InstanceChange> changes);
  /// As `Scene::setVisibility`.
  Result<void> setVisibility(std::span<const InstanceVisibility> instances);
  /// As `Scene::isDue`.
  Result<bool> isDue(InstanceHandle instance) const;
  /// As `Scene::compact`. The next `jobs` moves the outputs.
  std::uint64_t compact(std::uint64_t maxBytes);

  // -- Frames.

  /// Lists the jobs for everything that changed; none if nothing changed. Call it once after each
  /// `beginFrame` and `abandonFrame`. The list is valid until the next `beginFrame` or
  /// `abandonFrame`.
  ///
  /// With a smaller `verticesPerJob` the work spreads better over threads. With a larger one it
  /// takes less time altogether, since each job converts its poses, and instances of one mesh are
  /// faster together. The default is a guess. Fails with `invalidArgument` if `beginFrame` was not
  /// called, and as `Scene::plan` does.
  Result<std::span<const PlannedJob>> jobs(std::uint32_t verticesPerJob = 1 << 16);
  /// States that the engine ran none of the jobs of this frame, and never will. As
  /// `Scene::abandonFrame`.
  Result<void> abandonFrame();

  // -- Results, as of the last `jobs`: as in `Scene`.

  /// The memory that holds all outputs. Its address changes when it grows; offsets stay the same.
  std::span<const std::byte> outputBytes() const;
  /// As `Scene::output`.
  Result<InstanceOutput> output(InstanceHandle instance) const;
  /// As `Scene::skinnedInstances`.
  std::span<const InstanceHandle> skinnedInstances() const;
  /// As `Scene::settledInstances`.
  std::span<const InstanceHandle> settledInstances() const;
  /// As `Scene::movedInstances`.
  std::span<const InstanceHandle> movedInstances() const;
  /// As `Scene::bounds`.
  Result<std::optional<Box>> bounds(InstanceHandle instance) const;
  /// As `Scene::statistics`.
  SceneStatistics statistics() const;

 private:
  SkinningSystem();
  struct State;
  std::unique_ptr<State> state_;
};

}  // namespace dermis::cpu
