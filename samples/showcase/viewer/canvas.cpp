#include "canvas.h"

#include <algorithm>
#include <array>
#include <utility>

#include <vulkan/vulkan.h>

namespace dermis::viewer {
namespace {

namespace render = samples::render;

constexpr VkImageSubresourceLayers allOfIt{VK_IMAGE_ASPECT_COLOR_BIT, 0, 0, 1};
constexpr VkClearColorValue background{{0.012f, 0.015f, 0.020f, 1}};  // linear

constexpr VkImageSubresourceRange allColors{VK_IMAGE_ASPECT_COLOR_BIT, 0, 1, 0, 1};

bool isBlueFirst(VkFormat format) {
  return format == VK_FORMAT_B8G8R8A8_SRGB;
}

/// The same format without the sRGB curve.
VkFormat plainFormat(VkFormat format) {
  return isBlueFirst(format) ? VK_FORMAT_B8G8R8A8_UNORM : VK_FORMAT_R8G8B8A8_UNORM;
}

VkOffset3D corner(std::uint32_t x, std::uint32_t y, std::int32_t z) {
  return {static_cast<std::int32_t>(x), static_cast<std::int32_t>(y), z};
}

}  // namespace

Result<Canvas> Canvas::create(samples::Device& device, VkFormat format) {
  Canvas canvas;
  canvas.device_ = &device;
  canvas.format_ = format;
  if (Result<void> made = canvas.makePass(); !made) return made.error();
  return canvas;
}

Result<void> Canvas::makePass() {
  VkAttachmentDescription attachment{};
  attachment.format = plainFormat(format_);
  attachment.samples = VK_SAMPLE_COUNT_1_BIT;
  attachment.loadOp = VK_ATTACHMENT_LOAD_OP_LOAD;
  attachment.storeOp = VK_ATTACHMENT_STORE_OP_STORE;
  attachment.stencilLoadOp = VK_ATTACHMENT_LOAD_OP_DONT_CARE;
  attachment.stencilStoreOp = VK_ATTACHMENT_STORE_OP_DONT_CARE;
  attachment.initialLayout = VK_IMAGE_LAYOUT_TRANSFER_DST_OPTIMAL;
  attachment.finalLayout = VK_IMAGE_LAYOUT_TRANSFER_SRC_OPTIMAL;
  const VkAttachmentReference color{0, VK_IMAGE_LAYOUT_COLOR_ATTACHMENT_OPTIMAL};
  VkSubpassDescription subpass{};
  subpass.pipelineBindPoint = VK_PIPELINE_BIND_POINT_GRAPHICS;
  subpass.colorAttachmentCount = 1;
  subpass.pColorAttachments = &color;
  std::array<VkSubpassDependency, 2> dependencies{};
  dependencies[0].srcSubpass = VK_SUBPASS_EXTERNAL;
  dependencies[0].srcStageMask = VK_PIPELINE_STAGE_TRANSFER_BIT;
  dependencies[0].srcAccessMask = VK_ACCESS_TRANSFER_WRITE_BIT;
  dependencies[0].dstStageMask = VK_PIPELINE_STAGE_COLOR_ATTACHMENT_OUTPUT_BIT;
  dependencies[0].dstAccessMask =
      VK_ACCESS_COLOR_ATTACHMENT_READ_BIT | VK_ACCESS_COLOR_ATTACHMENT_WRITE_BIT;
  dependencies[1].dstSubpass = VK_SUBPASS_EXTERNAL;
  dependencies[1].srcStageMask = VK_PIPELINE_STAGE_COLOR_ATTACHMENT_OUTPUT_BIT;
  dependencies[1].srcAccessMask = VK_ACCESS_COLOR_ATTACHMENT_WRITE_BIT;
  dependencies[1].dstStageMask = VK_PIPELINE_STAGE_TRANSFER_BIT;
  dependencies[1].dstAccessMask = VK_ACCESS_TRANSFER_READ_BIT;
  VkRenderPassCreateInfo info{};
  info.sType = VK_STRUCTURE_TYPE_RENDER_PASS_CREATE_INFO;
  info.attachmentCount = 1;
  info.pAttachments = &attachment;
  info.subpassCount = 1;
  info.pSubpasses = &subpass;
  info.dependencyCount = static_cast<std::uint32_t>(dependencies.size());
  info.pDependencies = dependencies.data();
  Result<render::Owned<VkRenderPass>> made = DERMIS_MAKE(*device_, RenderPass, info);
  if (!made) return made.error();
  pass_ = std::move(*made);
  return {};
}

Result<void> Canvas::resize(VkExtent2D pixels) {
  render::ImageDescription description;
  description.format = format_;
  description.viewFormat = plainFormat(format_);
  description.width = pixels.width;
  description.height = pixels.height;
  description.usage = VK_IMAGE_USAGE_COLOR_ATTACHMENT_BIT | VK_IMAGE_USAGE_TRANSFER_SRC_BIT |
                      VK_IMAGE_USAGE_TRANSFER_DST_BIT;
  Result<render::Image> image = render::Image::create(*device_, description);
  if (!image) return image.error();
  const VkImageView view = image->view();
  VkFramebufferCreateInfo info{};
  info.sType = VK_STRUCTURE_TYPE_FRAMEBUFFER_CREATE_INFO;
  info.renderPass = pass_.get();
  info.attachmentCount = 1;
  info.pAttachments = &view;
  info.width = pixels.width;
  info.height = pixels.height;
  info.layers = 1;
  Result<render::Owned<VkFramebuffer>> framebuffer = DERMIS_MAKE(*device_, Framebuffer, info);
  if (!framebuffer) return framebuffer.error();
  framebuffer_ = std::move(*framebuffer);
  image_ = std::move(*image);
  readBack_ = {};
  extent_ = pixels;
  return {};
}

void Canvas::record(VkCommandBuffer commandBuffer, const render::RenderTarget* picture,
                    const VkRect2D& area, const std::function<void()>& drawInterface) const {
  const samples::VulkanFunctions& functions = device_->functions();
  samples::render::recordTransition(*device_, commandBuffer, image_.handle(), allColors,
                                    VK_IMAGE_LAYOUT_UNDEFINED, VK_IMAGE_LAYOUT_TRANSFER_DST_OPTIMAL,
                                    VK_PIPELINE_STAGE_TRANSFER_BIT, 0,
                                    VK_PIPELINE_STAGE_TRANSFER_BIT, VK_ACCESS_TRANSFER_WRITE_BIT);
  vkCmdClearColorImage(commandBuffer, image_.handle(), VK_IMAGE_LAYOUT_TRANSFER_DST_OPTIMAL,
                       &background, 1, &allColors);
  if (picture != nullptr) recordPicture(commandBuffer, *picture, area);

  VkRenderPassBeginInfo begin{};
  begin.sType = VK_STRUCTURE_TYPE_RENDER_PASS_BEGIN_INFO;
  begin.renderPass = pass_.get();
  begin.framebuffer = framebuffer_.get();
  begin.renderArea.extent = extent_;
  functions.CmdBeginRenderPass(commandBuffer, &begin, VK_SUBPASS_CONTENTS_INLINE);
  drawInterface();
  functions.CmdEndRenderPass(commandBuffer);
}

void Canvas::recordPicture(VkCommandBuffer commandBuffer, const render::RenderTarget& picture,
                           const VkRect2D& area) const {
  samples::render::recordTransition(
      *device_, commandBuffer, image_.handle(), allColors, VK_IMAGE_LAYOUT_TRANSFER_DST_OPTIMAL,
      VK_IMAGE_LAYOUT_TRANSFER_DST_OPTIMAL, VK_PIPELINE_STAGE_TRANSFER_BIT,
      VK_ACCESS_TRANSFER_WRITE_BIT, VK_PIPELINE_STAGE_TRANSFER_BIT, VK_ACCESS_TRANSFER_WRITE_BIT);
  VkImageBlit blit{};
  blit.srcSubresource = blit.dstSubresource = allOfIt;
  blit.srcOffsets[1] = corner(picture.width(), picture.height(), 1);
  blit.dstOffsets[0] = {area.offset.x, area.offset.y, 0};
  blit.dstOffsets[1] = {area.offset.x + static_cast<std::int32_t>(area.extent.width),
                        area.offset.y + static_cast<std::int32_t>(area.extent.height), 1};
  device_->functions().CmdBlitImage(
      commandBuffer, picture.resolved().handle(), VK_IMAGE_LAYOUT_TRANSFER_SRC_OPTIMAL,
      image_.handle(), VK_IMAGE_LAYOUT_TRANSFER_DST_OPTIMAL, 1, &blit, VK_FILTER_LINEAR);
}

void Canvas::recordCopy(VkCommandBuffer commandBuffer, VkImage image) const {
  samples::render::recordTransition(*device_, commandBuffer, image, allColors,
                                    VK_IMAGE_LAYOUT_UNDEFINED, VK_IMAGE_LAYOUT_TRANSFER_DST_OPTIMAL,
                                    VK_PIPELINE_STAGE_TRANSFER_BIT, 0,
                                    VK_PIPELINE_STAGE_TRANSFER_BIT, VK_ACCESS_TRANSFER_WRITE_BIT);
  VkImageCopy copy{};
  copy.srcSubresource = copy.dstSubresource = allOfIt;
  copy.extent = {extent_.width, extent_.height, 1};
  vkCmdCopyImage(commandBuffer, image_.handle(), VK_IMAGE_LAYOUT_TRANSFER_SRC_OPTIMAL, image,
                 VK_IMAGE_LAYOUT_TRANSFER_DST_OPTIMAL, 1, &copy);
  samples::render::recordTransition(
      *device_, commandBuffer, image, allColors, VK_IMAGE_LAYOUT_TRANSFER_DST_OPTIMAL,
      VK_IMAGE_LAYOUT_PRESENT_SRC_KHR, VK_PIPELINE_STAGE_TRANSFER_BIT, VK_ACCESS_TRANSFER_WRITE_BIT,
      VK_PIPELINE_STAGE_BOTTOM_OF_PIPE_BIT, 0);
}

Result<void> Canvas::recordReadBack(VkCommandBuffer commandBuffer) {
  if (readBack_.handle() == VK_NULL_HANDLE) {
    Result<samples::MappedBuffer> made =
        samples::MappedBuffer::create(*device_, std::uint64_t{4} * extent_.width * extent_.height,
                                      VK_BUFFER_USAGE_TRANSFER_DST_BIT, true);
    if (!made) return made.error();
    readBack_ = std::move(*made);
  }
  VkBufferImageCopy copy{};
  copy.imageSubresource = allOfIt;
  copy.imageExtent = {extent_.width, extent_.height, 1};
  const samples::VulkanFunctions& functions = device_->functions();
  functions.CmdCopyImageToBuffer(commandBuffer, image_.handle(),
                                 VK_IMAGE_LAYOUT_TRANSFER_SRC_OPTIMAL, readBack_.handle(), 1,
                                 &copy);
  VkMemoryBarrier barrier{};
  barrier.sType = VK_STRUCTURE_TYPE_MEMORY_BARRIER;
  barrier.srcAccessMask = VK_ACCESS_TRANSFER_WRITE_BIT;
  barrier.dstAccessMask = VK_ACCESS_HOST_READ_BIT;
  functions.CmdPipelineBarrier(commandBuffer, VK_PIPELINE_STAGE_TRANSFER_BIT,
                               VK_PIPELINE_STAGE_HOST_BIT, 0, 1, &barrier, 0, nullptr, 0, nullptr);
  return {};
}

render::Picture Canvas::picture() const {
  render::Picture picture;
  picture.width = extent_.width;
  picture.height = extent_.height;
  picture.pixels.resize(readBack_.bytes().size());
  std::ranges::transform(readBack_.bytes(), picture.pixels.begin(),
                         [](std::byte byte) { return std::to_integer<std::uint8_t>(byte); });
  for (std::size_t pixel = 0; isBlueFirst(format_) && pixel < picture.pixels.size(); pixel += 4)
    std::swap(picture.pixels[pixel], picture.pixels[pixel + 2]);
  return picture;
}

}  // namespace dermis::viewer
