#include "crowd.h"

#include <algorithm>
#include <chrono>
#include <cstring>
#include <utility>

#include "frames.h"
#include "in_parallel.h"
#include "kit/barrier.h"

using namespace dermis;

namespace crowd {
namespace {

/// Maximum bytes that `compact` moves in a frame, so that no frame moves many.
constexpr std::uint64_t mostMovedBytes = std::uint64_t{1} << 20;

VertexLayout layoutOf(const Part& part) {
  VertexLayout layout;
  layout.positions = VertexFormat::float32x3;
  if (part.packed.info().hasNormals) layout.normals = VertexFormat::octahedral16x2;
  layout.motion = Motion::kept;  // for motion vectors
  return layout;
}

/// Memory of removed objects is free only once the GPU has finished with it, so there is room for a
/// quarter more.
std::uint64_t withSlack(std::uint64_t count) {
  return count + count / 4 + 64;
}

vulkan::SkinningSystemDescription capacities(const Character& character, std::uint32_t figures,
                                             const CrowdOptions& options) {
  vulkan::SkinningSystemDescription capacity;
  capacity.meshCapacity.initial = 0;
  std::uint64_t joints = 0, outputBytes = 0;
  for (const std::uint32_t count : character.jointCounts()) joints += count;
  for (const Part& part : character.parts()) {
    const MeshInfo mesh = part.packed.info();
    const VertexLayout layout = layoutOf(part);
    capacity.meshCapacity.initial += mesh.byteSize;
    outputBytes += mesh.vertexCount *
                   std::uint64_t{2 * formatSize(layout.positions) + formatSize(layout.normals)};
  }
  const std::uint64_t parts = character.parts().size();
  capacity.jointCapacity.initial = withSlack(figures * joints + parts * joints);
  capacity.instanceCapacity.initial = withSlack(figures * parts + parts);
  capacity.outputCapacity.initial = withSlack((figures + 1) * outputBytes);
  if (options.outputBudget != 0) capacity.outputCapacity = Capacity::fixed(options.outputBudget);
  return capacity;
}

}  // namespace

// [crowd-set-up]
Result<Crowd> Crowd::create(samples::Device& device, vulkan::Context& context,
                            const Character& character, const Figures& script,
                            const CrowdOptions& options) {
  // Capacities in bytes, joints and instances, so that nothing has to grow later.
  vulkan::SkinningSystemDescription description = capacities(character, script.count(), options);
  description.context = &context;
  description.framesInFlight = options.framesInFlight;
  description.measuresGpuTime = options.measuresGpuTime;
  description.tuning = context.tuning();
  Result<vulkan::SkinningSystem> system = vulkan::SkinningSystem::create(description);
  if (!system) return system.error();

  Crowd crowd(&device, character, script, options, CrowdSystem(std::move(*system)));
  for (const Part& part : character.parts()) {
    Result<MeshHandle> mesh = crowd.system_.addMesh(part.packed);
    if (!mesh) return mesh.error();
    crowd.meshes_.push_back(*mesh);
    const PipelineNeeds needs = pipelineNeeds(crowd.describe(part));
    if (Result<void> built = crowd.system_.onDevice()->prepare(needs); !built) return built.error();
  }
  return crowd;
}
// [/crowd-set-up]

InstanceDescription Crowd::describe(const Part& part) const {
  InstanceDescription description;
  description.method = method;
  description.layout = layoutOf(part);
  description.culledOnGpu = options_.culledOnGpu;
  return description;
}

// [crowd-add]
/// A figure has a pose for each skin, and an instance of each mesh: body, hair, clothes.
Result<void> Crowd::add(CrowdFigure& figure) {
  for (const std::uint32_t jointCount : character_->jointCounts()) {
    Result<PoseHandle> pose = system_.addPose(jointCount);
    if (!pose) return pose.error();
    figure.poses.push_back(*pose);
  }
  for (std::size_t index = 0; index < meshes_.size(); ++index) {
    const Part& part = character_->parts()[index];
    InstanceDescription description = describe(part);
    description.mesh = meshes_[index];
    description.pose = figure.poses[part.skin];
    Result<InstanceHandle> instance = system_.addInstance(description);
    if (!instance) return instance.error();
    figure.instances.push_back(*instance);
  }
  return {};
}

/// May be called at any time: vertices of frames in flight stay valid until those frames complete.
Result<void> Crowd::remove(CrowdFigure& figure) {
  for (const InstanceHandle instance : std::exchange(figure.instances, {})) {
    if (Result<void> removed = system_.removeInstance(instance); !removed) return removed;
  }
  for (const PoseHandle pose : std::exchange(figure.poses, {})) {
    if (Result<void> removed = system_.removePose(pose); !removed) return removed;
  }
  return {};
}
// [/crowd-add]

Result<void> Crowd::comeAndGo(std::uint64_t frame) {
  bool hasGaps = false;
  for (std::uint32_t index = 0; index < script_->count(); ++index) {
    CrowdFigure& figure = figures_[index];
    figure.now = script_->at(index, frame);
    if (!figure.isThere() || figure.now.isPresent) continue;
    if (Result<void> removed = remove(figure); !removed) return removed;
    hasGaps = true;
  }
  for (CrowdFigure& figure : figures_) {
    if (figure.isThere() || !figure.now.isPresent) continue;
    Result<void> added = add(figure);
    if (added) continue;
    if (Result<void> removed = remove(figure); !removed) return removed;
    if (added.error().code != ErrorCode::limitExceeded) return added;
    ++refusals_;  // it is added when others have been removed
    break;
  }
  if (hasGaps) system_.compact(mostMovedBytes);
  return {};
}

// [crowd-frame]
Result<void> Crowd::skinFrame(std::uint64_t frame, std::uint64_t completedFrame,
                              VkCommandBuffer commandBuffer) {
  vulkan::SkinningSystem& system = *system_.onDevice();
  if (Result<void> begun = system.beginFrame(frame, completedFrame); !begun) return begun;
  if (Result<void> done = moveAll(frame); !done) return done;
  vulkan::FrameDescription description;
  if (options_.culledOnGpu) {
    Result<VkBuffer> visibility = writeVisibility(frame);
    if (!visibility) return visibility.error();
    description.visibility = *visibility;
  }

  // The check copies the vertices. To draw them, use vertexInput in both barriers.
  recordBarrier(*device_, commandBuffer, vulkan::inputScope(vulkan::PreviousUse::transfer));
  if (Result<void> done = system.record(commandBuffer, description); !done) return done;
  recordBarrier(*device_, commandBuffer, vulkan::outputScope(vulkan::Consumer::transfer));
  return {};
}

Result<void> Crowd::moveAll(std::uint64_t frame) {
  if (Result<void> done = comeAndGo(frame); !done) return done;
  for (const CrowdFigure& figure : figures_) {
    if (!figure.isThere()) continue;
    if (Result<void> done = move(figure); !done) return done;
  }
  return {};
}

Result<void> Crowd::move(const CrowdFigure& figure) {
  const FigureFrame& now = figure.now;
  // If the CPU culls, a figure that is out of view need not be animated.
  const bool isAnimated = now.isInView || options_.culledOnGpu;
  for (std::uint32_t skin = 0; isAnimated && skin < figure.poses.size(); ++skin) {
    const Result<std::span<JointMatrix>> pose = system_.writePose(figure.poses[skin]);
    if (!pose) return pose.error();
    std::ranges::copy(character_->pose(now.pose, skin), pose->begin());
  }
  for (const InstanceHandle instance : figure.instances) {
    InstanceChange change;
    change.instance = instance;
    change.updateInterval = now.updateInterval;
    if (!options_.culledOnGpu) change.visible = now.isInView;
    change.teleports = now.teleports;
    if (Result<void> done = system_.change(change); !done) return done;
  }
  return {};
}
// [/crowd-frame]

Result<Crowd> Crowd::createOnCpu(const Character& character, const Figures& script,
                                 const CrowdOptions& options) {
  const vulkan::SkinningSystemDescription most = capacities(character, script.count(), options);
  cpu::SkinningSystemDescription description;
  description.jointCapacity = most.jointCapacity;
  description.instanceCapacity = most.instanceCapacity;
  description.outputCapacity = most.outputCapacity;
  Result<cpu::SkinningSystem> system = cpu::SkinningSystem::create(description);
  if (!system) return system.error();
  Crowd crowd(nullptr, character, script, options, CrowdSystem(std::move(*system)));
  for (const Part& part : character.parts()) {
    Result<MeshHandle> mesh = crowd.system_.addMesh(part.packed);
    if (!mesh) return mesh.error();
    crowd.meshes_.push_back(*mesh);
  }
  return crowd;
}

Result<void> Crowd::skinOnCpu(std::uint64_t frame) {
  using Clock = std::chrono::steady_clock;
  cpu::SkinningSystem& system = *system_.onCpu();
  system.beginFrame();
  if (Result<void> done = moveAll(frame); !done) return done;
  const auto begin = Clock::now();
  const Result<std::span<const cpu::PlannedJob>> jobs = system.jobs();
  if (!jobs) return jobs.error();
  const auto planned = Clock::now();
  inParallel(jobs->size(), [&](std::size_t index) { cpu::skin((*jobs)[index]); });
  planSeconds_ = std::chrono::duration<double>(planned - begin).count();
  jobSeconds_ = std::chrono::duration<double>(Clock::now() - planned).count();
  return {};
}

vulkan::SystemStatistics Crowd::statistics() const {
  if (system_.onDevice() != nullptr) return system_.onDevice()->statistics();
  const SceneStatistics scene = system_.onCpu()->statistics();
  vulkan::SystemStatistics all;
  static_cast<FrameWorkStatistics&>(all.lastFrame) = scene.lastFrame;
  all.lastFrame.planSeconds = planSeconds_;
  all.lastCompletedFrame.frame = scene.lastFrame.frame;
  all.lastCompletedFrame.seconds = jobSeconds_;
  all.meshes = scene.meshes;
  all.palettes = scene.palettes;
  all.outputs = scene.outputs;
  return all;
}

/// Writes a word for each instance. Here the CPU writes to mapped memory before the submission,
/// which needs no barrier.
Result<VkBuffer> Crowd::writeVisibility(std::uint64_t frame) {
  visibility_.resize(options_.framesInFlight);
  samples::MappedBuffer& buffer = visibility_[frame % options_.framesInFlight];
  if (buffer.handle() == VK_NULL_HANDLE) {
    Result<samples::MappedBuffer> made = samples::MappedBuffer::create(
        *device_, std::uint64_t{system_.onDevice()->visibilityCount()} * 4,
        VK_BUFFER_USAGE_STORAGE_BUFFER_BIT);
    if (!made) return made.error();
    buffer = std::move(*made);
  }
  for (const CrowdFigure& figure : figures_) {
    const std::uint32_t word = figure.now.isInView ? 1 : 0;
    for (const InstanceHandle instance : figure.instances) {
      const Result<std::uint32_t> index = system_.onDevice()->visibilityIndex(instance);
      if (!index) return index.error();
      std::memcpy(buffer.bytes().data() + std::size_t{*index} * 4, &word, 4);
    }
  }
  return buffer.handle();
}

}  // namespace crowd
