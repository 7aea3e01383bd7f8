// What the SIMD code gets: jobs that were checked, and memory to work in.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include "cpu/mesh_data.h"
#include "dermis/cpu/skin.h"

namespace dermis::cpu {

/// As wide as the widest vectors.
struct alignas(64) CacheLine {
  float v[16];
};

/// Memory of one thread, as large as the largest section that it has skinned needs.
struct Scratch {
  std::vector<CacheLine> dualQuaternions;  ///< of joints: real and dual part
  std::vector<CacheLine> scaleShears;      ///< of joints: diagonal and mixed entries, and two zeros
  std::vector<CacheLine> rows;             ///< of joints: 3×4, and four zeros
  std::vector<CacheLine> pairs;            ///< dual quaternions, of up to four instances
  std::vector<CacheLine> scalePairs;       ///< the joint's scale/shear part less the pivot's
};

/// As `Instance`.
struct TaskInstance {
  std::span<const JointMatrix> pose;
  /// Where each attribute of the mesh's first vertex stands, by `Stream`.
  std::array<std::byte*, streamCount> outputs{};
  bool mayScale = true, restartsMotion = false, settles = false;
  std::span<const MorphWeight> morphs;  ///< rising by target
  std::span<const JointMatrix> previousPose;
  std::span<const MorphWeight> previousMorphs;
  InstanceResult* result = nullptr;
  float boxCenter[3] = {}, boxInverse[3] = {};  ///< of snorm16 positions; 1 / half its size

  std::byte* output(Stream stream) const { return outputs[static_cast<std::size_t>(stream)]; }
};

struct Task {
  const MeshData* mesh = nullptr;
  Method method = Method::dualQuaternion;
  VertexPlaces places;  ///< formats, strides and motion
  std::uint32_t firstVertex = 0, vertexEnd = 0;
  std::span<const TaskInstance> instances;
};

/// Fails with `invalidArgument` for a method for comparison. The message begins with `subject`.
Result<void> checkMethod(Method method, const char* subject);

/// With memory that the thread keeps.
void skinTask(const Task& task);

/// `scratch`: four, of an instance, of its previous pose, of several at a time, and of several that
/// scale.
/// By the best instructions that the processor has, or those that `setTarget` chose.
void dispatchTask(const Task& task, Scratch* scratch);

}  // namespace dermis::cpu
