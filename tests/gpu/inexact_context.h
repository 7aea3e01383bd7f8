// A context whose kernels compute as a GPU may that is only as exact as Vulkan demands.
#pragma once

#include <cstddef>
#include <cstdint>
#include <vector>

#include "dermis/vulkan/context.h"
#include "inexact_arithmetic.h"
#include "intercepted_device.h"

namespace dermis::test {

inline Inexactness inexactness;
inline std::size_t changedOperations = 0;
inline PFN_vkCreateShaderModule createExactModule = nullptr;

inline VkResult VKAPI_CALL createInexactModule(VkDevice device,
                                               const VkShaderModuleCreateInfo* info,
                                               const VkAllocationCallbacks* callbacks,
                                               VkShaderModule* module) {
  const std::vector<std::uint32_t> words =
      makeInexact({info->pCode, info->codeSize / 4}, inexactness, &changedOperations);
  VkShaderModuleCreateInfo changed = *info;
  changed.pCode = words.data();
  changed.codeSize = words.size() * 4;
  return createExactModule(device, &changed, callbacks, module);
}

struct Arithmetic {
  const char* name;
  Inexactness inexactness;
};

/// Only one may exist at a time, because the replaced function is passed no context.
struct Inexact {
  Inexact(const vulkan::DeviceDescription& description, const Arithmetic& arithmetic)
      : gpu(description), context(create(description, arithmetic)) {}

  Result<vulkan::Context> create(const vulkan::DeviceDescription& description,
                                 const Arithmetic& arithmetic) {
    const auto getDeviceProcAddr = reinterpret_cast<PFN_vkGetDeviceProcAddr>(
        description.getInstanceProcAddr(description.instance, "vkGetDeviceProcAddr"));
    createExactModule = reinterpret_cast<PFN_vkCreateShaderModule>(
        getDeviceProcAddr(description.device, "vkCreateShaderModule"));
    inexactness = arithmetic.inexactness;
    changedOperations = 0;
    gpu.replace("vkCreateShaderModule", &createInexactModule);
    return vulkan::Context::create(gpu.description());
  }

  InterceptedDevice gpu;
  Result<vulkan::Context> context;
};

}  // namespace dermis::test
