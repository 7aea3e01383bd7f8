#include "swapchain.h"

#include <algorithm>
#include <limits>
#include <string>
#include <utility>

#include <vulkan/vulkan.h>

namespace dermis::viewer {
namespace {

using samples::render::Owned;

// Long enough for any picture, but short enough that the window closes if the display is gone.
constexpr std::uint64_t patience = 2'000'000'000;  // nanoseconds

Error failed(const char* function, VkResult result) {
  return {
      ErrorCode::vulkanError,
      std::string(function) + " failed with VkResult " + std::to_string(static_cast<int>(result)),
      static_cast<std::int32_t>(result)};
}

Result<Owned<VkSemaphore>> makeSemaphore(const samples::Device& device) {
  VkSemaphoreCreateInfo info{};
  info.sType = VK_STRUCTURE_TYPE_SEMAPHORE_CREATE_INFO;
  return samples::render::make(device, "vkCreateSemaphore", vkCreateSemaphore, vkDestroySemaphore,
                               info);
}

VkExtent2D extentOf(const VkSurfaceCapabilitiesKHR& capabilities, VkExtent2D wanted) {
  if (capabilities.currentExtent.width != std::numeric_limits<std::uint32_t>::max())
    return capabilities.currentExtent;
  return {std::clamp(wanted.width, capabilities.minImageExtent.width,
                     capabilities.maxImageExtent.width),
          std::clamp(wanted.height, capabilities.minImageExtent.height,
                     capabilities.maxImageExtent.height)};
}

VkCompositeAlphaFlagBitsKHR alphaOf(const VkSurfaceCapabilitiesKHR& capabilities) {
  for (const VkCompositeAlphaFlagBitsKHR alpha :
       {VK_COMPOSITE_ALPHA_OPAQUE_BIT_KHR, VK_COMPOSITE_ALPHA_INHERIT_BIT_KHR,
        VK_COMPOSITE_ALPHA_PRE_MULTIPLIED_BIT_KHR}) {
    if ((capabilities.supportedCompositeAlpha & static_cast<VkFlags>(alpha)) != 0) return alpha;
  }
  return VK_COMPOSITE_ALPHA_POST_MULTIPLIED_BIT_KHR;
}

}  // namespace

Result<Swapchain> Swapchain::create(samples::Device& device, VkSurfaceKHR surface) {
  Swapchain swapchain;
  swapchain.device_ = &device;
  swapchain.surface_ = surface;
  if (Result<void> chosen = swapchain.chooseFormat(); !chosen) return chosen.error();
  return swapchain;
}

Result<void> Swapchain::chooseFormat() {
  std::uint32_t count = 0;
  vkGetPhysicalDeviceSurfaceFormatsKHR(device_->physicalDevice(), surface_, &count, nullptr);
  std::vector<VkSurfaceFormatKHR> formats(count);
  vkGetPhysicalDeviceSurfaceFormatsKHR(device_->physicalDevice(), surface_, &count, formats.data());
  // Bytes are copied to the images, so it does not matter whether the format is sRGB.
  for (const VkFormat wanted : {VK_FORMAT_B8G8R8A8_UNORM, VK_FORMAT_R8G8B8A8_UNORM,
                                VK_FORMAT_B8G8R8A8_SRGB, VK_FORMAT_R8G8B8A8_SRGB}) {
    for (const VkSurfaceFormatKHR& format : formats) {
      if (format.format != wanted || format.colorSpace != colorSpace_) continue;
      format_ = wanted;
      return {};
    }
  }
  return Error{ErrorCode::missingFeature,
               "the window has no format with 8 bits each for red, green and blue"};
}

VkFormat Swapchain::srgbFormat() const {
  const bool isBlueFirst =
      format_ == VK_FORMAT_B8G8R8A8_UNORM || format_ == VK_FORMAT_B8G8R8A8_SRGB;
  return isBlueFirst ? VK_FORMAT_B8G8R8A8_SRGB : VK_FORMAT_R8G8B8A8_SRGB;
}

Result<void> Swapchain::resize(VkExtent2D pixels) {
  VkSurfaceCapabilitiesKHR capabilities{};
  if (const VkResult result = vkGetPhysicalDeviceSurfaceCapabilitiesKHR(device_->physicalDevice(),
                                                                        surface_, &capabilities);
      result != VK_SUCCESS) {
    return failed("vkGetPhysicalDeviceSurfaceCapabilitiesKHR", result);
  }
  if ((capabilities.supportedUsageFlags & VK_IMAGE_USAGE_TRANSFER_DST_BIT) == 0)
    return Error{ErrorCode::missingFeature, "the window's images cannot be copied to"};
  extent_ = extentOf(capabilities, pixels);
  isStale_ = true;
  images_.clear();
  if (extent_.width == 0 || extent_.height == 0) return {};

  VkSwapchainCreateInfoKHR info{};
  info.sType = VK_STRUCTURE_TYPE_SWAPCHAIN_CREATE_INFO_KHR;
  info.surface = surface_;
  info.minImageCount = capabilities.minImageCount + 1;
  if (capabilities.maxImageCount != 0)
    info.minImageCount = std::min(info.minImageCount, capabilities.maxImageCount);
  info.imageFormat = format_;
  info.imageColorSpace = colorSpace_;
  info.imageExtent = extent_;
  info.imageArrayLayers = 1;
  info.imageUsage = VK_IMAGE_USAGE_TRANSFER_DST_BIT;
  info.imageSharingMode = VK_SHARING_MODE_EXCLUSIVE;
  info.preTransform = capabilities.currentTransform;
  info.compositeAlpha = alphaOf(capabilities);
  info.presentMode = VK_PRESENT_MODE_FIFO_KHR;  // every device supports it
  info.clipped = VK_TRUE;
  info.oldSwapchain = swapchain_.get();
  Result<Owned<VkSwapchainKHR>> made = samples::render::make(
      *device_, "vkCreateSwapchainKHR", vkCreateSwapchainKHR, vkDestroySwapchainKHR, info);
  if (!made) return made.error();
  swapchain_ = std::move(*made);
  std::uint32_t count = 0;
  vkGetSwapchainImagesKHR(device_->handle(), swapchain_.get(), &count, nullptr);
  images_.resize(count);
  vkGetSwapchainImagesKHR(device_->handle(), swapchain_.get(), &count, images_.data());
  isStale_ = false;
  return makeSemaphores();
}

Result<void> Swapchain::makeSemaphores() {
  Result<Owned<VkSemaphore>> acquired = makeSemaphore(*device_);
  if (!acquired) return acquired.error();
  acquired_ = std::move(*acquired);
  drawn_.clear();
  for (std::size_t image = 0; image < images_.size(); ++image) {
    Result<Owned<VkSemaphore>> drawn = makeSemaphore(*device_);
    if (!drawn) return drawn.error();
    drawn_.push_back(std::move(*drawn));
  }
  return {};
}

Result<std::optional<Swapchain::Image>> Swapchain::acquire() {
  std::uint32_t index = 0;
  const VkResult result = vkAcquireNextImageKHR(device_->handle(), swapchain_.get(), patience,
                                                acquired_.get(), VK_NULL_HANDLE, &index);
  if (result == VK_TIMEOUT || result == VK_NOT_READY) return std::optional<Image>();
  if (result == VK_ERROR_OUT_OF_DATE_KHR) {
    isStale_ = true;
    return std::optional<Image>();
  }
  if (result == VK_SUBOPTIMAL_KHR) isStale_ = true;  // recreated after this picture
  if (result != VK_SUCCESS && result != VK_SUBOPTIMAL_KHR)
    return failed("vkAcquireNextImageKHR", result);
  return std::optional<Image>(Image{index, images_[index], acquired_.get(), drawn_[index].get()});
}

Result<void> Swapchain::present(const Image& image) {
  const VkSwapchainKHR swapchain = swapchain_.get();
  VkPresentInfoKHR info{};
  info.sType = VK_STRUCTURE_TYPE_PRESENT_INFO_KHR;
  info.waitSemaphoreCount = 1;
  info.pWaitSemaphores = &image.drawn;
  info.swapchainCount = 1;
  info.pSwapchains = &swapchain;
  info.pImageIndices = &image.index;
  const VkResult result = vkQueuePresentKHR(device_->queue(), &info);
  if (result == VK_SUBOPTIMAL_KHR || result == VK_ERROR_OUT_OF_DATE_KHR) {
    isStale_ = true;
    return {};
  }
  if (result != VK_SUCCESS) return failed("vkQueuePresentKHR", result);
  return {};
}

}  // namespace dermis::viewer
