// The kernels as data, for an engine that executes the commands of a plan with its own RHI. Needs
// no Vulkan device.
//
// Descriptor set 0 of every kernel has `storageBuffersWanted` storage buffers, or the first four on
// a device that has fewer per stage:
//
// - palette kernel: 0 tables, 1 poses, 2 palettes;
// - clear kernel: 0 tables, 7 results;
// - skin kernel: 0 tables, 1 meshes, 2 palettes (linear: poses), 3 positions, 4 normals, 5
// tangents,
//   6 previous positions, 7 results;
// - visibility kernel: 0 tables, 1 visibility, 2 history, 3 counters, 7 results.
//
// A binding that a kernel does not use may have any buffer. With four, all attributes go to
// binding 3. Variants with `texels` also have uniform texel buffers: 8 tables, 9 meshes and 11
// palettes (linear: poses) in VK_FORMAT_R32G32B32A32_UINT, 10 meshes in VK_FORMAT_R32_UINT, views
// of the same ranges. Records and push constants are in shaders/abi.h, which compiles as C++; it is
// installed in DERMIS_SHADER_DIR.
#pragma once

#include <array>
#include <cstdint>
#include <span>

#include "dermis/export.h"
#include "dermis/plan.h"

namespace dermis::vulkan {

/// The module for a variant, on a device with these limits: SPIR-V 1.3, entry point "main". The
/// memory is static: variants with one module get the same span. A module that stores less than a
/// word requires `storage16Bit` or `storage8Bit` of `DeviceLimits`, one that stores more
/// `shaderInt64` and perhaps `scalarBlockLayout`. Empty if this build of Dermis does not contain
/// the module.
DERMIS_VULKAN_API std::span<const std::uint32_t> kernelSpirv(const Variant& variant,
                                                             const DeviceLimits& limits);

/// The values of a kernel's specialisation constants: `values[id]` for the ids from 0 to `count` -
/// 1, 4 bytes each.
struct SpecializationConstants {
  std::array<std::uint32_t, 20> values{};
  std::uint32_t count = 0;
};

DERMIS_VULKAN_API SpecializationConstants specializationConstants(const Variant& variant);

}  // namespace dermis::vulkan
