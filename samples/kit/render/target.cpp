#include "kit/render/target.h"

#include <algorithm>
#include <array>
#include <cstring>
#include <string>
#include <utility>

namespace dermis::samples::render {
namespace {

VkAttachmentDescription attachment(VkFormat format, VkSampleCountFlagBits samples,
                                   VkAttachmentLoadOp load, VkAttachmentStoreOp store,
                                   VkImageLayout layout) {
  VkAttachmentDescription description{};
  description.format = format;
  description.samples = samples;
  description.loadOp = load;
  description.storeOp = store;
  description.stencilLoadOp = VK_ATTACHMENT_LOAD_OP_DONT_CARE;
  description.stencilStoreOp = VK_ATTACHMENT_STORE_OP_DONT_CARE;
  description.initialLayout = VK_IMAGE_LAYOUT_UNDEFINED;
  description.finalLayout = layout;
  return description;
}

/// Waits for the last use of the images before the pass, and for the picture before its use after
/// the pass.
std::array<VkSubpassDependency, 2> pictureDependencies() {
  constexpr VkPipelineStageFlags drawing = VK_PIPELINE_STAGE_COLOR_ATTACHMENT_OUTPUT_BIT |
                                           VK_PIPELINE_STAGE_EARLY_FRAGMENT_TESTS_BIT |
                                           VK_PIPELINE_STAGE_LATE_FRAGMENT_TESTS_BIT;
  constexpr VkAccessFlags written =
      VK_ACCESS_COLOR_ATTACHMENT_WRITE_BIT | VK_ACCESS_DEPTH_STENCIL_ATTACHMENT_WRITE_BIT;
  std::array<VkSubpassDependency, 2> dependencies{};
  dependencies[0].srcSubpass = VK_SUBPASS_EXTERNAL;
  dependencies[0].dstSubpass = 0;
  dependencies[0].srcStageMask = drawing | VK_PIPELINE_STAGE_TRANSFER_BIT;
  dependencies[0].dstStageMask = drawing;
  dependencies[0].srcAccessMask = written;
  dependencies[0].dstAccessMask =
      written | VK_ACCESS_COLOR_ATTACHMENT_READ_BIT | VK_ACCESS_DEPTH_STENCIL_ATTACHMENT_READ_BIT;
  dependencies[1].srcSubpass = 0;
  dependencies[1].dstSubpass = VK_SUBPASS_EXTERNAL;
  dependencies[1].srcStageMask = VK_PIPELINE_STAGE_COLOR_ATTACHMENT_OUTPUT_BIT;
  dependencies[1].dstStageMask = VK_PIPELINE_STAGE_TRANSFER_BIT;
  dependencies[1].srcAccessMask = VK_ACCESS_COLOR_ATTACHMENT_WRITE_BIT;
  dependencies[1].dstAccessMask = VK_ACCESS_TRANSFER_READ_BIT;
  return dependencies;
}

/// Bytes per pixel of the largest image of a picture: four samples of color.
constexpr std::uint64_t largestPerPixel = 4 * 4;
/// Bytes per pixel in all: four samples of color and of depth, the resolved image, and its copy.
constexpr std::uint64_t bytesPerPixel = 2 * largestPerPixel + 4 + 4;

Error tooLarge(const Device& device, std::uint32_t width, std::uint32_t height,
               const std::string& reason) {
  return {ErrorCode::limitExceeded, device.info().name + " cannot draw a picture of " +
                                        std::to_string(width) + " x " + std::to_string(height) +
                                        " pixels: " + reason};
}

std::string mebibytes(std::uint64_t bytes) {
  return std::to_string(bytes >> 20) + " MiB";
}

/// Maximum size of an image along one side.
std::uint32_t longestSide(const Device& device, VkFormat format, VkImageUsageFlags usage) {
  VkImageFormatProperties properties{};
  if (device.functions().GetPhysicalDeviceImageFormatProperties(
          device.physicalDevice(), format, VK_IMAGE_TYPE_2D, VK_IMAGE_TILING_OPTIMAL, usage, 0,
          &properties) != VK_SUCCESS)
    return 0;
  return std::min(properties.maxExtent.width, properties.maxExtent.height);
}

/// Checks limits before anything is created. The amount of free memory is unknown.
Result<void> checkSize(const Device& device, VkFormat depthFormat, std::uint32_t width,
                       std::uint32_t height) {
  VkPhysicalDeviceProperties properties{};
  device.functions().GetPhysicalDeviceProperties(device.physicalDevice(), &properties);
  const VkPhysicalDeviceLimits& limits = properties.limits;
  const std::uint32_t longest =
      std::min({limits.maxImageDimension2D, limits.maxFramebufferWidth, limits.maxFramebufferHeight,
                longestSide(device, colorFormat, VK_IMAGE_USAGE_COLOR_ATTACHMENT_BIT),
                longestSide(device, depthFormat, VK_IMAGE_USAGE_DEPTH_STENCIL_ATTACHMENT_BIT)});
  if (std::max(width, height) > longest)
    return tooLarge(device, width, height,
                    "the device's maximum is " + std::to_string(longest) + " pixels per side");
  VkPhysicalDeviceMemoryProperties memory{};
  device.functions().GetPhysicalDeviceMemoryProperties(device.physicalDevice(), &memory);
  std::uint64_t largestHeap = 0;
  for (std::uint32_t heap = 0; heap < memory.memoryHeapCount; ++heap)
    largestHeap = std::max(largestHeap, memory.memoryHeaps[heap].size);
  // Vulkan forbids an allocation larger than its heap. Several allocations may exceed it: lavapipe
  // 22.3 reports a heap of 2 GiB, but allocates as much as the machine has.
  const std::uint64_t bytes = largestPerPixel * width * height;
  if (bytes <= largestHeap) return {};
  return tooLarge(device, width, height,
                  "one of its images takes " + mebibytes(bytes) + ", and the device's memory has " +
                      mebibytes(largestHeap));
}

}  // namespace

VkFormat chooseDepthFormat(const Device& device) {
  for (const VkFormat format : {VK_FORMAT_D32_SFLOAT, VK_FORMAT_X8_D24_UNORM_PACK32}) {
    VkFormatProperties properties{};
    device.functions().GetPhysicalDeviceFormatProperties(device.physicalDevice(), format,
                                                         &properties);
    if ((properties.optimalTilingFeatures & VK_FORMAT_FEATURE_DEPTH_STENCIL_ATTACHMENT_BIT) != 0)
      return format;
  }
  return VK_FORMAT_D16_UNORM;  // Every device has it.
}

Result<Owned<VkRenderPass>> makePicturePass(const Device& device, VkFormat depthFormat) {
  const std::array attachments{
      attachment(colorFormat, sampleCount, VK_ATTACHMENT_LOAD_OP_CLEAR,
                 VK_ATTACHMENT_STORE_OP_DONT_CARE, VK_IMAGE_LAYOUT_COLOR_ATTACHMENT_OPTIMAL),
      attachment(depthFormat, sampleCount, VK_ATTACHMENT_LOAD_OP_CLEAR,
                 VK_ATTACHMENT_STORE_OP_DONT_CARE,
                 VK_IMAGE_LAYOUT_DEPTH_STENCIL_ATTACHMENT_OPTIMAL),
      attachment(colorFormat, VK_SAMPLE_COUNT_1_BIT, VK_ATTACHMENT_LOAD_OP_DONT_CARE,
                 VK_ATTACHMENT_STORE_OP_STORE, VK_IMAGE_LAYOUT_TRANSFER_SRC_OPTIMAL)};
  const VkAttachmentReference color{0, VK_IMAGE_LAYOUT_COLOR_ATTACHMENT_OPTIMAL};
  const VkAttachmentReference depth{1, VK_IMAGE_LAYOUT_DEPTH_STENCIL_ATTACHMENT_OPTIMAL};
  const VkAttachmentReference resolved{2, VK_IMAGE_LAYOUT_COLOR_ATTACHMENT_OPTIMAL};
  VkSubpassDescription subpass{};
  subpass.pipelineBindPoint = VK_PIPELINE_BIND_POINT_GRAPHICS;
  subpass.colorAttachmentCount = 1;
  subpass.pColorAttachments = &color;
  subpass.pResolveAttachments = &resolved;
  subpass.pDepthStencilAttachment = &depth;
  const auto dependencies = pictureDependencies();
  VkRenderPassCreateInfo info{};
  info.sType = VK_STRUCTURE_TYPE_RENDER_PASS_CREATE_INFO;
  info.attachmentCount = static_cast<std::uint32_t>(attachments.size());
  info.pAttachments = attachments.data();
  info.subpassCount = 1;
  info.pSubpasses = &subpass;
  info.dependencyCount = static_cast<std::uint32_t>(dependencies.size());
  info.pDependencies = dependencies.data();
  return DERMIS_MAKE(device, RenderPass, info);
}

Result<RenderTarget> RenderTarget::create(Device& device, VkRenderPass pass, VkFormat depthFormat,
                                          std::uint32_t width, std::uint32_t height) {
  if (Result<void> checked = checkSize(device, depthFormat, width, height); !checked)
    return checked.error();
  Result<RenderTarget> target = make(device, pass, depthFormat, width, height);
  if (target || target.error().code == ErrorCode::missingFeature) return target;
  // Drivers report a lack of memory with different results, from different calls.
  Error error = tooLarge(
      device, width, height,
      "it takes " + mebibytes(bytesPerPixel * width * height) + ", and " + target.error().message);
  error.vulkanResult = target.error().vulkanResult;
  return error;
}

Result<RenderTarget> RenderTarget::make(Device& device, VkRenderPass pass, VkFormat depthFormat,
                                        std::uint32_t width, std::uint32_t height) {
  RenderTarget target;
  target.width_ = width;
  target.height_ = height;
  ImageDescription description;
  description.format = colorFormat;
  description.width = width;
  description.height = height;
  description.usage = VK_IMAGE_USAGE_COLOR_ATTACHMENT_BIT | VK_IMAGE_USAGE_TRANSFER_SRC_BIT;
  Result<Image> resolved = Image::create(device, description);
  if (!resolved) return resolved.error();
  description.samples = sampleCount;
  description.usage = VK_IMAGE_USAGE_COLOR_ATTACHMENT_BIT | VK_IMAGE_USAGE_TRANSIENT_ATTACHMENT_BIT;
  Result<Image> color = Image::create(device, description);
  if (!color) return color.error();
  description.format = depthFormat;
  description.aspect = VK_IMAGE_ASPECT_DEPTH_BIT;
  description.usage =
      VK_IMAGE_USAGE_DEPTH_STENCIL_ATTACHMENT_BIT | VK_IMAGE_USAGE_TRANSIENT_ATTACHMENT_BIT;
  Result<Image> depth = Image::create(device, description);
  if (!depth) return depth.error();
  target.resolved_ = std::move(*resolved);
  target.color_ = std::move(*color);
  target.depth_ = std::move(*depth);

  const std::array views{target.color_.view(), target.depth_.view(), target.resolved_.view()};
  VkFramebufferCreateInfo info{};
  info.sType = VK_STRUCTURE_TYPE_FRAMEBUFFER_CREATE_INFO;
  info.renderPass = pass;
  info.attachmentCount = static_cast<std::uint32_t>(views.size());
  info.pAttachments = views.data();
  info.width = width;
  info.height = height;
  info.layers = 1;
  Result<Owned<VkFramebuffer>> framebuffer = DERMIS_MAKE(device, Framebuffer, info);
  if (!framebuffer) return framebuffer.error();
  target.framebuffer_ = std::move(*framebuffer);

  Result<MappedBuffer> readBack = MappedBuffer::create(device, std::uint64_t{4} * width * height,
                                                       VK_BUFFER_USAGE_TRANSFER_DST_BIT, true);
  if (!readBack) return readBack.error();
  target.readBack_ = std::move(*readBack);
  return target;
}

void RenderTarget::recordReadBack(const Device& device, VkCommandBuffer commandBuffer) const {
  VkBufferImageCopy copy{};
  copy.imageSubresource = {VK_IMAGE_ASPECT_COLOR_BIT, 0, 0, 1};
  copy.imageExtent = {width_, height_, 1};
  device.functions().CmdCopyImageToBuffer(commandBuffer, resolved_.handle(),
                                          VK_IMAGE_LAYOUT_TRANSFER_SRC_OPTIMAL, readBack_.handle(),
                                          1, &copy);
  recordBarrier(device, commandBuffer, Use::copyWrite, Use::hostRead);
}

std::vector<std::uint8_t> RenderTarget::pixels() const {
  std::vector<std::uint8_t> pixels(readBack_.bytes().size());
  std::memcpy(pixels.data(), readBack_.bytes().data(), pixels.size());
  return pixels;
}

}  // namespace dermis::samples::render
