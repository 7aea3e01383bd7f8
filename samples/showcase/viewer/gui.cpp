#include "gui.h"

#include <utility>

#include <imgui.h>
#include <imgui_internal.h>
#if __has_include(<backends/imgui_impl_sdl2.h>)
#include <backends/imgui_impl_sdl2.h>
#else
#include <backends/imgui_impl_sdl.h>
#endif
#include <backends/imgui_impl_vulkan.h>

#include "gui_style.h"

namespace dermis::viewer {
namespace {

/// Number of frames after a key: one that acts on it, one in which text is no longer wanted, and
/// one that starts with this known.
constexpr int framesPerKey = 3;

/// A pool for the font texture only.
Result<samples::render::Owned<VkDescriptorPool>> makePool(const samples::Device& device) {
  const VkDescriptorPoolSize size{VK_DESCRIPTOR_TYPE_COMBINED_IMAGE_SAMPLER, 4};
  VkDescriptorPoolCreateInfo info{};
  info.sType = VK_STRUCTURE_TYPE_DESCRIPTOR_POOL_CREATE_INFO;
  info.flags = VK_DESCRIPTOR_POOL_CREATE_FREE_DESCRIPTOR_SET_BIT;
  info.maxSets = 4;
  info.poolSizeCount = 1;
  info.pPoolSizes = &size;
  return DERMIS_MAKE(device, DescriptorPool, info);
}

#if IMGUI_VERSION_NUM >= 19000
Result<void> uploadFonts(samples::Device&) {
  if (ImGui_ImplVulkan_CreateFontsTexture()) return {};
  return Error{ErrorCode::vulkanError, "the font texture could not be created"};
}
#else
Result<void> uploadFonts(samples::Device& device) {
  const VkCommandBuffer commandBuffer = device.allocateCommandBuffer();
  VkCommandBufferBeginInfo begin{};
  begin.sType = VK_STRUCTURE_TYPE_COMMAND_BUFFER_BEGIN_INFO;
  device.functions().BeginCommandBuffer(commandBuffer, &begin);
  ImGui_ImplVulkan_CreateFontsTexture(commandBuffer);
  device.functions().EndCommandBuffer(commandBuffer);
  const Result<void> done = device.submitAndWait(commandBuffer);
  device.freeCommandBuffer(commandBuffer);
  ImGui_ImplVulkan_DestroyFontUploadObjects();
  return done;
}
#endif

/// Whether a key produces a character, and is not a command.
bool isLetter(const SDL_Keysym& key) {
  return key.sym >= SDLK_SPACE && key.sym != SDLK_DELETE && (key.sym & SDLK_SCANCODE_MASK) == 0 &&
         (key.mod & (KMOD_CTRL | KMOD_ALT | KMOD_GUI)) == 0;
}

bool isModifier(const SDL_Keysym& key) {
  return key.sym >= SDLK_LCTRL && key.sym <= SDLK_RGUI;
}

}  // namespace

Result<Gui> Gui::create(const Window& window, samples::Device& device, VkRenderPass pass) {
  Gui gui;
  gui.device_ = &device;
  Result<samples::render::Owned<VkDescriptorPool>> pool = makePool(device);
  if (!pool) return pool.error();
  gui.pool_ = std::move(*pool);
  IMGUI_CHECKVERSION();
  ImGui::CreateContext();
  gui.hasContext_ = true;
  ImGui::GetIO().IniFilename = nullptr;  // Do not leave a file in the folder.
  styleGui(window.pixelsPerUnit());
  gui.hasWindow_ = ImGui_ImplSDL2_InitForVulkan(window.handle());

  const vulkan::DeviceDescription description = device.description();
  ImGui_ImplVulkan_InitInfo info{};
  info.Instance = description.instance;
  info.PhysicalDevice = device.physicalDevice();
  info.Device = device.handle();
  info.QueueFamily = device.queueFamily();
  info.Queue = device.queue();
  info.DescriptorPool = gui.pool_.get();
  info.MinImageCount = info.ImageCount = 2;
  info.MSAASamples = VK_SAMPLE_COUNT_1_BIT;
  gui.hasRenderer_ = ImGui_ImplVulkan_Init(&info, pass);
  if (!gui.hasWindow_ || !gui.hasRenderer_)
    return Error{ErrorCode::vulkanError, "Dear ImGui could not be started"};
  if (Result<void> done = uploadFonts(device); !done) return done.error();
  return gui;
}

Gui::~Gui() {
  if (device_ != nullptr) device_->functions().DeviceWaitIdle(device_->handle());
  if (hasRenderer_) ImGui_ImplVulkan_Shutdown();
  if (hasWindow_) ImGui_ImplSDL2_Shutdown();
  if (hasContext_) ImGui::DestroyContext();
}

Gui& Gui::operator=(Gui&& other) noexcept {
  std::swap(device_, other.device_);
  std::swap(pool_, other.pool_);
  std::swap(hasContext_, other.hasContext_);
  std::swap(hasWindow_, other.hasWindow_);
  std::swap(hasRenderer_, other.hasRenderer_);
  std::swap(framesToSeeKey_, other.framesToSeeKey_);
  return *this;
}

void Gui::handle(const SDL_Event& event) {
  if (event.type == SDL_KEYDOWN && wantsText()) {
    // Typed characters arrive as text. If their key events were passed on too, ImGui would use a
    // frame for each letter, and frames are slow here.
    if (isLetter(event.key.keysym)) return;
    if (!isModifier(event.key.keysym)) framesToSeeKey_ = framesPerKey;
  }
  ImGui_ImplSDL2_ProcessEvent(&event);
}

bool Gui::wantsMouse() const {
  return ImGui::GetIO().WantCaptureMouse;
}

bool Gui::wantsText() const {
  return ImGui::GetIO().WantTextInput;
}

bool Gui::hasQueuedInput() const {
#if IMGUI_VERSION_NUM >= 18700
  return !ImGui::GetCurrentContext()->InputEventsQueue.empty();
#else
  return false;
#endif
}

void Gui::beginFrame() {
  ImGui_ImplVulkan_NewFrame();
  ImGui_ImplSDL2_NewFrame();
  ImGui::NewFrame();
  if (framesToSeeKey_ > 0 && !hasQueuedInput()) --framesToSeeKey_;
}

void Gui::endFrame() const {
  ImGui::Render();
}

void Gui::record(VkCommandBuffer commandBuffer) const {
  ImGui_ImplVulkan_RenderDrawData(ImGui::GetDrawData(), commandBuffer);
}

}  // namespace dermis::viewer
