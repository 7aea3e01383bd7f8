// Lays out the buffers of a batch: meshes, poses, and skinned vertices in any format and
// arrangement.
#pragma once

#include <array>
#include <cstdint>
#include <map>
#include <span>
#include <vector>

#include "dermis/plan.h"
#include "dermis/types.h"

namespace dermis::samples {

/// One instance: its mesh, pose and method. Spans refer to the caller's memory.
struct SkinRequest {
  const PackedMesh* mesh = nullptr;
  std::span<const JointMatrix> pose;
  bool mayScale = true;
  Method method = Method::dualQuaternion;
  std::span<const MorphWeight> morphs = {};
  Box box = {};  ///< for snorm16 positions
  // For motion.
  std::span<const JointMatrix> previousPose = {};  ///< empty: the same pose
  std::span<const MorphWeight> previousMorphs = {};
  bool restartsMotion = false;
  bool settles = false;
};

enum class Arrangement : std::uint8_t {
  interleaved,  ///< one buffer; the attributes of a vertex are adjacent
  planar,       ///< one buffer; each attribute of an instance is a separate array
  separate,     ///< a buffer for each attribute
};

/// How skinned vertices are stored. Normals and tangents are written if the mesh has them.
struct OutputLayout {
  VertexFormat positions = VertexFormat::float32x3;
  VertexFormat normals = VertexFormat::float32x3;
  VertexFormat tangents = VertexFormat::none;
  Motion motion = Motion::none;
  bool bounds = false;
  Arrangement arrangement = Arrangement::interleaved;
  std::uint32_t gap = 0;  ///< bytes after each vertex (interleaved) or element; never written
};

struct BatchLayout {
  std::map<const PackedMesh*, std::uint64_t>
      meshOffsets;  ///< a mesh that several requests share is stored once
  std::vector<PoseDescription> poseDescriptions;
  std::vector<std::span<const JointMatrix>> poses;  ///< in the same order
  std::vector<Job> jobs;                            ///< of the requests
  std::uint64_t meshesSize = 0, posesSize = 0;
  OutputSizes outputs;
  bool oneOutput = true;

  Batch batch() const { return {poseDescriptions, jobs, meshesSize, posesSize, outputs}; }
};

BatchLayout layOutBatch(std::span<const SkinRequest> requests, const OutputLayout& output);

/// An attribute of a job, by `Stream`; `none` if it is not written.
OutputAttribute attributeOf(const Job& job, std::size_t stream);

}  // namespace dermis::samples
