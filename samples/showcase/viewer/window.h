// A window on a Vulkan device: what is drawn in it, and the interface on top, by Dear ImGui.
//
// Picture and interface are drawn on a canvas, an image of the window's size, which is copied to
// the window. Screenshots read the canvas, because images of a swapchain need not be readable. The
// CPU waits for each picture, so that no semaphores are needed.
#pragma once

#include <cstdint>
#include <functional>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include <SDL.h>

#include "kit/buffer.h"
#include "kit/device.h"
#include "kit/render/image.h"
#include "kit/render/owned.h"
#include "kit/render/picture.h"
#include "kit/render/target.h"

namespace dermis::viewer {

/// There can only be one at a time. One picture is drawn at a time.
class Window {
 public:
  /// Records the picture of the scene, outside a render pass. Returns null if there is none.
  using RecordScene = std::function<Result<const samples::render::RenderTarget*>(VkCommandBuffer)>;

  /// Opens a window, and a device for it: the options need not say what a window requires. Fails
  /// with `missingFeature` if there is no display or no device.
  static Result<std::unique_ptr<Window>> open(std::uint32_t width, std::uint32_t height,
                                              samples::DeviceOptions options);
  ~Window();
  Window(const Window&) = delete;
  Window& operator=(const Window&) = delete;

  samples::OpenDevice& device() { return *device_; }
  void setTitle(const std::string& title) { SDL_SetWindowTitle(window_, title.c_str()); }
  VkExtent2D size() const;

  /// Gives an event to the interface.
  static void handle(const SDL_Event& event);
  /// Begins a frame of the interface. Returns false if there is nothing to draw on, as in a
  /// minimized window.
  Result<bool> begin();
  /// Ends the frame of the interface, draws, shows and waits. The picture begins at the column
  /// `left`. Returns false if there was no image to draw on this time. Fails with `vulkanError`, or
  /// like `recordScene`.
  Result<bool> show(const RecordScene& recordScene, std::uint32_t left, bool isReadBack);
  /// The contents of the window in the last frame, which must have been read back.
  samples::render::Picture picture() const;

 private:
  Window() = default;
  Result<void> openWindow(std::uint32_t width, std::uint32_t height);
  Result<void> openDevice(samples::DeviceOptions options);
  Result<void> checkFormat() const;
  Result<void> makePass();
  Result<void> startInterface();
  Result<void> makeSwapchain();
  Result<void> makeCanvas(VkExtent2D extent);
  Result<std::optional<std::uint32_t>> acquire();
  Result<void> present(std::uint32_t image);
  void recordPicture(VkCommandBuffer commandBuffer, const samples::render::RenderTarget* picture,
                     std::uint32_t left) const;
  void recordInterface(VkCommandBuffer commandBuffer) const;
  void recordCopy(VkCommandBuffer commandBuffer, VkImage image) const;
  Result<void> recordReadBack(VkCommandBuffer commandBuffer);

  SDL_Window* window_ = nullptr;
  VkSurfaceKHR surface_ = VK_NULL_HANDLE;
  // Members are destroyed in reverse order of declaration: all others before the device.
  std::optional<samples::OpenDevice> device_;
  samples::render::Owned<VkSwapchainKHR> swapchain_;
  std::vector<VkImage> images_;
  bool isStale_ = true;  ///< the swapchain does not fit the window
  samples::render::Owned<VkFence> acquired_;
  samples::render::Owned<VkRenderPass> pass_;  ///< of the interface
  samples::render::Owned<VkDescriptorPool> pool_;
  samples::render::Image canvas_;
  samples::render::Owned<VkFramebuffer> framebuffer_;
  samples::MappedBuffer readBack_;
};

}  // namespace dermis::viewer
