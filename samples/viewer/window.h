// A window, its Vulkan surface, and how many pixels it has.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include <SDL.h>
#include <vulkan/vulkan_core.h>

#include "dermis/result.h"
#include "device.h"

namespace dermis::viewer {

/// SDL, and one window of it. Only one at a time.
class Window {
 public:
  /// Fails with `missingFeature`: no display, or none with Vulkan.
  static Result<Window> create(std::uint32_t width, std::uint32_t height);
  Window() = default;
  ~Window();
  Window(Window&& other) noexcept { *this = std::move(other); }
  Window& operator=(Window&& other) noexcept;

  SDL_Window* handle() const { return window_; }
  /// For `DeviceOptions`.
  Result<std::vector<std::string>> surfaceExtensions() const;
  void setTitle(const std::string& title) const;

  /// Of what can be drawn to, which may be more than the units that the mouse is told in.
  VkExtent2D pixels() const;
  /// Pixels to such a unit.
  float pixelsPerUnit() const;
  bool isMinimized() const;

 private:
  SDL_Window* window_ = nullptr;
};

/// What the device shows its pictures on. The device and the window must outlive it.
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
