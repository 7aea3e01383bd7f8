// The smallest engine: a device without a window and one twisting character. At the end it checks
// every vertex of the last frame.
//
//   dermis_minimal
//
// Exit status: 0 success; 4 no Vulkan device, or a Vulkan call of this program failed; 1 any other
// error.

#include <vulkan/vulkan.h>

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <cstdio>
#include <cstdlib>
#include <type_traits>
#include <utility>
#include <vector>

#include "dermis/verify.h"
#include "dermis/vulkan/context.h"
#include "dermis/vulkan/scene_recorder.h"

using namespace dermis;

constexpr std::uint32_t vertexCount = 200, frameCount = 3;

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
  VkBuffer readBack;
  const float* vertices;  ///< the read-back buffer, mapped
};

Engine makeEngine(std::uint32_t readBackSize) {
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

  auto bufferInfo = structure<VkBufferCreateInfo>(VK_STRUCTURE_TYPE_BUFFER_CREATE_INFO);
  bufferInfo.size = readBackSize;
  bufferInfo.usage = VK_BUFFER_USAGE_TRANSFER_DST_BIT;
  must(vkCreateBuffer(engine.device, &bufferInfo, nullptr, &engine.readBack));
  VkMemoryRequirements needed{};
  vkGetBufferMemoryRequirements(engine.device, engine.readBack, &needed);
  VkPhysicalDeviceMemoryProperties memory{};
  vkGetPhysicalDeviceMemoryProperties(engine.physicalDevice, &memory);
  constexpr auto coherent =
      VK_MEMORY_PROPERTY_HOST_VISIBLE_BIT | VK_MEMORY_PROPERTY_HOST_COHERENT_BIT;
  auto memoryInfo = structure<VkMemoryAllocateInfo>(VK_STRUCTURE_TYPE_MEMORY_ALLOCATE_INFO);
  memoryInfo.allocationSize = needed.size;
  while ((needed.memoryTypeBits >> memoryInfo.memoryTypeIndex & 1) == 0 ||
         (memory.memoryTypes[memoryInfo.memoryTypeIndex].propertyFlags & coherent) != coherent)
    ++memoryInfo.memoryTypeIndex;
  VkDeviceMemory block = VK_NULL_HANDLE;
  void* mapped = nullptr;
  must(vkAllocateMemory(engine.device, &memoryInfo, nullptr, &block));
  must(vkBindBufferMemory(engine.device, engine.readBack, block, 0));
  must(vkMapMemory(engine.device, block, 0, VK_WHOLE_SIZE, 0, &mapped));
  engine.vertices = static_cast<const float*>(mapped);
  return engine;
}

// -- The character: a strip of two joints.

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
  Engine engine = makeEngine(vertexCount * 24);

  // -- Dermis: while loading.
  // [mesh]
  InfluenceSet influences;
  influences.joints = attributeView(strip.joints[0], vertexCount, 2);
  influences.weights = attributeView(strip.weights[0], vertexCount, 2);
  MeshView mesh;
  mesh.name = "strip";
  mesh.vertexCount = vertexCount;
  mesh.positions = attributeView(strip.positions[0], vertexCount, 3);
  mesh.normals = attributeView(strip.normals[0], vertexCount, 3);
  mesh.influenceSets = {&influences, 1};
  // [/mesh]

  // [load]
  vulkan::DeviceDescription device;
  device.instance = engine.instance;
  device.physicalDevice = engine.physicalDevice;
  device.device = engine.device;
  device.getInstanceProcAddr = vkGetInstanceProcAddr;
  device.apiVersion = VK_API_VERSION_1_1;
  vulkan::Context context = must(vulkan::Context::create(device));
  vulkan::SceneRecorder recorder = must(vulkan::SceneRecorder::create(context));
  Scene& scene = recorder.scene();

  InstanceDescription figure;
  figure.mesh = must(scene.addMesh(must(pack(mesh, 2))));
  figure.pose = must(scene.addPose(2));
  figure.layout = {.positions = VertexFormat::float32x3, .normals = VertexFormat::float32x3};
  must(recorder.prepare(figure));
  const auto instance = must(scene.addInstance(figure));
  // [/load]

  // -- Each frame.
  std::vector<JointMatrix> pose(2);
  for (std::uint32_t frame = 1; frame <= frameCount; ++frame) {
    const float angle = 0.5f * static_cast<float>(frame);  // joint 1 turns about the strip's axis
    pose[1] = {{{std::cos(angle), 0, std::sin(angle), 0},
                {0, 1, 0, 0},
                {-std::sin(angle), 0, std::cos(angle), 0}}};
    auto begin = structure<VkCommandBufferBeginInfo>(VK_STRUCTURE_TYPE_COMMAND_BUFFER_BEGIN_INFO);
    must(vkBeginCommandBuffer(engine.commandBuffer, &begin));
    // [frame]
    // `frame - 1`: the newest frame that the GPU has completed. This program waits for each.
    must(scene.beginFrame(frame, frame - 1));
    std::copy(pose.begin(), pose.end(), must(scene.writePose(figure.pose)).begin());
    context.recordBarrier(engine.commandBuffer, Use::copyRead, Use::dermis);
    must(recorder.record(engine.commandBuffer));
    context.recordBarrier(engine.commandBuffer, Use::dermis, Use::copyRead);
    // [/frame]
    // An engine draws here. This program copies the vertices to compare them.
    const VkBufferCopy copy{must(scene.output(instance)).offset, 0, vertexCount * 24};
    vkCmdCopyBuffer(engine.commandBuffer, recorder.outputBuffer(), engine.readBack, 1, &copy);
    context.recordBarrier(engine.commandBuffer, Use::copyWrite, Use::hostRead);
    must(vkEndCommandBuffer(engine.commandBuffer));
    auto submit = structure<VkSubmitInfo>(VK_STRUCTURE_TYPE_SUBMIT_INFO);
    submit.commandBufferCount = 1;
    submit.pCommandBuffers = &engine.commandBuffer;
    must(vkQueueSubmit(engine.queue, 1, &submit, VK_NULL_HANDLE));
    must(vkQueueWaitIdle(engine.queue));
  }

  // -- The check: every vertex is compared with the reference in double precision.
  // [compare]
  SkinnedView skinned;
  skinned.positions = {engine.vertices, vertexCount, 24, VertexFormat::float32x3};
  skinned.normals = {engine.vertices + 3, vertexCount, 24, VertexFormat::float32x3};
  const auto expected = must(reference::skin(mesh, pose, Method::dualQuaternion));
  const Comparison comparison = must(compareWithReference(expected, skinned));
  // [/compare]
  std::printf("%u vertices, %u frames: %s, worst position error %.0f %% of its bound\n",
              vertexCount, frameCount, comparison.passed() ? "every vertex is right" : "WRONG",
              100 * comparison.worstPosition);
  return comparison.passed() ? 0 : 1;  // the operating system takes the device back
}
