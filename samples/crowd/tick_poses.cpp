#include "tick_poses.h"

#include <algorithm>
#include <cmath>
#include <cstring>
#include <deque>
#include <optional>

#include <glm/glm.hpp>

#include "dermis/verify.h"
#include "dermis/vulkan/scene_recorder.h"
#include "kit/buffer.h"
#include "kit/frame_loop.h"
#include "kit/program.h"

namespace crowd {

using namespace dermis;
using namespace dermis::samples;

namespace {

template <typename Matrix>
glm::dmat4 matrixOf(const Matrix& rows) {
  glm::dmat4 matrix(1.0);
  for (int row = 0; row < 3; ++row) {
    for (int column = 0; column < 4; ++column)
      matrix[column][row] =
          double{rows[static_cast<std::size_t>(row)][static_cast<std::size_t>(column)]};
  }
  return matrix;
}

/// A list of one layer, or of none.
std::span<const ClipLayer> listOf(const std::optional<ClipLayer>& layer) {
  return layer ? std::span(&*layer, 1) : std::span<const ClipLayer>();
}

/// Figures, one for each tick of the longest clip, on the device.
class Sampler {
 public:
  Sampler(const Character& character, const PackedClips& bank, OpenDevice& open)
      : character_(&character),
        open_(&open),
        recorder_(must(vulkan::SceneRecorder::create(open.context, {}))),
        loop_(*open.device, 1) {
    std::uint32_t ticks = 1;
    for (std::uint32_t clip = 0; clip < character.clipCount(); ++clip)
      ticks = std::max(ticks, character.tickCount(clip));
    Scene& scene = recorder_.scene();
    const ClipsHandle clips = must(scene.addClips(PackedClips(bank)));
    // Somebody must be skinned with each pose.
    std::vector<InstanceDescription> wearers(character.jointCounts().size());
    for (const Part& part : character.parts()) {
      if (!wearers[part.skin].mesh) wearers[part.skin].mesh = must(scene.addMesh(part.packed));
    }
    while (figures_.size() < ticks) {
      figures_.push_back(must(scene.addFigure(clips)));
      for (std::uint32_t skin = 0; skin < wearers.size(); ++skin) {
        wearers[skin].pose = must(scene.pose(figures_.back(), skin));
        if (figures_.size() == 1) must(recorder_.prepare(wearers[skin]));
        must(scene.addInstance(wearers[skin]));
      }
    }
  }

  std::vector<std::vector<JointMatrix>> poses(std::uint32_t clip) {
    const std::uint32_t ticks = character_->tickCount(clip);
    Scene& scene = recorder_.scene();
    std::deque<std::optional<ClipLayer>> layers;
    std::vector<FigurePlay> plays;
    std::vector<vulkan::BufferRange> ranges;
    std::uint64_t size = 0;
    for (std::uint32_t tick = 0; tick < ticks; ++tick) {
      layers.push_back(character_->layer({clip, tick}));
      plays.push_back({figures_[tick], listOf(layers.back())});
      for (std::uint32_t skin = 0; skin < character_->jointCounts().size(); ++skin) {
        ranges.push_back(must(recorder_.poseRange(must(scene.pose(figures_[tick], skin)))));
        size += ranges.back().size;
      }
    }
    const MappedBuffer copy =
        must(MappedBuffer::create(*open_->device, size, VK_BUFFER_USAGE_TRANSFER_DST_BIT, true));
    const VkCommandBuffer commandBuffer = must(loop_.begin());
    must(scene.beginFrame(loop_.frame(), loop_.completed()));
    must(scene.play(plays));
    must(recorder_.record(commandBuffer));
    open_->context.recordBarrier(commandBuffer, vulkan::barrierBetween(Use::dermis, Use::copyRead));
    std::uint64_t offset = 0;
    for (const vulkan::BufferRange& range : ranges) {
      const VkBufferCopy region{range.offset, offset, range.size};
      open_->device->functions().CmdCopyBuffer(commandBuffer, range.buffer, copy.handle(), 1,
                                               &region);
      offset += range.size;
    }
    open_->context.recordBarrier(commandBuffer,
                                 vulkan::barrierBetween(Use::copyWrite, Use::hostRead));
    must(loop_.submit());
    must(loop_.finish());
    std::vector<std::vector<JointMatrix>> all;
    const std::byte* from = copy.bytes().data();
    for (const vulkan::BufferRange& range : ranges) {
      std::vector<JointMatrix>& pose = all.emplace_back(range.size / sizeof(JointMatrix));
      std::memcpy(pose.data(), from, range.size);
      from += range.size;
    }
    return all;
  }

 private:
  const Character* character_;
  OpenDevice* open_;
  vulkan::SceneRecorder recorder_;
  FrameLoop loop_;  // destroyed first: it waits
  std::vector<FigureHandle> figures_;
};

}  // namespace

TickPoses::TickPoses(const Character& character, const PackedClips& bank) : character_(&character) {
  for (std::uint32_t clip = 0; clip < character.clipCount(); ++clip) {
    std::vector<std::vector<JointMatrix>>& all = poses_.emplace_back();
    for (std::uint32_t tick = 0; tick < character.tickCount(clip); ++tick) {
      const auto layer = character.layer({clip, tick});
      for (std::uint32_t skin = 0; skin < bank.skinCount(); ++skin) {
        std::vector<JointMatrix>& pose = all.emplace_back(bank.jointCount(skin));
        must(samplePose(bank, listOf(layer), skin, pose));
      }
    }
  }
  check(bank);
}

TickPoses::TickPoses(const Character& character, const PackedClips& bank, OpenDevice& open)
    : character_(&character) {
  Sampler sampler(character, bank, open);
  for (std::uint32_t clip = 0; clip < character.clipCount(); ++clip)
    poses_.push_back(sampler.poses(clip));
  check(bank);
}

std::span<const JointMatrix> TickPoses::pose(PoseKey key, std::uint32_t skin) const {
  return poses_[key.clip][key.tick * character_->jointCounts().size() + skin];
}

void TickPoses::check(const PackedClips& bank) {
  const Skeleton skeleton = character_->skeleton();
  const std::vector<ClipView> clips = gltf::clips(character_->model());
  for (std::uint32_t clip = 0; clip < character_->clipCount(); ++clip) {
    for (std::uint32_t tick = 0; tick < character_->tickCount(clip); ++tick) {
      const auto layer = character_->layer({clip, tick});
      for (std::uint32_t skin = 0; skin < bank.skinCount(); ++skin) {
        const std::span<const JointMatrix> sampled = pose({clip, tick}, skin);
        const reference::SampledPose exact =
            must(reference::samplePose(skeleton, clips, {}, listOf(layer), skin, &bank));
        for (std::size_t joint = 0; joint < sampled.size(); ++joint) {
          const auto [atJoint, perDistance] = exact.bounds[joint];
          if (!std::isfinite(atJoint + perDistance))
            continue;  // its inverse bind matrix is singular
          const glm::dmat4 error =
              (matrixOf(sampled[joint].m) - matrixOf(exact.joints[joint])) *
              glm::inverse(matrixOf(skeleton.skins[skin].inverseBind[joint].m));
          for (int axis = 0; axis < 4; ++axis) {
            glm::dvec4 point(0, 0, 0, 1);
            if (axis < 3) point[axis] = 1;
            const double off = glm::length(glm::dvec3(error * point));
            const double bound = atJoint + (axis < 3 ? perDistance : 0);
            if (off > 0) worst_ = std::max(worst_, off / bound);
          }
        }
      }
    }
  }
}

}  // namespace crowd
