#include "vulkan_loader.h"

#include <dlfcn.h>

namespace dermis::samples {

Result<std::shared_ptr<VulkanLoader>> VulkanLoader::open() {
  std::shared_ptr<VulkanLoader> loader(new VulkanLoader);
  loader->library_ = dlopen("libvulkan.so.1", RTLD_NOW | RTLD_LOCAL);
  if (loader->library_ == nullptr) {
    return Error{ErrorCode::missingFeature,
                 "there is no Vulkan loader (libvulkan.so.1) on this machine"};
  }
  loader->getInstanceProcAddr =
      reinterpret_cast<PFN_vkGetInstanceProcAddr>(dlsym(loader->library_, "vkGetInstanceProcAddr"));
  if (loader->getInstanceProcAddr == nullptr) {
    return Error{ErrorCode::missingFeature, "libvulkan.so.1 has no vkGetInstanceProcAddr"};
  }
  return loader;
}

VulkanLoader::~VulkanLoader() {
  // Not closed: drivers leave threads and exit handlers behind that would run in unmapped code.
}

}  // namespace dermis::samples
