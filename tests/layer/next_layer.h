// What every Vulkan layer of the tests does: take its link off the chain that the loader made, and
// pass on the functions that it does not change.
#pragma once

#include <vulkan/vk_layer.h>

#include <map>
#include <mutex>

namespace dermis::test {

/// The link of the chain that the loader made for this layer, which is taken off it.
template <typename Info, typename CreateInfo>
auto* takeLink(const CreateInfo* createInfo, VkStructureType type) {
  auto* info = static_cast<Info*>(const_cast<void*>(createInfo->pNext));
  while (info->sType != type || info->function != VK_LAYER_LINK_INFO)
    info = static_cast<Info*>(const_cast<void*>(info->pNext));
  auto* link = info->u.pLayerInfo;
  info->u.pLayerInfo = link->pNext;
  return link;
}

/// The instances that exist, and how to ask the next layer for their functions.
class NextLayer {
 public:
  VkResult createInstance(const VkInstanceCreateInfo* info, const VkAllocationCallbacks* callbacks,
                          VkInstance* instance) {
    const PFN_vkGetInstanceProcAddr next =
        takeLink<VkLayerInstanceCreateInfo>(info, VK_STRUCTURE_TYPE_LOADER_INSTANCE_CREATE_INFO)
            ->pfnNextGetInstanceProcAddr;
    const auto create = reinterpret_cast<PFN_vkCreateInstance>(next(nullptr, "vkCreateInstance"));
    const VkResult result = create(info, callbacks, instance);
    if (result != VK_SUCCESS) return result;
    const std::lock_guard lock(mutex_);
    instances_[*instance] = next;
    return result;
  }

  PFN_vkVoidFunction function(VkInstance instance, const char* name) {
    PFN_vkGetInstanceProcAddr next = nullptr;
    {
      const std::lock_guard lock(mutex_);
      next = instances_[instance];
    }
    return next != nullptr ? next(instance, name) : nullptr;
  }

 private:
  std::mutex mutex_;
  std::map<VkInstance, PFN_vkGetInstanceProcAddr> instances_;
};

}  // namespace dermis::test
