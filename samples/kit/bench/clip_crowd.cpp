#include "kit/bench/clip_crowd.h"

#include <algorithm>
#include <array>
#include <chrono>
#include <cstddef>
#include <functional>
#include <span>
#include <string>
#include <utility>
#include <vector>

#include "dermis/clips.h"
#include "dermis/cpu.h"
#include "dermis/scene.h"
#include "dermis/verify.h"
#include "dermis/vulkan/scene_recorder.h"
#include "kit/bench/clip_pair.h"
#include "kit/buffer.h"
#include "kit/in_parallel.h"
#include "kit/program.h"
#include "kit/timestamps.h"

namespace dermis::samples {
namespace {

/// The reference takes long.
constexpr std::size_t comparedInstances = 3;

class PlayingCrowd : public ClipCrowd {
 public:
  Result<void> check() override {
    const std::size_t count = std::min(comparedInstances, instances_.size());
    for (std::size_t i = 0; i < count; ++i) {
      const std::size_t instance =
          i * (instances_.size() - 1) / std::max<std::size_t>(count - 1, 1);
      if (Result<void> same = checkInstance(static_cast<std::uint32_t>(instance)); !same)
        return same;
    }
    return {};
  }

 protected:
  explicit PlayingCrowd(const Crowd& crowd) : crowd_(crowd) {}

  SceneDescription sceneDescription() const {
    const std::uint64_t count = crowd_.instanceCount();
    SceneDescription description;
    description.instanceCapacity.initial = count;
    description.boundsCapacity = Capacity::fixed(0);
    description.outputCapacity.initial = count * (std::uint64_t{24} * crowd_.vertexCount() + 256);
    return description;
  }

  /// `prepare` is called once. Throws `Failure`.
  void fill(Scene& scene, const std::function<Result<void>(const InstanceDescription&)>& prepare) {
    scene_ = &scene;
    const ClipsHandle clips = must(scene.addClips(PackedClips(*crowd_.clips)));
    InstanceDescription instance;
    instance.mesh = must(scene.addMesh(PackedMesh(*crowd_.mesh)));
    instance.layout.normals = VertexFormat::float32x3;
    for (std::uint32_t i = 0; i < crowd_.instanceCount(); ++i) {
      figures_.push_back(must(scene.addFigure(clips)));
      instance.pose = must(scene.pose(figures_.back()));
      if (i == 0) must(prepare(instance));
      instances_.push_back(must(scene.addInstance(instance)));
    }
  }

  /// Begins a frame in which all figures play on.
  Result<void> beginFrame() {
    ++frame_;
    if (Result<void> begun = scene_->beginFrame(frame_, frame_ - 1); !begun) return begun;
    layers_.resize(figures_.size());
    plays_.clear();
    for (std::uint32_t i = 0; i < figures_.size(); ++i) {
      layers_[i] = layersOf(i);
      plays_.push_back({figures_[i], layers_[i]});
    }
    return scene_->play(plays_);
  }

  /// The bytes of an instance in the output of the last frame.
  virtual Result<std::vector<std::byte>> read(const InstanceOutput& output) = 0;

 private:
  std::array<ClipLayer, 2> layersOf(std::uint32_t figure) const {
    return clipPair(crowd_.clips->clipCount(), figure, static_cast<double>(frame_) / 60);
  }

  Result<void> checkInstance(std::uint32_t number) {
    std::vector<JointMatrix> pose(crowd_.clips->jointCount(0));
    if (Result<void> sampled = samplePose(*crowd_.clips, layersOf(number), 0, pose); !sampled)
      return sampled;
    const PlainMesh mesh(crowd_.vertices);
    Result<reference::SkinnedMesh> expected =
        reference::skin(mesh.view(), pose, Method::dualQuaternion);
    if (!expected) return expected.error();
    // The bounds are for the same joint matrices. Those of a device differ by roundings: fitted,
    // and generous, to find a wrong clip, time or weight.
    for (reference::VertexBounds& bounds : expected->bounds) {
      bounds.position = 16 * bounds.position + 1e-4 * bounds.scale;
      if (bounds.normal >= 0) bounds.normal = 16 * bounds.normal + 1e-4;
    }
    const Result<InstanceOutput> output = scene_->output(instances_[number]);
    if (!output) return output.error();
    const Result<std::vector<std::byte>> bytes = read(*output);
    if (!bytes) return bytes.error();
    const auto attribute = [&](Stream stream) {
      const OutputAttribute& place = output->places[stream];
      return SkinnedAttribute{bytes->data() + (place.offset - output->offset), crowd_.vertexCount(),
                              place.stride, place.format};
    };
    const Result<Comparison> compared =
        compareWithReference(*expected, {attribute(Stream::positions), attribute(Stream::normals)},
                             exemptionsOf(*expected));
    if (!compared) return compared.error();
    if (compared->passed()) return {};
    return Error{ErrorCode::invalidData,
                 "clips: vertex " + std::to_string(compared->firstFailure) + " of instance " +
                     std::to_string(number) + " and " + std::to_string(compared->failures - 1) +
                     " others differ from the reference by more than is allowed"};
  }

  const Crowd& crowd_;
  Scene* scene_ = nullptr;
  std::vector<FigureHandle> figures_;
  std::vector<InstanceHandle> instances_;
  std::vector<std::array<ClipLayer, 2>> layers_;  ///< of the last frame, by figure
  std::vector<FigurePlay> plays_;
  std::uint64_t frame_ = 0;
};

class DeviceClipCrowd : public PlayingCrowd {
 public:
  /// Throws `Failure`.
  DeviceClipCrowd(OpenDevice& open, const Crowd& crowd)
      : PlayingCrowd(crowd),
        open_(open),
        recorder_(must(vulkan::SceneRecorder::create(open.context, recorderDescription()))),
        timestamps_(must(Timestamps::create(*open.device))) {
    fill(recorder_.scene(), [this](const auto& instance) { return recorder_.prepare(instance); });
  }

  Result<double> skin(std::uint32_t) override {
    if (Result<void> begun = beginFrame(); !begun) return begun.error();
    const VkCommandBuffer commandBuffer = open_.device->allocateCommandBuffer();
    const Result<void> recorded = record(commandBuffer);
    const Result<double> seconds =
        recorded ? timestamps_.measure(commandBuffer) : Result<double>(recorded.error());
    open_.device->freeCommandBuffer(commandBuffer);
    return seconds;
  }

 private:
  vulkan::SceneRecorderDescription recorderDescription() const {
    vulkan::SceneRecorderDescription description;
    description.scene = sceneDescription();
    return description;
  }

  /// A frame begins with a barrier after the one before, so its commands may be executed again.
  Result<void> record(VkCommandBuffer commandBuffer) {
    VkCommandBufferBeginInfo begin{};
    begin.sType = VK_STRUCTURE_TYPE_COMMAND_BUFFER_BEGIN_INFO;
    begin.flags = VK_COMMAND_BUFFER_USAGE_SIMULTANEOUS_USE_BIT;
    open_.device->functions().BeginCommandBuffer(commandBuffer, &begin);
    recordBarrier(*open_.device, commandBuffer, Use::dermis, Use::dermis);
    timestamps_.recordBegin(commandBuffer);
    Result<void> done = recorder_.record(commandBuffer);
    timestamps_.recordEnd(commandBuffer);
    open_.device->functions().EndCommandBuffer(commandBuffer);
    return done;
  }

  Result<std::vector<std::byte>> read(const InstanceOutput& output) override {
    Device& device = *open_.device;
    const Result<MappedBuffer> copy =
        MappedBuffer::create(device, output.places.size, VK_BUFFER_USAGE_TRANSFER_DST_BIT, true);
    if (!copy) return copy.error();
    const Result<void> done = device.run([&](VkCommandBuffer commandBuffer) -> Result<void> {
      recordBarrier(device, commandBuffer, Use::dermis, Use::copyRead);
      const VkBufferCopy all{output.offset, 0, output.places.size};
      device.functions().CmdCopyBuffer(commandBuffer, recorder_.outputBuffer(), copy->handle(), 1,
                                       &all);
      recordBarrier(device, commandBuffer, Use::copyWrite, Use::hostRead);
      return {};
    });
    if (!done) return done.error();
    return std::vector<std::byte>(copy->bytes().begin(), copy->bytes().end());
  }

  OpenDevice& open_;
  vulkan::SceneRecorder recorder_;
  Timestamps timestamps_;
};

class CpuClipCrowd : public PlayingCrowd {
 public:
  /// Throws `Failure`.
  explicit CpuClipCrowd(const Crowd& crowd)
      : PlayingCrowd(crowd), runner_(must(cpu::SceneRunner::create(sceneDescription()))) {
    fill(runner_.scene(), [](const auto&) { return Result<void>(); });
  }

  Result<double> skin(std::uint32_t threads) override {
    const auto begin = std::chrono::steady_clock::now();
    if (Result<void> begun = beginFrame(); !begun) return begun.error();
    const Result<std::span<const cpu::PlannedJob>> jobs = runner_.jobs();
    if (!jobs) return jobs.error();
    inParallel(
        jobs->size(), [&](std::size_t job) { cpu::run((*jobs)[job]); }, threads);
    return std::chrono::duration<double>(std::chrono::steady_clock::now() - begin).count();
  }

 private:
  Result<std::vector<std::byte>> read(const InstanceOutput& output) override {
    const std::span<const std::byte> bytes = runner_.output().subspan(
        static_cast<std::size_t>(output.offset), static_cast<std::size_t>(output.places.size));
    return std::vector<std::byte>(bytes.begin(), bytes.end());
  }

  cpu::SceneRunner runner_;
};

template <typename Made, typename... Arguments>
Result<std::unique_ptr<ClipCrowd>> makeClipCrowd(Arguments&... arguments) {
  try {
    return std::unique_ptr<ClipCrowd>(std::make_unique<Made>(arguments...));
  } catch (const Failure& failure) {
    return failure.error();
  }
}

}  // namespace

Result<std::unique_ptr<ClipCrowd>> ClipCrowd::onDevice(OpenDevice& open, const Crowd& crowd) {
  return makeClipCrowd<DeviceClipCrowd>(open, crowd);
}

Result<std::unique_ptr<ClipCrowd>> ClipCrowd::onCpu(const Crowd& crowd) {
  return makeClipCrowd<CpuClipCrowd>(crowd);
}

}  // namespace dermis::samples
