// A Vulkan object that is destroyed with its owner.
#pragma once

#include <utility>

#include "kit/device.h"

namespace dermis::samples::render {

template <typename Handle>
class Owned {
 public:
  using Destroy = void(VKAPI_PTR*)(VkDevice, Handle, const VkAllocationCallbacks*);

  Owned() = default;
  Owned(VkDevice device, Handle handle, Destroy destroy)
      : device_(device), handle_(handle), destroy_(destroy) {}
  ~Owned() {
    if (handle_ != VK_NULL_HANDLE) destroy_(device_, handle_, nullptr);
  }
  Owned(Owned&& other) noexcept { *this = std::move(other); }
  Owned& operator=(Owned&& other) noexcept {
    std::swap(device_, other.device_);
    std::swap(handle_, other.handle_);
    std::swap(destroy_, other.destroy_);
    return *this;
  }

  Handle get() const { return handle_; }

 private:
  VkDevice device_ = VK_NULL_HANDLE;
  Handle handle_ = VK_NULL_HANDLE;
  Destroy destroy_ = nullptr;
};

/// Calls a vkCreate… function.
template <typename Handle, typename Info>
Result<Owned<Handle>> make(const Device& device, const char* name,
                           VkResult(VKAPI_PTR* create)(VkDevice, const Info*,
                                                       const VkAllocationCallbacks*, Handle*),
                           typename Owned<Handle>::Destroy destroy, const Info& info) {
  Handle handle = VK_NULL_HANDLE;
  const VkResult result = create(device.handle(), &info, nullptr, &handle);
  if (result != VK_SUCCESS) return vulkanError(name, result);
  return Owned<Handle>(device.handle(), handle, destroy);
}

}  // namespace dermis::samples::render

/// Calls `make` for the named type of object: DERMIS_MAKE(device, Image, info).
#define DERMIS_MAKE(device, name, info)                                                          \
  ::dermis::samples::render::make((device), "vkCreate" #name, (device).functions().Create##name, \
                                  (device).functions().Destroy##name, (info))
