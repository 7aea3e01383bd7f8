#include "kit/bench/plain_batches.h"

#include <algorithm>
#include <cstring>
#include <type_traits>
#include <utility>

#include "dermis/vulkan/context.h"
#include "plain_kernels.h"

namespace dermis::samples {
namespace {

constexpr std::uint32_t workgroupSize = 64;  // of all kernels
constexpr std::uint64_t outputStride = 24;
constexpr std::uint64_t copiedTogether = 24;  // instances per invocation of plain_copy.comp
/// A dispatch skins whole instances, in multiples of this. With 24 bytes per vertex, their output
/// then begins at a multiple of 256 bytes, the largest alignment that a device may require.
constexpr std::uint64_t instanceStep = 32;

std::uint32_t groupsOf(std::uint64_t invocations) {
  return static_cast<std::uint32_t>((invocations + workgroupSize - 1) / workgroupSize);
}

/// The number of instances per dispatch.
std::uint64_t instancesTogether(std::uint64_t maxRange, std::uint64_t instanceSize) {
  const std::uint64_t most = maxRange / instanceSize;
  return std::max(most - most % instanceStep, instanceStep);
}

}  // namespace

PlainBatches::~PlainBatches() {
  for (const VkCommandBuffer commandBuffer : commandBuffers_) {
    if (commandBuffer != VK_NULL_HANDLE) device_.freeCommandBuffer(commandBuffer);
  }
}

Result<std::unique_ptr<PlainBatches>> PlainBatches::create(OpenDevice& open, const Crowd& crowd) {
  std::unique_ptr<PlainBatches> batches(new PlainBatches(open));
  if (Result<void> made = batches->make(crowd); !made) return made.error();
  return batches;
}

Result<void> PlainBatches::make(const Crowd& crowd) {
  Result<Timestamps> timestamps = Timestamps::create(device_);
  if (!timestamps) return timestamps.error();
  timestamps_ = std::move(*timestamps);
  if (Result<void> made = makeBuffers(crowd); !made) return made;
  const std::uint64_t step =
      instancesTogether(maxRange_, std::uint64_t{crowd.vertexCount()} * outputStride);
  const std::uint64_t dispatches = (crowd.instanceCount() + step - 1) / step;
  // The sets of the three kernels, and that of the palettes.
  const std::uint64_t sets = dispatches * plainKernelCount + 1;
  Result<StorageKernels> kernels =
      StorageKernels::create(device_, 3, 12, static_cast<std::uint32_t>(sets));
  if (!kernels) return kernels.error();
  kernels_ = std::move(*kernels);
  Result<render::Owned<VkPipeline>> palettes =
      kernels_.makePipeline(plain_kernels::plain_palette_spirv);
  if (!palettes) return palettes.error();
  palettePipeline_ = std::move(*palettes);
  const std::array spirv{plain_kernels::plain_skin_spirv, plain_kernels::plain_linear_spirv,
                         plain_kernels::plain_copy_spirv};
  for (std::size_t kernel = 0; kernel < plainKernelCount; ++kernel) {
    Result<render::Owned<VkPipeline>> pipeline = kernels_.makePipeline(spirv[kernel]);
    if (!pipeline) return pipeline.error();
    pipelines_[kernel] = std::move(*pipeline);
    if (Result<void> recorded = record(crowd, static_cast<PlainKernel>(kernel)); !recorded)
      return recorded;
    const Result<double> first = skin(static_cast<PlainKernel>(kernel));
    if (!first) return first.error();
  }
  return {};
}

Result<void> PlainBatches::makeBuffers(const Crowd& crowd) {
  const std::uint64_t joints = std::uint64_t{crowd.instanceCount()} * crowd.jointCount();
  const std::uint64_t vertices = crowd.vertices.size();
  const auto make = [this](auto& buffer, std::uint64_t size) -> Result<void> {
    using Buffer = std::remove_reference_t<decltype(buffer)>;
    Result<Buffer> made = Buffer::create(device_, size, VK_BUFFER_USAGE_STORAGE_BUFFER_BIT);
    if (!made) return made.error();
    buffer = std::move(*made);
    return {};
  };
  for (const Result<void>& made :
       {make(vertices_, vertices * sizeof(PlainVertex)),
        make(matrices_, joints * sizeof(JointMatrix)), make(palettes_, joints * 32),
        make(output_, crowd.instanceCount() * vertices * outputStride)}) {
    if (!made) return made;
  }
  std::memcpy(vertices_.bytes().data(), crowd.vertices.data(),
              crowd.vertices.size() * sizeof(PlainVertex));
  std::byte* place = matrices_.bytes().data();
  for (const std::vector<JointMatrix>& pose : crowd.poses) {
    std::memcpy(place, pose.data(), pose.size() * sizeof(JointMatrix));
    place += pose.size() * sizeof(JointMatrix);
  }
  return {};
}

Result<void> PlainBatches::recordPalettes(const Crowd& crowd, VkCommandBuffer commandBuffer) {
  if (Result<void> bound = kernels_.bind(commandBuffer, palettePipeline_.get(),
                                         std::array{matrices_.range(), palettes_.range()});
      !bound)
    return bound;
  const std::uint32_t jointTotal = crowd.instanceCount() * crowd.jointCount();
  kernels_.push(commandBuffer, {&jointTotal, 1});
  device_.functions().CmdDispatch(commandBuffer, groupsOf(jointTotal), 1, 1);
  recordBarrier(device_, commandBuffer, Use::computeWrite, Use::computeRead);
  return {};
}

Result<void> PlainBatches::recordSkinning(const Crowd& crowd, PlainKernel kernel,
                                          VkCommandBuffer commandBuffer) {
  const std::uint64_t instanceSize = std::uint64_t{crowd.vertexCount()} * outputStride;
  const std::uint64_t step = instancesTogether(maxRange_, instanceSize);
  const vulkan::BufferRange joints =
      kernel == PlainKernel::dualQuaternion ? palettes_.range() : matrices_.range();
  for (std::uint64_t first = 0; first < crowd.instanceCount(); first += step) {
    const std::uint64_t count = std::min(step, crowd.instanceCount() - first);
    const vulkan::BufferRange written{output_.range().buffer, first * instanceSize,
                                      count * instanceSize};
    if (Result<void> bound =
            kernels_.bind(commandBuffer, pipelines_[static_cast<std::size_t>(kernel)].get(),
                          std::array{vertices_.range(), joints, written});
        !bound)
      return bound;
    const bool copies = kernel == PlainKernel::copy;
    const std::array<std::uint32_t, 3> push{
        crowd.vertexCount(), copies ? static_cast<std::uint32_t>(count) : crowd.jointCount(),
        static_cast<std::uint32_t>(first)};
    const std::uint64_t rows = copies ? (count + copiedTogether - 1) / copiedTogether : count;
    kernels_.push(commandBuffer, push);
    device_.functions().CmdDispatch(commandBuffer, groupsOf(crowd.vertexCount()),
                                    static_cast<std::uint32_t>(rows), 1);
  }
  return {};
}

Result<void> PlainBatches::record(const Crowd& crowd, PlainKernel kernel) {
  VkCommandBuffer& commandBuffer = commandBuffers_[static_cast<std::size_t>(kernel)];
  commandBuffer = device_.allocateCommandBuffer();
  VkCommandBufferBeginInfo begin{};
  begin.sType = VK_STRUCTURE_TYPE_COMMAND_BUFFER_BEGIN_INFO;
  begin.flags = VK_COMMAND_BUFFER_USAGE_SIMULTANEOUS_USE_BIT;
  if (Result<void> begun = checkVulkan(
          "vkBeginCommandBuffer", device_.functions().BeginCommandBuffer(commandBuffer, &begin));
      !begun)
    return begun;
  // After the previous execution.
  recordBarrier(device_, commandBuffer, Use::computeWrite, Use::computeWrite | Use::computeRead);
  timestamps_.recordBegin(commandBuffer);
  if (kernel == PlainKernel::dualQuaternion) {
    if (Result<void> recorded = recordPalettes(crowd, commandBuffer); !recorded) return recorded;
  }
  if (Result<void> recorded = recordSkinning(crowd, kernel, commandBuffer); !recorded)
    return recorded;
  timestamps_.recordEnd(commandBuffer);
  return checkVulkan("vkEndCommandBuffer", device_.functions().EndCommandBuffer(commandBuffer));
}

Result<double> PlainBatches::skin(PlainKernel kernel) {
  return timestamps_.measure(commandBuffers_[static_cast<std::size_t>(kernel)]);
}

}  // namespace dermis::samples
