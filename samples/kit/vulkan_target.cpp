// Batches on a device, and poses of a scene's figures.

#include <algorithm>
#include <cstring>

#include "dermis/scene.h"
#include "dermis/vulkan/scene_recorder.h"
#include "kit/batch_runner.h"
#include "kit/device.h"
#include "kit/program.h"

namespace dermis::samples {
namespace {

constexpr std::array<BufferRole, streamCount> outputRoles{BufferRole::positions,
                                                          BufferRole::normals, BufferRole::tangents,
                                                          BufferRole::previousPositions};

struct Buffers {
  MappedBuffer meshes, poses, tables, palettes, results;
};

Result<Buffers> makeBuffers(Device& device, const Plan& plan) {
  Buffers buffers;
  for (const auto& [buffer, role] : {std::pair{&buffers.meshes, BufferRole::meshes},
                                     {&buffers.poses, BufferRole::poses},
                                     {&buffers.tables, BufferRole::tables},
                                     {&buffers.palettes, BufferRole::palettes},
                                     {&buffers.results, BufferRole::results}}) {
    const BufferRequirement requirement = plan.buffer(role);
    const bool readBack = role == BufferRole::results || role == BufferRole::palettes;
    Result<MappedBuffer> made =
        MappedBuffer::create(device, requirement.size, requirement.usage, readBack);
    if (!made) return made.error();
    *buffer = std::move(*made);
  }
  return buffers;
}

void fill(const BatchLayout& layout, const Buffers& buffers) {
  for (const auto& [mesh, offset] : layout.meshOffsets) {
    std::memcpy(buffers.meshes.bytes().data() + offset, mesh->bytes().data(), mesh->bytes().size());
  }
  for (std::size_t index = 0; index < layout.poses.size(); ++index) {
    std::memcpy(buffers.poses.bytes().data() + layout.poseDescriptions[index].matrixOffset,
                layout.poses[index].data(), layout.poses[index].size_bytes());
  }
}

Result<void> submit(Device& device, const vulkan::Context& context, const Plan& plan,
                    const vulkan::Bindings& bindings) {
  return device.run([&](VkCommandBuffer commandBuffer) {
    context.recordBarrier(commandBuffer, Use::dermis, Use::dermis);
    Result<void> done = context.record(commandBuffer, plan, bindings);
    context.recordBarrier(commandBuffer, Use::dermis, Use::hostRead);
    return done;
  });
}

class VulkanRunner : public BatchRunner {
 public:
  VulkanRunner(Device& device, vulkan::Context& context, const RunOptions& options)
      : BatchRunner(options), device_(device), context_(context) {}

 private:
  Result<BatchResult> skin() override;
  std::span<const std::byte> outputBytes(std::size_t stream) const override {
    return outputs_[stream].bytes();
  }
  Result<void> makeOutputs(const Plan& plan);
  ByStream<vulkan::BufferRange> outputRanges() const;

  Device& device_;
  vulkan::Context& context_;
  std::array<MappedBuffer, streamCount> outputs_;
};

Result<void> VulkanRunner::makeOutputs(const Plan& plan) {
  for (std::size_t stream = 0; stream < (layout_.oneOutput ? 1 : streamCount); ++stream) {
    const BufferRequirement requirement = plan.buffer(outputRoles[stream]);
    if (outputs_[stream].bytes().size() == requirement.size) continue;
    Result<MappedBuffer> made =
        MappedBuffer::create(device_, requirement.size, requirement.usage, true);
    if (!made) return made.error();
    outputs_[stream] = std::move(*made);
    std::ranges::fill(outputs_[stream].bytes(), options_.poison);
  }
  return {};
}

ByStream<vulkan::BufferRange> VulkanRunner::outputRanges() const {
  if (layout_.oneOutput) return ByStream<vulkan::BufferRange>::all(outputs_[0].range());
  return {{outputs_[0].range(), outputs_[1].range(), outputs_[2].range(), outputs_[3].range()}};
}

Result<BatchResult> VulkanRunner::skin() {
  Plan plan;
  if (Result<void> planned = makePlan(layout_.batch(), context_.limits(), options_.tuning, plan);
      !planned)
    return planned.error();
  if (Result<void> ready = context_.prepare(plan.pipelines()); !ready) return ready.error();

  Result<Buffers> buffers = makeBuffers(device_, plan);
  if (!buffers) return buffers.error();
  if (Result<void> made = makeOutputs(plan); !made) return made.error();
  fill(layout_, *buffers);
  if (Result<void> written = writeTables(plan, buffers->tables.bytes()); !written)
    return written.error();
  Result<vulkan::Bindings> bindings = context_.createBindings(
      {buffers->meshes.range(), buffers->poses.range(), buffers->tables.range(),
       buffers->palettes.range(), outputRanges(), buffers->results.range()});
  if (!bindings) return bindings.error();
  if (Result<void> done = submit(device_, context_, plan, *bindings); !done) return done.error();

  BatchResult result;
  result.dispatches = plan.dispatchCount();
  for (std::uint32_t index = 0; index < layout_.jobs.size(); ++index) {
    SkinnedVertices& skinned = result.instances.emplace_back();
    PoseStatus& known = skinned.status.emplace();
    if (const auto status = plan.statusOffset(layout_.jobs[index].pose))
      std::memcpy(&known, buffers->palettes.bytes().data() + *status, sizeof(known));
    if (const auto place = plan.resultOffset(index)) {
      std::memcpy(&skinned.result, buffers->results.bytes().data() + *place,
                  sizeof(skinned.result));
    }
  }
  return result;
}

/// Results with the other tunings must have the same bits as results with the first.
constexpr std::array<Tuning, 4> tunings{{{64, 4}, {8, 1}, {32, 3}, {128, 16}}};

/// A vertex that follows joint 0.
PackedMesh pointMesh() {
  constexpr std::array<float, 3> place{0, 0, 0};
  constexpr float joint = 0, weight = 1;
  const InfluenceSet influences{attributeView(&joint, 1, 1), attributeView(&weight, 1, 1)};
  MeshView mesh;
  mesh.name = "point";
  mesh.vertexCount = 1;
  mesh.positions = attributeView(place.data(), 1, 3);
  mesh.influenceSets = {&influences, 1};
  return must(pack(mesh, 1));
}

/// Adds a figure for each of `plays`. Returns where the device keeps their poses or, if their first
/// poses have a rig, what it drives there.
std::vector<vulkan::BufferRange> addFigures(vulkan::SceneRecorder& recorder,
                                            const PackedClips& bank,
                                            std::span<const std::vector<ClipLayer>> plays,
                                            RigHandle rig = {}) {
  Scene& scene = recorder.scene();
  const ClipsHandle clips = must(scene.addClips(PackedClips(bank)));
  // A pose is sampled when an instance is skinned with it.
  InstanceDescription point;
  point.mesh = must(scene.addMesh(pointMesh()));
  std::vector<RigHandle> rigs(bank.skinCount());
  rigs[0] = rig;
  std::vector<vulkan::BufferRange> ranges;
  for (const std::vector<ClipLayer>& layers : plays) {
    const FigurePlay play{must(scene.addFigure(clips, rigs)), layers};
    must(scene.play({&play, 1}));
    for (std::uint32_t skin = 0; skin < (rig ? 1 : bank.skinCount()); ++skin) {
      point.pose = must(scene.pose(play.figure, skin));
      must(recorder.prepare(point));
      must(scene.addInstance(point));
      ranges.push_back(
          must(rig ? recorder.drivenRange(point.pose) : recorder.poseRange(point.pose)));
    }
  }
  return ranges;
}

/// Skins a frame, and returns what is in each of these buffers after it. Throws `Failure`.
std::vector<std::vector<std::byte>> runFrame(Device& device, const vulkan::Context& context,
                                             vulkan::SceneRecorder& recorder,
                                             std::span<const vulkan::BufferRange> ranges) {
  std::uint64_t size = 0;
  for (const vulkan::BufferRange& range : ranges) size += range.size;
  const MappedBuffer copy =
      must(MappedBuffer::create(device, size, VK_BUFFER_USAGE_TRANSFER_DST_BIT, true));
  must(recorder.scene().beginFrame(1, 0));
  must(device.run([&](VkCommandBuffer commandBuffer) -> Result<void> {
    if (Result<void> recorded = recorder.record(commandBuffer); !recorded) return recorded;
    context.recordBarrier(commandBuffer, Use::dermis, Use::copyRead);
    std::uint64_t offset = 0;
    for (const vulkan::BufferRange& range : ranges) {
      const VkBufferCopy region{range.offset, offset, range.size};
      device.functions().CmdCopyBuffer(commandBuffer, range.buffer, copy.handle(), 1, &region);
      offset += range.size;
    }
    context.recordBarrier(commandBuffer, Use::copyWrite, Use::hostRead);
    return {};
  }));
  std::vector<std::vector<std::byte>> contents;
  const std::byte* from = copy.bytes().data();
  for (const vulkan::BufferRange& range : ranges) {
    contents.emplace_back(from, from + range.size);
    from += range.size;
  }
  return contents;
}

template <typename T>
std::vector<T> arrayOf(std::span<const std::byte> bytes) {
  std::vector<T> array(bytes.size() / sizeof(T));
  if (!array.empty()) std::memcpy(array.data(), bytes.data(), array.size() * sizeof(T));
  return array;
}

/// Throws `Failure`.
std::vector<std::vector<JointMatrix>> sampledPoses(Device& device, const vulkan::Context& context,
                                                   const PackedClips& bank,
                                                   std::span<const std::vector<ClipLayer>> plays) {
  vulkan::SceneRecorder recorder = must(vulkan::SceneRecorder::create(context));
  const std::vector<vulkan::BufferRange> ranges = addFigures(recorder, bank, plays);
  std::vector<std::vector<JointMatrix>> poses;
  for (const std::vector<std::byte>& bytes : runFrame(device, context, recorder, ranges))
    poses.push_back(arrayOf<JointMatrix>(bytes));
  return poses;
}

/// The given weights of a rig that drives nothing. Throws `Failure`.
std::vector<std::vector<float>> sampledWeights(Device& device, const vulkan::Context& context,
                                               const PackedClips& bank,
                                               std::span<const std::vector<ClipLayer>> plays,
                                               std::uint32_t node) {
  const std::vector<RigJoint> joints(bank.jointCount(0));
  RigView rig;
  rig.joints = joints;
  rig.writtenJoints = bank.jointCount(0);
  rig.givenWeights = bank.weightCount(node);
  rig.weightsOf = node;
  vulkan::SceneRecorder recorder = must(vulkan::SceneRecorder::create(context));
  const RigHandle added = must(recorder.scene().addRig(must(packRig(rig))));
  const std::vector<vulkan::BufferRange> ranges = addFigures(recorder, bank, plays, added);
  std::vector<std::vector<float>> weights;
  for (const std::vector<std::byte>& bytes : runFrame(device, context, recorder, ranges))
    weights.push_back(arrayOf<float>(bytes));
  return weights;
}

/// Throws `Failure`.
std::vector<DrivenPose> drivenPoses(Device& device, const vulkan::Context& context,
                                    const PackedRig& rig, std::span<const RigInput> inputs) {
  const std::size_t ofJoints = rig.drivenJoints() * sizeof(JointMatrix);
  // There is no buffer without bytes.
  if (ofJoints == 0 && rig.givenWeights() + rig.drivenWeights() == 0)
    return std::vector<DrivenPose>(inputs.size());
  vulkan::SceneRecorder recorder = must(vulkan::SceneRecorder::create(context));
  Scene& scene = recorder.scene();
  // A rig is evaluated when an instance is skinned with its pose.
  InstanceDescription point;
  point.mesh = must(scene.addMesh(pointMesh()));
  const RigHandle added = must(scene.addRig(PackedRig(rig)));
  std::vector<vulkan::BufferRange> ranges;
  for (const RigInput& input : inputs) {
    point.pose = must(scene.addPose(rig.writtenJoints(), {.rig = added}));
    std::ranges::copy(input.written, must(scene.writePose(point.pose)).begin());
    if (!input.givenWeights.empty())
      std::ranges::copy(input.givenWeights, must(scene.writePoseWeights(point.pose)).begin());
    must(recorder.prepare(point));
    must(scene.addInstance(point));
    ranges.push_back(must(recorder.drivenRange(point.pose)));
  }
  std::vector<DrivenPose> poses;
  for (const std::vector<std::byte>& bytes : runFrame(device, context, recorder, ranges)) {
    const std::span<const std::byte> all(bytes);
    poses.push_back(
        {arrayOf<JointMatrix>(all.first(ofJoints)), arrayOf<float>(all.subspan(ofJoints))});
  }
  return poses;
}

}  // namespace

std::string VulkanTarget::name() const {
  return device_.info().name;
}
DeviceLimits VulkanTarget::limits() const {
  return context_.limits();
}
std::span<const Method> VulkanTarget::methods() const {
  return allMethods;
}
std::vector<Division> VulkanTarget::divisions() const {
  std::vector<Division> all;
  for (const Tuning& tuning : tunings) {
    all.push_back({std::to_string(tuning.workgroupSize) + " invocations, " +
                       std::to_string(tuning.instancesPerInvocation) + " instances each",
                   tuning,
                   {}});
  }
  return all;
}
std::unique_ptr<BatchRunner> VulkanTarget::runner(const RunOptions& options) {
  return std::make_unique<VulkanRunner>(device_, context_, options);
}

Result<std::vector<std::vector<JointMatrix>>> VulkanTarget::samplePoses(
    const PackedClips& bank, std::span<const std::vector<ClipLayer>> plays) {
  try {
    return sampledPoses(device_, context_, bank, plays);
  } catch (const Failure& failure) {
    return failure.error();
  }
}

Result<std::vector<std::vector<float>>> VulkanTarget::sampleWeights(
    const PackedClips& bank, std::span<const std::vector<ClipLayer>> plays, std::uint32_t node) {
  try {
    return sampledWeights(device_, context_, bank, plays, node);
  } catch (const Failure& failure) {
    return failure.error();
  }
}

Result<std::vector<DrivenPose>> VulkanTarget::drivePoses(const PackedRig& rig,
                                                         std::span<const RigInput> inputs) {
  try {
    return drivenPoses(device_, context_, rig, inputs);
  } catch (const Failure& failure) {
    return failure.error();
  }
}

Result<BatchResult> runBatch(Device& device, vulkan::Context& context,
                             std::span<const SkinRequest> requests, const RunOptions& options) {
  return VulkanTarget(device, context).run(requests, options);
}

}  // namespace dermis::samples
