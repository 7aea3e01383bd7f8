// The kernels as SPIR-V, for an engine that executes the commands of a plan with its own RHI. Needs
// no Vulkan device.
//
// Descriptor set 0 of every kernel has `storageBuffersWanted` storage buffers:
//
// - palette kernel: 0 tables, 1 poses, 2 palettes;
// - clear kernel: 0 tables, 7 results;
// - skin kernel: 0 tables, 1 meshes, 2 `DispatchCommand::joints`, 3 positions, 4 normals, 5
//   tangents, 6 previous positions, 7 results;
// - visibility kernel: 0 tables, 1 visibility, 2 history, 3 counters, 7 results.
//
// On a device with fewer storage buffers per stage, the set has bindings 0 to 3 only, and all
// attributes go to binding 3. A binding that a kernel does not use may have any buffer.
//
// Kernels of variants with `texels` also have uniform texel buffers. They are views of the same
// ranges: 8 tables, 9 meshes and 11 `DispatchCommand::joints` as VK_FORMAT_R32G32B32A32_UINT, 10
// meshes as VK_FORMAT_R32_UINT.
//
// The records in the buffers and the push constants are declared in shaders/abi.h, which compiles
// as C++. It is installed in DERMIS_SHADER_DIR.
#pragma once

#include <array>
#include <cstdint>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "dermis/export.h"
#include "dermis/plan.h"
#include "dermis/result.h"

namespace dermis::vulkan {

/// The name of the module for a variant, on a device with these limits: "skin_texels". Empty if the
/// variant has a member that no plan uses.
DERMIS_VULKAN_API std::string kernelName(const Variant& variant, const DeviceLimits& limits);

/// The module for a variant, on a device with these limits: SPIR-V 1.3, entry point "main". The
/// memory is static, and variants of the same module get the same span. With `Variant::texels` it
/// requires the features `shaderInt64` and `scalarBlockLayout`. Empty if this build of Dermis does
/// not contain the module.
DERMIS_VULKAN_API std::span<const std::uint32_t> kernelSpirv(const Variant& variant,
                                                             const DeviceLimits& limits);

/// The values of the specialization constants of a kernel: `values[id]`, 4 bytes each, for the ids
/// from 0 to `count` - 1.
struct SpecializationConstants {
  std::array<std::uint32_t, 20> values{};
  std::uint32_t count = 0;
};

/// The specialization constants for a variant.
DERMIS_VULKAN_API SpecializationConstants specializationConstants(const Variant& variant);

/// Supplies modules to a Context that replace those in the library: `RuntimeCompiler::source`
/// (runtime_compiler.h), or the engine's own build of the kernels.
struct KernelSource {
  void* user = nullptr;  ///< passed to `get`
  /// Returns the SPIR-V of the module with this `kernelName`. `Context::prepare` calls it for each
  /// pipeline that it creates, in the thread that calls `prepare`; several threads may call it at
  /// once. If it fails, `prepare` fails with the same error. It must not throw. If null, the
  /// modules in the library are used.
  Result<std::vector<std::uint32_t>> (*get)(void* user, std::string_view name) = nullptr;
};

/// A module and its `kernelName`. The caller owns the memory.
struct KernelModule {
  std::string_view name;
  std::span<const std::uint32_t> spirv;
};

}  // namespace dermis::vulkan
