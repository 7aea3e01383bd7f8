// Runs the frames of a scene (scene.h) on the CPU, without Vulkan. A runner owns the scene and,
// unless the engine lends memory for it, the output. It turns each frame into jobs, which the
// engine runs on its threads.
//
//     cpu::SceneRunner runner = *cpu::SceneRunner::create();
//     Scene& scene = runner.scene();
//
// and in each frame:
//
//     scene.beginFrame(frame, frame - 1);                   // the jobs of the last frame are done
//     std::span<JointMatrix> matrices = *scene.writePose(pose);    // for each pose that changes
//     ... add, remove, change ...
//     for (const cpu::PlannedJob& job : *runner.jobs()) threadPool.run([&] { cpu::skin(job); });
//     ... wait for them, and use runner.output() at scene.output(instance)
#pragma once

#include <cstddef>
#include <cstdint>
#include <memory>
#include <span>

#include "dermis/cpu/mesh.h"
#include "dermis/export.h"
#include "dermis/handle.h"
#include "dermis/result.h"
#include "dermis/scene.h"

namespace dermis::cpu {

struct PlannedTask;

/// A part of the work of a frame. `SceneRunner::jobs` makes it; a default-constructed one must not
/// be run.
class PlannedJob {
 public:
  /// Vertices of all its instances: a measure of how long the job takes.
  std::uint64_t vertexCount() const { return vertexCount_; }

 private:
  friend class SceneRunner;
  friend DERMIS_CPU_API void skin(const PlannedJob& job);
  const PlannedTask* task_ = nullptr;
  std::uint64_t vertexCount_ = 0;
};

/// Runs a job. The jobs of a frame may run on any threads, in any order and at the same time.
DERMIS_CPU_API void skin(const PlannedJob& job);

/// Owns a scene and the memory for it.
///
/// One thread at a time may call a function of the runner or of its scene. From `jobs` until its
/// jobs are done, only `output` and const functions of the scene may be called. If the engine runs
/// none of the jobs, it may call any function, and calls `Scene::abandonFrame` before the next
/// `beginFrame`.
class DERMIS_CPU_API SceneRunner {
 public:
  /// Creates a scene. Meshes and palettes take no memory of its buffers. `output` is optional:
  /// memory of the engine for the output, which must outlive the runner. It does not grow: its size
  /// is the capacity. Skinning is fastest if it is aligned to 64 bytes. Fails with
  /// `invalidArgument` if a member of the description is not valid, or if `output` is not empty and
  /// has less than 4 bytes.
  static Result<SceneRunner> create(const SceneDescription& description = {},
                                    std::span<std::byte> output = {});
  ~SceneRunner();
  SceneRunner(SceneRunner&&) noexcept;
  SceneRunner& operator=(SceneRunner&&) noexcept;

  /// Stays at one address until the runner is destroyed, even if the runner is moved.
  Scene& scene() const;

  /// As `Scene::addMesh`, for a mesh that was converted before, by any thread.
  Result<MeshHandle> addMesh(Mesh mesh);

  /// Lists the jobs for everything that changed; none if nothing changed. Call it once after each
  /// `beginFrame` and `abandonFrame`. The list is valid until the next `beginFrame` or
  /// `abandonFrame`.
  ///
  /// With a smaller `verticesPerJob` the work spreads better over threads. With a larger one it
  /// takes less time altogether, since each job converts its poses, and instances of one mesh are
  /// faster together. The default is a guess. Fails with `invalidArgument` if `beginFrame` was not
  /// called.
  Result<std::span<const PlannedJob>> jobs(std::uint32_t verticesPerJob = 1 << 16);

  /// The memory that holds all outputs, as of the last `jobs`. Its address changes when it grows;
  /// offsets stay the same.
  std::span<const std::byte> output() const;

 private:
  SceneRunner();
  struct State;
  std::unique_ptr<State> state_;
};

}  // namespace dermis::cpu
