// Dear ImGui on SDL and Vulkan: what differs between the versions of Debian 12 (1.86) and 13 (1.90)
// is in gui.cpp alone.
#pragma once

#include <SDL.h>
#include <vulkan/vulkan_core.h>

#include "render/owned.h"
#include "window.h"

namespace dermis::viewer {

/// Only one at a time. Window and device must outlive it.
class Gui {
 public:
  /// `pass` is what it is drawn in. Fails with `vulkanError`.
  static Result<Gui> create(const Window& window, samples::Device& device, VkRenderPass pass);
  Gui() = default;
  ~Gui();
  Gui(Gui&& other) noexcept { *this = std::move(other); }
  Gui& operator=(Gui&& other) noexcept;

  void handle(const SDL_Event& event);
  /// Whether it wants what the mouse does, and what is typed, for itself.
  bool wantsMouse() const;
  bool wantsText() const;
  /// Whether there is input for more frames: since 1.87 what came at once is spread over several,
  /// so that a key that was pressed and let go is seen.
  bool hasQueuedInput() const;
  /// Whether a key that may end its typing is still to be seen: what is pressed after that key has
  /// to wait for a frame, for it is not known whose it is. Before 1.87 a key that is let go before
  /// there was a frame was never pressed.
  bool hasUnseenKey() const { return framesToSeeKey_ > 0; }

  void beginFrame();
  /// Ends the frame; then `record` draws it.
  void endFrame() const;
  void record(VkCommandBuffer commandBuffer) const;

 private:
  samples::Device* device_ = nullptr;
  samples::render::Owned<VkDescriptorPool> pool_;
  bool hasContext_ = false, hasWindow_ = false, hasRenderer_ = false;
  int framesToSeeKey_ = 0;
};

}  // namespace dermis::viewer
