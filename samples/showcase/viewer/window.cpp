#include "window.h"

#include <algorithm>
#include <utility>

#include <SDL_vulkan.h>
// The window uses the functions of the loader that Dear ImGui is linked to.
#include <vulkan/vulkan.h>

namespace dermis::viewer {
namespace {

Error failed(const std::string& what) {
  return {ErrorCode::missingFeature, what + ": " + SDL_GetError()};
}

}  // namespace

Result<Window> Window::create(std::uint32_t width, std::uint32_t height) {
  // Ctrl+C ends the program at once, as usual.
  SDL_SetHint(SDL_HINT_NO_SIGNAL_HANDLERS, "1");
  if (SDL_Init(SDL_INIT_VIDEO) != 0) return failed("there is no display to open a window on");
  Window window;
  window.window_ =
      SDL_CreateWindow("Dermis", SDL_WINDOWPOS_CENTERED, SDL_WINDOWPOS_CENTERED,
                       static_cast<int>(width), static_cast<int>(height),
                       SDL_WINDOW_VULKAN | SDL_WINDOW_RESIZABLE | SDL_WINDOW_ALLOW_HIGHDPI);
  if (window.window_ == nullptr) {
    const Error error = failed("cannot open a window for Vulkan");
    SDL_Quit();
    return error;
  }
  SDL_SetWindowMinimumSize(window.window_, 480, 320);
  SDL_EventState(SDL_DROPFILE, SDL_ENABLE);
  return window;
}

Window::~Window() {
  if (window_ == nullptr) return;
  SDL_DestroyWindow(window_);
  SDL_Quit();
}

Window& Window::operator=(Window&& other) noexcept {
  std::swap(window_, other.window_);
  return *this;
}

Result<std::vector<std::string>> Window::surfaceExtensions() const {
  unsigned int count = 0;
  if (SDL_Vulkan_GetInstanceExtensions(window_, &count, nullptr) == SDL_FALSE)
    return failed("the window does not support Vulkan");
  std::vector<const char*> names(count);
  if (SDL_Vulkan_GetInstanceExtensions(window_, &count, names.data()) == SDL_FALSE)
    return failed("the window does not support Vulkan");
  return std::vector<std::string>(names.begin(), names.end());
}

void Window::setTitle(const std::string& title) const {
  SDL_SetWindowTitle(window_, title.c_str());
}

VkExtent2D Window::pixels() const {
  int width = 0, height = 0;
  SDL_Vulkan_GetDrawableSize(window_, &width, &height);
  return {static_cast<std::uint32_t>(std::max(width, 0)),
          static_cast<std::uint32_t>(std::max(height, 0))};
}

float Window::pixelsPerUnit() const {
  int width = 0, height = 0;
  SDL_GetWindowSize(window_, &width, &height);
  return width > 0 ? static_cast<float>(pixels().width) / static_cast<float>(width) : 1;
}

bool Window::isMinimized() const {
  return (SDL_GetWindowFlags(window_) & (SDL_WINDOW_MINIMIZED | SDL_WINDOW_HIDDEN)) != 0 ||
         pixels().width == 0 || pixels().height == 0;
}

Result<Surface> Surface::create(const Window& window, const samples::Device& device) {
  Surface surface;
  surface.instance_ = device.description().instance;
  if (SDL_Vulkan_CreateSurface(window.handle(), surface.instance_, &surface.surface_) == SDL_FALSE)
    return failed("cannot create a Vulkan surface for the window");
  VkBool32 isSupported = VK_FALSE;
  vkGetPhysicalDeviceSurfaceSupportKHR(device.physicalDevice(), device.queueFamily(),
                                       surface.surface_, &isSupported);
  if (isSupported == VK_FALSE) {
    return Error{ErrorCode::missingFeature, "device '" + device.info().name +
                                                "' cannot show pictures in this window; choose "
                                                "another one with --device"};
  }
  return surface;
}

Surface::~Surface() {
  if (surface_ != VK_NULL_HANDLE) vkDestroySurfaceKHR(instance_, surface_, nullptr);
}

Surface& Surface::operator=(Surface&& other) noexcept {
  std::swap(instance_, other.instance_);
  std::swap(surface_, other.surface_);
  return *this;
}

}  // namespace dermis::viewer
