// The engine's buffers, and the descriptors of Dermis for them.
#pragma once

#include <cstdint>
#include <memory>

#include "dermis/export.h"
#include "dermis/vulkan/handles.h"

namespace dermis::vulkan {

/// A part of a VkBuffer. The offset is a multiple of
/// `DeviceLimits::minStorageBufferOffsetAlignment`, the size of 4.
struct BufferRange {
  VkBuffer buffer{};
  VkDeviceSize offset = 0;
  VkDeviceSize size = 0;  ///< bytes; VK_WHOLE_SIZE is not allowed here
};

/// The output buffers, by attribute. Attributes may share a buffer. Each may be larger than a
/// storage buffer range.
struct OutputBuffers {
  BufferRange positions;
  BufferRange normals;
  BufferRange tangents;
  BufferRange previousPositions;

  /// All attributes in one buffer.
  static OutputBuffers oneBuffer(const BufferRange& range) { return {range, range, range, range}; }
};

/// The buffers of a batch, each with VK_BUFFER_USAGE_STORAGE_BUFFER_BIT. If
/// `DeviceLimits::texelBuffers`, meshes, poses, tables and palettes also have
/// VK_BUFFER_USAGE_UNIFORM_TEXEL_BUFFER_BIT. `Plan::buffer` gives their sizes and usage. An engine
/// that cannot give them that usage sets `DeviceDescription::texelBuffers` to false. The engine
/// owns the buffers. One that a plan does not need may be left empty: meshes and outputs if there
/// is no job, poses and tables if the batch is empty, palettes if all jobs are linear and no pose
/// `isReadByShaders`, results if no job has any, an attribute's output if no job wants it.
struct BatchBuffers {
  BufferRange meshes;    ///< packed meshes at the jobs' `meshOffset`
  BufferRange poses;     ///< joint matrices at `PoseDescription::matrixOffset`
  BufferRange tables;    ///< what `writeTables` wrote
  BufferRange palettes;  ///< palettes and `PoseStatus`: the palette kernel writes them
  OutputBuffers outputs;
  BufferRange results;  ///< `InstanceResult` at `Plan::resultOffset`
};

struct BindingsState;

/// Descriptor sets and buffer views for one set of buffers, created by `Context::createBindings`.
/// It must live until the GPU has completed all commands that `record` recorded with it. Destroy it
/// before the Context. Any number of threads may `record` with it at the same time.
class DERMIS_VULKAN_API Bindings {
 public:
  Bindings();
  ~Bindings();
  Bindings(Bindings&&) noexcept;
  Bindings& operator=(Bindings&&) noexcept;

 private:
  friend class Context;
  friend class SkinningSystem;
  friend struct ContextState;
  std::unique_ptr<BindingsState> state_;
};

}  // namespace dermis::vulkan
