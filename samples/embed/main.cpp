// An engine that manages buffers and instances itself. It turns a batch of instances into a plan
// and records the plan. A hundred instances of one mesh are skinned into the engine's vertex
// buffer, and every vertex of the last frame is compared with the reference.
//
//   dermis_embed
//
// Exit status: 0 success; 4 no Vulkan device, or a Vulkan call of this program failed; 1 any other
// error.

#include <vulkan/vulkan.h>

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <cstdio>
#include <cstdlib>
#include <span>
#include <type_traits>
#include <utility>
#include <vector>

#include "dermis/layout.h"
#include "dermis/mesh.h"
#include "dermis/plan.h"
#include "dermis/result.h"
#include "dermis/scene.h"
#include "dermis/verify.h"
#include "dermis/vulkan/context.h"
#include "dermis/vulkan/scene_recorder.h"

using namespace dermis;

constexpr std::uint32_t vertexCount = 200, jointCount = 2, instanceCount = 100, frameCount = 4;

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

/// A buffer in memory that the CPU can access.
struct Buffer {
  VkBuffer handle = VK_NULL_HANDLE;
  VkDeviceSize size = 0;
  std::byte* mapped = nullptr;

  std::span<std::byte> bytes() const { return {mapped, static_cast<std::size_t>(size)}; }
};

Buffer makeBuffer(const Engine& engine, VkDeviceSize size, VkBufferUsageFlags usage) {
  auto bufferInfo = structure<VkBufferCreateInfo>(VK_STRUCTURE_TYPE_BUFFER_CREATE_INFO);
  bufferInfo.size = size;
  bufferInfo.usage = usage;
  Buffer made{VK_NULL_HANDLE, size, nullptr};
  must(vkCreateBuffer(engine.device, &bufferInfo, nullptr, &made.handle));
  VkMemoryRequirements needed{};
  vkGetBufferMemoryRequirements(engine.device, made.handle, &needed);
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
  must(vkBindBufferMemory(engine.device, made.handle, block, 0));
  must(vkMapMemory(engine.device, block, 0, VK_WHOLE_SIZE, 0, &mapped));
  made.mapped = static_cast<std::byte*>(mapped);
  return made;
}

void submit(const Engine& engine) {
  auto info = structure<VkSubmitInfo>(VK_STRUCTURE_TYPE_SUBMIT_INFO);
  info.commandBufferCount = 1;
  info.pCommandBuffers = &engine.commandBuffer;
  must(vkQueueSubmit(engine.queue, 1, &info, VK_NULL_HANDLE));
  must(vkQueueWaitIdle(engine.queue));
}

// -- The mesh: a strip of two joints. Each instance has its own pose.

struct Strip {
  float positions[vertexCount][3], normals[vertexCount][3], weights[vertexCount][2];
  std::uint8_t joints[vertexCount][2];
};

/// Joint global transform × inverse bind matrix, for all joints of all instances.
std::vector<JointMatrix> posesOf(std::uint32_t frame) {
  std::vector<JointMatrix> matrices;
  for (std::uint32_t instance = 0; instance < instanceCount; ++instance) {
    const auto x = static_cast<float>(instance % 10), z = static_cast<float>(instance / 10);
    const float angle = 0.025f * static_cast<float>(instance) + 0.2f * static_cast<float>(frame);
    const float c = std::cos(angle), s = std::sin(angle);
    matrices.push_back({{{1, 0, 0, x}, {0, 1, 0, 0}, {0, 0, 1, z}}});
    matrices.push_back({{{c, 0, s, x}, {0, 1, 0, 0}, {-s, 0, c, z}}});
  }
  return matrices;
}

// -- Dermis.

// [needs]
/// A vertex as the engine's shaders read it. Dermis writes the first two attributes and never the
/// bytes after them.
struct SkinnedVertex {
  float position[3];
  std::int16_t normal[2];  ///< octahedral
  float textureCoordinate[2];
};

/// Layout and method are known while loading, so all pipelines can be built then.
const PipelineNeeds needs{.layout = {.positions = VertexFormat::float32x3,
                                     .normals = VertexFormat::octahedral16x2,
                                     .stride = sizeof(SkinnedVertex)}};
// [/needs]

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

  // [set-up]
  // Lends the VkDevice to Dermis. Features and extensions enabled on it would be stated here.
  vulkan::DeviceDescription device;
  device.instance = engine.instance;
  device.physicalDevice = engine.physicalDevice;
  device.device = engine.device;
  device.getInstanceProcAddr = vkGetInstanceProcAddr;
  device.apiVersion = VK_API_VERSION_1_1;
  const vulkan::Context context = must(vulkan::Context::create(device));
  const auto packed = must(pack(mesh, jointCount));
  must(context.prepare(needs));

  // The pose and the output of each instance. Plan again only if these change.
  constexpr std::uint64_t poseSize = jointCount * sizeof(JointMatrix);
  constexpr std::uint64_t instanceSize = vertexCount * sizeof(SkinnedVertex);
  std::vector<PoseDescription> descriptions(instanceCount);
  std::vector<Job> jobs(instanceCount);
  for (std::uint32_t instance = 0; instance < instanceCount; ++instance) {
    descriptions[instance].jointCount = jointCount;
    descriptions[instance].matrixOffset = instance * poseSize;
    jobs[instance].mesh = packed.info();
    jobs[instance].pose = instance;
    jobs[instance].method = needs.method;
    jobs[instance].places = must(placeVertices(needs.layout, vertexCount, instance * instanceSize));
  }
  Batch batch;
  batch.poses = descriptions;
  batch.jobs = jobs;
  batch.meshesSize = packed.bytes().size();
  batch.posesSize = instanceCount * poseSize;
  batch.outputSizes.fill(instanceCount * instanceSize);
  Plan plan;
  must(makePlan(batch, context.limits(), context.tuning(), plan));

  // The plan lists the buffers to create. Poses, tables and palettes need one buffer for each frame
  // in flight; this program has one.
  const auto make = [&](BufferRole role, VkBufferUsageFlags ownUsage = 0) {
    const auto needed = plan.buffer(role);
    return makeBuffer(engine, needed.size, needed.usage | ownUsage);
  };
  const Buffer meshes = make(BufferRole::meshes), poses = make(BufferRole::poses),
               tables = make(BufferRole::tables), palettes = make(BufferRole::palettes),
               vertices = make(BufferRole::positions, VK_BUFFER_USAGE_VERTEX_BUFFER_BIT);
  std::ranges::copy(packed.bytes(), meshes.bytes().begin());
  const auto bindings = must(context.createBindings(
      {.meshes = {meshes.handle, 0, meshes.size},
       .poses = {poses.handle, 0, poses.size},
       .tables = {tables.handle, 0, tables.size},
       .palettes = {palettes.handle, 0, palettes.size},
       .outputs = ByStream<vulkan::BufferRange>::all({vertices.handle, 0, vertices.size}),
       .results = {}}));
  // [/set-up]

  std::vector<JointMatrix> matrices;
  for (std::uint32_t frame = 0; frame < frameCount; ++frame) {
    matrices = posesOf(frame);
    auto begin = structure<VkCommandBufferBeginInfo>(VK_STRUCTURE_TYPE_COMMAND_BUFFER_BEGIN_INFO);
    must(vkBeginCommandBuffer(engine.commandBuffer, &begin));
    // [frame]
    std::ranges::copy(std::as_bytes(std::span(matrices)), poses.bytes().begin());
    must(writeTables(plan, tables.bytes()));
    // The engine records the barriers around `record`: only it knows how else it uses the buffers.
    context.recordBarrier(engine.commandBuffer, Use::dermis, Use::dermis);
    must(context.record(engine.commandBuffer, plan, bindings));
    // This program reads the vertices on the CPU. To draw them, use `Use::vertexInput`.
    context.recordBarrier(engine.commandBuffer, Use::dermis, Use::hostRead);
    // [/frame]
    must(vkEndCommandBuffer(engine.commandBuffer));
    submit(engine);
  }

  // -- The check: every vertex is compared with the reference in double precision.
  double worst = 0;
  for (std::uint32_t instance = 0; instance < instanceCount; ++instance) {
    const std::byte* skinnedInstance =
        vertices.mapped + std::size_t{instance} * vertexCount * sizeof(SkinnedVertex);
    SkinnedView skinned;
    skinned.positions = {skinnedInstance, vertexCount, sizeof(SkinnedVertex),
                         VertexFormat::float32x3};
    skinned.normals = {skinnedInstance + offsetof(SkinnedVertex, normal), vertexCount,
                       sizeof(SkinnedVertex), VertexFormat::octahedral16x2};
    const auto pose = std::span(matrices).subspan(std::size_t{instance} * jointCount, jointCount);
    const auto expected = must(reference::skin(mesh, pose, needs.method));
    const Comparison comparison = must(compareWithReference(expected, skinned));
    if (!comparison.passed()) {
      std::printf("instance %u is WRONG\n", instance);
      return 1;
    }
    worst = std::max({worst, comparison.worstPosition, comparison.worstNormal});
  }
  std::printf(
      "%u frames of %u instances in %u dispatches each: every vertex is right, worst error "
      "%.0f %% of its bound\n",
      frameCount, instanceCount, plan.dispatchCount(), 100 * worst);
  return 0;  // the operating system takes the device back
}
