// The smallest engine in C: a device without a window and one twisting character. At the end it
// checks every vertex of the last frame. The same program in C++ is samples/minimal.
// Exit status: 0 success; 4 no Vulkan device or a Vulkan error; 1 any other error.

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <vulkan/vulkan.h>

#include "dermis/dermis.h"

enum { VERTEX_COUNT = 200, FRAME_COUNT = 3, STRIDE = 24 };

static dermis_error error;
static void must(int code) {  // of Dermis, or a negative one of Vulkan
  if (code != 0) exit((printf("%s (%d)\n", error.message, code), code < 0 ? 4 : 1));
}

// -- What every engine already has.

#define VK(type, ...) \
  { .sType = VK_STRUCTURE_TYPE_##type, __VA_ARGS__ }

static VkInstance vk_instance;
static VkPhysicalDevice physical_device;
static VkDevice device;
static VkQueue queue;
static VkCommandBuffer cmd;
static VkBuffer read_back;
static float* vertices;  // the read-back buffer, mapped

static void make_engine(void) {
  const VkApplicationInfo application = VK(APPLICATION_INFO, .apiVersion = VK_API_VERSION_1_1);
  const VkInstanceCreateInfo info = VK(INSTANCE_CREATE_INFO, .pApplicationInfo = &application);
  must(vkCreateInstance(&info, NULL, &vk_instance));
  uint32_t one = 1;  // the first device, and its first queue family
  vkEnumeratePhysicalDevices(vk_instance, &one, &physical_device);
  if (one == 0) must(VK_ERROR_INITIALIZATION_FAILED);
  const float priority = 1;
  const VkDeviceQueueCreateInfo queue_info =
      VK(DEVICE_QUEUE_CREATE_INFO, .queueCount = 1, .pQueuePriorities = &priority);
  const VkDeviceCreateInfo device_info =
      VK(DEVICE_CREATE_INFO, .queueCreateInfoCount = 1, .pQueueCreateInfos = &queue_info);
  must(vkCreateDevice(physical_device, &device_info, NULL, &device));
  vkGetDeviceQueue(device, 0, 0, &queue);
  const VkCommandPoolCreateInfo pool_info =
      VK(COMMAND_POOL_CREATE_INFO, .flags = VK_COMMAND_POOL_CREATE_RESET_COMMAND_BUFFER_BIT);
  VkCommandBufferAllocateInfo cmd_info = VK(COMMAND_BUFFER_ALLOCATE_INFO, .commandBufferCount = 1);
  must(vkCreateCommandPool(device, &pool_info, NULL, &cmd_info.commandPool));
  must(vkAllocateCommandBuffers(device, &cmd_info, &cmd));
  const VkBufferCreateInfo buffer_info = VK(BUFFER_CREATE_INFO, .size = VERTEX_COUNT * STRIDE,
                                            .usage = VK_BUFFER_USAGE_TRANSFER_DST_BIT);
  must(vkCreateBuffer(device, &buffer_info, NULL, &read_back));
  VkMemoryRequirements needed;
  vkGetBufferMemoryRequirements(device, read_back, &needed);
  VkPhysicalDeviceMemoryProperties memory;
  vkGetPhysicalDeviceMemoryProperties(physical_device, &memory);
  const VkFlags both = VK_MEMORY_PROPERTY_HOST_VISIBLE_BIT | VK_MEMORY_PROPERTY_HOST_COHERENT_BIT;
  VkMemoryAllocateInfo memory_info = VK(MEMORY_ALLOCATE_INFO, .allocationSize = needed.size);
  uint32_t* type = &memory_info.memoryTypeIndex;
  while ((needed.memoryTypeBits >> *type & 1) == 0 ||
         (memory.memoryTypes[*type].propertyFlags & both) != both)
    ++*type;
  VkDeviceMemory block;
  must(vkAllocateMemory(device, &memory_info, NULL, &block));
  must(vkBindBufferMemory(device, read_back, block, 0));
  must(vkMapMemory(device, block, 0, VK_WHOLE_SIZE, 0, (void**)&vertices));
}

// -- The character: a strip of two joints.
static float positions[VERTEX_COUNT][3], normals[VERTEX_COUNT][3], weights[VERTEX_COUNT][2];
static uint8_t joints[VERTEX_COUNT][2];

int main(void) {
  for (int i = 0; i < VERTEX_COUNT; ++i) {
    const float along = (float)(i / 2) / (VERTEX_COUNT / 2 - 1);
    positions[i][0] = i % 2 == 0 ? -0.1f : 0.1f;
    positions[i][1] = 2 * along;
    normals[i][2] = 1;
    weights[i][0] = 1 - along;
    weights[i][1] = along;
    joints[i][1] = 1;
  }
  make_engine();

  // -- Dermis: while loading.
  // [mesh]
  const dermis_influence_set influences = {{joints, 0, DERMIS_UINT8, 2},
                                           {weights, 0, DERMIS_FLOAT32, 2}};
  const dermis_mesh_view mesh = {.size = sizeof mesh,
                                 .vertex_count = VERTEX_COUNT,
                                 .positions = {positions, 0, DERMIS_FLOAT32, 3},
                                 .normals = {normals, 0, DERMIS_FLOAT32, 3},
                                 .influence_sets = &influences,
                                 .influence_set_count = 1};
  dermis_packed* packed = NULL;
  must(dermis_pack(&mesh, 2, &packed, &error));
  // [/mesh]
  // [load]
  const dermis_device_desc device_desc = {.size = sizeof device_desc,
                                          .api_version = VK_API_VERSION_1_1,
                                          .instance = vk_instance,
                                          .physical_device = physical_device,
                                          .device = device,
                                          .get_instance_proc_addr = vkGetInstanceProcAddr};
  dermis_context* context = NULL;
  must(dermis_context_create(&device_desc, NULL, NULL, &context, &error));
  dermis_recorder* recorder = NULL;
  must(dermis_recorder_create(context, NULL, &recorder, &error));
  dermis_scene* scene = dermis_recorder_scene(recorder);

  dermis_instance_desc figure = {.size = sizeof figure,
                                 .layout = {.normals = DERMIS_FORMAT_FLOAT32X3}};
  must(dermis_add_mesh(scene, packed, &figure.mesh, &error));
  const dermis_pose_desc pose_desc = {.size = sizeof pose_desc, .joint_count = 2};
  must(dermis_add_poses(scene, &pose_desc, 1, &figure.pose, &error));
  must(dermis_prepare(context, scene, &figure, &error));
  dermis_instance instance;
  must(dermis_add_instance(scene, &figure, &instance, &error));
  dermis_destroy(packed);  // the scene has a copy
  // [/load]

  // -- Each frame.
  dermis_joint pose[2] = {{{{1, 0, 0, 0}, {0, 1, 0, 0}, {0, 0, 1, 0}}}};
  for (uint32_t frame = 1; frame <= FRAME_COUNT; ++frame) {
    const float c = cosf(0.5f * (float)frame), s = sinf(0.5f * (float)frame);
    pose[1] = (dermis_joint){{{c, 0, s, 0}, {0, 1, 0, 0}, {-s, 0, c, 0}}};
    const VkCommandBufferBeginInfo begin = VK(COMMAND_BUFFER_BEGIN_INFO, .flags = 0);
    must(vkBeginCommandBuffer(cmd, &begin));
    // [frame]
    // `frame - 1`: the newest frame that the GPU has completed. This program waits for each.
    must(dermis_begin_frame(scene, frame, frame - 1, &error));
    dermis_joint* memory;
    must(dermis_write_poses(scene, &figure.pose, 1, &memory, NULL, &error));
    memcpy(memory, pose, sizeof pose);
    must(dermis_record_barrier(context, cmd, DERMIS_USE_COPY_READ, DERMIS_USE_DERMIS, &error));
    must(dermis_record(recorder, cmd, VK_NULL_HANDLE, 0, &error));
    must(dermis_record_barrier(context, cmd, DERMIS_USE_DERMIS, DERMIS_USE_COPY_READ, &error));
    dermis_instance_info place = {.size = sizeof place};
    dermis_recorder_info output = {.size = sizeof output};
    must(dermis_instance_contents(scene, instance, &place, &error));
    must(dermis_recorder_contents(recorder, &output, &error));
    // [/frame]
    // An engine draws from place.offset of output.output_buffer. This program copies and compares.
    const VkBufferCopy copy = {place.offset, 0, VERTEX_COUNT * STRIDE};
    vkCmdCopyBuffer(cmd, output.output_buffer, read_back, 1, &copy);
    must(dermis_record_barrier(context, cmd, DERMIS_USE_COPY_WRITE, DERMIS_USE_HOST_READ, &error));
    must(vkEndCommandBuffer(cmd));
    const VkSubmitInfo submit = VK(SUBMIT_INFO, .commandBufferCount = 1, .pCommandBuffers = &cmd);
    must(vkQueueSubmit(queue, 1, &submit, VK_NULL_HANDLE));
    must(vkQueueWaitIdle(queue));
  }

  // -- The check: every vertex is compared with the reference in double precision.
  const dermis_posed_mesh posed = {sizeof posed, 2, &mesh, pose, NULL, 0, DERMIS_METHOD_DEFAULT};
  const dermis_skinned_view skinned = {.size = sizeof skinned,
                                       .vertex_count = VERTEX_COUNT,
                                       .positions = {vertices, STRIDE, DERMIS_FORMAT_FLOAT32X3},
                                       .normals = {vertices + 3, STRIDE, DERMIS_FORMAT_FLOAT32X3}};
  dermis_comparison comparison = {.size = sizeof comparison};
  must(dermis_compare(&posed, &skinned, &comparison, &error));
  printf("%d vertices: %s, worst position error %.0f %% of its bound\n", VERTEX_COUNT,
         comparison.passed ? "every vertex is right" : "WRONG", 100 * comparison.worst_position);
  return comparison.passed ? 0 : 1;  // the operating system takes the device back
}
