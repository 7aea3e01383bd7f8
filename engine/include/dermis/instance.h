// What an engine says of an instance of a SkinningSystem, and where it finds the vertices.
#pragma once

#include <cstdint>

#include "dermis/handle.h"
#include "dermis/layout.h"
#include "dermis/method.h"
#include "dermis/plan.h"
#include "dermis/types.h"

namespace dermis {

struct InstanceDescription {
  MeshHandle mesh = {};
  PoseHandle pose = {};  ///< Any number of instances may share one: body, clothes, hair.
  Method method = Method::dualQuaternion;
  /// Previous positions are right on first frames, when poses rest or are skipped, and when an
  /// instance comes back into view; `teleport` for jumps. `Motion::reskinned` is not possible.
  VertexLayout layout = {};
  Box box = {};  ///< for positions in snorm16, as `Job::box`
  bool bounds =
      false;  ///< the exact box of the skinned positions is wanted: `SkinningSystem::bounds`
  /// Skinned in one frame of so many, 1 or more. Instances of one pose take the same frames;
  /// poses are spread over them.
  std::uint32_t updateInterval = 1;
  /// Whether it is skinned is decided on the GPU, by `vulkan::FrameDescription::visibility`. Its
  /// output must lie in one storage buffer range; one of up to a 32nd of that always does.
  bool culledOnGpu = false;
};

/// What `prepare` must be given before such an instance is recorded.
inline PipelineNeeds pipelineNeeds(const InstanceDescription& description) {
  return {description.method, description.layout, description.bounds, description.culledOnGpu};
}

/// Where the vertices of an instance stand in `SkinningSystem::outputBuffer`.
struct InstanceOutput {
  MeshHandle mesh;  ///< whose vertices they are: out of view, those of the mesh that it was
                    ///< last skinned with
  std::uint64_t offset = 0;  ///< bytes; interleaved: a multiple of the stride, so that
                             ///< `firstVertex` may say it as well as the offset of a vertex buffer
  std::uint64_t size = 0;    ///< 0: there are none yet
  /// Offsets count from the beginning of the buffer.
  OutputAttribute positions, normals, tangents, previousPositions;
};

}  // namespace dermis
