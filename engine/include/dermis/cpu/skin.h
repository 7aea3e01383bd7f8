// Skinning on the CPU by the everyday methods, with the SIMD instructions of its processor. It
// needs no Vulkan, and starts no threads: the thread that calls `skin` does the job.
//
//   const cpu::Mesh mesh = *cpu::Mesh::create(*pack(view, jointCount));      // at import
//   cpu::Job job;
//   job.mesh = &mesh;
//   job.places = *placeVertices(layout, mesh.info().vertexCount);
//   job.instances = instances;             // each with its pose, and memory for its vertices
//   cpu::skin(job);
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

/// Where the vertices of an instance are written: what the offsets of `Job::places` count from.
/// Each attribute that is written needs offset + (vertexCount - 1) × stride + `formatSize` bytes
/// from there on.
struct OutputMemory {
  void* positions = nullptr;
  void* normals = nullptr;
  void* tangents = nullptr;
  void* previousPositions = nullptr;

  constexpr OutputMemory() = default;
  /// The same for all attributes: the usual case.
  constexpr OutputMemory(void* all)
      : positions(all), normals(all), tangents(all), previousPositions(all) {}
  /// An array for each attribute; null for those that the job does not write. Offsets are then
  /// mostly 0, not those of `placeVertices`.
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
  OutputMemory output;                  ///< any alignment
  Box box;                              ///< as `dermis::Job::box`
  std::span<const MorphWeight> morphs;  ///< as `dermis::Job::morphs`, rising by target
  bool restartsMotion = false;          ///< as `dermis::Job::restartsMotion`
  bool settles = false;                 ///< as `dermis::Job::settles`
  /// Motion::reskinned: the previous pose, and the previous morph weights, rising by target.
  std::span<const JointMatrix> previousPose;
  std::span<const MorphWeight> previousMorphs;
  /// Not null: what was found out about the vertices of this job is written here. Results of
  /// several jobs of an instance are put together by `addResult`.
  InstanceResult* result = nullptr;
};

/// Vertices of one mesh, for some instances that are skinned alike. Instances in one job take less
/// time than in a job each.
struct Job {
  const Mesh* mesh = nullptr;
  Method method = Method::dualQuaternion;  ///< not for comparison
  VertexPlaces places;                     ///< `placeVertices`, or arranged otherwise
  std::uint32_t firstVertex = 0;
  std::uint32_t vertexEnd = 0xffffffff;  ///< or the end of the mesh
  std::span<const Instance> instances;
};

/// Writes the vertices. Every vertex comes out the same, to the bit, whatever the range, the other
/// instances, the thread and the processor. This is true of finite poses, and of threads that round
/// to nearest and do not flush subnormal numbers to zero. Any number of threads may call it at
/// once, with output that does not overlap. It allocates until a thread has seen its longest job.
/// Each thread keeps the memory that it worked in: at most 1.5 MiB where no vertex has more than
/// 128 influences, and 150 bytes for each instance of a job.
///
/// Fails with `invalidArgument` if a field makes no sense, as `makePlan` does; nothing is written
/// then.
DERMIS_CPU_API Result<void> skin(const Job& job);

/// Where some vertices of an instance are, without skinning the others: for picking, and for things
/// that hang on a vertex. `positions` gets three floats for each of `vertices`, which may stand in
/// any order: of finite poses the same values that `skin` writes as float32x3. O(vertices ×
/// influences); it allocates. Of the instance, pose, `mayScale` and morph targets count. Fails as
/// `skin`, and with `invalidArgument` for a vertex that the mesh does not have.
DERMIS_CPU_API Result<void> skinVertices(const Mesh& mesh, Method method, const Instance& instance,
                                         std::span<const std::uint32_t> vertices,
                                         std::span<float> positions);

/// Adds to the result of some vertices of an instance that of others.
DERMIS_CPU_API void addResult(InstanceResult& result, const InstanceResult& other);

/// The names of the instruction sets that `skin` was compiled for and that this processor has, the
/// best one first: "AVX3", "AVX2", "SSE4", "EMU128" (none), "NEON".
DERMIS_CPU_API std::vector<std::string_view> targetNames();
/// Has `skin` use one of them from now on, in the whole process, to test or measure it. Fails with
/// `invalidArgument` for a name that is not in `targetNames`. Empty: the best one again.
DERMIS_CPU_API Result<void> setTarget(std::string_view name);

}  // namespace dermis::cpu
