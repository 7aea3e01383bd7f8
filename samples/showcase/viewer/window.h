// A window, its Vulkan surface, and its size in pixels.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include <SDL.h>
#include <vulkan/vulkan_core.h>

#include "dermis/result.h"
#include "kit/device.h"

namespace dermis::viewer {

/// SDL and its only window. There can only be one at a time.
class Window {
 public:
  /// Fails with `missingFeature` if there is no display, or none with Vulkan.
  static Result<Window> create(std::uint32_t width, std::uint32_t height);
  Window() = default;
  ~Window();
  Window(Window&& other) noexcept { *this = std::move(other); }
  Window& operator=(Window&& other) noexcept;

  SDL_Window* handle() const { return window_; }
  /// For `DeviceOptions`.
  Result<std::vector<std::string>> surfaceExtensions() const;
  void setTitle(const std::string& title) const;

  /// The size of the drawable area. It may have more pixels than mouse units.
  VkExtent2D pixels() const;
  /// Pixels per mouse unit.
  float pixelsPerUnit() const;
  bool isMinimized() const;

 private:
  SDL_Window* window_ = nullptr;
};

/// The Vulkan surface of the window. The device and the window must outlive it.
class Surface {
 public:
  /// Fails with `missingFeature` if the device cannot show anything in the window.
  static Result<Surface> create(const Window& window, const samples::Device& device);
  Surface() = default;
  ~Surface();
  Surface(Surface&& other) noexcept { *this = std::move(other); }
  Surface& operator=(Surface&& other) noexcept;

  VkSurfaceKHR handle() const { return surface_; }

 private:
  VkInstance instance_ = VK_NULL_HANDLE;
  VkSurfaceKHR surface_ = VK_NULL_HANDLE;
};

}  // namespace dermis::viewer
