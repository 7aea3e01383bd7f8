// Synchronization as data: stages and accesses for the barriers that the engine records before and
// after `record`. Dermis itself records barriers between its own commands only, and does not track
// the state of resources.
//
// The values are those of Vulkan 1.0 barriers. VkPipelineStageFlags2 and VkAccessFlags2 have the
// same bits: `memoryBarrier2` and `bufferBarrier2` are for vkCmdPipelineBarrier2.
#pragma once

#include <cstdint>

#include "dermis/export.h"
#include "dermis/vulkan/handles.h"

namespace dermis::vulkan {

/// One side of a dependency, as in the Vulkan specification.
struct Scope {
  VkPipelineStageFlags stages = 0;
  VkAccessFlags accesses = 0;
};

/// Both sides of the barrier between two uses of a buffer.
struct Dependency {
  Scope source;
  Scope destination;
};

/// Two dependencies in one barrier. Example: the engine has copied tables, and `record` overwrites
/// vertices that the last frame drew.
inline Dependency operator|(const Dependency& a, const Dependency& b) {
  return {{a.source.stages | b.source.stages, a.source.accesses | b.source.accesses},
          {a.destination.stages | b.destination.stages,
           a.destination.accesses | b.destination.accesses}};
}

/// The last use of a buffer before `record`.
enum class PreviousUse : std::uint8_t {
  // Writes to buffers that `record` reads or overwrites: meshes, poses, tables, the output.
  /// Writes to mapped memory before the submission. vkQueueSubmit makes them visible: no barrier is
  /// needed.
  hostWrite,
  transferWrite,  ///< vkCmdCopyBuffer, vkCmdUpdateBuffer, vkCmdFillBuffer
  computeWrite,   ///< another compute pass
  // Reads of a buffer that `record` overwrites: the output.
  vertexInput,   ///< draws, as a vertex buffer
  vertexShader,  ///< this and the next four: as a storage or texel buffer
  fragmentShader,
  taskShader,  ///< of VK_EXT_mesh_shader
  meshShader,
  rayTracingShader,            ///< any shader of a ray-tracing pipeline
  compute,                     ///< another compute pass
  accelerationStructureBuild,  ///< a build or refit
  transfer,                    ///< vkCmdCopyBuffer
  // Reads and writes: the palettes, the results and the output.
  /// An earlier `Context::record` used the same buffer. A SkinningSystem records this barrier
  /// itself.
  previousRecord,
};

/// The next use of the skinned vertices.
enum class Consumer : std::uint8_t {
  vertexInput,   ///< bound as a vertex buffer
  vertexShader,  ///< this and the next four: fetched from a storage or texel buffer
  fragmentShader,
  taskShader,  ///< of VK_EXT_mesh_shader
  meshShader,
  rayTracingShader,            ///< any shader of a ray-tracing pipeline
  compute,                     ///< another compute pass
  accelerationStructureBuild,  ///< the geometry of a bottom-level acceleration structure
  transfer,                    ///< vkCmdCopyBuffer
  hostRead,                    ///< read through a mapping after a fence
};

/// How the GPU overwrites data that an earlier `record` reads.
enum class Writer : std::uint8_t {
  compute,   ///< a compute pass of the engine: animation, culling
  transfer,  ///< vkCmdCopyBuffer, vkCmdUpdateBuffer, vkCmdFillBuffer
};

/// Which half of a queue-family ownership transfer a barrier is. A transfer needs two barriers: the
/// release on the queue that skins, and the acquire on the queue that reads. Vulkan ignores the
/// destination scope of a release and the source scope of an acquire (Vulkan 1.3, 7.7.4). The host
/// has no queue family, so `Consumer::hostRead` has the same dependency with all three values.
enum class QueueTransfer : std::uint8_t { none, release, acquire };

/// The barrier before `record`, for a buffer with this last use.
DERMIS_VULKAN_API Dependency inputScope(PreviousUse use);

/// The barrier before the engine overwrites poses, visibility words or meshes that an earlier
/// `record` reads. After its writes the engine records `inputScope(PreviousUse::computeWrite)` or
/// `inputScope(PreviousUse::transferWrite)`.
DERMIS_VULKAN_API Dependency overwriteScope(Writer writer);

/// The barrier after `record`, for the output buffer.
DERMIS_VULKAN_API Dependency outputScope(Consumer consumer,
                                         QueueTransfer transfer = QueueTransfer::none);

/// A dependency as a structure for vkCmdPipelineBarrier. The stages, which are separate parameters
/// there, are `dependency.source.stages` and `dependency.destination.stages`.
DERMIS_VULKAN_API VkMemoryBarrier memoryBarrier(const Dependency& dependency);

/// The same for a part of one buffer: `offset` and `size` in bytes. If the families differ, it is
/// one half of a queue-family ownership transfer.
DERMIS_VULKAN_API VkBufferMemoryBarrier
bufferBarrier(const Dependency& dependency, VkBuffer buffer, VkDeviceSize offset, VkDeviceSize size,
              std::uint32_t sourceFamily = queueFamilyIgnored,
              std::uint32_t destinationFamily = queueFamilyIgnored);

/// `memoryBarrier` for vkCmdPipelineBarrier2 (Vulkan 1.3 or VK_KHR_synchronization2).
DERMIS_VULKAN_API VkMemoryBarrier2 memoryBarrier2(const Dependency& dependency);
/// `bufferBarrier` for vkCmdPipelineBarrier2.
DERMIS_VULKAN_API VkBufferMemoryBarrier2
bufferBarrier2(const Dependency& dependency, VkBuffer buffer, VkDeviceSize offset,
               VkDeviceSize size, std::uint32_t sourceFamily = queueFamilyIgnored,
               std::uint32_t destinationFamily = queueFamilyIgnored);

}  // namespace dermis::vulkan
