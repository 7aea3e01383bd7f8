// What an engine says of an instance of a SkinningSystem, and where it finds the vertices.
#pragma once

#include <cstdint>

#include "dermis/handle.h"
#include "dermis/method.h"
#include "dermis/plan.h"
#include "dermis/types.h"
#include "dermis/vertex_format.h"

namespace dermis {

enum class Arrangement : std::uint8_t {
  interleaved,  ///< vertex after vertex: positions, normals, tangents, previous positions
  planar,       ///< attribute after attribute, each beginning at a multiple of 16 bytes
};

/// The skinned vertices of an instance, as the engine draws them.
struct VertexLayout {
  VertexFormat positions = VertexFormat::float32x3;
  VertexFormat normals = VertexFormat::none;
  VertexFormat tangents = VertexFormat::none;
  /// Positions of the last frame in which the instance was displayed, for motion vectors; in the
  /// format of positions. Right by themselves on first frames, when poses rest or are skipped, and
  /// when an instance comes back into view; `teleport` for jumps.
  bool previousPositions = false;
  Arrangement arrangement = Arrangement::interleaved;
  /// Interleaved: bytes from vertex to vertex, for attributes of the engine's own behind those of
  /// Dermis, which leaves them alone. 0: no more than is needed, rounded up to a multiple of 4.
  std::uint32_t stride = 0;

  friend bool operator==(const VertexLayout&, const VertexLayout&) = default;
};

struct InstanceDescription {
  MeshHandle mesh;
  PaletteHandle palette;  ///< Any number of instances may share one: body, clothes, hair.
  Method method = Method::dualQuaternion;
  VertexLayout layout;
  Box box;  ///< for positions in snorm16, as `Job::box`
  bool bounds =
      false;  ///< the exact box of the skinned positions is wanted: `SkinningSystem::bounds`
  /// Skinned in one frame of so many, 1 or more. Instances of one palette take the same frames;
  /// palettes are spread over them.
  std::uint32_t updateInterval = 1;
  /// Whether it is skinned is decided on the GPU, by `vulkan::FrameDescription::visibility`. Its
  /// output must lie in one storage buffer range; one of up to a 32nd of that always does.
  bool culledOnGpu = false;
};

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
