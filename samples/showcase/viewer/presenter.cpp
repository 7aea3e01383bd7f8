#include "presenter.h"

#include <limits>
#include <string>
#include <utility>

namespace dermis::viewer {
namespace {

Error failed(const char* function, VkResult result) {
  if (result == VK_ERROR_DEVICE_LOST) {
    return {ErrorCode::vulkanError, "the device was lost: it stopped or was removed",
            static_cast<std::int32_t>(result)};
  }
  return {
      ErrorCode::vulkanError,
      std::string(function) + " failed with VkResult " + std::to_string(static_cast<int>(result)),
      static_cast<std::int32_t>(result)};
}

}  // namespace

Result<std::unique_ptr<Presenter>> Presenter::create(const Options& options) {
  std::unique_ptr<Presenter> presenter(new Presenter);
  if (Result<void> opened = presenter->open(options); !opened) return opened.error();
  return presenter;
}

Presenter::~Presenter() {
  if (!device_) return;
  device_->device->functions().DeviceWaitIdle(device_->device->handle());
  if (commandBuffer_ != VK_NULL_HANDLE) device_->device->freeCommandBuffer(commandBuffer_);
}

Result<void> Presenter::open(const Options& options) {
  Result<Window> window = Window::create(options.width, options.height);
  if (!window) return window.error();
  window_ = std::move(*window);
  Result<std::vector<std::string>> extensions = window_.surfaceExtensions();
  if (!extensions) return extensions.error();
  samples::DeviceOptions deviceOptions;
  deviceOptions.device = options.device;
  deviceOptions.validation = options.validates;
  deviceOptions.graphics = true;
  deviceOptions.surfaceExtensions = *extensions;
#ifdef DERMIS_RUNTIME_COMPILER
  if (!options.shaders.empty()) {
    Result<std::unique_ptr<KernelFolder>> kernels = openKernelFolder(options);
    if (!kernels) return kernels.error();
    kernels_ = std::move(*kernels);
    deviceOptions.kernels = kernels_->source();
  }
#endif
  Result<samples::OpenDevice> device = samples::openDevice(deviceOptions);
  if (!device) return device.error();
  device_.emplace(std::move(*device));
  Result<Surface> surface = Surface::create(window_, *device_->device);
  if (!surface) return surface.error();
  surface_ = std::move(*surface);
  Result<Swapchain> swapchain = Swapchain::create(*device_->device, surface_.handle());
  if (!swapchain) return swapchain.error();
  swapchain_.emplace(std::move(*swapchain));
  Result<Canvas> canvas = Canvas::create(*device_->device, swapchain_->srgbFormat());
  if (!canvas) return canvas.error();
  canvas_.emplace(std::move(*canvas));
  Result<Gui> gui = Gui::create(window_, *device_->device, canvas_->pass());
  if (!gui) return gui.error();
  gui_ = std::move(*gui);

  VkFenceCreateInfo fence{};
  fence.sType = VK_STRUCTURE_TYPE_FENCE_CREATE_INFO;
  Result<samples::render::Owned<VkFence>> made = DERMIS_MAKE(*device_->device, Fence, fence);
  if (!made) return made.error();
  done_ = std::move(*made);
  return {};
}

Result<void> Presenter::resize() {
  // The last picture may not be on the display yet.
  device_->device->functions().DeviceWaitIdle(device_->device->handle());
  if (Result<void> done = swapchain_->resize(window_.pixels()); !done) return done;
  const VkExtent2D extent = swapchain_->extent();
  if (extent.width == 0 || extent.height == 0) return {};
  if (extent.width == canvas_->extent().width && extent.height == canvas_->extent().height)
    return {};
  return canvas_->resize(extent);
}

Result<bool> Presenter::prepare() {
  if (window_.isMinimized()) return false;
  const VkExtent2D pixels = window_.pixels(), extent = swapchain_->extent();
  if (!image_ &&
      (swapchain_->isStale() || pixels.width != extent.width || pixels.height != extent.height)) {
    if (Result<void> done = resize(); !done) return done.error();
  }
  return !swapchain_->isStale();
}

Result<bool> Presenter::show(const WindowFrame& frame) {
  if (!image_) {
    const Result<std::optional<Swapchain::Image>> image = swapchain_->acquire();
    if (!image) return image.error();
    if (!*image) return false;
    image_ = *image;
  }
  if (Result<void> done = record(frame, *image_); !done) return done.error();
  const Swapchain::Image image = *std::exchange(image_, std::nullopt);
  if (Result<void> done = submit(image); !done) return done.error();
  if (Result<void> done = swapchain_->present(image); !done) return done.error();
  return true;
}

Result<void> Presenter::record(const WindowFrame& frame, const Swapchain::Image& image) {
  samples::Device& device = *device_->device;
  if (commandBuffer_ != VK_NULL_HANDLE) device.freeCommandBuffer(commandBuffer_);
  commandBuffer_ = device.allocateCommandBuffer();
  VkCommandBufferBeginInfo begin{};
  begin.sType = VK_STRUCTURE_TYPE_COMMAND_BUFFER_BEGIN_INFO;
  begin.flags = VK_COMMAND_BUFFER_USAGE_ONE_TIME_SUBMIT_BIT;
  device.functions().BeginCommandBuffer(commandBuffer_, &begin);
  Result<void> done = frame.record(commandBuffer_);
  if (done) {
    canvas_->record(commandBuffer_, frame.picture(), frame.area,
                    [&] { gui_.record(commandBuffer_); });
    canvas_->recordCopy(commandBuffer_, image.handle);
    if (frame.isReadBack) done = canvas_->recordReadBack(commandBuffer_);
  }
  device.functions().EndCommandBuffer(commandBuffer_);
  return done;
}

Result<void> Presenter::submit(const Swapchain::Image& image) {
  const samples::VulkanFunctions& functions = device_->device->functions();
  const VkPipelineStageFlags copying = VK_PIPELINE_STAGE_TRANSFER_BIT;
  const VkFence fence = done_.get();
  VkSubmitInfo submit{};
  submit.sType = VK_STRUCTURE_TYPE_SUBMIT_INFO;
  submit.waitSemaphoreCount = 1;
  submit.pWaitSemaphores = &image.acquired;
  submit.pWaitDstStageMask = &copying;
  submit.commandBufferCount = 1;
  submit.pCommandBuffers = &commandBuffer_;
  submit.signalSemaphoreCount = 1;
  submit.pSignalSemaphores = &image.drawn;
  if (const VkResult result = functions.QueueSubmit(device_->device->queue(), 1, &submit, fence);
      result != VK_SUCCESS) {
    return failed("vkQueueSubmit", result);
  }
  if (const VkResult result = functions.WaitForFences(device_->device->handle(), 1, &fence, VK_TRUE,
                                                      std::numeric_limits<std::uint64_t>::max());
      result != VK_SUCCESS) {
    return failed("vkWaitForFences", result);
  }
  functions.ResetFences(device_->device->handle(), 1, &fence);
  return {};
}

}  // namespace dermis::viewer
