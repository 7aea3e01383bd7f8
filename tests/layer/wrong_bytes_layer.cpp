// A Vulkan layer that makes the device wrong: it changes bytes of buffers after the host has waited
// for them. Tests plant errors with it to see that they are found, in programs that know nothing of
// it.
//
// In the process of a test, what to change is a function (wrong_bytes.h). In any other it is
// DERMIS_WRONG_BYTES in the environment, "FIRST LAST USAGE OFFSET BITS" in decimal numbers: after
// the waits FIRST to LAST, counted from 1, these BITS of the byte at OFFSET are inverted in each
// buffer of exactly that USAGE. Several of them stand one after the other.

#include <vulkan/vk_layer.h>

#include <cstdlib>
#include <cstring>
#include <map>
#include <mutex>
#include <sstream>
#include <string>
#include <vector>

#include "next_layer.h"
#include "wrong_bytes.h"

namespace dermis::test {
namespace {

struct DeviceFunctions {
  PFN_vkGetDeviceProcAddr GetDeviceProcAddr = nullptr;
  PFN_vkDestroyDevice DestroyDevice = nullptr;
  PFN_vkCreateBuffer CreateBuffer = nullptr;
  PFN_vkDestroyBuffer DestroyBuffer = nullptr;
  PFN_vkBindBufferMemory BindBufferMemory = nullptr;
  PFN_vkMapMemory MapMemory = nullptr;
  PFN_vkFreeMemory FreeMemory = nullptr;
  PFN_vkWaitForFences WaitForFences = nullptr;
  PFN_vkQueueWaitIdle QueueWaitIdle = nullptr;
};

struct Buffer {
  std::uint64_t order = 0;
  VkBufferCreateInfo info{};
  VkDeviceMemory memory = VK_NULL_HANDLE;
  VkDeviceSize offset = 0;
};

/// Inverts bits, as the environment says.
struct Plant {
  std::uint64_t first = 0, last = 0;
  std::uint32_t usage = 0;
  std::size_t offset = 0;
  unsigned bits = 0;
};

struct Layer {
  std::mutex mutex;
  NextLayer next;
  VkInstance newest = VK_NULL_HANDLE;
  std::map<VkDevice, DeviceFunctions> devices;
  std::map<VkBuffer, Buffer> buffers;
  std::map<VkDeviceMemory, std::byte*> mapped;
  std::uint64_t made = 0, waits = 0;
  std::vector<Plant> plants;
  AfterWait afterWait;

  Layer() {
    const char* text = std::getenv("DERMIS_WRONG_BYTES");
    std::istringstream words(text != nullptr ? text : "");
    Plant plant;
    while (words >> plant.first >> plant.last >> plant.usage >> plant.offset >> plant.bits)
      plants.push_back(plant);
  }
};

/// Never destroyed: drivers have threads that end late.
Layer& layer() {
  static Layer& made = *new Layer;
  return made;
}

DeviceFunctions functionsOf(VkDevice device) {
  const std::lock_guard lock(layer().mutex);
  return layer().devices[device];
}

std::vector<WrittenBuffer> writtenBuffers() {
  std::map<std::uint64_t, WrittenBuffer> ordered;
  for (const auto& [handle, buffer] : layer().buffers) {
    const auto memory = layer().mapped.find(buffer.memory);
    if (memory == layer().mapped.end()) continue;
    std::byte* first = memory->second + buffer.offset;
    ordered[buffer.order] = {buffer.info.usage,
                             {first, static_cast<std::size_t>(buffer.info.size)}};
  }
  std::vector<WrittenBuffer> all;
  for (const auto& [order, buffer] : ordered) all.push_back(buffer);
  return all;
}

void changeBytes() {
  const std::lock_guard lock(layer().mutex);
  ++layer().waits;
  const std::vector<WrittenBuffer> buffers = writtenBuffers();
  for (const Plant& plant : layer().plants) {
    if (layer().waits < plant.first || layer().waits > plant.last) continue;
    for (const WrittenBuffer& buffer : buffers) {
      if (buffer.usage == plant.usage && plant.offset < buffer.bytes.size())
        buffer.bytes[plant.offset] ^= static_cast<std::byte>(plant.bits);
    }
  }
  if (layer().afterWait) layer().afterWait(buffers);
}

VKAPI_ATTR VkResult VKAPI_CALL createBuffer(VkDevice device, const VkBufferCreateInfo* info,
                                            const VkAllocationCallbacks* callbacks,
                                            VkBuffer* buffer) {
  const VkResult result = functionsOf(device).CreateBuffer(device, info, callbacks, buffer);
  if (result != VK_SUCCESS) return result;
  const std::lock_guard lock(layer().mutex);
  layer().buffers[*buffer] = {++layer().made, *info};
  return result;
}

VKAPI_ATTR void VKAPI_CALL destroyBuffer(VkDevice device, VkBuffer buffer,
                                         const VkAllocationCallbacks* callbacks) {
  functionsOf(device).DestroyBuffer(device, buffer, callbacks);
  const std::lock_guard lock(layer().mutex);
  layer().buffers.erase(buffer);
}

VKAPI_ATTR VkResult VKAPI_CALL bindBufferMemory(VkDevice device, VkBuffer buffer,
                                                VkDeviceMemory memory, VkDeviceSize offset) {
  {
    const std::lock_guard lock(layer().mutex);
    layer().buffers[buffer].memory = memory;
    layer().buffers[buffer].offset = offset;
  }
  return functionsOf(device).BindBufferMemory(device, buffer, memory, offset);
}

VKAPI_ATTR VkResult VKAPI_CALL mapMemory(VkDevice device, VkDeviceMemory memory,
                                         VkDeviceSize offset, VkDeviceSize size,
                                         VkMemoryMapFlags flags, void** data) {
  const VkResult result = functionsOf(device).MapMemory(device, memory, offset, size, flags, data);
  if (result != VK_SUCCESS) return result;
  const std::lock_guard lock(layer().mutex);
  layer().mapped[memory] = static_cast<std::byte*>(*data) - offset;
  return result;
}

VKAPI_ATTR void VKAPI_CALL freeMemory(VkDevice device, VkDeviceMemory memory,
                                      const VkAllocationCallbacks* callbacks) {
  {
    const std::lock_guard lock(layer().mutex);
    layer().mapped.erase(memory);
  }
  functionsOf(device).FreeMemory(device, memory, callbacks);
}

VKAPI_ATTR VkResult VKAPI_CALL waitForFences(VkDevice device, std::uint32_t count,
                                             const VkFence* fences, VkBool32 all,
                                             std::uint64_t timeout) {
  const VkResult result = functionsOf(device).WaitForFences(device, count, fences, all, timeout);
  if (result == VK_SUCCESS) changeBytes();
  return result;
}

/// The loader puts the same table at the beginning of a device and of its queues.
const void* loaderTable(const void* handle) {
  return *static_cast<const void* const*>(handle);
}

VKAPI_ATTR VkResult VKAPI_CALL queueWaitIdle(VkQueue queue) {
  PFN_vkQueueWaitIdle next = nullptr;
  {
    const std::lock_guard lock(layer().mutex);
    for (const auto& [device, functions] : layer().devices) {
      if (loaderTable(device) == loaderTable(queue)) next = functions.QueueWaitIdle;
    }
  }
  const VkResult result = next(queue);
  if (result == VK_SUCCESS) changeBytes();
  return result;
}

VKAPI_ATTR VkResult VKAPI_CALL createInstance(const VkInstanceCreateInfo* info,
                                              const VkAllocationCallbacks* callbacks,
                                              VkInstance* instance) {
  const VkResult result = layer().next.createInstance(info, callbacks, instance);
  if (result != VK_SUCCESS) return result;
  const std::lock_guard lock(layer().mutex);
  layer().newest = *instance;
  return result;
}

VKAPI_ATTR VkResult VKAPI_CALL createDevice(VkPhysicalDevice physicalDevice,
                                            const VkDeviceCreateInfo* info,
                                            const VkAllocationCallbacks* callbacks,
                                            VkDevice* device) {
  const VkLayerDeviceLink link =
      *takeLink<VkLayerDeviceCreateInfo>(info, VK_STRUCTURE_TYPE_LOADER_DEVICE_CREATE_INFO);
  const auto create = reinterpret_cast<PFN_vkCreateDevice>(
      link.pfnNextGetInstanceProcAddr(layer().newest, "vkCreateDevice"));
  const VkResult result = create(physicalDevice, info, callbacks, device);
  if (result != VK_SUCCESS) return result;
  DeviceFunctions functions;
  functions.GetDeviceProcAddr = link.pfnNextGetDeviceProcAddr;
  const auto load = [&](auto& function, const char* name) {
    function = reinterpret_cast<std::remove_reference_t<decltype(function)>>(
        link.pfnNextGetDeviceProcAddr(*device, name));
  };
  load(functions.DestroyDevice, "vkDestroyDevice");
  load(functions.CreateBuffer, "vkCreateBuffer");
  load(functions.DestroyBuffer, "vkDestroyBuffer");
  load(functions.BindBufferMemory, "vkBindBufferMemory");
  load(functions.MapMemory, "vkMapMemory");
  load(functions.FreeMemory, "vkFreeMemory");
  load(functions.WaitForFences, "vkWaitForFences");
  load(functions.QueueWaitIdle, "vkQueueWaitIdle");
  const std::lock_guard lock(layer().mutex);
  layer().devices[*device] = functions;
  return result;
}

VKAPI_ATTR void VKAPI_CALL destroyDevice(VkDevice device, const VkAllocationCallbacks* callbacks) {
  DeviceFunctions functions;
  {
    const std::lock_guard lock(layer().mutex);
    functions = layer().devices[device];
    layer().devices.erase(device);
  }
  functions.DestroyDevice(device, callbacks);
}

PFN_vkVoidFunction deviceFunction(const std::string& name) {
  const std::map<std::string, PFN_vkVoidFunction> own{
      {"vkDestroyDevice", reinterpret_cast<PFN_vkVoidFunction>(destroyDevice)},
      {"vkCreateBuffer", reinterpret_cast<PFN_vkVoidFunction>(createBuffer)},
      {"vkDestroyBuffer", reinterpret_cast<PFN_vkVoidFunction>(destroyBuffer)},
      {"vkBindBufferMemory", reinterpret_cast<PFN_vkVoidFunction>(bindBufferMemory)},
      {"vkMapMemory", reinterpret_cast<PFN_vkVoidFunction>(mapMemory)},
      {"vkFreeMemory", reinterpret_cast<PFN_vkVoidFunction>(freeMemory)},
      {"vkWaitForFences", reinterpret_cast<PFN_vkVoidFunction>(waitForFences)},
      {"vkQueueWaitIdle", reinterpret_cast<PFN_vkVoidFunction>(queueWaitIdle)}};
  const auto found = own.find(name);
  return found == own.end() ? nullptr : found->second;
}

VKAPI_ATTR PFN_vkVoidFunction VKAPI_CALL getDeviceProcAddr(VkDevice device, const char* name) {
  if (std::strcmp(name, "vkGetDeviceProcAddr") == 0)
    return reinterpret_cast<PFN_vkVoidFunction>(getDeviceProcAddr);
  if (const PFN_vkVoidFunction own = deviceFunction(name)) return own;
  return functionsOf(device).GetDeviceProcAddr(device, name);
}

VKAPI_ATTR PFN_vkVoidFunction VKAPI_CALL getInstanceProcAddr(VkInstance instance,
                                                             const char* name) {
  const std::map<std::string, PFN_vkVoidFunction> own{
      {"vkGetInstanceProcAddr", reinterpret_cast<PFN_vkVoidFunction>(getInstanceProcAddr)},
      {"vkGetDeviceProcAddr", reinterpret_cast<PFN_vkVoidFunction>(getDeviceProcAddr)},
      {"vkCreateInstance", reinterpret_cast<PFN_vkVoidFunction>(createInstance)},
      {"vkCreateDevice", reinterpret_cast<PFN_vkVoidFunction>(createDevice)}};
  if (const auto found = own.find(name); found != own.end()) return found->second;
  return layer().next.function(instance, name);
}

}  // namespace
}  // namespace dermis::test

extern "C" {

__attribute__((visibility("default"))) VkResult VKAPI_CALL
vkNegotiateLoaderLayerInterfaceVersion(VkNegotiateLayerInterface* interface) {
  interface->loaderLayerInterfaceVersion = 2;
  interface->pfnGetInstanceProcAddr = dermis::test::getInstanceProcAddr;
  interface->pfnGetDeviceProcAddr = dermis::test::getDeviceProcAddr;
  interface->pfnGetPhysicalDeviceProcAddr = nullptr;
  return VK_SUCCESS;
}

__attribute__((visibility("default"))) void dermisSetAfterWait(
    const dermis::test::AfterWait* afterWait) {
  const std::lock_guard lock(dermis::test::layer().mutex);
  dermis::test::layer().afterWait = afterWait != nullptr ? *afterWait : dermis::test::AfterWait{};
}
}
