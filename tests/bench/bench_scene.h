// A batch that stays on a device, to be skinned again and again.
#pragma once

#include <optional>
#include <span>
#include <vector>

#include "dermis/vulkan/context.h"
#include "kit/batch_runner.h"
#include "kit/buffer.h"
#include "kit/device.h"

namespace dermis::bench {

/// The device of this process; nothing where there is none, which has then been said on standard
/// error. DERMIS_DEVICE in the environment names another than the best.
samples::OpenDevice* benchDevice();

/// Submits, waits, and returns the seconds that both took. Ends the process where that fails.
double timedSubmission(samples::Device& device, VkCommandBuffer commandBuffer);

class BenchScene {
 public:
  /// Ends the process with a message where the batch cannot be skinned: there is nothing to measure
  /// then.
  BenchScene(samples::OpenDevice& open, std::span<const samples::SkinRequest> requests,
             const samples::OutputLayout& output, const Tuning& tuning);

  /// Submits the batch, waits, and returns the seconds that both took.
  double skin();

  std::uint64_t vertexCount() const { return plan_.vertexCount(); }
  /// Where one buffer holds all attributes.
  std::span<const std::byte> output() const { return output_.bytes(); }

 private:
  samples::OpenDevice& open_;
  samples::BatchLayout layout_;
  Plan plan_;
  samples::MappedBuffer meshes_, matrices_, tables_, palettes_, results_, output_;
  std::optional<vulkan::Bindings> bindings_;
  VkCommandBuffer commandBuffer_ = VK_NULL_HANDLE;
};

}  // namespace dermis::bench
