#include "kit/render/image.h"

#include <algorithm>
#include <utility>

namespace dermis::samples::render {
namespace {

VkFormat viewFormatOf(const ImageDescription& description) {
  return description.viewFormat != VK_FORMAT_UNDEFINED ? description.viewFormat
                                                       : description.format;
}

Result<Owned<VkImageView>> makeView(Device& device, VkImage image,
                                    const ImageDescription& description, VkImageViewType type,
                                    std::uint32_t firstLayer, std::uint32_t layers) {
  VkImageViewCreateInfo info{};
  info.sType = VK_STRUCTURE_TYPE_IMAGE_VIEW_CREATE_INFO;
  info.image = image;
  info.viewType = type;
  info.format = viewFormatOf(description);
  info.subresourceRange = {description.aspect, 0, description.levels, firstLayer, layers};
  return DERMIS_MAKE(device, ImageView, info);
}

Result<Owned<VkDeviceMemory>> allocate(Device& device, VkImage image) {
  VkMemoryRequirements requirements{};
  device.functions().GetImageMemoryRequirements(device.handle(), image, &requirements);
  const Result<std::uint32_t> type =
      device.memoryType(requirements.memoryTypeBits, 0, VK_MEMORY_PROPERTY_DEVICE_LOCAL_BIT);
  if (!type) return type.error();
  VkMemoryAllocateInfo info{};
  info.sType = VK_STRUCTURE_TYPE_MEMORY_ALLOCATE_INFO;
  info.allocationSize = requirements.size;
  info.memoryTypeIndex = *type;
  return make(device, "vkAllocateMemory", device.functions().AllocateMemory,
              device.functions().FreeMemory, info);
}

}  // namespace

Result<Image> Image::create(Device& device, const ImageDescription& description) {
  Image image;
  image.description_ = description;
  const std::uint32_t layers = std::max(description.layers, 1u);
  VkImageCreateInfo info{};
  info.sType = VK_STRUCTURE_TYPE_IMAGE_CREATE_INFO;
  if (viewFormatOf(description) != description.format)
    info.flags = VK_IMAGE_CREATE_MUTABLE_FORMAT_BIT;
  info.imageType = VK_IMAGE_TYPE_2D;
  info.format = description.format;
  info.extent = {description.width, description.height, 1};
  info.mipLevels = description.levels;
  info.arrayLayers = layers;
  info.samples = description.samples;
  info.tiling = VK_IMAGE_TILING_OPTIMAL;
  info.usage = description.usage;
  Result<Owned<VkImage>> made = DERMIS_MAKE(device, Image, info);
  if (!made) return made.error();
  image.image_ = std::move(*made);

  Result<Owned<VkDeviceMemory>> memory = allocate(device, image.handle());
  if (!memory) return memory.error();
  image.memory_ = std::move(*memory);
  if (const VkResult result = device.functions().BindImageMemory(device.handle(), image.handle(),
                                                                 image.memory_.get(), 0);
      result != VK_SUCCESS) {
    return Error{ErrorCode::vulkanError, "vkBindImageMemory failed",
                 static_cast<std::int32_t>(result)};
  }
  const VkImageViewType type =
      description.layers == 0 ? VK_IMAGE_VIEW_TYPE_2D : VK_IMAGE_VIEW_TYPE_2D_ARRAY;
  Result<Owned<VkImageView>> view = makeView(device, image.handle(), description, type, 0, layers);
  if (!view) return view.error();
  image.view_ = std::move(*view);
  return image;
}

Result<Owned<VkImageView>> Image::layerView(Device& device, std::uint32_t layer) const {
  return makeView(device, handle(), description_, VK_IMAGE_VIEW_TYPE_2D, layer, 1);
}

void recordTransition(const Device& device, VkCommandBuffer commandBuffer, VkImage image,
                      const VkImageSubresourceRange& part, VkImageLayout from, VkImageLayout to,
                      VkPipelineStageFlags sourceStages, VkAccessFlags sourceAccesses,
                      VkPipelineStageFlags destinationStages, VkAccessFlags destinationAccesses) {
  VkImageMemoryBarrier barrier{};
  barrier.sType = VK_STRUCTURE_TYPE_IMAGE_MEMORY_BARRIER;
  barrier.srcAccessMask = sourceAccesses;
  barrier.dstAccessMask = destinationAccesses;
  barrier.oldLayout = from;
  barrier.newLayout = to;
  barrier.srcQueueFamilyIndex = barrier.dstQueueFamilyIndex = VK_QUEUE_FAMILY_IGNORED;
  barrier.image = image;
  barrier.subresourceRange = part;
  device.functions().CmdPipelineBarrier(commandBuffer, sourceStages, destinationStages, 0, 0,
                                        nullptr, 0, nullptr, 1, &barrier);
}

void recordTransition(const Device& device, VkCommandBuffer commandBuffer, const Image& image,
                      VkImageLayout from, VkImageLayout to, VkPipelineStageFlags sourceStages,
                      VkAccessFlags sourceAccesses, VkPipelineStageFlags destinationStages,
                      VkAccessFlags destinationAccesses) {
  const ImageDescription& description = image.description();
  const VkImageSubresourceRange all{description.aspect, 0, description.levels, 0,
                                    std::max(description.layers, 1u)};
  recordTransition(device, commandBuffer, image.handle(), all, from, to, sourceStages,
                   sourceAccesses, destinationStages, destinationAccesses);
}

}  // namespace dermis::samples::render
