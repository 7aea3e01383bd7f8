// A crowd that is skinned into an engine's vertex buffer, frame by frame: what an engine adds to
// use Dermis. The engine is played by the samples' Device and MappedBuffer; it owns the device, the
// memory, the command buffers, the submission and the waiting.
#pragma once

#include <array>
#include <cstdint>
#include <span>
#include <vector>

#include "buffer.h"
#include "dermis/dermis.h"
#include "dermis/vulkan/vulkan.h"
#include "device.h"

namespace embed {

inline constexpr std::uint32_t instanceCount = 100;
inline constexpr std::size_t framesInFlight = 2;

/// A vertex as the engine's shaders read it. Dermis writes the first two attributes and leaves the
/// bytes between alone.
struct SkinnedVertex {
  float position[3];
  std::int16_t normal[2];  ///< octahedral
  float textureCoordinate[2];
};

/// What is rewritten each frame, and so needed once for every frame in flight.
struct Frame {
  dermis::samples::MappedBuffer poses, tables, palettes;
  dermis::vulkan::Bindings bindings;
};

struct Crowd {
  dermis::vulkan::Context context;  ///< One for all that is skinned on a device.
  dermis::PackedMesh mesh;          ///< Made at import, or read with `PackedMesh::fromBytes`.
  std::uint32_t jointCount = 0;     ///< of a pose
  dermis::samples::MappedBuffer meshes;
  dermis::samples::MappedBuffer output;  ///< The vertex buffer that the engine draws from.
  std::array<Frame, framesInFlight> frames;
  // Reused from frame to frame, to keep their memory.
  std::vector<dermis::PoseDescription> poses;
  std::vector<dermis::Job> jobs;
  dermis::Plan plan;
};

/// Once, on a loading thread: it builds pipelines.
dermis::Result<Crowd> setUp(dermis::samples::Device& engine, const dermis::MeshView& mesh,
                            std::uint32_t jointCount);

/// Each frame, when the GPU is done with what it last did with `frame`. `poses` has the poses of
/// all instances, one after the other. Outside a render pass.
dermis::Result<void> skinFrame(const dermis::samples::Device& engine, Crowd& crowd, Frame& frame,
                               std::span<const dermis::JointMatrix> poses,
                               VkCommandBuffer commandBuffer);

}  // namespace embed
