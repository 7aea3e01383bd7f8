#include "window.h"

#include <algorithm>
#include <array>
#include <limits>
#include <utility>
#include <vector>

#include <SDL_vulkan.h>
#include <imgui.h>
#if __has_include(<backends/imgui_impl_sdl2.h>)
#include <backends/imgui_impl_sdl2.h>
#else
#include <backends/imgui_impl_sdl.h>
#endif
#include <backends/imgui_impl_vulkan.h>
#include <vulkan/vulkan.h>  // the functions of the loader that Dear ImGui is linked to

#include "vulkan_helpers.h"

namespace dermis::viewer {
namespace {

namespace render = samples::render;

constexpr VkImageSubresourceLayers allLayers{VK_IMAGE_ASPECT_COLOR_BIT, 0, 0, 1};
constexpr VkImageSubresourceRange allOfIt{VK_IMAGE_ASPECT_COLOR_BIT, 0, 1, 0, 1};
constexpr VkClearColorValue background{{0.03f, 0.035f, 0.04f, 1}};  // linear

// Long enough for any picture, but short enough that the window closes if the display is gone.
constexpr std::uint64_t patience = 2'000'000'000;  // nanoseconds

// Every desktop has this format. The colors of the interface are sRGB bytes, those of the picture
// are linear light.
constexpr VkFormat imageFormat = VK_FORMAT_B8G8R8A8_UNORM, srgbFormat = VK_FORMAT_B8G8R8A8_SRGB;
constexpr VkColorSpaceKHR colorSpace = VK_COLOR_SPACE_SRGB_NONLINEAR_KHR;

Error missing(const std::string& what) {
  return {ErrorCode::missingFeature, what + ": " + SDL_GetError()};
}

Error failed(const char* function, VkResult result) {
  return {
      ErrorCode::vulkanError,
      std::string(function) + " failed with VkResult " + std::to_string(static_cast<int>(result)),
      static_cast<std::int32_t>(result)};
}

VkExtent2D extentOf(const VkSurfaceCapabilitiesKHR& capabilities, VkExtent2D wanted) {
  if (capabilities.currentExtent.width != std::numeric_limits<std::uint32_t>::max())
    return capabilities.currentExtent;
  return {std::clamp(wanted.width, capabilities.minImageExtent.width,
                     capabilities.maxImageExtent.width),
          std::clamp(wanted.height, capabilities.minImageExtent.height,
                     capabilities.maxImageExtent.height)};
}

/// The first that is supported, which is opaque if possible.
VkCompositeAlphaFlagBitsKHR alphaOf(const VkSurfaceCapabilitiesKHR& capabilities) {
  const VkCompositeAlphaFlagsKHR flags = capabilities.supportedCompositeAlpha;
  return static_cast<VkCompositeAlphaFlagBitsKHR>(flags & (~flags + 1));
}

/// Prepares an image to be written by copies and blits, after others if `isAgain`. Otherwise its
/// contents are lost.
void recordWritable(const samples::Device& device, VkCommandBuffer commandBuffer, VkImage image,
                    bool isAgain) {
  render::recordTransition(
      device, commandBuffer, image, allOfIt,
      isAgain ? VK_IMAGE_LAYOUT_TRANSFER_DST_OPTIMAL : VK_IMAGE_LAYOUT_UNDEFINED,
      VK_IMAGE_LAYOUT_TRANSFER_DST_OPTIMAL, VK_PIPELINE_STAGE_TRANSFER_BIT,
      isAgain ? VK_ACCESS_TRANSFER_WRITE_BIT : 0, VK_PIPELINE_STAGE_TRANSFER_BIT,
      VK_ACCESS_TRANSFER_WRITE_BIT);
}

#if IMGUI_VERSION_NUM >= 19000  // Debian 13; Debian 12 has 1.86
Result<void> uploadFonts(samples::Device&) {
  if (ImGui_ImplVulkan_CreateFontsTexture()) return {};
  return Error{ErrorCode::vulkanError, "the font texture could not be created"};
}
#else
Result<void> uploadFonts(samples::Device& device) {
  const VkCommandBuffer commandBuffer = beginCommands(device);
  ImGui_ImplVulkan_CreateFontsTexture(commandBuffer);
  const Result<void> done = endCommands(device, commandBuffer, {});
  ImGui_ImplVulkan_DestroyFontUploadObjects();
  return done;
}
#endif

}  // namespace

Result<std::unique_ptr<Window>> Window::open(std::uint32_t width, std::uint32_t height,
                                             samples::DeviceOptions options) {
  std::unique_ptr<Window> window(new Window);
  if (Result<void> done = window->openWindow(width, height); !done) return done.error();
  if (Result<void> done = window->openDevice(std::move(options)); !done) return done.error();
  if (Result<void> done = window->makePass(); !done) return done.error();
  if (Result<void> done = window->startInterface(); !done) return done.error();
  return window;
}

Window::~Window() {
  if (device_) vkDeviceWaitIdle(device_->device->handle());
  if (ImGui::GetCurrentContext() != nullptr) {
    if (ImGui::GetIO().BackendRendererUserData != nullptr) ImGui_ImplVulkan_Shutdown();
    if (ImGui::GetIO().BackendPlatformUserData != nullptr) ImGui_ImplSDL2_Shutdown();
    ImGui::DestroyContext();
  }
  swapchain_ = {};
  if (surface_ != VK_NULL_HANDLE)
    vkDestroySurfaceKHR(device_->device->description().instance, surface_, nullptr);
  if (window_ != nullptr) SDL_DestroyWindow(window_);
  SDL_Quit();
}

Result<void> Window::openWindow(std::uint32_t width, std::uint32_t height) {
  // Ctrl+C ends the program at once, as usual.
  SDL_SetHint(SDL_HINT_NO_SIGNAL_HANDLERS, "1");
  if (SDL_Init(SDL_INIT_VIDEO) != 0) return missing("there is no display to open a window on");
  window_ = SDL_CreateWindow("Dermis", SDL_WINDOWPOS_CENTERED, SDL_WINDOWPOS_CENTERED,
                             static_cast<int>(width), static_cast<int>(height),
                             SDL_WINDOW_VULKAN | SDL_WINDOW_RESIZABLE);
  if (window_ == nullptr) return missing("cannot open a window for Vulkan");
  SDL_SetWindowMinimumSize(window_, 480, 320);
  SDL_EventState(SDL_DROPFILE, SDL_ENABLE);
  return {};
}

Result<void> Window::openDevice(samples::DeviceOptions options) {
  unsigned int count = 0;
  std::vector<const char*> names;
  for (int pass = 0; pass < 2; ++pass) {  // first only the number
    names.resize(count);
    if (SDL_Vulkan_GetInstanceExtensions(window_, &count, pass == 0 ? nullptr : names.data()) ==
        SDL_FALSE)
      return missing("the window does not support Vulkan");
  }
  options.graphics = true;
  options.surfaceExtensions.assign(names.begin(), names.end());
  Result<samples::OpenDevice> opened = samples::openDevice(options);
  if (!opened) return opened.error();
  device_.emplace(std::move(*opened));
  samples::Device& device = *device_->device;
  if (SDL_Vulkan_CreateSurface(window_, device.description().instance, &surface_) == SDL_FALSE)
    return missing("cannot create a Vulkan surface for the window");
  VkBool32 isSupported = VK_FALSE;
  vkGetPhysicalDeviceSurfaceSupportKHR(device.physicalDevice(), device.queueFamily(), surface_,
                                       &isSupported);
  if (isSupported == VK_FALSE) {
    return Error{ErrorCode::missingFeature, "device '" + device.info().name +
                                                "' cannot show pictures in this window; choose "
                                                "another one with --device"};
  }
  VkFenceCreateInfo fence{};
  fence.sType = VK_STRUCTURE_TYPE_FENCE_CREATE_INFO;
  if (Result<void> done = keep(DERMIS_MAKE(device, Fence, fence), acquired_); !done) return done;
  return checkFormat();
}

Result<void> Window::checkFormat() const {
  const VkPhysicalDevice device = device_->device->physicalDevice();
  std::uint32_t count = 0;
  vkGetPhysicalDeviceSurfaceFormatsKHR(device, surface_, &count, nullptr);
  std::vector<VkSurfaceFormatKHR> formats(count);
  vkGetPhysicalDeviceSurfaceFormatsKHR(device, surface_, &count, formats.data());
  for (const VkSurfaceFormatKHR& format : formats) {
    if (format.format == imageFormat && format.colorSpace == colorSpace) return {};
  }
  return Error{ErrorCode::missingFeature, "the window has no images of format B8G8R8A8_UNORM"};
}

Result<void> Window::makePass() {
  VkAttachmentDescription attachment{};
  attachment.format = imageFormat;
  attachment.samples = VK_SAMPLE_COUNT_1_BIT;
  attachment.loadOp = VK_ATTACHMENT_LOAD_OP_LOAD;
  attachment.storeOp = VK_ATTACHMENT_STORE_OP_STORE;
  attachment.initialLayout = VK_IMAGE_LAYOUT_TRANSFER_DST_OPTIMAL;
  attachment.finalLayout = VK_IMAGE_LAYOUT_TRANSFER_SRC_OPTIMAL;
  const VkAttachmentReference color{0, VK_IMAGE_LAYOUT_COLOR_ATTACHMENT_OPTIMAL};
  VkSubpassDescription subpass{};
  subpass.pipelineBindPoint = VK_PIPELINE_BIND_POINT_GRAPHICS;
  subpass.colorAttachmentCount = 1;
  subpass.pColorAttachments = &color;
  const std::array<VkSubpassDependency, 2> dependencies{{
      {VK_SUBPASS_EXTERNAL, 0, VK_PIPELINE_STAGE_TRANSFER_BIT,
       VK_PIPELINE_STAGE_COLOR_ATTACHMENT_OUTPUT_BIT, VK_ACCESS_TRANSFER_WRITE_BIT,
       VK_ACCESS_COLOR_ATTACHMENT_READ_BIT | VK_ACCESS_COLOR_ATTACHMENT_WRITE_BIT, 0},
      {0, VK_SUBPASS_EXTERNAL, VK_PIPELINE_STAGE_COLOR_ATTACHMENT_OUTPUT_BIT,
       VK_PIPELINE_STAGE_TRANSFER_BIT, VK_ACCESS_COLOR_ATTACHMENT_WRITE_BIT,
       VK_ACCESS_TRANSFER_READ_BIT, 0},
  }};
  VkRenderPassCreateInfo info{};
  info.sType = VK_STRUCTURE_TYPE_RENDER_PASS_CREATE_INFO;
  info.attachmentCount = 1;
  info.pAttachments = &attachment;
  info.subpassCount = 1;
  info.pSubpasses = &subpass;
  info.dependencyCount = static_cast<std::uint32_t>(dependencies.size());
  info.pDependencies = dependencies.data();
  return keep(DERMIS_MAKE(*device_->device, RenderPass, info), pass_);
}

Result<void> Window::startInterface() {
  samples::Device& device = *device_->device;
  const VkDescriptorPoolSize size{VK_DESCRIPTOR_TYPE_COMBINED_IMAGE_SAMPLER, 4};  // for the font
  VkDescriptorPoolCreateInfo pool{};
  pool.sType = VK_STRUCTURE_TYPE_DESCRIPTOR_POOL_CREATE_INFO;
  pool.flags = VK_DESCRIPTOR_POOL_CREATE_FREE_DESCRIPTOR_SET_BIT;
  pool.maxSets = size.descriptorCount;
  pool.poolSizeCount = 1;
  pool.pPoolSizes = &size;
  if (Result<void> done = keep(DERMIS_MAKE(device, DescriptorPool, pool), pool_); !done)
    return done;
  IMGUI_CHECKVERSION();
  ImGui::CreateContext();
  ImGuiIO& io = ImGui::GetIO();
  io.IniFilename = nullptr;  // Do not leave a file in the folder.
  // Without the file, Dear ImGui's own font is used.
  static const std::array<ImWchar, 7> glyphs{0x20, 0xff, 0x2010, 0x2030, 0x2190, 0x2193, 0};
  if (const Result<std::string> file = render::findFontFile(); file)
    io.Fonts->AddFontFromFileTTF(file->c_str(), 15, nullptr, glyphs.data());
  const bool hasInput = ImGui_ImplSDL2_InitForVulkan(window_);
  ImGui_ImplVulkan_InitInfo info{};
  info.Instance = device.description().instance;
  info.PhysicalDevice = device.physicalDevice();
  info.Device = device.handle();
  info.QueueFamily = device.queueFamily();
  info.Queue = device.queue();
  info.DescriptorPool = pool_.get();
  info.MinImageCount = info.ImageCount = 2;
  info.MSAASamples = VK_SAMPLE_COUNT_1_BIT;
  if (!hasInput || !ImGui_ImplVulkan_Init(&info, pass_.get()))
    return Error{ErrorCode::vulkanError, "Dear ImGui could not be started"};
  return uploadFonts(device);
}

VkExtent2D Window::size() const {
  int width = 0, height = 0;
  SDL_GetWindowSize(window_, &width, &height);
  return {static_cast<std::uint32_t>(std::max(width, 0)),
          static_cast<std::uint32_t>(std::max(height, 0))};
}

Result<void> Window::makeSwapchain() {
  samples::Device& device = *device_->device;
  VkSurfaceCapabilitiesKHR capabilities{};
  if (const VkResult result = vkGetPhysicalDeviceSurfaceCapabilitiesKHR(device.physicalDevice(),
                                                                        surface_, &capabilities);
      result != VK_SUCCESS) {
    return failed("vkGetPhysicalDeviceSurfaceCapabilitiesKHR", result);
  }
  if ((capabilities.supportedUsageFlags & VK_IMAGE_USAGE_TRANSFER_DST_BIT) == 0)
    return Error{ErrorCode::missingFeature, "the window's images cannot be copied to"};
  const VkExtent2D extent = extentOf(capabilities, size());
  if (extent.width == 0 || extent.height == 0) return {};  // It stays stale.
  VkSwapchainCreateInfoKHR info{};
  info.sType = VK_STRUCTURE_TYPE_SWAPCHAIN_CREATE_INFO_KHR;
  info.surface = surface_;
  info.minImageCount = capabilities.minImageCount + 1;
  if (capabilities.maxImageCount != 0)
    info.minImageCount = std::min(info.minImageCount, capabilities.maxImageCount);
  info.imageFormat = imageFormat;
  info.imageColorSpace = colorSpace;
  info.imageExtent = extent;
  info.imageArrayLayers = 1;
  info.imageUsage = VK_IMAGE_USAGE_TRANSFER_DST_BIT;
  info.imageSharingMode = VK_SHARING_MODE_EXCLUSIVE;
  info.preTransform = capabilities.currentTransform;
  info.compositeAlpha = alphaOf(capabilities);
  info.presentMode = VK_PRESENT_MODE_FIFO_KHR;  // every device supports it
  info.clipped = VK_TRUE;
  info.oldSwapchain = swapchain_.get();
  Result<void> made = keep(render::make(device, "vkCreateSwapchainKHR", vkCreateSwapchainKHR,
                                        vkDestroySwapchainKHR, info),
                           swapchain_);
  if (!made) return made;
  std::uint32_t count = 0;
  vkGetSwapchainImagesKHR(device.handle(), swapchain_.get(), &count, nullptr);
  images_.resize(count);
  vkGetSwapchainImagesKHR(device.handle(), swapchain_.get(), &count, images_.data());
  isStale_ = false;
  return makeCanvas(extent);
}

Result<void> Window::makeCanvas(VkExtent2D extent) {
  render::ImageDescription description;
  description.format = srgbFormat;
  description.viewFormat = imageFormat;
  description.width = extent.width;
  description.height = extent.height;
  description.usage = VK_IMAGE_USAGE_COLOR_ATTACHMENT_BIT | VK_IMAGE_USAGE_TRANSFER_SRC_BIT |
                      VK_IMAGE_USAGE_TRANSFER_DST_BIT;
  Result<void> made = keep(render::Image::create(*device_->device, description), canvas_);
  if (!made) return made;
  const VkImageView view = canvas_.view();
  VkFramebufferCreateInfo info{};
  info.sType = VK_STRUCTURE_TYPE_FRAMEBUFFER_CREATE_INFO;
  info.renderPass = pass_.get();
  info.attachmentCount = 1;
  info.pAttachments = &view;
  info.width = extent.width;
  info.height = extent.height;
  info.layers = 1;
  readBack_ = {};
  return keep(DERMIS_MAKE(*device_->device, Framebuffer, info), framebuffer_);
}

void Window::handle(const SDL_Event& event) {
  ImGui_ImplSDL2_ProcessEvent(&event);
}

Result<bool> Window::begin() {
  const VkExtent2D size = this->size();
  const render::ImageDescription& now = canvas_.description();
  if ((SDL_GetWindowFlags(window_) & (SDL_WINDOW_MINIMIZED | SDL_WINDOW_HIDDEN)) != 0 ||
      size.width == 0 || size.height == 0)
    return false;
  if (isStale_ || size.width != now.width || size.height != now.height) {
    isStale_ = true;
    // The last picture may not be on the display yet.
    vkDeviceWaitIdle(device_->device->handle());
    if (Result<void> done = makeSwapchain(); !done) return done.error();
  }
  if (isStale_) return false;
  ImGui_ImplVulkan_NewFrame();
  ImGui_ImplSDL2_NewFrame();
  ImGui::NewFrame();
  return true;
}

Result<bool> Window::show(const RecordScene& recordScene, std::uint32_t left, bool isReadBack) {
  ImGui::Render();
  const Result<std::optional<std::uint32_t>> image = acquire();
  if (!image) return image.error();
  if (!*image) return false;
  samples::Device& device = *device_->device;
  const VkCommandBuffer commandBuffer = beginCommands(device);
  const auto picture = recordScene(commandBuffer);
  Result<void> done = picture ? Result<void>() : Result<void>(picture.error());
  if (done) {
    recordPicture(commandBuffer, *picture, left);
    recordInterface(commandBuffer);
    recordCopy(commandBuffer, images_[**image]);
    if (isReadBack) done = recordReadBack(commandBuffer);
  }
  done = endCommands(device, commandBuffer, std::move(done));
  if (done) done = present(**image);
  if (!done) return done.error();
  return true;
}

Result<std::optional<std::uint32_t>> Window::acquire() {
  const VkDevice device = device_->device->handle();
  std::uint32_t index = 0;
  const VkFence fence = acquired_.get();
  VkResult result =
      vkAcquireNextImageKHR(device, swapchain_.get(), patience, VK_NULL_HANDLE, fence, &index);
  if (result == VK_SUBOPTIMAL_KHR || result == VK_ERROR_OUT_OF_DATE_KHR) isStale_ = true;
  if (result == VK_TIMEOUT || result == VK_NOT_READY || result == VK_ERROR_OUT_OF_DATE_KHR)
    return std::optional<std::uint32_t>();
  if (result != VK_SUCCESS && result != VK_SUBOPTIMAL_KHR)
    return failed("vkAcquireNextImageKHR", result);
  result = vkWaitForFences(device, 1, &fence, VK_TRUE, UINT64_MAX);
  if (result != VK_SUCCESS) return failed("vkWaitForFences", result);
  vkResetFences(device, 1, &fence);
  return std::optional(index);
}

Result<void> Window::present(std::uint32_t image) {
  const VkSwapchainKHR swapchain = swapchain_.get();
  VkPresentInfoKHR info{};
  info.sType = VK_STRUCTURE_TYPE_PRESENT_INFO_KHR;
  info.swapchainCount = 1;
  info.pSwapchains = &swapchain;
  info.pImageIndices = &image;
  const VkResult result = vkQueuePresentKHR(device_->device->queue(), &info);
  if (result == VK_SUBOPTIMAL_KHR || result == VK_ERROR_OUT_OF_DATE_KHR) isStale_ = true;
  if (result != VK_SUCCESS && !isStale_) return failed("vkQueuePresentKHR", result);
  return {};
}

void Window::recordPicture(VkCommandBuffer commandBuffer, const render::RenderTarget* picture,
                           std::uint32_t left) const {
  samples::Device& device = *device_->device;
  recordWritable(device, commandBuffer, canvas_.handle(), false);
  vkCmdClearColorImage(commandBuffer, canvas_.handle(), VK_IMAGE_LAYOUT_TRANSFER_DST_OPTIMAL,
                       &background, 1, &allOfIt);
  const render::ImageDescription& size = canvas_.description();
  if (picture == nullptr || left >= size.width) return;
  recordWritable(device, commandBuffer, canvas_.handle(), true);
  // While the window changes its size, the picture may be too large.
  const auto begin = static_cast<std::int32_t>(left);
  const auto width = static_cast<std::int32_t>(std::min(picture->width(), size.width - left));
  const auto height = static_cast<std::int32_t>(std::min(picture->height(), size.height));
  VkImageBlit blit{};  // not a copy, because the order of red and blue differs
  blit.srcSubresource = blit.dstSubresource = allLayers;
  blit.srcOffsets[1] = {width, height, 1};
  blit.dstOffsets[0] = {begin, 0, 0};
  blit.dstOffsets[1] = {begin + width, height, 1};
  vkCmdBlitImage(commandBuffer, picture->resolved().handle(), VK_IMAGE_LAYOUT_TRANSFER_SRC_OPTIMAL,
                 canvas_.handle(), VK_IMAGE_LAYOUT_TRANSFER_DST_OPTIMAL, 1, &blit,
                 VK_FILTER_NEAREST);
}

void Window::recordInterface(VkCommandBuffer commandBuffer) const {
  VkRenderPassBeginInfo begin{};
  begin.sType = VK_STRUCTURE_TYPE_RENDER_PASS_BEGIN_INFO;
  begin.renderPass = pass_.get();
  begin.framebuffer = framebuffer_.get();
  begin.renderArea.extent = {canvas_.description().width, canvas_.description().height};
  vkCmdBeginRenderPass(commandBuffer, &begin, VK_SUBPASS_CONTENTS_INLINE);
  ImGui_ImplVulkan_RenderDrawData(ImGui::GetDrawData(), commandBuffer);
  vkCmdEndRenderPass(commandBuffer);
}

void Window::recordCopy(VkCommandBuffer commandBuffer, VkImage image) const {
  const samples::Device& device = *device_->device;
  recordWritable(device, commandBuffer, image, false);
  VkImageCopy copy{};
  copy.srcSubresource = copy.dstSubresource = allLayers;
  copy.extent = {canvas_.description().width, canvas_.description().height, 1};
  vkCmdCopyImage(commandBuffer, canvas_.handle(), VK_IMAGE_LAYOUT_TRANSFER_SRC_OPTIMAL, image,
                 VK_IMAGE_LAYOUT_TRANSFER_DST_OPTIMAL, 1, &copy);
  render::recordTransition(device, commandBuffer, image, allOfIt,
                           VK_IMAGE_LAYOUT_TRANSFER_DST_OPTIMAL, VK_IMAGE_LAYOUT_PRESENT_SRC_KHR,
                           VK_PIPELINE_STAGE_TRANSFER_BIT, VK_ACCESS_TRANSFER_WRITE_BIT,
                           VK_PIPELINE_STAGE_BOTTOM_OF_PIPE_BIT, 0);
}

Result<void> Window::recordReadBack(VkCommandBuffer commandBuffer) {
  const VkExtent2D extent{canvas_.description().width, canvas_.description().height};
  if (readBack_.handle() == VK_NULL_HANDLE) {
    Result<void> made = keep(samples::MappedBuffer::create(
                                 *device_->device, std::uint64_t{4} * extent.width * extent.height,
                                 VK_BUFFER_USAGE_TRANSFER_DST_BIT, true),
                             readBack_);
    if (!made) return made;
  }
  VkBufferImageCopy copy{};
  copy.imageSubresource = allLayers;
  copy.imageExtent = {extent.width, extent.height, 1};
  vkCmdCopyImageToBuffer(commandBuffer, canvas_.handle(), VK_IMAGE_LAYOUT_TRANSFER_SRC_OPTIMAL,
                         readBack_.handle(), 1, &copy);
  recordHostBarrier(*device_->device, commandBuffer);
  return {};
}

render::Picture Window::picture() const {
  render::Picture picture;
  picture.width = canvas_.description().width;
  picture.height = canvas_.description().height;
  picture.pixels.resize(readBack_.bytes().size());
  std::ranges::transform(readBack_.bytes(), picture.pixels.begin(),
                         [](std::byte byte) { return std::to_integer<std::uint8_t>(byte); });
  for (std::size_t pixel = 0; pixel < picture.pixels.size(); pixel += 4)
    std::swap(picture.pixels[pixel], picture.pixels[pixel + 2]);
  return picture;
}

}  // namespace dermis::viewer
