// How to build a pipeline, for an engine that executes the commands of a plan with its own RHI, and
// modules that replace those of the library. Needs no Vulkan device.
//
// What kernels read and write, and the push constants, are declared in shaders/abi.h, which
// compiles as C++. It is installed in DERMIS_SHADER_DIR.
#pragma once

#include <cstdint>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "dermis/export.h"
#include "dermis/plan.h"
#include "dermis/result.h"

namespace dermis::vulkan {

/// What a compute pipeline is built from.
struct PipelineDescription {
  std::string name;    ///< for messages and debuggers
  std::string module;  ///< name of the SPIR-V module, for example "skin_texels"
  /// SPIR-V 1.3, entry point "main". The memory is static; pipelines of one module have the same.
  /// With texel buffers it requires the features `shaderInt64` and `scalarBlockLayout`.
  std::span<const std::uint32_t> spirv;
  /// The values of the specialization constants from id 0 on, 4 bytes each.
  std::vector<std::uint32_t> constants;
  /// Descriptor set 0 has storage buffers in the slots from 0 on, and uniform texel buffers in the
  /// slots that follow. The only other resource is a range of push constants, at most
  /// `DispatchCommand::constants`. All pipelines for one device can share a layout: the largest.
  std::uint32_t storageBuffers = 0, texelBuffers = 0;
};

/// Describes a pipeline. Fails with `invalidArgument` if `pipelines` never lists it, and with
/// `missingFeature` if this build of Dermis does not contain its module.
DERMIS_VULKAN_API Result<PipelineDescription> pipelineDescription(PipelineId id);

/// Supplies modules to a Context that replace those in the library: `RuntimeCompiler::source`
/// (runtime_compiler.h), or the engine's own build of the kernels.
struct KernelSource {
  void* user = nullptr;  ///< passed to `get`
  /// Returns the SPIR-V of the module with this name (`PipelineDescription::module`).
  /// `Context::prepare` calls it for each pipeline that it creates, in the thread that calls
  /// `prepare`; several threads may call it at once. If it fails, `prepare` fails with the same
  /// error. It must not throw. If null, the modules in the library are used.
  Result<std::vector<std::uint32_t>> (*get)(void* user, std::string_view name) = nullptr;
};

/// A module and its name. The caller owns the memory.
struct KernelModule {
  std::string_view name;
  std::span<const std::uint32_t> spirv;
};

}  // namespace dermis::vulkan
