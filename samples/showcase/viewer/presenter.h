// A window on a device, and everything needed to show pictures in it.
#pragma once

#include <functional>
#include <memory>
#include <optional>

#include "canvas.h"
#include "gui.h"
#include "kernel_folder.h"
#include "kit/open_device.h"
#include "options.h"
#include "swapchain.h"
#include "window.h"

namespace dermis::viewer {

/// One picture in the window.
struct WindowFrame {
  /// Records the commands that precede the picture, outside a render pass.
  std::function<Result<void>(VkCommandBuffer)> record;
  /// The picture of the scene after `record`; null: none.
  std::function<const samples::render::RenderTarget*()> picture;
  VkRect2D area{};  ///< area of the picture, in pixels
  bool isReadBack = false;
};

class Presenter {
 public:
  /// Fails with `missingFeature` if there is no display or no device for it.
  static Result<std::unique_ptr<Presenter>> create(const Options& options);
  ~Presenter();

  samples::OpenDevice& device() { return *device_; }
  /// Null if the kernels are those of the library.
  KernelFolder* kernels() const { return kernels_.get(); }
  const Window& window() const { return window_; }
  Gui& gui() { return gui_; }

  /// Makes images that fit the window. Returns whether there is something to draw on.
  Result<bool> prepare();
  /// Draws, shows and waits. The interface's frame must have ended. Returns false if there was no
  /// image to draw on this time. Fails with `vulkanError`, or like `frame.record`; then nothing is
  /// shown.
  Result<bool> show(const WindowFrame& frame);
  /// The contents of the window, if `isReadBack`.
  samples::render::Picture picture() const { return canvas_->picture(); }

 private:
  Presenter() = default;
  Result<void> open(const Options& options);
  Result<void> resize();
  Result<void> record(const WindowFrame& frame, const Swapchain::Image& image);
  Result<void> submit(const Swapchain::Image& image);

  // Members are destroyed in reverse order of declaration.
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
