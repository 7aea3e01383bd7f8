// An engine with its own allocator and one global vertex buffer. Every buffer of Dermis comes from
// the engine. One frame is recorded but never submitted; its work is recorded again in the next
// frame.
//
//   dermis_allocator
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

constexpr std::uint32_t vertexCount = 200, frameCount = 4, lostFrame = 3;

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

/// The engine's allocator: here a VkDeviceMemory for each buffer.
struct Allocation {
  VkDeviceMemory memory = VK_NULL_HANDLE;
  void* mapped = nullptr;
};
class Allocator {
 public:
  explicit Allocator(const Engine& engine) : engine_(engine) {
    vkGetPhysicalDeviceMemoryProperties(engine.physicalDevice, &properties_);
  }

  VkResult createBuffer(const VkBufferCreateInfo& info, VkMemoryPropertyFlags wanted,
                        VkBuffer& buffer, Allocation& allocation) {
    must(vkCreateBuffer(engine_.device, &info, nullptr, &buffer));
    VkMemoryRequirements needed{};
    vkGetBufferMemoryRequirements(engine_.device, buffer, &needed);
    auto memoryInfo = structure<VkMemoryAllocateInfo>(VK_STRUCTURE_TYPE_MEMORY_ALLOCATE_INFO);
    memoryInfo.allocationSize = needed.size;
    while ((needed.memoryTypeBits >> memoryInfo.memoryTypeIndex & 1) == 0 ||
           (properties_.memoryTypes[memoryInfo.memoryTypeIndex].propertyFlags & wanted) != wanted)
      ++memoryInfo.memoryTypeIndex;
    const VkResult result =
        vkAllocateMemory(engine_.device, &memoryInfo, nullptr, &allocation.memory);
    if (result != VK_SUCCESS) return result;
    ++buffers;
    bytes += info.size;
    if ((wanted & VK_MEMORY_PROPERTY_HOST_VISIBLE_BIT) != 0)
      must(vkMapMemory(engine_.device, allocation.memory, 0, VK_WHOLE_SIZE, 0, &allocation.mapped));
    return vkBindBufferMemory(engine_.device, buffer, allocation.memory, 0);
  }
  void destroyBuffer(VkBuffer buffer, const Allocation& allocation) {
    --buffers;
    vkDestroyBuffer(engine_.device, buffer, nullptr);
    vkFreeMemory(engine_.device, allocation.memory, nullptr);
  }

  std::uint32_t buffers = 0;  ///< number of buffers that exist now
  std::uint64_t bytes = 0;    ///< total size of all buffers that were created

 private:
  const Engine& engine_;
  VkPhysicalDeviceMemoryProperties properties_{};
};

// -- The two functions that Dermis calls.

constexpr VkMemoryPropertyFlags mappedMemory =
    VK_MEMORY_PROPERTY_HOST_VISIBLE_BIT | VK_MEMORY_PROPERTY_HOST_COHERENT_BIT;

// [callbacks]
Result<vulkan::CreatedBuffer> createForDermis(void* user, const VkBufferCreateInfo& info,
                                              vulkan::BufferUse use, const char*) {
  vulkan::CreatedBuffer created;
  auto* allocation = new Allocation;
  const VkMemoryPropertyFlags wanted = use == vulkan::BufferUse::device ? 0 : mappedMemory;
  const VkResult result =
      static_cast<Allocator*>(user)->createBuffer(info, wanted, created.buffer, *allocation);
  created.mapped = allocation->mapped;
  created.allocation = allocation;
  if (result == VK_SUCCESS) return created;
  return Error{ErrorCode::vulkanError, "the engine is out of memory", result};
}

void destroyForDermis(void* user, const vulkan::CreatedBuffer& created) {
  auto* allocation = static_cast<Allocation*>(created.allocation);
  static_cast<Allocator*>(user)->destroyBuffer(created.buffer, *allocation);
  delete allocation;
}
// [/callbacks]

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
  const Engine engine = makeEngine();
  Allocator allocator(engine);

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

  // -- Dermis: its output is a range of the vertex buffer that the engine uses for everything.
  // [range]
  vulkan::SceneRecorderDescription description;
  description.buffers = {&allocator, createForDermis, destroyForDermis};
  description.scene.outputCapacity = Capacity::fixed(64 << 10);
  const VertexLayout layout{.positions = VertexFormat::float32x3,
                            .normals = VertexFormat::float32x3};
  const BufferRequirement needed = must(vulkan::SceneRecorder::requirement(
      context, description, BufferRole::positions, {&layout, 1}));
  auto vertexInfo = structure<VkBufferCreateInfo>(VK_STRUCTURE_TYPE_BUFFER_CREATE_INFO);
  vertexInfo.size = 1 << 20;
  vertexInfo.usage = needed.usage | VK_BUFFER_USAGE_VERTEX_BUFFER_BIT;
  VkBuffer vertexBuffer = VK_NULL_HANDLE;
  Allocation vertexMemory;  // mapped, to look at the vertices
  must(allocator.createBuffer(vertexInfo, mappedMemory, vertexBuffer, vertexMemory));
  const VkDeviceSize begin = (300'000 / needed.alignment + 1) * needed.alignment;
  description.output = {vertexBuffer, begin, needed.size};
  // [/range]

  int status = 1;
  {
    vulkan::SceneRecorder recorder = must(vulkan::SceneRecorder::create(context, description));
    Scene& scene = recorder.scene();
    InstanceDescription figure;
    figure.mesh = must(scene.addMesh(must(pack(mesh, 2))));
    figure.pose = must(scene.addPose(2));
    figure.layout = layout;
    must(recorder.prepare(figure));
    const InstanceHandle instance = must(scene.addInstance(figure));

    // -- Each frame.
    std::vector<JointMatrix> pose(2);
    std::uint32_t submitted = 0;
    for (std::uint32_t frame = 1; frame <= frameCount; ++frame) {
      must(scene.beginFrame(frame, submitted));
      if (frame <= lostFrame) {  // after the lost frame the pose does not change
        const float angle = 0.5f * static_cast<float>(frame);
        pose[1] = {{{std::cos(angle), 0, std::sin(angle), 0},
                    {0, 1, 0, 0},
                    {-std::sin(angle), 0, std::cos(angle), 0}}};
        std::copy(pose.begin(), pose.end(), must(scene.writePose(figure.pose)).begin());
      }
      auto beginInfo =
          structure<VkCommandBufferBeginInfo>(VK_STRUCTURE_TYPE_COMMAND_BUFFER_BEGIN_INFO);
      must(vkBeginCommandBuffer(engine.commandBuffer, &beginInfo));
      context.recordBarrier(engine.commandBuffer, Use::vertexInput, Use::dermis);
      must(recorder.record(engine.commandBuffer));
      context.recordBarrier(engine.commandBuffer, Use::dermis, Use::vertexInput | Use::hostRead);
      must(vkEndCommandBuffer(engine.commandBuffer));
      // [lost-frame]
      if (frame == lostFrame) {
        // As after VK_ERROR_OUT_OF_DATE_KHR: the commands are not submitted.
        must(scene.abandonFrame(frame));
        continue;
      }
      auto submit = structure<VkSubmitInfo>(VK_STRUCTURE_TYPE_SUBMIT_INFO);
      submit.commandBufferCount = 1;
      submit.pCommandBuffers = &engine.commandBuffer;
      must(vkQueueSubmit(engine.queue, 1, &submit, VK_NULL_HANDLE));
      must(vkQueueWaitIdle(engine.queue));
      submitted = frame;
      // [/lost-frame]
    }

    // -- The check: the frame after the lost one shows the pose of the lost frame.
    const InstanceOutput output = must(scene.output(instance));
    const auto* vertices = reinterpret_cast<const float*>(
        static_cast<const std::byte*>(vertexMemory.mapped) + output.offset);
    SkinnedView skinned;
    skinned.positions = {vertices, vertexCount, 24, VertexFormat::float32x3};
    skinned.normals = {vertices + 3, vertexCount, 24, VertexFormat::float32x3};
    const auto expected = must(reference::skin(mesh, pose, Method::dualQuaternion));
    const Comparison comparison = must(compareWithReference(expected, skinned));
    std::printf("%u buffers, %llu bytes from the engine, a lost frame: %s\n", allocator.buffers,
                static_cast<unsigned long long>(allocator.bytes),
                comparison.passed() ? "every vertex is right" : "WRONG");
    status = comparison.passed() && output.offset >= begin ? 0 : 1;
  }
  allocator.destroyBuffer(vertexBuffer, vertexMemory);
  return allocator.buffers == 0 ? status : 1;  // the operating system takes the device back
}
