// Skins on the CPU, with SIMD instructions. All methods except those for comparison are available.
// Needs no Vulkan and starts no threads: the thread that calls `skin` does the work.
//
//     const cpu::Mesh mesh = *cpu::Mesh::create(*pack(view, jointCount));      // while loading
//     cpu::Job job;
//     job.mesh = &mesh;
//     job.places = *placeVertices(layout, mesh.info().vertexCount);
//     job.instances = instances;             // each with its pose, and memory for its vertices
//     cpu::skin(job);
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <string_view>
#include <vector>

#include "dermis/cpu/mesh.h"
#include "dermis/export.h"
#include "dermis/layout.h"
#include "dermis/mesh.h"
#include "dermis/method.h"
#include "dermis/plan.h"
#include "dermis/result.h"
#include "dermis/types.h"

namespace dermis::cpu {

/// The memory that the vertices of an instance are written to. Offsets in `Job::places` count from
/// these addresses. For each attribute that the job writes, there must be offset + (vertexCount -
/// 1) × stride + `formatSize` bytes. The addresses need no alignment.
struct OutputMemory {
  void* positions = nullptr;
  void* normals = nullptr;
  void* tangents = nullptr;
  void* previousPositions = nullptr;

  /// No memory.
  constexpr OutputMemory() = default;
  /// One address for all attributes, for the offsets that `placeVertices` returns.
  constexpr OutputMemory(void* all)
      : positions(all), normals(all), tangents(all), previousPositions(all) {}
  /// An array for each attribute; null for attributes that the job does not write. The offsets in
  /// `Job::places` are then usually 0, not those that `placeVertices` returns.
  constexpr OutputMemory(void* positionArray, void* normalArray, void* tangentArray,
                         void* previousArray)
      : positions(positionArray),
        normals(normalArray),
        tangents(tangentArray),
        previousPositions(previousArray) {}
};

/// One instance of a job.
struct Instance {
  std::span<const JointMatrix> pose;    ///< at least `MeshInfo::requiredJoints`
  bool mayScale = true;                 ///< as `PoseDescription::mayScale`
  OutputMemory output;                  ///< where the vertices are written
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
/// uses pose, `mayScale` and `morphs` only. O(vertices × influences); it allocates. Fails as `skin`
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

}  // namespace dermis::cpu
