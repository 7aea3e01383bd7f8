// The images of a window.
#pragma once

#include <cstdint>
#include <optional>
#include <vector>

#include "kit/render/owned.h"

namespace dermis::viewer {

class Swapchain {
 public:
  struct Image {
    std::uint32_t index = 0;
    VkImage handle = VK_NULL_HANDLE;
    VkSemaphore acquired = VK_NULL_HANDLE;  ///< for the submission to wait for
    VkSemaphore drawn = VK_NULL_HANDLE;     ///< for the submission to signal
  };

  /// `device` and `surface` must outlive it. Fails with `missingFeature` if the surface has no
  /// format with bytes of red, green and blue, or its images cannot be copied to. Initially has no
  /// images.
  static Result<Swapchain> create(samples::Device& device, VkSurfaceKHR surface);

  /// The format of the images, four bytes per pixel.
  VkFormat format() const { return format_; }
  /// The same format, as sRGB.
  VkFormat srgbFormat() const;
  VkExtent2D extent() const { return extent_; }

  /// Makes new images of the given size, unless the surface specifies its size. The device must be
  /// idle. Makes none if the surface currently has no size.
  Result<void> resize(VkExtent2D pixels);
  /// The next image. Nothing if there is none now, or if new ones must be made first (`isStale`).
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
