// An engine with its own RHI: it executes the frames of a Scene, culling on the GPU included, with
// nothing of dermis::vulkan but the kernels.

#include <algorithm>
#include <array>
#include <cstring>
#include <map>
#include <variant>

#include "abi.h"
#include "dermis/scene.h"
#include "dermis/vulkan/kernels.h"
#include "kit/buffer.h"
#include "system_test.h"

namespace dermis::test {
namespace {

/// Every call of Vulkan that the commands of a scene need.
class Rhi {
 public:
  Rhi(samples::Device& device, const DeviceLimits& limits)
      : device_(device), functions_(device.functions()), limits_(limits) {
    createLayouts();
  }

  /// Those that a scene has at first.
  void createBuffers(const Scene& scene) {
    for (std::size_t index = 0; index < bufferRoleCount; ++index) {
      const auto role = static_cast<BufferRole>(index);
      const BufferRequirement needed = scene.buffer(role);
      // Outputs share one buffer.
      if (role <= BufferRole::positions || role >= BufferRole::gpuPoses)
        makeRoom(buffers_[role], needed);
    }
    for (std::uint32_t number = 0; number < scene.poseBufferCount(); ++number)
      makeRoom(poses_.emplace_back(), scene.poseBuffer(number).requirement);
  }

  void makeRoom(BufferRole role, const BufferRequirement& needed) {
    makeRoom(buffers_[role], needed);
  }

  GrowthCallback growth() {
    return {this, [](void* user, const BufferGrowth& growth) {
              Rhi& self = *static_cast<Rhi*>(user);
              ++self.growths;
              const bool isPose =
                  growth.role == BufferRole::poses || growth.role == BufferRole::gpuPoses;
              EXPECT_TRUE(!isPose || growth.poseBuffer == self.poses_.size());
              self.makeRoom(isPose ? self.poses_.emplace_back() : self.buffers_[growth.role],
                            growth.requirement);
              return Result<void>();
            }};
  }
  std::uint32_t growths = 0;

  ~Rhi() {
    functions_.DeviceWaitIdle(device_.handle());
    for (const auto& [key, pipeline] : pipelines_)
      functions_.DestroyPipeline(device_.handle(), pipeline, nullptr);
    functions_.DestroyDescriptorPool(device_.handle(), pool_, nullptr);
    functions_.DestroyPipelineLayout(device_.handle(), pipelineLayout_, nullptr);
    functions_.DestroyDescriptorSetLayout(device_.handle(), setLayout_, nullptr);
  }
  Rhi(const Rhi&) = delete;
  Rhi& operator=(const Rhi&) = delete;

  std::span<std::byte> bytes(BufferRole role) { return buffers_.at(role).bytes(); }
  std::byte* poseBytes(const PosePlace& place) {
    return poses_[place.poseBuffer].bytes().data() + place.offset;
  }

  void prepare(const Variant& variant) {
    if (pipelines_.contains(variant.key())) return;
    const std::span<const std::uint32_t> spirv = vulkan::kernelSpirv(variant, limits_);
    VkShaderModuleCreateInfo moduleInfo{};
    moduleInfo.sType = VK_STRUCTURE_TYPE_SHADER_MODULE_CREATE_INFO;
    moduleInfo.codeSize = spirv.size_bytes();
    moduleInfo.pCode = spirv.data();
    VkShaderModule module = VK_NULL_HANDLE;
    check(functions_.CreateShaderModule(device_.handle(), &moduleInfo, nullptr, &module));
    const vulkan::SpecializationConstants constants = vulkan::specializationConstants(variant);
    std::vector<VkSpecializationMapEntry> entries;
    for (std::uint32_t id = 0; id < constants.count; ++id) entries.push_back({id, id * 4, 4});
    const VkSpecializationInfo specialization{
        constants.count, entries.data(), std::size_t{constants.count} * 4, constants.values.data()};
    VkComputePipelineCreateInfo info{};
    info.sType = VK_STRUCTURE_TYPE_COMPUTE_PIPELINE_CREATE_INFO;
    info.stage.sType = VK_STRUCTURE_TYPE_PIPELINE_SHADER_STAGE_CREATE_INFO;
    info.stage.stage = VK_SHADER_STAGE_COMPUTE_BIT;
    info.stage.module = module;
    info.stage.pName = "main";
    info.stage.pSpecializationInfo = &specialization;
    info.layout = pipelineLayout_;
    const auto createPipelines = load<PFN_vkCreateComputePipelines>("vkCreateComputePipelines");
    check(createPipelines(device_.handle(), VK_NULL_HANDLE, 1, &info, nullptr,
                          &pipelines_[variant.key()]));
    functions_.DestroyShaderModule(device_.handle(), module, nullptr);
  }

  /// Writes the tables, executes all commands, and waits.
  void run(const Plan& plan) {
    for (const BufferRole role : {BufferRole::tables, BufferRole::upload, BufferRole::readBack,
                                  BufferRole::history, BufferRole::counters})
      makeRoom(role, plan.buffer(role));
    must(writeTables(plan, bytes(BufferRole::upload)));
    check(load<PFN_vkResetDescriptorPool>("vkResetDescriptorPool")(device_.handle(), pool_, 0));
    const VkCommandBuffer commands = device_.allocateCommandBuffer();
    VkCommandBufferBeginInfo begin{};
    begin.sType = VK_STRUCTURE_TYPE_COMMAND_BUFFER_BEGIN_INFO;
    check(functions_.BeginCommandBuffer(commands, &begin));
    commandBuffer_ = commands;
    for (const Command& command : plan.commands())
      std::visit([this](const auto& one) { record(one); }, command);
    check(functions_.EndCommandBuffer(commands));
    VkSubmitInfo submit{};
    submit.sType = VK_STRUCTURE_TYPE_SUBMIT_INFO;
    submit.commandBufferCount = 1;
    submit.pCommandBuffers = &commands;
    check(functions_.QueueSubmit(device_.queue(), 1, &submit, VK_NULL_HANDLE));
    check(functions_.DeviceWaitIdle(device_.handle()));
    device_.freeCommandBuffer(commands);
  }

 private:
  static void check(VkResult result) {
    if (result != VK_SUCCESS) throw std::runtime_error("Vulkan: " + std::to_string(result));
  }
  template <typename Function>
  Function load(const char* name) const {
    return reinterpret_cast<Function>(functions_.GetDeviceProcAddr(device_.handle(), name));
  }

  /// Nothing runs: a larger buffer gets the old contents at once.
  void makeRoom(samples::MappedBuffer& buffer, const BufferRequirement& needed) {
    if (buffer.bytes().size() >= needed.size) return;
    samples::MappedBuffer larger =
        must(samples::MappedBuffer::create(device_, needed.size, needed.usage));
    std::ranges::fill(larger.bytes(), std::byte{0xa5});
    std::ranges::copy(buffer.bytes(), larger.bytes().begin());
    buffer = std::move(larger);
  }

  // As vulkan/kernels.h says.
  void createLayouts() {
    std::array<VkDescriptorSetLayoutBinding, storageBuffersWanted> bindings{};
    for (std::uint32_t binding = 0; binding < bindings.size(); ++binding) {
      bindings[binding] = {binding, VK_DESCRIPTOR_TYPE_STORAGE_BUFFER, 1,
                           VK_SHADER_STAGE_COMPUTE_BIT, nullptr};
    }
    VkDescriptorSetLayoutCreateInfo setInfo{};
    setInfo.sType = VK_STRUCTURE_TYPE_DESCRIPTOR_SET_LAYOUT_CREATE_INFO;
    setInfo.bindingCount = storageBuffersWanted;
    setInfo.pBindings = bindings.data();
    check(functions_.CreateDescriptorSetLayout(device_.handle(), &setInfo, nullptr, &setLayout_));
    const VkPushConstantRange range{VK_SHADER_STAGE_COMPUTE_BIT, 0,
                                    sizeof(DispatchCommand::constants)};
    VkPipelineLayoutCreateInfo info{};
    info.sType = VK_STRUCTURE_TYPE_PIPELINE_LAYOUT_CREATE_INFO;
    info.setLayoutCount = 1;
    info.pSetLayouts = &setLayout_;
    info.pushConstantRangeCount = 1;
    info.pPushConstantRanges = &range;
    check(functions_.CreatePipelineLayout(device_.handle(), &info, nullptr, &pipelineLayout_));
    const VkDescriptorPoolSize size{VK_DESCRIPTOR_TYPE_STORAGE_BUFFER, 64 * storageBuffersWanted};
    VkDescriptorPoolCreateInfo poolInfo{};
    poolInfo.sType = VK_STRUCTURE_TYPE_DESCRIPTOR_POOL_CREATE_INFO;
    poolInfo.maxSets = 64;
    poolInfo.poolSizeCount = 1;
    poolInfo.pPoolSizes = &size;
    check(functions_.CreateDescriptorPool(device_.handle(), &poolInfo, nullptr, &pool_));
  }

  VkBuffer handleOf(BufferRole role) const { return buffers_.at(role).handle(); }
  VkBuffer handleOf(BufferRole role, const DispatchCommand& dispatch) const {
    const bool isPose = role == BufferRole::poses || role == BufferRole::gpuPoses;
    return isPose ? poses_[dispatch.poseBuffer].handle() : handleOf(role);
  }

  /// The role behind each binding of a kernel.
  static std::array<BufferRole, storageBuffersWanted> rolesOf(const DispatchCommand& dispatch) {
    constexpr BufferRole out = BufferRole::positions, tables = BufferRole::tables;
    const Variant& variant = dispatch.variant;
    if (variant.kernel == Kernel::palette || variant.kernel == Kernel::clear)
      return {tables, dispatch.joints,    BufferRole::palettes, out, out, out,
              out,    BufferRole::results};
    if (variant.kernel == Kernel::visibility)
      return {tables, BufferRole::visibility, BufferRole::history, BufferRole::counters, out, out,
              out,    BufferRole::results};
    return {tables, BufferRole::meshes, dispatch.joints, out, out, out, out, BufferRole::results};
  }

  void record(const DispatchCommand& dispatch) {
    VkDescriptorSetAllocateInfo allocate{};
    allocate.sType = VK_STRUCTURE_TYPE_DESCRIPTOR_SET_ALLOCATE_INFO;
    allocate.descriptorPool = pool_;
    allocate.descriptorSetCount = 1;
    allocate.pSetLayouts = &setLayout_;
    VkDescriptorSet set = VK_NULL_HANDLE;
    check(functions_.AllocateDescriptorSets(device_.handle(), &allocate, &set));
    std::array<VkDescriptorBufferInfo, storageBuffersWanted> infos{};
    std::array<VkWriteDescriptorSet, storageBuffersWanted> writes{};
    const std::array<BufferRole, storageBuffersWanted> roles = rolesOf(dispatch);
    for (std::uint32_t binding = 0; binding < storageBuffersWanted; ++binding) {
      infos[binding] = {handleOf(roles[binding], dispatch), 0, VK_WHOLE_SIZE};
      writes[binding].sType = VK_STRUCTURE_TYPE_WRITE_DESCRIPTOR_SET;
      writes[binding].dstSet = set;
      writes[binding].dstBinding = binding;
      writes[binding].descriptorCount = 1;
      writes[binding].descriptorType = VK_DESCRIPTOR_TYPE_STORAGE_BUFFER;
      writes[binding].pBufferInfo = &infos[binding];
    }
    functions_.UpdateDescriptorSets(device_.handle(), storageBuffersWanted, writes.data(), 0,
                                    nullptr);
    functions_.CmdBindDescriptorSets(commandBuffer_, VK_PIPELINE_BIND_POINT_COMPUTE,
                                     pipelineLayout_, 0, 1, &set, 0, nullptr);
    functions_.CmdBindPipeline(commandBuffer_, VK_PIPELINE_BIND_POINT_COMPUTE,
                               pipelines_.at(dispatch.variant.key()));
    functions_.CmdPushConstants(commandBuffer_, pipelineLayout_, VK_SHADER_STAGE_COMPUTE_BIT, 0,
                                dispatch.constantCount * 4, dispatch.constants.data());
    if (dispatch.indirectOffset) {
      load<PFN_vkCmdDispatchIndirect>("vkCmdDispatchIndirect")(
          commandBuffer_, handleOf(BufferRole::tables), *dispatch.indirectOffset);
    } else {
      load<PFN_vkCmdDispatch>("vkCmdDispatch")(commandBuffer_, dispatch.groupCountX,
                                               dispatch.groupCountY, 1);
    }
  }

  void record(const CopyCommand& copy) {
    const VkBufferCopy region{copy.fromOffset, copy.toOffset, copy.size};
    functions_.CmdCopyBuffer(commandBuffer_, handleOf(copy.from), handleOf(copy.to), 1, &region);
  }

  void record(const ClearCommand& clear) {
    functions_.CmdFillBuffer(commandBuffer_, handleOf(clear.buffer), clear.offset, clear.size, 0);
  }

  void record(const BarrierCommand& barrier) {
    const auto [before, writes] = scopeOf(barrier.before);
    const auto [after, accesses] = scopeOf(barrier.after);
    VkMemoryBarrier memory{};
    memory.sType = VK_STRUCTURE_TYPE_MEMORY_BARRIER;
    memory.srcAccessMask = writes;
    memory.dstAccessMask = accesses;
    functions_.CmdPipelineBarrier(commandBuffer_, before, after, 0, 1, &memory, 0, nullptr, 0,
                                  nullptr);
  }
  static std::pair<VkPipelineStageFlags, VkAccessFlags> scopeOf(Access accesses) {
    VkPipelineStageFlags stages = 0;
    VkAccessFlags flags = 0;
    const auto add = [&](Access one, VkPipelineStageFlags stage, VkAccessFlags flag) {
      if (!includes(accesses, one)) return;
      stages |= stage;
      flags |= flag;
    };
    add(Access::computeRead, VK_PIPELINE_STAGE_COMPUTE_SHADER_BIT, VK_ACCESS_SHADER_READ_BIT);
    add(Access::computeWrite, VK_PIPELINE_STAGE_COMPUTE_SHADER_BIT, VK_ACCESS_SHADER_WRITE_BIT);
    add(Access::copyRead, VK_PIPELINE_STAGE_TRANSFER_BIT, VK_ACCESS_TRANSFER_READ_BIT);
    add(Access::copyWrite, VK_PIPELINE_STAGE_TRANSFER_BIT, VK_ACCESS_TRANSFER_WRITE_BIT);
    add(Access::indirectRead, VK_PIPELINE_STAGE_DRAW_INDIRECT_BIT,
        VK_ACCESS_INDIRECT_COMMAND_READ_BIT);
    add(Access::hostRead, VK_PIPELINE_STAGE_HOST_BIT, VK_ACCESS_HOST_READ_BIT);
    return {stages, flags};
  }

  samples::Device& device_;
  const samples::VulkanFunctions& functions_;
  DeviceLimits limits_;
  std::map<BufferRole, samples::MappedBuffer> buffers_;
  std::vector<samples::MappedBuffer> poses_;
  VkDescriptorSetLayout setLayout_ = VK_NULL_HANDLE;
  VkPipelineLayout pipelineLayout_ = VK_NULL_HANDLE;
  VkDescriptorPool pool_ = VK_NULL_HANDLE;
  std::map<std::uint64_t, VkPipeline> pipelines_;
  VkCommandBuffer commandBuffer_ = VK_NULL_HANDLE;
};

class SceneCommandsTest : public SystemTest {};

// Half of the instances are culled on the GPU; some are linear; all have motion, some bounds; the
// poses of some are the GPU's. An instance goes and makes room, and another moves there. All
// buffers are too small at first, and again when more instances come.
TEST_F(SceneCommandsTest, AnEnginesOwnRhiExecutesTheFramesOfAScene) {
  constexpr std::uint32_t count = 24, lateCount = 60, vertexCount = 150, jointCount = 8;
  SceneDescription description;
  // So little that everything grows, in the frames too.
  description.meshCapacity = {1 << 10};
  description.jointCapacity = {8};
  description.outputCapacity = {1 << 10};
  description.instanceCapacity = {4};
  description.boundsCapacity = {1};
  description.limits = context().limits();
  description.limits.texelBuffers = false;
  Rhi rhi(device(), description.limits);
  description.growth = rhi.growth();
  Scene scene = must(Scene::create(description));
  rhi.createBuffers(scene);

  const PackedMesh packed = systemMesh(1, vertexCount, jointCount);
  const MeshHandle mesh = must(scene.addMesh(packed.info()));
  std::ranges::copy(packed.bytes(), rhi.bytes(BufferRole::meshes).begin() +
                                        static_cast<std::ptrdiff_t>(must(scene.meshOffset(mesh))));
  std::vector<PoseHandle> palettes;
  std::vector<InstanceHandle> instances;
  std::vector<InstanceDescription> descriptions;
  const auto isOfGpu = [](std::uint32_t index) { return index % 5 == 1; };
  const auto add = [&](std::uint32_t index) {
    palettes.push_back(must(
        scene.addPose(jointCount, {.writer = isOfGpu(index) ? PoseWriter::gpu : PoseWriter::cpu})));
    InstanceDescription instance;
    instance.mesh = mesh;
    instance.pose = palettes.back();
    instance.method = index % 3 == 0 ? Method::linear : Method::dualQuaternion;
    instance.layout = motionLayout();
    instance.bounds = index % 4 == 0;
    instance.culledOnGpu = index % 2 == 0;
    for (const Variant& variant :
         must(everyVariant(pipelineNeeds(instance), description.limits, description.tuning)))
      rhi.prepare(variant);
    instances.push_back(must(scene.addInstance(instance)));
    descriptions.push_back(instance);
  };
  for (std::uint32_t index = 0; index < count; ++index) add(index);
  const auto isShown = [](std::uint32_t index) { return index % 2 == 1 || index % 8 != 6; };
  const auto writeWords = [&] {
    rhi.makeRoom(BufferRole::visibility, scene.buffer(BufferRole::visibility));
    const std::span<std::byte> words = rhi.bytes(BufferRole::visibility);
    std::ranges::fill(words, std::byte{0});
    for (std::uint32_t index = 0; index < instances.size(); index += 2) {
      const Result<std::uint32_t> word = scene.visibilityIndex(instances[index]);
      if (word && isShown(index)) words[*word * 4] = std::byte{1};
    }
  };
  writeWords();

  Plan plan;
  const auto poseOf = [](std::uint64_t frame, std::uint32_t index) {
    return systemPose(static_cast<std::uint32_t>(frame) * 100 + index * 5);
  };
  const auto writePose = [&](const PosePlace& place, const Pose& pose) {
    ASSERT_EQ(place.jointCount, pose.size());
    std::memcpy(rhi.poseBytes(place), pose.data(), pose.size() * sizeof(JointMatrix));
  };
  const auto runFrame = [&](std::uint64_t frame, bool moves) {
    must(scene.beginFrame(frame, frame - 1));
    if (frame > 1) must(scene.readBack(frame - 1, rhi.bytes(BufferRole::readBack)));
    for (std::uint32_t index = 0; moves && index < count; ++index) {
      if (isOfGpu(index)) must(scene.markWritten({&palettes[index], 1}));
      const PosePlace place = must(isOfGpu(index) ? scene.posePlace(palettes[index])
                                                  : scene.writePose(palettes[index]));
      writePose(place, poseOf(frame, index));
    }
    must(scene.plan(plan));
    rhi.run(plan);
    must(scene.commit());
  };
  const auto expectInstances = [&](std::uint64_t frame, std::uint64_t before, std::uint32_t first) {
    for (std::uint32_t index = first; index < instances.size(); ++index) {
      SCOPED_TRACE(index);
      const InstanceOutput output = must(scene.output(instances[index]));
      const std::array<OutputAttribute, streamCount> attributes = attributesOf(output);
      Streams streams;
      for (std::size_t stream = 0; stream < streamCount; ++stream) {
        streams[stream] =
            readAttribute(rhi.bytes(BufferRole::positions), attributes[stream], vertexCount);
      }
      if (!isShown(index)) {
        EXPECT_TRUE(std::ranges::all_of(streams[positionStream],
                                        [](std::byte byte) { return byte == std::byte{0xa5}; }));
        continue;
      }
      expectSkinned(streams, alone(packed, poseOf(frame, index), descriptions[index]));
      EXPECT_TRUE(streams[previousStream] ==
                  alone(packed, poseOf(before, index), descriptions[index])[positionStream]);
    }
  };

  runFrame(1, true);
  EXPECT_EQ(scene.statistics().lastFrame.skinnedInstances, count / 2);
  EXPECT_EQ(scene.statistics().lastFrame.culledCandidates, count / 2);
  expectInstances(1, 1, 0);
  runFrame(2, true);
  expectInstances(2, 1, 0);
  EXPECT_EQ(scene.statistics().lastCompletedFrame.frame, 1u);
  EXPECT_EQ(scene.statistics().lastCompletedFrame.skinnedInstances, count / 2 - 3);

  must(scene.removeInstance(instances[0]));
  const std::uint32_t growths = rhi.growths;
  for (std::uint32_t index = count; index < count + lateCount; ++index) {
    add(index);
    writePose(must(scene.posePlace(palettes[index])), poseOf(2, index));
  }
  EXPECT_GE(rhi.growths, growths + 5) << "outputs, palettes, results, and poses of both kinds";
  writeWords();
  runFrame(3, false);  // all come to rest, but for the new ones
  EXPECT_EQ(scene.settledInstances().size(), count / 2);
  expectInstances(2, 2, 1);
  runFrame(4, false);
  EXPECT_GT(scene.compact(1 << 20), 0u);
  runFrame(5, false);
  EXPECT_GT(scene.movedInstances().size(), 0u);
  expectInstances(2, 2, 1);

  for (std::uint32_t index = 4; index < instances.size(); index += 4) {
    const std::optional<Box> box = must(scene.bounds(instances[index]));
    ASSERT_EQ(box.has_value(), isShown(index)) << index;
  }
  must(scene.beginFrame(6, 5));
  must(scene.plan(plan));
  EXPECT_EQ(plan.dispatchCount(), 2u + 4u)
      << "what the GPU chooses, by two methods, with and without bounds, and nothing else";
}

TEST_F(SceneCommandsTest, TheContextRefusesThePlanOfAScene) {
  SceneDescription description;
  description.limits = context().limits();
  Scene scene = must(Scene::create(description));
  must(scene.beginFrame(1, 0));
  Plan plan;
  must(scene.plan(plan));
  const vulkan::Bindings bindings = must(context().createBindings({}));
  const Result<void> recorded = context().record(VK_NULL_HANDLE, plan, bindings);
  ASSERT_FALSE(recorded.ok());
  EXPECT_EQ(recorded.error().code, ErrorCode::invalidArgument);
  EXPECT_NE(recorded.error().message.find("scene"), std::string::npos);
}

}  // namespace
}  // namespace dermis::test
