// The baselines: a crowd skinned by plain kernels (plain_palette.comp with plain_skin.comp, or
// plain_linear.comp), or only copied (plain_copy.comp).
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <memory>
#include <span>
#include <vector>

#include "kit/bench/crowd.h"
#include "kit/bench/storage_kernels.h"
#include "kit/buffer.h"
#include "kit/device.h"
#include "kit/render/owned.h"
#include "kit/timestamps.h"

namespace dermis::samples {

enum class PlainKernel : std::uint8_t { dualQuaternion, linear, copy };
inline constexpr std::size_t plainKernelCount = 3;

/// A crowd on a device. Each kernel skins it into the same memory. There is one dispatch for each
/// storage buffer range that the output needs; each range holds whole instances.
class PlainBatches {
 public:
  /// Skins the crowd once with each kernel, so that drivers have compiled and memory has been
  /// touched. `open` must outlive this object. Fails with `vulkanError`.
  static Result<std::unique_ptr<PlainBatches>> create(OpenDevice& open, const Crowd& crowd);
  ~PlainBatches();
  PlainBatches(const PlainBatches&) = delete;
  PlainBatches& operator=(const PlainBatches&) = delete;

  /// Skins the crowd, including the conversion of its poses, and returns the seconds that it took:
  /// on the device if it has timestamps, otherwise from submission to the end of waiting.
  Result<double> skin(PlainKernel kernel);

  /// Position and normal of every vertex of every instance, interleaved.
  Result<std::vector<std::byte>> output() const { return output_.read(); }

 private:
  explicit PlainBatches(OpenDevice& open)
      : device_(*open.device), maxRange_(open.context.limits().maxStorageBufferRange) {}
  Result<void> make(const Crowd& crowd);
  Result<void> makeBuffers(const Crowd& crowd);
  Result<void> record(const Crowd& crowd, PlainKernel kernel);
  Result<void> recordPalettes(const Crowd& crowd, VkCommandBuffer commandBuffer);
  Result<void> recordSkinning(const Crowd& crowd, PlainKernel kernel,
                              VkCommandBuffer commandBuffer);

  Device& device_;
  std::uint64_t maxRange_;
  Timestamps timestamps_;
  MappedBuffer vertices_, matrices_;
  DeviceBuffer palettes_, output_;
  StorageKernels kernels_;
  render::Owned<VkPipeline> palettePipeline_;
  std::array<render::Owned<VkPipeline>, plainKernelCount> pipelines_;
  std::array<VkCommandBuffer, plainKernelCount> commandBuffers_{};
};

}  // namespace dermis::samples
