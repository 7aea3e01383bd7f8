#include "kit/vulkan_loader.h"

#ifdef _WIN32
#include <windows.h>
#else
#include <dlfcn.h>
#endif

#include <string>

namespace dermis::samples {
namespace {

#ifdef _WIN32
constexpr const char* libraryName = "vulkan-1.dll";

void* openLibrary() {
  return LoadLibraryA(libraryName);
}

PFN_vkGetInstanceProcAddr findEntryPoint(void* library) {
  return reinterpret_cast<PFN_vkGetInstanceProcAddr>(reinterpret_cast<void*>(
      GetProcAddress(static_cast<HMODULE>(library), "vkGetInstanceProcAddr")));
}
#else
constexpr const char* libraryName = "libvulkan.so.1";

void* openLibrary() {
  return dlopen(libraryName, RTLD_NOW | RTLD_LOCAL);
}

PFN_vkGetInstanceProcAddr findEntryPoint(void* library) {
  return reinterpret_cast<PFN_vkGetInstanceProcAddr>(dlsym(library, "vkGetInstanceProcAddr"));
}
#endif

}  // namespace

Result<std::shared_ptr<VulkanLoader>> VulkanLoader::open() {
  std::shared_ptr<VulkanLoader> loader(new VulkanLoader);
  loader->library_ = openLibrary();
  if (loader->library_ == nullptr) {
    return Error{ErrorCode::missingFeature,
                 std::string("there is no Vulkan loader (") + libraryName + ") on this machine"};
  }
  loader->getInstanceProcAddr = findEntryPoint(loader->library_);
  if (loader->getInstanceProcAddr == nullptr) {
    return Error{ErrorCode::missingFeature,
                 std::string(libraryName) + " has no vkGetInstanceProcAddr"};
  }
  return loader;
}

VulkanLoader::~VulkanLoader() {
  // Never closed: drivers leave threads and exit handlers whose code would be unmapped.
}

}  // namespace dermis::samples
