// An engine with its own RHI: it executes the frames of a Scene, culling on the GPU included, with
// nothing of dermis::vulkan but the kernels.

#include <algorithm>
#include <array>
#include <cstring>
#include <map>
#include <variant>

#include "abi.h"
#include "buffer.h"
#include "dermis/scene.h"
#include "dermis/vulkan/kernels.h"
#include "system_test.h"

namespace dermis::test {
namespace {

/// Every call of Vulkan that the commands of a scene need.
class Rhi {
 public:
  Rhi(samples::Device& device, const Scene& scene)
      : device_(device), functions_(device.functions()), limits_(scene.description().limits) {
    for (std::size_t index = 0; index < bufferRoleCount; ++index) {
      const auto role = static_cast<BufferRole>(index);
      const BufferRequirement needed = scene.buffer(role);
      // Outputs share one buffer; those of the tables are as large as a plan says.
      if (needed.size == 0 || (role > BufferRole::positions && role < BufferRole::upload)) continue;
      buffers_[role] = must(samples::MappedBuffer::create(device, needed.size, needed.usage));
      std::ranges::fill(buffers_[role].bytes(), std::byte{0xa5});
    }
    createLayouts();
  }

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
    for (const BufferRole role : {BufferRole::tables, BufferRole::upload}) {
      const BufferRequirement needed = plan.buffer(role);
      buffers_[role] = must(samples::MappedBuffer::create(device_, needed.size, needed.usage));
    }
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

  /// The role behind each binding of a kernel.
  static std::array<BufferRole, storageBuffersWanted> rolesOf(const Variant& variant) {
    constexpr BufferRole out = BufferRole::positions, tables = BufferRole::tables;
    if (variant.kernel == Kernel::palette)
      return {tables, BufferRole::poses,  BufferRole::palettes, out, out, out,
              out,    BufferRole::results};
    if (variant.kernel == Kernel::visibility)
      return {tables, BufferRole::visibility, BufferRole::history, BufferRole::counters, out, out,
              out,    BufferRole::results};
    return {tables,
            BufferRole::meshes,
            variant.method == Method::linear ? BufferRole::poses : BufferRole::palettes,
            out,
            out,
            out,
            out,
            BufferRole::results};
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
    const std::array<BufferRole, storageBuffersWanted> roles = rolesOf(dispatch.variant);
    for (std::uint32_t binding = 0; binding < storageBuffersWanted; ++binding) {
      infos[binding] = {handleOf(roles[binding]), 0, VK_WHOLE_SIZE};
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
  VkDescriptorSetLayout setLayout_ = VK_NULL_HANDLE;
  VkPipelineLayout pipelineLayout_ = VK_NULL_HANDLE;
  VkDescriptorPool pool_ = VK_NULL_HANDLE;
  std::map<std::uint64_t, VkPipeline> pipelines_;
  VkCommandBuffer commandBuffer_ = VK_NULL_HANDLE;
};

class SceneCommandsTest : public SystemTest {};

// Half of the instances are culled on the GPU; some are linear; all have motion, some bounds. An
// instance goes and makes room, and another moves there.
TEST_F(SceneCommandsTest, AnEnginesOwnRhiExecutesTheFramesOfAScene) {
  constexpr std::uint32_t count = 24, vertexCount = 150, jointCount = 8;
  SceneDescription description;
  description.meshBudget = 1 << 20;
  description.jointBudget = 1024;
  description.outputBudget = 1 << 20;
  description.instanceBudget = 64;
  description.boundsBudget = 64;
  description.limits = context().limits();
  description.limits.texelBuffers = false;
  Scene scene = must(Scene::create(description));
  Rhi rhi(device(), scene);

  const PackedMesh packed = systemMesh(1, vertexCount, jointCount);
  const MeshHandle mesh = must(scene.addMesh(packed.info()));
  std::ranges::copy(packed.bytes(), rhi.bytes(BufferRole::meshes).begin() +
                                        static_cast<std::ptrdiff_t>(must(scene.meshOffset(mesh))));
  std::vector<PoseHandle> palettes;
  std::vector<InstanceHandle> instances;
  std::vector<InstanceDescription> descriptions;
  for (std::uint32_t index = 0; index < count; ++index) {
    palettes.push_back(must(scene.addPose(jointCount)));
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
  }
  const std::span<std::byte> words = rhi.bytes(BufferRole::visibility);
  const auto isShown = [](std::uint32_t index) { return index % 2 == 1 || index % 8 != 6; };
  std::ranges::fill(words, std::byte{0});
  for (std::uint32_t index = 0; index < count; index += 2) {
    if (isShown(index)) words[must(scene.visibilityIndex(instances[index])) * 4] = std::byte{1};
  }

  Plan plan;
  const auto poseOf = [](std::uint64_t frame, std::uint32_t index) {
    return systemPose(static_cast<std::uint32_t>(frame) * 100 + index * 5);
  };
  const auto runFrame = [&](std::uint64_t frame, bool moves) {
    must(scene.beginFrame(frame, frame - 1));
    if (frame > 1) must(scene.readBack(frame - 1, rhi.bytes(BufferRole::readBack)));
    for (std::uint32_t index = 0; moves && index < count; ++index) {
      const PosePlace place = must(scene.writePose(palettes[index]));
      const Pose pose = poseOf(frame, index);
      ASSERT_EQ(place.jointCount, pose.size());
      std::memcpy(rhi.bytes(BufferRole::poses).data() + place.offset, pose.data(),
                  pose.size() * sizeof(JointMatrix));
    }
    must(scene.plan(plan));
    rhi.run(plan);
    must(scene.commit());
  };
  const auto expectInstances = [&](std::uint64_t frame, std::uint64_t before, std::uint32_t first) {
    for (std::uint32_t index = first; index < count; ++index) {
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
  runFrame(3, false);  // all come to rest
  EXPECT_EQ(scene.settledInstances().size(), count / 2);
  expectInstances(2, 2, 1);
  runFrame(4, false);
  EXPECT_GT(scene.compact(1 << 20), 0u);
  runFrame(5, false);
  EXPECT_GT(scene.movedInstances().size(), 0u);
  expectInstances(2, 2, 1);

  for (std::uint32_t index = 4; index < count; index += 4) {
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
