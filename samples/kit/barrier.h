// Memory barriers from the dependencies of dermis/vulkan/scope.h.
#pragma once

#include "dermis/vulkan/scope.h"
#include "kit/device.h"

namespace dermis::samples {

/// A global memory barrier.
void recordBarrier(const Device& device, VkCommandBuffer commandBuffer,
                   const vulkan::Dependency& dependency);

}  // namespace dermis::samples
