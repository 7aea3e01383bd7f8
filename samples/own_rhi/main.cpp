// An engine with its own rendering hardware interface (RHI): it executes the commands of a
// scene, and creates all objects and buffers itself. Of dermis::vulkan it uses the kernels only.
// Half of the figures are culled on the GPU. At the end it checks every vertex and every box.
//
//   dermis_own_rhi
//
// Exit status: 0 success; 4 no Vulkan device, or a Vulkan call failed; 1 any other error.

#include <vulkan/vulkan.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <map>
#include <type_traits>
#include <variant>
#include <vector>

#include "dermis/mesh.h"
#include "dermis/scene.h"
#include "dermis/verify.h"
#include "dermis/vulkan/context.h"

using namespace dermis;

constexpr std::uint32_t figureCount = 10, vertexCount = 200, frameCount = 5;

/// Returns the value, or ends the program if there is none.
template <typename T>
T must(Result<T> result) {
  if (!result) std::exit((std::printf("%s\n", result.error().message.c_str()), 1));
  if constexpr (!std::is_void_v<T>) return *std::move(result);
}
void must(VkResult result) {
  if (result != VK_SUCCESS) std::exit((std::printf("VkResult %d\n", result), 4));
}

/// Returns a Vulkan structure with sType set and all other members zero.
template <typename T>
T structure(VkStructureType type) {
  T made{};
  made.sType = type;
  return made;
}

template <typename... Functions>
struct Overloaded : Functions... {
  using Functions::operator()...;
};
template <typename... Calls>
Overloaded(Calls...) -> Overloaded<Calls...>;  // for Clang before 17

// -- The RHI. A real one would not map all buffers, nor wait for each frame.

class Rhi {
 public:
  struct Buffer {
    VkBuffer buffer = VK_NULL_HANDLE;
    VkDeviceMemory memory = VK_NULL_HANDLE;
    std::byte* mapped = nullptr;
    VkDeviceSize size = 0;
  };

  Rhi();
  DeviceLimits limits() const;
  Buffer createBuffer(VkDeviceSize size, VkBufferUsageFlags usage);
  void destroy(const Buffer& buffer);
  VkPipeline build(const vulkan::PipelineDescription& description);
  void begin();
  void submit();
  VkDescriptorSet allocateSet();
  void write(VkDescriptorSet set, std::uint32_t slot, const VkDescriptorBufferInfo& part);

  VkInstance instance = VK_NULL_HANDLE;
  VkPhysicalDevice physicalDevice = VK_NULL_HANDLE;
  VkDevice device = VK_NULL_HANDLE;
  VkQueue queue = VK_NULL_HANDLE;
  VkCommandBuffer commandBuffer = VK_NULL_HANDLE;
  VkDescriptorSetLayout setLayout = VK_NULL_HANDLE;
  VkPipelineLayout layout = VK_NULL_HANDLE;
  VkDescriptorPool pool = VK_NULL_HANDLE;
};

Rhi::Rhi() {
  auto application = structure<VkApplicationInfo>(VK_STRUCTURE_TYPE_APPLICATION_INFO);
  application.apiVersion = VK_API_VERSION_1_1;
  auto instanceInfo = structure<VkInstanceCreateInfo>(VK_STRUCTURE_TYPE_INSTANCE_CREATE_INFO);
  instanceInfo.pApplicationInfo = &application;
  must(vkCreateInstance(&instanceInfo, nullptr, &instance));
  std::uint32_t one = 1;  // the first device, and its first queue family
  vkEnumeratePhysicalDevices(instance, &one, &physicalDevice);
  if (one == 0) must(VK_ERROR_INITIALIZATION_FAILED);
  const float priority = 1;
  auto queueInfo = structure<VkDeviceQueueCreateInfo>(VK_STRUCTURE_TYPE_DEVICE_QUEUE_CREATE_INFO);
  queueInfo.queueCount = 1;
  queueInfo.pQueuePriorities = &priority;
  auto deviceInfo = structure<VkDeviceCreateInfo>(VK_STRUCTURE_TYPE_DEVICE_CREATE_INFO);
  deviceInfo.queueCreateInfoCount = 1;
  deviceInfo.pQueueCreateInfos = &queueInfo;
  must(vkCreateDevice(physicalDevice, &deviceInfo, nullptr, &device));
  vkGetDeviceQueue(device, 0, 0, &queue);
  auto poolInfo = structure<VkCommandPoolCreateInfo>(VK_STRUCTURE_TYPE_COMMAND_POOL_CREATE_INFO);
  poolInfo.flags = VK_COMMAND_POOL_CREATE_RESET_COMMAND_BUFFER_BIT;
  VkCommandPool commands = VK_NULL_HANDLE;
  must(vkCreateCommandPool(device, &poolInfo, nullptr, &commands));
  auto commandInfo =
      structure<VkCommandBufferAllocateInfo>(VK_STRUCTURE_TYPE_COMMAND_BUFFER_ALLOCATE_INFO);
  commandInfo.commandPool = commands;
  commandInfo.commandBufferCount = 1;
  must(vkAllocateCommandBuffers(device, &commandInfo, &commandBuffer));

  // [layout]
  // Shared by all pipelines (`PipelineDescription`): storage buffers in set 0, and push constants.
  std::array<VkDescriptorSetLayoutBinding, storageBuffersWanted> slots{};
  for (std::uint32_t slot = 0; slot < slots.size(); ++slot)
    slots[slot] = {slot, VK_DESCRIPTOR_TYPE_STORAGE_BUFFER, 1, VK_SHADER_STAGE_COMPUTE_BIT,
                   nullptr};
  auto setInfo = structure<VkDescriptorSetLayoutCreateInfo>(
      VK_STRUCTURE_TYPE_DESCRIPTOR_SET_LAYOUT_CREATE_INFO);
  setInfo.bindingCount = storageBuffersWanted;
  setInfo.pBindings = slots.data();
  must(vkCreateDescriptorSetLayout(device, &setInfo, nullptr, &setLayout));
  const VkPushConstantRange constants{VK_SHADER_STAGE_COMPUTE_BIT, 0,
                                      sizeof(DispatchCommand::constants)};
  auto layoutInfo =
      structure<VkPipelineLayoutCreateInfo>(VK_STRUCTURE_TYPE_PIPELINE_LAYOUT_CREATE_INFO);
  layoutInfo.setLayoutCount = 1;
  layoutInfo.pSetLayouts = &setLayout;
  layoutInfo.pushConstantRangeCount = 1;
  layoutInfo.pPushConstantRanges = &constants;
  must(vkCreatePipelineLayout(device, &layoutInfo, nullptr, &layout));
  // [/layout]
  const VkDescriptorPoolSize size{VK_DESCRIPTOR_TYPE_STORAGE_BUFFER, 64 * storageBuffersWanted};
  auto setPool =
      structure<VkDescriptorPoolCreateInfo>(VK_STRUCTURE_TYPE_DESCRIPTOR_POOL_CREATE_INFO);
  setPool.maxSets = 64;
  setPool.poolSizeCount = 1;
  setPool.pPoolSizes = &size;
  must(vkCreateDescriptorPool(device, &setPool, nullptr, &pool));
}

DeviceLimits Rhi::limits() const {
  VkPhysicalDeviceProperties properties{};
  vkGetPhysicalDeviceProperties(physicalDevice, &properties);
  const VkPhysicalDeviceLimits& of = properties.limits;
  DeviceLimits limits;
  limits.maxStorageBufferRange = of.maxStorageBufferRange & ~3u;
  limits.minStorageBufferOffsetAlignment =
      static_cast<std::uint32_t>(of.minStorageBufferOffsetAlignment);
  limits.maxWorkgroupCountX = of.maxComputeWorkGroupCount[0];
  limits.maxWorkgroupCountY = of.maxComputeWorkGroupCount[1];
  limits.maxStorageBuffersPerStage = of.maxPerStageDescriptorStorageBuffers;
  return limits;
}

Rhi::Buffer Rhi::createBuffer(VkDeviceSize size, VkBufferUsageFlags usage) {
  auto bufferInfo = structure<VkBufferCreateInfo>(VK_STRUCTURE_TYPE_BUFFER_CREATE_INFO);
  bufferInfo.size = size;
  bufferInfo.usage = usage;
  Buffer made;
  made.size = size;
  must(vkCreateBuffer(device, &bufferInfo, nullptr, &made.buffer));
  VkMemoryRequirements needed{};
  vkGetBufferMemoryRequirements(device, made.buffer, &needed);
  VkPhysicalDeviceMemoryProperties memory{};
  vkGetPhysicalDeviceMemoryProperties(physicalDevice, &memory);
  constexpr auto coherent =
      VK_MEMORY_PROPERTY_HOST_VISIBLE_BIT | VK_MEMORY_PROPERTY_HOST_COHERENT_BIT;
  auto memoryInfo = structure<VkMemoryAllocateInfo>(VK_STRUCTURE_TYPE_MEMORY_ALLOCATE_INFO);
  memoryInfo.allocationSize = needed.size;
  while ((needed.memoryTypeBits >> memoryInfo.memoryTypeIndex & 1) == 0 ||
         (memory.memoryTypes[memoryInfo.memoryTypeIndex].propertyFlags & coherent) != coherent)
    ++memoryInfo.memoryTypeIndex;
  must(vkAllocateMemory(device, &memoryInfo, nullptr, &made.memory));
  must(vkBindBufferMemory(device, made.buffer, made.memory, 0));
  void* mapped = nullptr;
  must(vkMapMemory(device, made.memory, 0, VK_WHOLE_SIZE, 0, &mapped));
  made.mapped = static_cast<std::byte*>(mapped);
  std::fill_n(made.mapped, size, std::byte{0xa5});
  return made;
}

void Rhi::destroy(const Buffer& buffer) {
  vkDestroyBuffer(device, buffer.buffer, nullptr);
  vkFreeMemory(device, buffer.memory, nullptr);
}

VkPipeline Rhi::build(const vulkan::PipelineDescription& description) {
  auto moduleInfo =
      structure<VkShaderModuleCreateInfo>(VK_STRUCTURE_TYPE_SHADER_MODULE_CREATE_INFO);
  moduleInfo.codeSize = description.spirv.size_bytes();
  moduleInfo.pCode = description.spirv.data();
  VkShaderModule module = VK_NULL_HANDLE;
  must(vkCreateShaderModule(device, &moduleInfo, nullptr, &module));
  std::vector<VkSpecializationMapEntry> entries;
  const auto count = static_cast<std::uint32_t>(description.constants.size());
  for (std::uint32_t id = 0; id < count; ++id) entries.push_back({id, id * 4, 4});
  const VkSpecializationInfo specialization{count, entries.data(), std::size_t{count} * 4,
                                            description.constants.data()};
  auto info =
      structure<VkComputePipelineCreateInfo>(VK_STRUCTURE_TYPE_COMPUTE_PIPELINE_CREATE_INFO);
  info.stage = structure<VkPipelineShaderStageCreateInfo>(
      VK_STRUCTURE_TYPE_PIPELINE_SHADER_STAGE_CREATE_INFO);
  info.stage.stage = VK_SHADER_STAGE_COMPUTE_BIT;
  info.stage.module = module;
  info.stage.pName = "main";
  info.stage.pSpecializationInfo = &specialization;
  info.layout = layout;
  VkPipeline pipeline = VK_NULL_HANDLE;
  must(vkCreateComputePipelines(device, VK_NULL_HANDLE, 1, &info, nullptr, &pipeline));
  vkDestroyShaderModule(device, module, nullptr);
  return pipeline;
}

void Rhi::begin() {
  must(vkResetDescriptorPool(device, pool, 0));
  auto begin = structure<VkCommandBufferBeginInfo>(VK_STRUCTURE_TYPE_COMMAND_BUFFER_BEGIN_INFO);
  must(vkBeginCommandBuffer(commandBuffer, &begin));
}

void Rhi::submit() {
  must(vkEndCommandBuffer(commandBuffer));
  auto info = structure<VkSubmitInfo>(VK_STRUCTURE_TYPE_SUBMIT_INFO);
  info.commandBufferCount = 1;
  info.pCommandBuffers = &commandBuffer;
  must(vkQueueSubmit(queue, 1, &info, VK_NULL_HANDLE));
  must(vkQueueWaitIdle(queue));
}

VkDescriptorSet Rhi::allocateSet() {
  auto info =
      structure<VkDescriptorSetAllocateInfo>(VK_STRUCTURE_TYPE_DESCRIPTOR_SET_ALLOCATE_INFO);
  info.descriptorPool = pool;
  info.descriptorSetCount = 1;
  info.pSetLayouts = &setLayout;
  VkDescriptorSet set = VK_NULL_HANDLE;
  must(vkAllocateDescriptorSets(device, &info, &set));
  return set;
}

void Rhi::write(VkDescriptorSet set, std::uint32_t slot, const VkDescriptorBufferInfo& part) {
  auto write = structure<VkWriteDescriptorSet>(VK_STRUCTURE_TYPE_WRITE_DESCRIPTOR_SET);
  write.dstSet = set;
  write.dstBinding = slot;
  write.descriptorCount = 1;
  write.descriptorType = VK_DESCRIPTOR_TYPE_STORAGE_BUFFER;
  write.pBufferInfo = &part;
  vkUpdateDescriptorSets(device, 1, &write, 0, nullptr);
}

// -- What a scene needs of it.

// [executor]
/// The buffers of a scene by their numbers, its pipelines, and the loop over its commands.
struct Executor {
  Rhi rhi;
  std::map<std::uint32_t, Rhi::Buffer> buffers;
  std::map<PipelineId, VkPipeline> pipelines;
  std::vector<Rhi::Buffer> staging;  ///< of the frame
  Rhi::Buffer tables = rhi.createBuffer(1 << 16, VK_BUFFER_USAGE_TRANSFER_SRC_BIT);  ///< the same

  static Result<void*> createBuffer(void* user, const SceneBuffer& wanted) {
    Executor& self = *static_cast<Executor*>(user);
    const BufferRequirement& needed = wanted.requirement;
    const Rhi::Buffer made = self.rhi.createBuffer(needed.size, needed.usage);
    self.buffers[wanted.number] = made;
    return static_cast<void*>(wanted.isMapped ? made.mapped : nullptr);
  }
  static void releaseBuffer(void* user, std::uint32_t number) {
    Executor& self = *static_cast<Executor*>(user);
    self.rhi.destroy(self.buffers.at(number));
    self.buffers.erase(number);
  }

  void execute(std::span<const Command> commands);
};

void Executor::execute(std::span<const Command> commands) {
  const VkCommandBuffer to = rhi.commandBuffer;
  const auto buffer = [&](std::uint32_t number) { return buffers.at(number).buffer; };
  for (const Command& command : commands) {
    std::visit(
        Overloaded{
            [&](const DispatchCommand& dispatch) {
              const VkDescriptorSet set = rhi.allocateSet();
              for (const auto& [slot, isTexelBuffer, part] : dispatch.bindings)
                rhi.write(set, slot, {buffer(part.buffer), part.offset, part.size});
              vkCmdBindPipeline(to, VK_PIPELINE_BIND_POINT_COMPUTE,
                                pipelines.at(dispatch.pipeline));
              vkCmdBindDescriptorSets(to, VK_PIPELINE_BIND_POINT_COMPUTE, rhi.layout, 0, 1, &set, 0,
                                      nullptr);
              vkCmdPushConstants(to, rhi.layout, VK_SHADER_STAGE_COMPUTE_BIT, 0,
                                 dispatch.constantCount * 4, dispatch.constants.data());
              if (dispatch.indirect.size != 0) {
                vkCmdDispatchIndirect(to, buffer(dispatch.indirect.buffer),
                                      dispatch.indirect.offset);
              } else {
                vkCmdDispatch(to, dispatch.groupCountX, dispatch.groupCountY, 1);
              }
            },
            [&](const UploadCommand& upload) {
              Rhi::Buffer from = tables;
              if (upload.bytes.data() != tables.mapped) {  // else they are there already
                from = rhi.createBuffer(upload.to.size, VK_BUFFER_USAGE_TRANSFER_SRC_BIT);
                staging.push_back(from);
                std::ranges::copy(upload.bytes, from.mapped);
              }
              const VkBufferCopy region{0, upload.to.offset, upload.to.size};
              vkCmdCopyBuffer(to, from.buffer, buffer(upload.to.buffer), 1, &region);
            },
            [&](const CopyCommand& copy) {
              const VkBufferCopy region{copy.fromOffset, copy.toOffset, copy.size};
              vkCmdCopyBuffer(to, buffer(copy.from), buffer(copy.to), 1, &region);
            },
            [&](const ClearCommand& clear) {
              vkCmdFillBuffer(to, buffer(clear.part.buffer), clear.part.offset, clear.part.size, 0);
            },
            [&](const BarrierCommand& barrier) {
              const vulkan::Barrier between = vulkan::barrierBetween(barrier.before, barrier.after);
              const VkMemoryBarrier memory = between;
              vkCmdPipelineBarrier(to, between.sourceStages, between.destinationStages, 0, 1,
                                   &memory, 0, nullptr, 0, nullptr);
            }},
        command);
  }
}
// [/executor]

// -- The figures: strips of two joints.

struct Strip {
  float positions[vertexCount][3], weights[vertexCount][2];
  std::uint8_t joints[vertexCount][2];
};

std::vector<JointMatrix> poseOf(std::uint32_t figure, std::uint32_t frame) {
  const float angle = 0.3f * static_cast<float>(frame) + static_cast<float>(figure);
  std::vector<JointMatrix> pose(2);
  pose[1] = {{{std::cos(angle), 0, std::sin(angle), 0},
              {0, 1, 0, 0},
              {-std::sin(angle), 0, std::cos(angle), 0}}};
  return pose;
}

int main() {
  static Strip strip{};
  for (std::uint32_t i = 0; i < vertexCount; ++i) {
    const float along = static_cast<float>(i / 2) / (vertexCount / 2 - 1);
    strip.positions[i][0] = i % 2 == 0 ? -0.1f : 0.1f;
    strip.positions[i][1] = 2 * along;
    strip.weights[i][0] = 1 - along;
    strip.weights[i][1] = along;
    strip.joints[i][1] = 1;
  }
  InfluenceSet influences;
  influences.joints = {strip.joints, vertexCount, 2, ComponentType::uint8, 2};
  influences.weights = attributeView(strip.weights[0], vertexCount, 2);
  MeshView mesh;
  mesh.name = "strip";
  mesh.vertexCount = vertexCount;
  mesh.positions = attributeView(strip.positions[0], vertexCount, 3);
  mesh.influenceSets = {&influences, 1};

  // [load]
  Executor executor;
  SceneCommandsDescription description;
  description.scene.outputCapacity = {4096};  // grows
  description.limits = executor.rhi.limits();
  description.user = &executor;
  description.createBuffer = Executor::createBuffer;
  description.releaseBuffer = Executor::releaseBuffer;
  SceneCommands commands = must(SceneCommands::create(description));
  Scene& scene = commands.scene();

  InstanceDescription figure;
  figure.mesh = must(scene.addMesh(must(pack(mesh, 2))));
  figure.bounds = true;
  std::vector<PoseHandle> poses;
  std::vector<InstanceHandle> figures;
  for (std::uint32_t number = 0; number < figureCount; ++number) {
    poses.push_back(figure.pose = must(scene.addPose(2)));
    figure.culledOnGpu = number % 2 == 1;
    for (const PipelineId id : must(pipelines(must(scene.pipelineNeeds(figure)), description.limits,
                                              description.tuning))) {
      VkPipeline& pipeline = executor.pipelines[id];
      if (pipeline == VK_NULL_HANDLE)
        pipeline = executor.rhi.build(must(vulkan::pipelineDescription(id)));
    }
    figures.push_back(must(scene.addInstance(figure)));
  }
  // [/load]
  // A word for each instance; here the GPU's culling is the CPU. It sees all but figure 3.
  Rhi::Buffer& words = executor.buffers[visibilityBuffer];
  words = executor.rhi.createBuffer(scene.visibilityCount() * VkDeviceSize{4},
                                    VK_BUFFER_USAGE_STORAGE_BUFFER_BIT);
  std::fill_n(words.mapped, words.size, std::byte{0});
  for (std::uint32_t number = 1; number < figureCount; number += 2) {
    const std::uint32_t isSeen = number == 3 ? 0 : 1;
    std::memcpy(words.mapped + must(scene.visibilityIndex(figures[number])) * 4, &isSeen, 4);
  }

  for (std::uint32_t frame = 1; frame <= frameCount; ++frame) {
    // [frame]
    // `frame - 1`: the newest frame that the GPU has completed. This program waits for each.
    must(scene.beginFrame(frame, frame - 1));
    for (std::uint32_t number = 0; number < figureCount; ++number)
      std::ranges::copy(poseOf(number, frame), must(scene.writePose(poses[number])).begin());
    executor.rhi.begin();
    const Rhi::Buffer& tables = executor.tables;
    executor.execute(must(commands.plan({tables.mapped, tables.size})));
    must(commands.commit());
    // An engine records the barrier to its draws here, and draws.
    executor.rhi.submit();
    // [/frame]
    for (const Rhi::Buffer& staged : executor.staging) executor.rhi.destroy(staged);
    executor.staging.clear();
  }

  // -- The check: every vertex is compared with the reference, and every box with its vertices.
  must(scene.beginFrame(frameCount + 1, frameCount));  // reads the boxes back
  const std::byte* output = executor.buffers.at(commands.outputBuffer()).mapped;
  std::uint32_t right = 0;
  for (std::uint32_t number = 0; number < figureCount; ++number) {
    const InstanceOutput place = must(scene.output(figures[number]));
    const std::byte* vertices = output + place.offset;
    const std::optional<Box> box = must(scene.bounds(figures[number]));
    if (number == 3) {  // it was never visible
      right += !box.has_value();
      continue;
    }
    SkinnedView skinned;
    skinned.positions = {vertices, vertexCount, 12, VertexFormat::float32x3};
    const auto expected =
        must(reference::skin(mesh, poseOf(number, frameCount), Method::dualQuaternion));
    float low = 0;
    std::memcpy(&low, vertices, sizeof(low));
    for (std::uint32_t vertex = 1; vertex < vertexCount; ++vertex) {
      float x = 0;
      std::memcpy(&x, vertices + vertex * std::size_t{12}, sizeof(x));
      low = std::min(low, x);
    }
    right += must(compareWithReference(expected, skinned)).passed() && box && box->min[0] == low;
  }
  std::printf("%u figures, %u frames: %s\n", figureCount, frameCount,
              right == figureCount ? "every vertex is right" : "some are wrong");
  return right == figureCount ? 0 : 1;  // the operating system takes the device back
}
