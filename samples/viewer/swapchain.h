// The images of a window.
#pragma once

#include <cstdint>
#include <optional>
#include <vector>

#include "render/owned.h"

namespace dermis::viewer {

class Swapchain {
 public:
  struct Image {
    std::uint32_t index = 0;
    VkImage handle = VK_NULL_HANDLE;
    VkSemaphore acquired = VK_NULL_HANDLE;  ///< for the submission to wait for
    VkSemaphore drawn = VK_NULL_HANDLE;     ///< for the submission to signal
  };

  /// `device` and `surface` must outlive it. Fails with `missingFeature` if images of the
  /// surface have no bytes of red, green and blue, or cannot be copied to. Has no images yet.
  static Result<Swapchain> create(samples::Device& device, VkSurfaceKHR surface);

  /// Four bytes a pixel, as they are shown.
  VkFormat format() const { return format_; }
  /// The same bytes, taken for sRGB.
  VkFormat srgbFormat() const;
  VkExtent2D extent() const { return extent_; }

  /// New images, for a surface of that size where it does not say itself. The device must be idle.
  /// Without any where the surface has no size now.
  Result<void> resize(VkExtent2D pixels);
  /// The next image; nothing if there is none now, or new ones must be made first: `isStale`.
  Result<std::optional<Image>> acquire();
  Result<void> present(const Image& image);
  bool isStale() const { return isStale_ || swapchain_.get() == VK_NULL_HANDLE; }

 private:
  Result<void> chooseFormat();
  Result<void> makeSemaphores();

  samples::Device* device_ = nullptr;
  VkSurfaceKHR surface_ = VK_NULL_HANDLE;
  VkFormat format_ = VK_FORMAT_UNDEFINED;
  VkColorSpaceKHR colorSpace_ = VK_COLOR_SPACE_SRGB_NONLINEAR_KHR;
  VkExtent2D extent_{};
  samples::render::Owned<VkSwapchainKHR> swapchain_;
  std::vector<VkImage> images_;
  samples::render::Owned<VkSemaphore> acquired_;
  std::vector<samples::render::Owned<VkSemaphore>> drawn_;  ///< by image
  bool isStale_ = true;
};

}  // namespace dermis::viewer
