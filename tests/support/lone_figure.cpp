#include "lone_figure.h"

#include <cstring>

#include "random_rig.h"
#include "scene_meshes.h"

namespace dermis::test {

LoneFigure::LoneFigure(samples::Device& device, const vulkan::Context& context,
                       const PackedClips& clips)
    : device_(device), engine_(device, context, {}) {
  figure_ = must(engine_->addFigure(must(engine_->addClips(PackedClips(clips)))));
  // Poses are sampled for somebody.
  const MeshHandle mesh = engine_.addMesh(must(pack(randomMesh(1, 3, 1, 1).view(), 1)));
  for (std::uint32_t skin = 0; skin < clips.skinCount(); ++skin)
    engine_.addInstance({.mesh = mesh, .pose = must(engine_->pose(figure_, skin))});
}

std::vector<JointMatrix> LoneFigure::sample(std::span<const ClipLayer> layers, std::uint32_t skin) {
  const FigurePlay play{figure_, layers};
  must(engine_->play({&play, 1}));
  engine_.runFrame();
  const vulkan::BufferRange range =
      must(engine_.recorder().poseRange(must(engine_->pose(figure_, skin))));
  const samples::MappedBuffer copy = must(
      samples::MappedBuffer::create(device_, range.size, VK_BUFFER_USAGE_TRANSFER_DST_BIT, true));
  engine_.submitNow([&](VkCommandBuffer commandBuffer) {
    engine_.recordBarrier(commandBuffer, vulkan::barrierBetween(Use::dermis, Use::copyRead));
    const VkBufferCopy all{range.offset, 0, range.size};
    device_.functions().CmdCopyBuffer(commandBuffer, range.buffer, copy.handle(), 1, &all);
    engine_.recordBarrier(commandBuffer, vulkan::barrierBetween(Use::copyWrite, Use::hostRead));
  });
  std::vector<JointMatrix> pose(range.size / sizeof(JointMatrix));
  std::memcpy(pose.data(), copy.bytes().data(), range.size);
  return pose;
}

}  // namespace dermis::test
