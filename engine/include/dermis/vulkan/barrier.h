// The barriers that the engine records around `record`, and before and after its own writes to what
// `record` reads. Dermis records the barriers between its own commands, and does not track the
// state of resources.
//
//   context.recordBarrier(commandBuffer, barrierBetween(Use::vertexInput, Use::dermis));
//   context.record(commandBuffer, plan, bindings);  // or SceneRecorder::record
//   context.recordBarrier(commandBuffer, barrierBetween(Use::dermis, Use::vertexInput));
#pragma once

#include <cstdint>

#include "dermis/export.h"
#include "dermis/vulkan/handles.h"

namespace dermis::vulkan {

/// How commands use a buffer. Combine uses by `|`.
enum class Use : std::uint32_t {
  /// All that `record` reads and writes. A SceneRecorder orders its own `record`s; between two
  /// calls of `Context::record` with the same buffers, the engine records a barrier.
  dermis = 1,
  vertexInput = 2,   ///< draws, as a vertex buffer
  vertexShader = 4,  ///< this and the next four: as a storage or texel buffer that is only read
  fragmentShader = 8,
  taskShader = 16,  ///< of VK_EXT_mesh_shader
  meshShader = 32,
  rayTracing = 64,                   ///< any shader of a ray-tracing pipeline
  accelerationStructureBuild = 128,  ///< the geometry of a build or refit
  computeRead = 256,                 ///< by compute shaders of the engine
  computeWrite = 512,
  copyRead = 1024,   ///< vkCmdCopyBuffer
  copyWrite = 2048,  ///< vkCmdCopyBuffer, vkCmdUpdateBuffer, vkCmdFillBuffer
  hostRead = 4096,   ///< through a mapping, after a fence
  /// Through a mapping. What is written before the submission needs no barrier: vkQueueSubmit makes
  /// it visible.
  hostWrite = 8192,
};
/// Both uses.
constexpr Use operator|(Use a, Use b) {
  return static_cast<Use>(static_cast<std::uint32_t>(a) | static_cast<std::uint32_t>(b));
}

/// Which half of a queue-family ownership transfer a barrier is. A transfer needs two barriers with
/// the same uses: the release on the queue of the first, and the acquire on the queue of the
/// second. Vulkan ignores the destination of a release and the source of an acquire (Vulkan 1.3,
/// 7.7.4). The host has no queue family: uses by it are left out of a transfer. If no others are
/// before or after it, all three values give the same barrier.
enum class QueueTransfer : std::uint8_t { none = 0, release = 1, acquire = 2 };

/// Stages and accesses of both sides of a barrier. VkPipelineStageFlags2 and VkAccessFlags2 have
/// the same bits.
struct DERMIS_VULKAN_API Barrier {
  VkPipelineStageFlags sourceStages = 0;
  VkAccessFlags sourceAccesses = 0;
  VkPipelineStageFlags destinationStages = 0;
  VkAccessFlags destinationAccesses = 0;

  // For engines that record barriers themselves.

  /// For vkCmdPipelineBarrier, which takes the stages as parameters.
  operator VkMemoryBarrier() const;
  /// The same for a whole buffer, without a transfer. The caller sets `buffer`, and may set the
  /// range and the queue families.
  operator VkBufferMemoryBarrier() const;
  /// For vkCmdPipelineBarrier2 (Vulkan 1.3 or VK_KHR_synchronization2).
  operator VkMemoryBarrier2() const;
  /// The same for a whole buffer, without a transfer, as for VkBufferMemoryBarrier.
  operator VkBufferMemoryBarrier2() const;
};

/// The barrier between two uses of a buffer, or of several buffers. After reads alone it has no
/// source accesses: the second use only waits.
DERMIS_VULKAN_API Barrier barrierBetween(Use before, Use after,
                                         QueueTransfer transfer = QueueTransfer::none);

}  // namespace dermis::vulkan
