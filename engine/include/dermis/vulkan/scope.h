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

/// Both needs in one barrier: a frame that uploads its tables and overwrites what the last frame
/// drew has two.
inline Dependency operator|(const Dependency& a, const Dependency& b) {
  return {{a.source.stages | b.source.stages, a.source.accesses | b.source.accesses},
          {a.destination.stages | b.destination.stages,
           a.destination.accesses | b.destination.accesses}};
}

/// What a buffer of the batch was last used for, before `record`.
enum class PreviousUse : std::uint8_t {
  // Someone wrote what `record` reads: meshes, matrices, tables.
  hostWrite,  ///< through a mapping, before the submission: `vkQueueSubmit` is the barrier, none is
              ///< needed
  transferWrite,  ///< vkCmdCopyBuffer, vkCmdUpdateBuffer, vkCmdFillBuffer
  computeWrite,   ///< another compute pass
  // Someone still reads what `record` overwrites: the output.
  vertexInput,                 ///< draws, as a vertex buffer
  vertexShader,                ///< draws, as a storage or texel buffer
  compute,                     ///< another compute pass
  accelerationStructureBuild,  ///< a build or refit
  transfer,                    ///< vkCmdCopyBuffer
  // Both: the palettes, and the output.
  previousRecord,  ///< an earlier `record` used the same buffer
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
/// source scope (Vulkan 1.3, 7.7.4). The host belongs to no queue family: for
/// `Consumer::hostRead` there is nothing to transfer, and all three give the same dependency.
enum class QueueTransfer : std::uint8_t { none, release, acquire };

/// The barrier before `record`, for a buffer that was last used so.
Dependency inputScope(PreviousUse use);

/// The barrier after `record`, for the output buffer.
Dependency outputScope(Consumer consumer, QueueTransfer transfer = QueueTransfer::none);

/// A dependency as the structures that vkCmdPipelineBarrier takes; the stages are those of its two
/// scopes.
VkMemoryBarrier memoryBarrier(const Dependency& dependency);

/// The same for a part of one buffer and, where the families differ, as one half of a queue-family
/// transfer.
VkBufferMemoryBarrier bufferBarrier(const Dependency& dependency, VkBuffer buffer,
                                    VkDeviceSize offset, VkDeviceSize size,
                                    std::uint32_t sourceFamily = VK_QUEUE_FAMILY_IGNORED,
                                    std::uint32_t destinationFamily = VK_QUEUE_FAMILY_IGNORED);

}  // namespace dermis::vulkan
