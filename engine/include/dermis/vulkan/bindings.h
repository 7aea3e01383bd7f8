// The engine's buffers, bound once for as many `record`s as they live.
#pragma once

#include <cstdint>
#include <memory>

#include <vulkan/vulkan_core.h>

namespace dermis::vulkan {

/// A part of a VkBuffer. The offset is a multiple of the device's minStorageBufferOffsetAlignment.
struct BufferRange {
  VkBuffer buffer = VK_NULL_HANDLE;
  VkDeviceSize offset = 0;
  VkDeviceSize size = 0;  ///< bytes; VK_WHOLE_SIZE is not allowed here
};

/// The buffers of a batch, each with VK_BUFFER_USAGE_STORAGE_BUFFER_BIT; `Plan::buffer` tells their
/// sizes. The engine owns them. One that a plan does not need may be left empty: meshes and output
/// only where there is no job at all, matrices and tables likewise, palettes where no job uses dual
/// quaternions.
struct BatchBuffers {
  BufferRange meshes;    ///< packed meshes at the jobs' `meshOffset`
  BufferRange matrices;  ///< joint matrices at the palettes' `matrixOffset`
  BufferRange tables;    ///< what `writeTables` wrote
  BufferRange palettes;  ///< scratch: written and read by `record`
  BufferRange output;    ///< where skinned vertices go; may be larger than a storage buffer range
};

/// Descriptor sets for one set of buffers, made by `Context::createBindings`. It must outlive every
/// command buffer that `record` used it in, until the GPU is done with them; destroy it before the
/// Context. Movable, not thread-safe to destroy while in use; any number of threads may `record`
/// with it.
class Bindings {
 public:
  Bindings();
  ~Bindings();
  Bindings(Bindings&&) noexcept;
  Bindings& operator=(Bindings&&) noexcept;

 private:
  friend class Context;
  struct State;
  std::unique_ptr<State> state_;
};

}  // namespace dermis::vulkan
