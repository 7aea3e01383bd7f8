// Synchronisation as data: what goes into the barriers at the edges, which are the engine's. Dermis
// records barriers between its own passes only, and never tracks the state of a resource.
//
// The values are those of Vulkan 1.0 barriers; the bits are the same in VkPipelineStageFlags2 and
// VkAccessFlags2.
#pragma once

#include <cstdint>

#include <vulkan/vulkan_core.h>

namespace dermis::vulkan {

/// One side of a dependency.
struct Scope {
  VkPipelineStageFlags stages = 0;
  VkAccessFlags accesses = 0;
};

/// Both sides of the barrier that stands between two uses of a buffer.
struct Dependency {
  Scope source;
  Scope destination;
};

/// Who wrote what `record` reads (meshes, matrices, tables), or used what it overwrites (palettes,
/// output).
enum class Producer : std::uint8_t {
  hostWrite,  ///< written through a mapping before the submission: `vkQueueSubmit` is the barrier,
              ///< nothing to record
  transferWrite,   ///< vkCmdCopyBuffer, vkCmdUpdateBuffer, vkCmdFillBuffer
  computeWrite,    ///< another compute pass
  vertexInput,     ///< the last frame's draws still read the output
  previousRecord,  ///< an earlier `record` used the same palettes buffer or output
};

/// Who reads the skinned vertices next.
enum class Consumer : std::uint8_t {
  vertexInput,                 ///< bound as a vertex buffer
  vertexShader,                ///< fetched from a storage or texel buffer in the vertex shader
  compute,                     ///< another compute pass
  accelerationStructureBuild,  ///< the geometry of a bottom-level acceleration structure
  transfer,                    ///< vkCmdCopyBuffer
  hostRead,                    ///< read through a mapping after a fence
};

/// A queue-family ownership transfer is two barriers: the release on the queue that skinned, the
/// acquire on the other one. In the release the destination scope is ignored, in the acquire the
/// source scope (Vulkan 1.3, 7.7.4).
enum class QueueTransfer : std::uint8_t { none, release, acquire };

/// The barrier before `record`, for the buffers that `producer` touched.
Dependency inputScope(Producer producer);

/// The barrier after `record`, for the output buffer.
Dependency outputScope(Consumer consumer, QueueTransfer transfer = QueueTransfer::none);

/// `outputScope` as a buffer barrier over a range of the output; the engine passes it to
/// vkCmdPipelineBarrier with the stages of `outputScope`. Without a queue-family transfer both
/// families are VK_QUEUE_FAMILY_IGNORED.
VkBufferMemoryBarrier outputBarrier(Consumer consumer, VkBuffer buffer, VkDeviceSize offset,
                                    VkDeviceSize size, QueueTransfer transfer = QueueTransfer::none,
                                    std::uint32_t sourceFamily = VK_QUEUE_FAMILY_IGNORED,
                                    std::uint32_t destinationFamily = VK_QUEUE_FAMILY_IGNORED);

}  // namespace dermis::vulkan
