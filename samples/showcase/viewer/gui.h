// Dear ImGui on SDL and Vulkan. All differences between the versions of Debian 12 (1.86) and 13
// (1.90) are handled in gui.cpp.
#pragma once

#include <SDL.h>
#include <vulkan/vulkan_core.h>

#include "kit/render/owned.h"
#include "window.h"

namespace dermis::viewer {

/// There can only be one at a time. Window and device must outlive it.
class Gui {
 public:
  /// The interface is drawn in `pass`. Fails with `vulkanError`.
  static Result<Gui> create(const Window& window, samples::Device& device, VkRenderPass pass);
  Gui() = default;
  ~Gui();
  Gui(Gui&& other) noexcept { *this = std::move(other); }
  Gui& operator=(Gui&& other) noexcept;

  void handle(const SDL_Event& event);
  /// Whether the interface uses mouse input, or typed text, itself.
  bool wantsMouse() const;
  bool wantsText() const;
  /// Whether there is input for more frames. Since 1.87, events that arrive together are spread
  /// over several frames, so that a key that was pressed and released is seen.
  bool hasQueuedInput() const;
  /// Whether a key that may end text input has not been processed yet. Later keys must wait for a
  /// frame, because it is not known who receives them. Before 1.87, a key that is released before a
  /// frame is lost.
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
