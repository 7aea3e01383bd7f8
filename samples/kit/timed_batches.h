// Batches that stay on a device and are skinned repeatedly, to compare their times.
#pragma once

#include <cstddef>
#include <memory>
#include <optional>
#include <span>
#include <vector>

#include "dermis/vulkan/context.h"
#include "kit/batch_runner.h"
#include "kit/buffer.h"
#include "kit/timestamps.h"

namespace dermis::samples {

/// Batches that differ only in their methods. They share the memory of meshes, poses and outputs.
class TimedBatches {
 public:
  /// Both must outlive this object. Fails with `vulkanError`.
  static Result<TimedBatches> create(Device& device, vulkan::Context& context);
  TimedBatches(TimedBatches&&) = default;
  TimedBatches& operator=(TimedBatches&&) = delete;
  ~TimedBatches();

  /// Adds a batch and skins it once, because the first run includes compilation. Requests may
  /// differ from those of earlier batches only in their methods. All output goes to one buffer.
  /// Fails if the batch cannot be skinned.
  Result<void> add(std::span<const SkinRequest> requests, const OutputLayout& output,
                   const Tuning& tuning);

  /// Skins a batch and returns the time in seconds: the device's time if it has timestamps,
  /// otherwise the time from submission to the end of waiting.
  Result<double> skin(std::size_t batch);

  bool hasTimestamps() const { return timestamps_.has(); }

  /// The output of the batch that was skinned last.
  Result<std::vector<std::byte>> output() const { return output_.read(); }

  const Plan& plan(std::size_t batch) const { return batches_[batch]->plan; }

 private:
  struct TimedBatch {
    Plan plan;
    MappedBuffer tables;
    DeviceBuffer palettes, results;
    std::optional<vulkan::Bindings> bindings;
    VkCommandBuffer commandBuffer = VK_NULL_HANDLE;
  };
  TimedBatches() = default;
  template <typename Buffer>
  Result<void> makeBuffer(const Plan& plan, BufferRole role, Buffer& buffer);
  Result<void> makeShared(const BatchLayout& layout, const Plan& plan);
  Result<void> record(TimedBatch& batch);

  Device* device_ = nullptr;
  vulkan::Context* context_ = nullptr;
  Timestamps timestamps_;
  MappedBuffer meshes_, matrices_;
  DeviceBuffer output_;
  std::vector<std::unique_ptr<TimedBatch>> batches_;
};

}  // namespace dermis::samples
