// The kernels as data, for an engine that issues the dispatches of a plan with its own RHI. Needs
// no Vulkan device.
//
// Descriptor set 0 of every kernel has `storageBuffersWanted` storage buffers or, on a device that
// has fewer a stage, four. Variants with `texels` have uniform texel buffers behind them, views of
// the same ranges in VK_FORMAT_R32G32B32A32_UINT, of meshes in VK_FORMAT_R32_UINT; binding numbers,
// records and push constants are in shaders/abi.h, which compiles as C++.
#pragma once

#include <array>
#include <cstdint>
#include <span>

#include "dermis/plan.h"

namespace dermis::vulkan {

/// The module for a variant, on a device with these limits: SPIR-V 1.3, entry point "main". The
/// memory is static: variants with one module get the same span. A module that stores less than a
/// word requires `storage16Bit` or `storage8Bit` of `DeviceLimits`. Empty if this build of Dermis
/// does not contain the module.
std::span<const std::uint32_t> kernelSpirv(const Variant& variant, const DeviceLimits& limits);

/// The values of a kernel's specialisation constants: `values[id]` for the ids from 0 to `count` -
/// 1, 4 bytes each.
struct SpecializationConstants {
  std::array<std::uint32_t, 16> values{};
  std::uint32_t count = 0;
};

SpecializationConstants specializationConstants(const Variant& variant);

}  // namespace dermis::vulkan
