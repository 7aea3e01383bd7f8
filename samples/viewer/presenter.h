// A window on a device: what it takes to show pictures in it, one after the other.
#pragma once

#include <functional>
#include <memory>
#include <optional>

#include "canvas.h"
#include "gui.h"
#include "kernel_folder.h"
#include "open_device.h"
#include "options.h"
#include "swapchain.h"
#include "window.h"

namespace dermis::viewer {

/// One picture in the window.
struct WindowFrame {
  /// Records what comes before; outside a render pass.
  std::function<Result<void>(VkCommandBuffer)> record;
  /// What was drawn of the scene, once that is recorded; null: nothing.
  std::function<const samples::render::RenderTarget*()> picture;
  VkRect2D area{};  ///< where it goes, in pixels
  bool isReadBack = false;
};

class Presenter {
 public:
  /// Fails with `missingFeature` if there is no display or no device for it.
  static Result<std::unique_ptr<Presenter>> create(const Options& options);
  ~Presenter();

  samples::OpenDevice& device() { return *device_; }
  /// Null: the kernels are the library's.
  KernelFolder* kernels() const { return kernels_.get(); }
  const Window& window() const { return window_; }
  Gui& gui() { return gui_; }

  /// Makes images that fit the window. Whether there is anything to draw on.
  Result<bool> prepare();
  /// Draws, shows and waits; the interface's frame has been ended. False: there was no image to
  /// draw on this time. Fails with `vulkanError`, or as `frame.record` does; then nothing is shown.
  Result<bool> show(const WindowFrame& frame);
  /// What the window showed, if `isReadBack`.
  samples::render::Picture picture() const { return canvas_->picture(); }

 private:
  Presenter() = default;
  Result<void> open(const Options& options);
  Result<void> resize();
  Result<void> record(const WindowFrame& frame, const Swapchain::Image& image);
  Result<void> submit(const Swapchain::Image& image);

  // What is declared later goes first.
  Window window_;
  std::unique_ptr<KernelFolder> kernels_;
  std::optional<samples::OpenDevice> device_;
  Surface surface_;
  std::optional<Swapchain> swapchain_;
  std::optional<Canvas> canvas_;
  Gui gui_;
  samples::render::Owned<VkFence> done_;
  VkCommandBuffer commandBuffer_ = VK_NULL_HANDLE;
  std::optional<Swapchain::Image> image_;  ///< acquired and not yet shown
};

}  // namespace dermis::viewer
