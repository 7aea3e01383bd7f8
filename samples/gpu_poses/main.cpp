// Ten thousand figures whose poses stay on the GPU: a compute pass of this program writes them, and
// Dermis reads them in place.
//
//   dermis_gpu_poses
//
// Exit status: 0 success; 4 no Vulkan device, or a Vulkan call of this program failed; 1 any other
// error.

#include <vulkan/vulkan.h>

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <type_traits>
#include <utility>
#include <vector>

#include "dermis/verify.h"
#include "dermis/vulkan/context.h"
#include "dermis/vulkan/scene_recorder.h"
#include "dermis_gpu_poses_shaders.h"  // wave.comp as SPIR-V

using namespace dermis;

constexpr std::uint32_t vertexCount = 40, jointCount = 2, figureCount = 10'000, frameCount = 3;

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

// -- What every engine already has.

struct Engine {
  VkInstance instance;
  VkPhysicalDevice physicalDevice;
  VkDevice device;
  VkQueue queue;
  VkCommandBuffer commandBuffer;
};

Engine makeEngine() {
  Engine engine{};
  auto application = structure<VkApplicationInfo>(VK_STRUCTURE_TYPE_APPLICATION_INFO);
  application.apiVersion = VK_API_VERSION_1_1;
  auto instanceInfo = structure<VkInstanceCreateInfo>(VK_STRUCTURE_TYPE_INSTANCE_CREATE_INFO);
  instanceInfo.pApplicationInfo = &application;
  must(vkCreateInstance(&instanceInfo, nullptr, &engine.instance));
  std::uint32_t one = 1;  // the first device, and its first queue family
  vkEnumeratePhysicalDevices(engine.instance, &one, &engine.physicalDevice);
  if (one == 0) must(VK_ERROR_INITIALIZATION_FAILED);
  const float priority = 1;
  auto queueInfo = structure<VkDeviceQueueCreateInfo>(VK_STRUCTURE_TYPE_DEVICE_QUEUE_CREATE_INFO);
  queueInfo.queueCount = 1;
  queueInfo.pQueuePriorities = &priority;
  auto deviceInfo = structure<VkDeviceCreateInfo>(VK_STRUCTURE_TYPE_DEVICE_CREATE_INFO);
  deviceInfo.queueCreateInfoCount = 1;
  deviceInfo.pQueueCreateInfos = &queueInfo;
  must(vkCreateDevice(engine.physicalDevice, &deviceInfo, nullptr, &engine.device));
  vkGetDeviceQueue(engine.device, 0, 0, &engine.queue);
  auto poolInfo = structure<VkCommandPoolCreateInfo>(VK_STRUCTURE_TYPE_COMMAND_POOL_CREATE_INFO);
  poolInfo.flags = VK_COMMAND_POOL_CREATE_RESET_COMMAND_BUFFER_BIT;
  VkCommandPool pool = VK_NULL_HANDLE;
  must(vkCreateCommandPool(engine.device, &poolInfo, nullptr, &pool));
  auto commandInfo =
      structure<VkCommandBufferAllocateInfo>(VK_STRUCTURE_TYPE_COMMAND_BUFFER_ALLOCATE_INFO);
  commandInfo.commandPool = pool;
  commandInfo.commandBufferCount = 1;
  must(vkAllocateCommandBuffers(engine.device, &commandInfo, &engine.commandBuffer));
  return engine;
}

struct Buffer {
  VkBuffer buffer = VK_NULL_HANDLE;
  const std::byte* bytes = nullptr;  ///< null if the memory is not mapped
};

Buffer makeBuffer(const Engine& engine, VkDeviceSize size, VkBufferUsageFlags usage,
                  VkMemoryPropertyFlags wanted) {
  auto bufferInfo = structure<VkBufferCreateInfo>(VK_STRUCTURE_TYPE_BUFFER_CREATE_INFO);
  bufferInfo.size = size;
  bufferInfo.usage = usage;
  Buffer made;
  must(vkCreateBuffer(engine.device, &bufferInfo, nullptr, &made.buffer));
  VkMemoryRequirements needed{};
  vkGetBufferMemoryRequirements(engine.device, made.buffer, &needed);
  VkPhysicalDeviceMemoryProperties memory{};
  vkGetPhysicalDeviceMemoryProperties(engine.physicalDevice, &memory);
  auto memoryInfo = structure<VkMemoryAllocateInfo>(VK_STRUCTURE_TYPE_MEMORY_ALLOCATE_INFO);
  memoryInfo.allocationSize = needed.size;
  while ((needed.memoryTypeBits >> memoryInfo.memoryTypeIndex & 1) == 0 ||
         (memory.memoryTypes[memoryInfo.memoryTypeIndex].propertyFlags & wanted) != wanted)
    ++memoryInfo.memoryTypeIndex;
  VkDeviceMemory block = VK_NULL_HANDLE;
  must(vkAllocateMemory(engine.device, &memoryInfo, nullptr, &block));
  must(vkBindBufferMemory(engine.device, made.buffer, block, 0));
  if ((wanted & VK_MEMORY_PROPERTY_HOST_VISIBLE_BIT) == 0) return made;
  void* mapped = nullptr;
  must(vkMapMemory(engine.device, block, 0, VK_WHOLE_SIZE, 0, &mapped));
  made.bytes = static_cast<const std::byte*>(mapped);
  return made;
}

void submit(const Engine& engine) {
  auto info = structure<VkSubmitInfo>(VK_STRUCTURE_TYPE_SUBMIT_INFO);
  info.commandBufferCount = 1;
  info.pCommandBuffers = &engine.commandBuffer;
  must(vkQueueSubmit(engine.queue, 1, &info, VK_NULL_HANDLE));
  must(vkQueueWaitIdle(engine.queue));
}

/// The engine's animation: a compute pass that writes all poses, one after the other.
struct Animation {
  VkPipelineLayout layout = VK_NULL_HANDLE;
  VkPipeline pipeline = VK_NULL_HANDLE;
  VkDescriptorSet set = VK_NULL_HANDLE;

  Animation(const Engine& engine, const vulkan::BufferRange& poses) {
    VkDescriptorSetLayoutBinding binding{};
    binding.descriptorType = VK_DESCRIPTOR_TYPE_STORAGE_BUFFER;
    binding.descriptorCount = 1;
    binding.stageFlags = VK_SHADER_STAGE_COMPUTE_BIT;
    auto setInfo = structure<VkDescriptorSetLayoutCreateInfo>(
        VK_STRUCTURE_TYPE_DESCRIPTOR_SET_LAYOUT_CREATE_INFO);
    setInfo.bindingCount = 1;
    setInfo.pBindings = &binding;
    VkDescriptorSetLayout setLayout = VK_NULL_HANDLE;
    must(vkCreateDescriptorSetLayout(engine.device, &setInfo, nullptr, &setLayout));
    const VkPushConstantRange push{VK_SHADER_STAGE_COMPUTE_BIT, 0, 8};
    auto layoutInfo =
        structure<VkPipelineLayoutCreateInfo>(VK_STRUCTURE_TYPE_PIPELINE_LAYOUT_CREATE_INFO);
    layoutInfo.setLayoutCount = 1;
    layoutInfo.pSetLayouts = &setLayout;
    layoutInfo.pushConstantRangeCount = 1;
    layoutInfo.pPushConstantRanges = &push;
    must(vkCreatePipelineLayout(engine.device, &layoutInfo, nullptr, &layout));
    auto moduleInfo =
        structure<VkShaderModuleCreateInfo>(VK_STRUCTURE_TYPE_SHADER_MODULE_CREATE_INFO);
    moduleInfo.codeSize = gpu_poses::wave_spirv.size_bytes();
    moduleInfo.pCode = gpu_poses::wave_spirv.data();
    auto info =
        structure<VkComputePipelineCreateInfo>(VK_STRUCTURE_TYPE_COMPUTE_PIPELINE_CREATE_INFO);
    info.stage = structure<VkPipelineShaderStageCreateInfo>(
        VK_STRUCTURE_TYPE_PIPELINE_SHADER_STAGE_CREATE_INFO);
    info.stage.stage = VK_SHADER_STAGE_COMPUTE_BIT;
    info.stage.pName = "main";
    info.layout = layout;
    must(vkCreateShaderModule(engine.device, &moduleInfo, nullptr, &info.stage.module));
    must(vkCreateComputePipelines(engine.device, VK_NULL_HANDLE, 1, &info, nullptr, &pipeline));

    const VkDescriptorPoolSize size{VK_DESCRIPTOR_TYPE_STORAGE_BUFFER, 1};
    auto poolInfo =
        structure<VkDescriptorPoolCreateInfo>(VK_STRUCTURE_TYPE_DESCRIPTOR_POOL_CREATE_INFO);
    poolInfo.maxSets = 1;
    poolInfo.poolSizeCount = 1;
    poolInfo.pPoolSizes = &size;
    VkDescriptorPool pool = VK_NULL_HANDLE;
    must(vkCreateDescriptorPool(engine.device, &poolInfo, nullptr, &pool));
    auto allocateInfo =
        structure<VkDescriptorSetAllocateInfo>(VK_STRUCTURE_TYPE_DESCRIPTOR_SET_ALLOCATE_INFO);
    allocateInfo.descriptorPool = pool;
    allocateInfo.descriptorSetCount = 1;
    allocateInfo.pSetLayouts = &setLayout;
    must(vkAllocateDescriptorSets(engine.device, &allocateInfo, &set));
    const VkDescriptorBufferInfo bufferInfo{poses.buffer, poses.offset, poses.size};
    auto write = structure<VkWriteDescriptorSet>(VK_STRUCTURE_TYPE_WRITE_DESCRIPTOR_SET);
    write.dstSet = set;
    write.descriptorCount = 1;
    write.descriptorType = VK_DESCRIPTOR_TYPE_STORAGE_BUFFER;
    write.pBufferInfo = &bufferInfo;
    vkUpdateDescriptorSets(engine.device, 1, &write, 0, nullptr);
  }

  void record(VkCommandBuffer commandBuffer, float time) const {
    struct {
      std::uint32_t figures;
      float time;
    } push{figureCount, time};
    vkCmdBindPipeline(commandBuffer, VK_PIPELINE_BIND_POINT_COMPUTE, pipeline);
    vkCmdBindDescriptorSets(commandBuffer, VK_PIPELINE_BIND_POINT_COMPUTE, layout, 0, 1, &set, 0,
                            nullptr);
    vkCmdPushConstants(commandBuffer, layout, VK_SHADER_STAGE_COMPUTE_BIT, 0, sizeof(push), &push);
    vkCmdDispatch(commandBuffer, (figureCount + 63) / 64, 1, 1);
  }
};

// -- The figures: strips of two joints.

struct Strip {
  float positions[vertexCount][3], normals[vertexCount][3], weights[vertexCount][2];
  std::uint8_t joints[vertexCount][2];
};

int main() {
  static Strip strip{};
  for (std::uint32_t i = 0; i < vertexCount; ++i) {
    const float along = static_cast<float>(i / 2) / (vertexCount / 2 - 1);
    strip.positions[i][0] = i % 2 == 0 ? -0.1f : 0.1f;
    strip.positions[i][1] = 2 * along;
    strip.normals[i][2] = 1;
    strip.weights[i][0] = 1 - along;
    strip.weights[i][1] = along;
    strip.joints[i][1] = 1;
  }
  const Engine engine = makeEngine();

  InfluenceSet influences;
  influences.joints = attributeView(strip.joints[0], vertexCount, 2);
  influences.weights = attributeView(strip.weights[0], vertexCount, 2);
  MeshView mesh;
  mesh.name = "strip";
  mesh.vertexCount = vertexCount;
  mesh.positions = attributeView(strip.positions[0], vertexCount, 3);
  mesh.normals = attributeView(strip.normals[0], vertexCount, 3);
  mesh.influenceSets = {&influences, 1};

  vulkan::DeviceDescription device;
  device.instance = engine.instance;
  device.physicalDevice = engine.physicalDevice;
  device.device = engine.device;
  device.getInstanceProcAddr = vkGetInstanceProcAddr;
  device.apiVersion = VK_API_VERSION_1_1;
  vulkan::Context context = must(vulkan::Context::create(device));

  // -- Dermis: while loading. The engine creates the buffer of the poses and passes it to Dermis.
  vulkan::SceneRecorderDescription description;
  description.scene.gpuJointCapacity = Capacity::fixed(std::uint64_t{figureCount} * jointCount);
  const BufferRequirement needed =
      must(vulkan::SceneRecorder::requirement(context, description, BufferRole::gpuPoses));
  const Buffer poses =
      makeBuffer(engine, needed.size, needed.usage | VK_BUFFER_USAGE_TRANSFER_SRC_BIT,
                 VK_MEMORY_PROPERTY_DEVICE_LOCAL_BIT);
  description.gpuPoses = {poses.buffer, 0, needed.size};
  vulkan::SceneRecorder recorder = must(vulkan::SceneRecorder::create(context, description));
  Scene& scene = recorder.scene();

  InstanceDescription figure;
  figure.mesh = must(scene.addMesh(must(pack(mesh, jointCount))));
  figure.layout = {.positions = VertexFormat::float32x3, .normals = VertexFormat::float32x3};
  must(recorder.prepare(figure));
  // [add]
  std::vector<PoseHandle> handles(figureCount);
  must(scene.addPoses(handles, jointCount, {.writtenByGpu = true}));
  std::vector<InstanceHandle> figures;
  for (const PoseHandle pose : handles) {
    figure.pose = pose;
    figures.push_back(must(scene.addInstance(figure)));
  }
  const vulkan::BufferRange first = must(recorder.poseRange(handles[0]));
  const Animation animation(engine, {first.buffer, first.offset, first.size * figureCount});
  // [/add]

  // -- Each frame.
  for (std::uint32_t frame = 1; frame <= frameCount; ++frame) {
    must(scene.beginFrame(frame, frame - 1));
    auto begin = structure<VkCommandBufferBeginInfo>(VK_STRUCTURE_TYPE_COMMAND_BUFFER_BEGIN_INFO);
    must(vkBeginCommandBuffer(engine.commandBuffer, &begin));
    // [frame]
    // The previous frame may still read the poses.
    context.recordBarrier(engine.commandBuffer, Use::dermis, Use::computeWrite);
    animation.record(engine.commandBuffer, static_cast<float>(frame));
    must(scene.markAllWritten());
    context.recordBarrier(engine.commandBuffer, Use::computeWrite | Use::vertexInput, Use::dermis);
    must(recorder.record(engine.commandBuffer));
    context.recordBarrier(engine.commandBuffer, Use::dermis, Use::vertexInput);
    // [/frame]
    // An engine draws here.
    must(vkEndCommandBuffer(engine.commandBuffer));
    submit(engine);
  }

  // -- The check: the output of the GPU is copied, and every vertex is compared with the reference.
  constexpr VkMemoryPropertyFlags mapped =
      VK_MEMORY_PROPERTY_HOST_VISIBLE_BIT | VK_MEMORY_PROPERTY_HOST_COHERENT_BIT;
  const std::uint64_t outputSize = scene.statistics().outputs.capacity;
  const Buffer vertices = makeBuffer(engine, outputSize, VK_BUFFER_USAGE_TRANSFER_DST_BIT, mapped);
  const Buffer matrices = makeBuffer(engine, needed.size, VK_BUFFER_USAGE_TRANSFER_DST_BIT, mapped);
  auto begin = structure<VkCommandBufferBeginInfo>(VK_STRUCTURE_TYPE_COMMAND_BUFFER_BEGIN_INFO);
  must(vkBeginCommandBuffer(engine.commandBuffer, &begin));
  context.recordBarrier(engine.commandBuffer, Use::dermis, Use::copyRead);
  const VkBufferCopy allVertices{0, 0, outputSize}, allPoses{0, 0, needed.size};
  vkCmdCopyBuffer(engine.commandBuffer, recorder.outputBuffer(), vertices.buffer, 1, &allVertices);
  vkCmdCopyBuffer(engine.commandBuffer, poses.buffer, matrices.buffer, 1, &allPoses);
  context.recordBarrier(engine.commandBuffer, Use::copyWrite, Use::hostRead);
  must(vkEndCommandBuffer(engine.commandBuffer));
  submit(engine);
  std::uint32_t right = 0;
  for (std::uint32_t i = 0; i < figureCount; ++i) {
    const std::byte* skinnedFigure = vertices.bytes + must(scene.output(figures[i])).offset;
    SkinnedView skinned;
    skinned.positions = {skinnedFigure, vertexCount, 24, VertexFormat::float32x3};
    skinned.normals = {skinnedFigure + 12, vertexCount, 24, VertexFormat::float32x3};
    std::vector<JointMatrix> pose(jointCount);
    std::memcpy(pose.data(), matrices.bytes + i * first.size, first.size);
    const auto expected = must(reference::skin(mesh, pose, Method::dualQuaternion));
    right += must(compareWithReference(expected, skinned)).passed() ? 1u : 0u;
  }
  std::printf("%u figures, %u frames, poses from the GPU: %s\n", figureCount, frameCount,
              right == figureCount ? "every vertex is right" : "WRONG");
  return right == figureCount ? 0 : 1;  // the operating system takes the device back
}
