// Skinning without Vulkan, by SIMD instructions of the CPU: meshes, single jobs, and scenes.
#pragma once

#include <cstddef>
#include <cstdint>
#include <memory>
#include <span>
#include <string_view>
#include <vector>

#include "dermis/layout.h"
#include "dermis/mesh.h"
#include "dermis/plan.h"
#include "dermis/result.h"
#include "dermis/scene.h"

// ---- A mesh in the form that the CPU path reads.

namespace dermis::cpu {

struct MeshData;

/// Made once, while loading, from a packed mesh. It is immutable: any number of threads may skin it
/// at the same time. A moved-from mesh may only be assigned to or destroyed.
///
/// It owns its memory. Per vertex this is 44 bytes with normals, 32 more with tangents, 12
/// more with centers of rotation, and 8 for each influence. Vertices are stored in groups of eight,
/// each with the maximum influence count of its group. With morph targets it keeps a copy of the
/// packed mesh, too.
class DERMIS_CPU_API Mesh {
 public:
  /// Converts a packed mesh, which may be released afterwards. O(vertices × influences). Fails with
  /// `limitExceeded` if a vertex has more than 512 influences.
  static Result<Mesh> create(const PackedMesh& packed);
  ~Mesh();
  Mesh(Mesh&&) noexcept;
  Mesh& operator=(Mesh&&) noexcept;

  /// What `PackedMesh::info` returned.
  const MeshInfo& info() const;

 private:
  friend const MeshData& dataOf(const Mesh& mesh);
  explicit Mesh(std::unique_ptr<const MeshData> data);
  std::unique_ptr<const MeshData> data_;
};

// ---- Skins on the CPU, with SIMD instructions. All methods except those for comparison are
// available. Needs no Vulkan and starts no threads: the thread that calls `skin` does the work.
//
//     const cpu::Mesh mesh = *cpu::Mesh::create(*pack(view, jointCount));      // while loading
//     cpu::Job job;
//     job.mesh = &mesh;
//     job.places = *placeVertices(layout, mesh.info().vertexCount);
//     job.instances = instances;             // each with its pose, and memory for its vertices
//     cpu::skin(job);

/// One instance of a job.
struct Instance {
  std::span<const JointMatrix> pose;  ///< at least `MeshInfo::requiredJoints`
  /// As `PoseDescription::promise`. `rigid` is as good as `scaleIgnored` here.
  JointPromise promise = JointPromise::scaling;
  /// The memory of each attribute, from which the offsets in `Job::places` count: `all(memory)` for
  /// the offsets of `placeVertices`, or an array for each attribute, usually with offsets of 0.
  /// Null for attributes that the job does not write. An attribute needs offset + (vertexCount - 1)
  /// × stride + `formatSize` bytes, and no alignment.
  ByStream<void*> output{};
  Box box;                              ///< as `dermis::Job::box`
  std::span<const MorphWeight> morphs;  ///< as `dermis::Job::morphs`, ascending by target
  bool restartsMotion = false;          ///< as `dermis::Job::restartsMotion`
  bool settles = false;                 ///< as `dermis::Job::settles`
  /// Optional. `skin` writes the box and the clamped vertices of this job here. If an instance has
  /// several jobs, `addResult` combines their results.
  InstanceResult* result = nullptr;
};

/// A range of vertices of one mesh, for instances that are skinned by the same method. Several
/// instances in one job take less time than one job for each.
struct Job {
  const Mesh* mesh = nullptr;              ///< required, not owned
  Method method = Method::dualQuaternion;  ///< any that is not `isForComparison`
  VertexPlaces places;                     ///< from `placeVertices`, or any other arrangement
  std::uint32_t firstVertex = 0;
  std::uint32_t vertexEnd = 0xffffffff;  ///< one past the last vertex; limited to the vertex count
  std::span<const Instance> instances;
};

/// Skins the vertices of a job. Any number of threads may call it at the same time, if they write
/// different bytes.
///
/// The bits of a vertex do not depend on the range, the other instances, the thread or the
/// processor. This holds for finite poses, in threads that round to nearest and do not flush
/// subnormal numbers to zero.
///
/// Each thread keeps its working memory for the next job, so it stops allocating after its largest
/// job. The working memory is at most 1.5 MiB if no vertex has more than 128 influences, plus 150
/// bytes for each instance of the largest job.
///
/// Fails with `invalidArgument` if the job breaks a rule, as `makePlan` does. It then writes
/// nothing.
DERMIS_CPU_API Result<void> skin(const Job& job);

/// Computes the positions of some vertices of an instance, for example for picking, or for objects
/// that are attached to a vertex. `vertices` are in any order. `positions` has three floats for
/// each; for finite poses they are the values that `skin` writes as float32x3. Of `instance` it
/// uses pose, `promise` and `morphs` only. O(vertices × influences); it allocates. Fails as `skin`
/// does, and with `invalidArgument` if the mesh does not have a vertex or `positions` has the wrong
/// size.
DERMIS_CPU_API Result<void> skinVertices(const Mesh& mesh, Method method, const Instance& instance,
                                         std::span<const std::uint32_t> vertices,
                                         std::span<float> positions);

/// Combines the results of two jobs of an instance. `result` then holds for the vertices of both.
DERMIS_CPU_API void addResult(InstanceResult& result, const InstanceResult& other);

/// Names of the instruction sets that `skin` can use on this processor, the best one first. They
/// are the names of Highway, for example "AVX3", "AVX2", "SSE4", "NEON", or "EMU128" for no SIMD.
DERMIS_CPU_API std::vector<std::string_view> targetNames();
/// Makes `skin` use this instruction set from now on, in the whole process, for tests and
/// measurements. An empty name selects the best one again. Fails with `invalidArgument` if the name
/// is not in `targetNames`.
DERMIS_CPU_API Result<void> setTarget(std::string_view name);

// ---- Runs the frames of a scene (scene.h) on the CPU, without Vulkan. A runner owns the scene
// and, unless the engine lends memory for it, the output. It turns each frame into jobs, which the
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
//     for (const cpu::PlannedJob& job : *runner.jobs()) threadPool.run([&] { cpu::run(job); });
//     ... wait for them, and use runner.output() at scene.output(instance)

struct PlannedTask;

/// A part of the work of a frame. `SceneRunner::jobs` makes it; a default-constructed one must not
/// be run.
class PlannedJob {
 public:
  /// Vertices of all its instances: a measure of how long the job takes.
  std::uint64_t vertexCount() const { return vertexCount_; }

 private:
  friend class SceneRunner;
  friend DERMIS_CPU_API void run(const PlannedJob& job);
  const PlannedTask* task_ = nullptr;
  std::uint64_t vertexCount_ = 0;
};

/// Runs a job. The jobs of a frame may run on any threads, in any order and at the same time.
DERMIS_CPU_API void run(const PlannedJob& job);

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
