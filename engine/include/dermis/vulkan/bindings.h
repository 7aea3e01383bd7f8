// The engine's buffers, and the descriptors with which Dermis binds them.
#pragma once

#include <cstdint>
#include <memory>

#include "dermis/export.h"
#include "dermis/vulkan/handles.h"

namespace dermis::vulkan {

/// A part of a VkBuffer.
struct BufferRange {
  VkBuffer buffer{};
  /// Bytes; a multiple of `DeviceLimits::minStorageBufferOffsetAlignment`.
  VkDeviceSize offset = 0;
  VkDeviceSize size = 0;  ///< bytes; a multiple of 4, not VK_WHOLE_SIZE
};

/// The output buffer of each attribute. Attributes may share a buffer. Each may be larger than a
/// storage buffer range.
struct OutputBuffers {
  BufferRange positions;
  BufferRange normals;
  BufferRange tangents;
  BufferRange previousPositions;

  /// For one buffer that all attributes share.
  static OutputBuffers oneBuffer(const BufferRange& range) { return {range, range, range, range}; }
};

/// The buffers of a batch. The engine owns them. `Plan::buffer` returns their sizes and usage: each
/// has VK_BUFFER_USAGE_STORAGE_BUFFER_BIT. If `DeviceLimits::texelBuffers` is set, meshes, poses,
/// tables and palettes have VK_BUFFER_USAGE_UNIFORM_TEXEL_BUFFER_BIT, too; an engine that cannot
/// add that usage sets `DeviceDescription::texelBuffers` to false.
///
/// A buffer that no plan needs may be left out: meshes and outputs if there are no jobs, poses and
/// tables if batches are empty, palettes if all jobs are linear, results if no job has results, and
/// the output of an attribute that no job writes.
struct BatchBuffers {
  BufferRange meshes;    ///< packed meshes, each at its `Job::meshOffset`
  BufferRange poses;     ///< joint matrices at `PoseDescription::matrixOffset`
  BufferRange tables;    ///< what `writeTables` wrote
  BufferRange palettes;  ///< palettes and `PoseStatus`, which the palette kernel writes
  OutputBuffers outputs;
  BufferRange results;  ///< `InstanceResult` at `Plan::resultOffset`
};

struct BindingsState;

/// Descriptor sets and buffer views for one set of buffers, made by `Context::createBindings`. They
/// must live until the GPU has completed all commands that were recorded with them. Destroy them
/// before the buffers and the Context. Any number of threads may `record` with them at the same
/// time.
class DERMIS_VULKAN_API Bindings {
 public:
  Bindings();
  ~Bindings();
  Bindings(Bindings&&) noexcept;
  Bindings& operator=(Bindings&&) noexcept;

 private:
  friend class Context;
  friend class SceneRecorder;
  friend struct ContextState;
  std::unique_ptr<BindingsState> state_;
};

}  // namespace dermis::vulkan
