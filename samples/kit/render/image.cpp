#include "kit/render/image.h"

#include <algorithm>
#include <bit>
#include <cstring>
#include <memory>
#include <string>
#include <utility>

#include "kit/buffer.h"
#include "kit/memory_left.h"
#include "kit/render/stb_headers.h"

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

namespace {

constexpr int largestSide = 8192;

VkSamplerAddressMode addressMode(Wrap wrap) {
  switch (wrap) {
    case Wrap::mirror:
      return VK_SAMPLER_ADDRESS_MODE_MIRRORED_REPEAT;
    case Wrap::clamp:
      return VK_SAMPLER_ADDRESS_MODE_CLAMP_TO_EDGE;
    default:
      return VK_SAMPLER_ADDRESS_MODE_REPEAT;
  }
}

Result<Owned<VkSampler>> makeSampler(const Device& device, const TextureOptions& options) {
  VkSamplerCreateInfo info{};
  info.sType = VK_STRUCTURE_TYPE_SAMPLER_CREATE_INFO;
  info.magFilter = info.minFilter = VK_FILTER_LINEAR;
  info.mipmapMode = VK_SAMPLER_MIPMAP_MODE_LINEAR;
  info.addressModeU = addressMode(options.wrapU);
  info.addressModeV = addressMode(options.wrapV);
  info.addressModeW = VK_SAMPLER_ADDRESS_MODE_REPEAT;
  info.maxLod = VK_LOD_CLAMP_NONE;
  return DERMIS_MAKE(device, Sampler, info);
}

VkImageMemoryBarrier levelBarrier(VkImage image, std::uint32_t level, VkImageLayout from,
                                  VkImageLayout to, VkAccessFlags source,
                                  VkAccessFlags destination) {
  VkImageMemoryBarrier barrier{};
  barrier.sType = VK_STRUCTURE_TYPE_IMAGE_MEMORY_BARRIER;
  barrier.srcAccessMask = source;
  barrier.dstAccessMask = destination;
  barrier.oldLayout = from;
  barrier.newLayout = to;
  barrier.srcQueueFamilyIndex = barrier.dstQueueFamilyIndex = VK_QUEUE_FAMILY_IGNORED;
  barrier.image = image;
  barrier.subresourceRange = {VK_IMAGE_ASPECT_COLOR_BIT, level, 1, 0, 1};
  return barrier;
}

/// Computes every mip level from the previous one. Afterwards all levels are in the layout for
/// copying from.
void recordLevels(const VulkanFunctions& functions, VkCommandBuffer commandBuffer,
                  const Image& image) {
  const ImageDescription& description = image.description();
  const auto side = [](std::uint32_t size, std::uint32_t level) {
    return static_cast<std::int32_t>(std::max(size >> level, 1u));
  };
  for (std::uint32_t level = 0; level < description.levels; ++level) {
    if (level > 0) {
      VkImageBlit blit{};
      blit.srcSubresource = {VK_IMAGE_ASPECT_COLOR_BIT, level - 1, 0, 1};
      blit.dstSubresource = {VK_IMAGE_ASPECT_COLOR_BIT, level, 0, 1};
      blit.srcOffsets[1] = {side(description.width, level - 1), side(description.height, level - 1),
                            1};
      blit.dstOffsets[1] = {side(description.width, level), side(description.height, level), 1};
      functions.CmdBlitImage(commandBuffer, image.handle(), VK_IMAGE_LAYOUT_TRANSFER_SRC_OPTIMAL,
                             image.handle(), VK_IMAGE_LAYOUT_TRANSFER_DST_OPTIMAL, 1, &blit,
                             VK_FILTER_LINEAR);
    }
    const VkImageMemoryBarrier barrier =
        levelBarrier(image.handle(), level, VK_IMAGE_LAYOUT_TRANSFER_DST_OPTIMAL,
                     VK_IMAGE_LAYOUT_TRANSFER_SRC_OPTIMAL, VK_ACCESS_TRANSFER_WRITE_BIT,
                     VK_ACCESS_TRANSFER_READ_BIT);
    functions.CmdPipelineBarrier(commandBuffer, VK_PIPELINE_STAGE_TRANSFER_BIT,
                                 VK_PIPELINE_STAGE_TRANSFER_BIT, 0, 0, nullptr, 0, nullptr, 1,
                                 &barrier);
  }
}

Result<void> upload(Device& device, const TexturePixels& pixels, const Image& image) {
  Result<MappedBuffer> staging =
      MappedBuffer::create(device, pixels.pixels.size(), VK_BUFFER_USAGE_TRANSFER_SRC_BIT);
  if (!staging) return staging.error();
  std::memcpy(staging->bytes().data(), pixels.pixels.data(), pixels.pixels.size());

  const VulkanFunctions& functions = device.functions();
  return device.run([&](VkCommandBuffer commandBuffer) -> Result<void> {
    recordTransition(device, commandBuffer, image, VK_IMAGE_LAYOUT_UNDEFINED,
                     VK_IMAGE_LAYOUT_TRANSFER_DST_OPTIMAL, VK_PIPELINE_STAGE_TOP_OF_PIPE_BIT, 0,
                     VK_PIPELINE_STAGE_TRANSFER_BIT, VK_ACCESS_TRANSFER_WRITE_BIT);
    VkBufferImageCopy copy{};
    copy.imageSubresource = {VK_IMAGE_ASPECT_COLOR_BIT, 0, 0, 1};
    copy.imageExtent = {pixels.width, pixels.height, 1};
    functions.CmdCopyBufferToImage(commandBuffer, staging->handle(), image.handle(),
                                   VK_IMAGE_LAYOUT_TRANSFER_DST_OPTIMAL, 1, &copy);
    recordLevels(functions, commandBuffer, image);
    recordTransition(device, commandBuffer, image, VK_IMAGE_LAYOUT_TRANSFER_SRC_OPTIMAL,
                     VK_IMAGE_LAYOUT_SHADER_READ_ONLY_OPTIMAL, VK_PIPELINE_STAGE_TRANSFER_BIT,
                     VK_ACCESS_TRANSFER_READ_BIT, VK_PIPELINE_STAGE_FRAGMENT_SHADER_BIT,
                     VK_ACCESS_SHADER_READ_BIT);
    return {};
  });
}

}  // namespace

Result<TexturePixels> decodeImage(std::span<const std::byte> encoded, std::uint64_t* memoryLeft) {
  const auto* bytes = reinterpret_cast<const stbi_uc*>(encoded.data());
  const Error broken{ErrorCode::invalidData, "it is not a valid PNG or JPEG"};
  if (encoded.empty() || !std::in_range<int>(encoded.size())) return broken;
  const int size = static_cast<int>(encoded.size());
  int width = 0, height = 0, channels = 0;
  if (stbi_info_from_memory(bytes, size, &width, &height, &channels) == 0) return broken;
  if (width < 1 || height < 1 || width > largestSide || height > largestSide) {
    return Error{ErrorCode::limitExceeded, "it has " + std::to_string(width) + " x " +
                                               std::to_string(height) + " pixels; the maximum is " +
                                               std::to_string(largestSide) + " per side"};
  }
  const auto pixels =
      std::uint64_t{4} * static_cast<std::uint32_t>(width) * static_cast<std::uint32_t>(height);
  if (memoryLeft != nullptr && !spend(*memoryLeft, pixels)) {
    return Error{ErrorCode::limitExceeded,
                 "its " + std::to_string(width) + " x " + std::to_string(height) +
                     " pixels take more memory than the limit for a file of this size"};
  }
  const std::unique_ptr<stbi_uc, void (*)(void*)> decoded(
      stbi_load_from_memory(bytes, size, &width, &height, &channels, 4), stbi_image_free);
  if (decoded == nullptr) return broken;
  TexturePixels texture{static_cast<std::uint32_t>(width), static_cast<std::uint32_t>(height), {}};
  texture.pixels.assign(decoded.get(),
                        decoded.get() + std::size_t{4} * texture.width * texture.height);
  return texture;
}

Result<Texture> Texture::create(Device& device, const TexturePixels& pixels,
                                const TextureOptions& options) {
  Texture texture;
  ImageDescription description;
  description.format = VK_FORMAT_R8G8B8A8_SRGB;
  description.width = pixels.width;
  description.height = pixels.height;
  description.levels =
      static_cast<std::uint32_t>(std::bit_width(std::max(pixels.width, pixels.height)));
  description.usage = VK_IMAGE_USAGE_SAMPLED_BIT | VK_IMAGE_USAGE_TRANSFER_SRC_BIT |
                      VK_IMAGE_USAGE_TRANSFER_DST_BIT;
  Result<Image> image = Image::create(device, description);
  if (!image) return image.error();
  texture.image_ = std::make_shared<const Image>(std::move(*image));
  Result<Owned<VkSampler>> sampler = makeSampler(device, options);
  if (!sampler) return sampler.error();
  texture.sampler_ = std::move(*sampler);
  if (Result<void> done = upload(device, pixels, *texture.image_); !done) return done.error();
  return texture;
}

Result<Texture> Texture::create(Device& device, const Texture& other,
                                const TextureOptions& options) {
  Texture texture;
  texture.image_ = other.image_;
  Result<Owned<VkSampler>> sampler = makeSampler(device, options);
  if (!sampler) return sampler.error();
  texture.sampler_ = std::move(*sampler);
  return texture;
}

}  // namespace dermis::samples::render
