// Limits of kinds of devices, in what Dermis looks at or could trip over. Each is near what drivers
// of that kind report; none is a description of one device.
//
// What is not here needs none: kernels have no subgroup operations, so that no subgroup size is
// seen; they ask for no float controls, so that denormals may be flushed; they index nothing out of
// range, so that robustness may be off (KernelTest).
#pragma once

#include <algorithm>
#include <array>
#include <cstdint>
#include <string_view>

#include <vulkan/vulkan_core.h>

namespace dermis::test {

struct DeviceProfile {
  std::string_view name;
  VkPhysicalDeviceType type = VK_PHYSICAL_DEVICE_TYPE_OTHER;
  std::uint32_t vendor = 0;
  std::uint32_t storageBuffers = 4;       ///< of a stage
  std::uint32_t storageRange = 1u << 27;  ///< bytes
  std::uint32_t storageAlignment = 256;   ///< of offsets
  std::uint32_t texels = 65536;           ///< of a texel buffer
  std::uint32_t texelAlignment = 256;     ///< of offsets
  std::uint32_t nonCoherentAtomSize = 256;
  std::array<std::uint32_t, 2> workgroups{65535, 65535};
  std::uint32_t invocations = 128;        ///< of a workgroup
  std::uint32_t sharedMemory = 16 << 10;  ///< bytes
};

inline constexpr std::uint32_t unlimited = 0xffffffffu;

inline constexpr std::array<DeviceProfile, 6> deviceProfiles{
    {// What Vulkan guarantees, and old Mali GPUs have.
     {.name = "least"},
     {.name = "mali",
      .type = VK_PHYSICAL_DEVICE_TYPE_INTEGRATED_GPU,
      .storageBuffers = 35,
      .storageRange = 1u << 29,
      .storageAlignment = 64,
      .nonCoherentAtomSize = 64,
      .invocations = 512,
      .sharedMemory = 32 << 10},
     {.name = "moltenvk",
      .type = VK_PHYSICAL_DEVICE_TYPE_INTEGRATED_GPU,
      .storageBuffers = 31,
      .storageRange = unlimited,
      .storageAlignment = 16,
      .texels = 1u << 28,
      .nonCoherentAtomSize = 16384,
      .workgroups = {1u << 30, 1u << 30},
      .invocations = 1024,
      .sharedMemory = 32 << 10},
     {.name = "nvidia",
      .type = VK_PHYSICAL_DEVICE_TYPE_DISCRETE_GPU,
      .vendor = 0x10de,
      .storageBuffers = 1u << 20,
      .storageRange = unlimited,
      .storageAlignment = 16,
      .texels = 1u << 27,
      .texelAlignment = 16,
      .nonCoherentAtomSize = 64,
      .workgroups = {0x7fffffffu, 65535},
      .invocations = 1024,
      .sharedMemory = 48 << 10},
     {.name = "amd",
      .type = VK_PHYSICAL_DEVICE_TYPE_DISCRETE_GPU,
      .vendor = 0x1002,
      .storageBuffers = unlimited,
      .storageRange = unlimited,
      .storageAlignment = 4,
      .texels = unlimited,
      .texelAlignment = 4,
      .nonCoherentAtomSize = 64,
      .workgroups = {unlimited, unlimited},
      .invocations = 1024,
      .sharedMemory = 64 << 10},
     {.name = "intel",
      .type = VK_PHYSICAL_DEVICE_TYPE_INTEGRATED_GPU,
      .vendor = 0x8086,
      .storageBuffers = 64,
      .storageRange = 1u << 30,
      .storageAlignment = 4,
      .texels = 1u << 27,
      .texelAlignment = 16,
      .nonCoherentAtomSize = 64,
      .invocations = 1024,
      .sharedMemory = 64 << 10}}};

/// Limits that are no better than those of the profile, nor than they were.
inline void lowerLimits(const DeviceProfile& profile, VkPhysicalDeviceLimits& limits) {
  const auto lower = [](std::uint32_t& limit, std::uint32_t most) {
    limit = std::min(limit, most);
  };
  const auto raise = [](VkDeviceSize& limit, VkDeviceSize least) {
    limit = std::max(limit, least);
  };
  lower(limits.maxPerStageDescriptorStorageBuffers, profile.storageBuffers);
  lower(limits.maxStorageBufferRange, profile.storageRange);
  lower(limits.maxTexelBufferElements, profile.texels);
  lower(limits.maxComputeWorkGroupCount[0], profile.workgroups[0]);
  lower(limits.maxComputeWorkGroupCount[1], profile.workgroups[1]);
  lower(limits.maxComputeWorkGroupInvocations, profile.invocations);
  lower(limits.maxComputeWorkGroupSize[0], profile.invocations);
  lower(limits.maxComputeSharedMemorySize, profile.sharedMemory);
  raise(limits.minStorageBufferOffsetAlignment, profile.storageAlignment);
  raise(limits.minTexelBufferOffsetAlignment, profile.texelAlignment);
  raise(limits.nonCoherentAtomSize, profile.nonCoherentAtomSize);
}

}  // namespace dermis::test
