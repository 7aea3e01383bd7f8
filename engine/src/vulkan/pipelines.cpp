#include "vulkan/pipelines.h"

#include <algorithm>
#include <array>
#include <span>
#include <string>
#include <string_view>
#include <utility>

#include "plan/check.h"

namespace dermis::vulkan {

namespace {

/// Checks that a device with these features can use the module for a variant.
Result<void> checkFeatures(const Variant& variant, const DeviceLimits& limits) {
  if (variant.texels && !limits.texelBuffers) {
    return Error{ErrorCode::missingFeature,
                 "a variant that reads texel buffers needs scalarBlockLayout and shaderInt64"};
  }
  return {};
}

}  // namespace

Pipelines::~Pipelines() {
  for (const auto& [key, built] : pipelines_)
    table_.destroyPipeline(device_, built.pipeline, allocator_);
  for (const Retired& retired : retired_)
    table_.destroyPipeline(device_, retired.pipeline, allocator_);
}

Result<void> Pipelines::build(const Variant& variant, VkPipelineLayout layout) {
  if (Result<void> good = checkVariant(variant); !good) return good;  // before `key`
  if (find(variant) != VK_NULL_HANDLE) return {};
  if (Result<void> good = checkFeatures(variant, limits_); !good) return good;
  while (true) {
    const std::uint64_t began = generation();
    // Not under the lock: a compile takes long, and `record` must not wait for it.
    const Result<VkPipeline> pipeline = createFromSource(variant, layout);
    if (!pipeline) return pipeline.error();

    const std::unique_lock lock(mutex_);
    if (generation_ == began &&
        pipelines_.try_emplace(variant.key(), Built{variant, *pipeline}).second) {
      return {};
    }
    table_.destroyPipeline(device_, *pipeline, allocator_);
    if (generation_ == began) return {};  // another thread was faster
    // Kernels were replaced in the meantime, so build it again.
  }
}

Result<VkPipeline> Pipelines::createFromSource(const Variant& variant,
                                               VkPipelineLayout layout) const {
  if (kernelSource_.get != nullptr) {
    const Result<std::vector<std::uint32_t>> spirv =
        kernelSource_.get(kernelSource_.user, kernelName(variant, limits_));
    if (!spirv) return spirv.error();
    if (spirv->empty()) {
      return Error{ErrorCode::missingFeature,
                   "KernelSource::get returned no kernel '" + kernelName(variant, limits_) + "'"};
    }
    return create(variant, layout, *spirv);
  }
  const std::span<const std::uint32_t> spirv = kernelSpirv(variant, limits_);
  if (spirv.empty()) {
    return Error{ErrorCode::missingFeature,
                 "this build of Dermis has no kernel '" + kernelName(variant, limits_) + "'"};
  }
  return create(variant, layout, spirv);
}

std::uint64_t Pipelines::generation() const {
  const std::shared_lock lock(mutex_);
  return generation_;
}

void Pipelines::destroy(std::span<const Built> pipelines) const {
  for (const Built& built : pipelines) table_.destroyPipeline(device_, built.pipeline, allocator_);
}

Result<std::uint32_t> Pipelines::replace(std::span<const KernelModule> modules,
                                         VkPipelineLayout layout, std::uint64_t frame,
                                         std::uint64_t completedFrame) {
  const auto moduleOf = [&](const Variant& variant) {
    const std::string name = kernelName(variant, limits_);
    return std::ranges::find(modules, std::string_view(name), &KernelModule::name);
  };
  std::vector<Built> replacements;
  std::vector<VkPipeline> complete;
  while (true) {
    // Pipelines that must be replaced and have no replacement yet. `build` may add some in the
    // meantime.
    std::vector<Variant> missing;
    {
      const std::unique_lock lock(mutex_);
      for (const auto& [key, built] : pipelines_) {
        if (modules.empty() || moduleOf(built.variant) == modules.end()) continue;
        const bool isThere = std::ranges::any_of(
            replacements, [&key = key](const Built& other) { return other.variant.key() == key; });
        if (!isThere) missing.push_back(built.variant);
      }
      if (missing.empty()) {
        if (!modules.empty()) ++generation_;
        for (const Built& replacement : replacements) {
          Built& built = pipelines_.at(replacement.variant.key());
          retired_.push_back({std::exchange(built.pipeline, replacement.pipeline), frame});
        }
        std::erase_if(retired_, [&](const Retired& retired) {
          if (retired.frame > completedFrame) return false;
          complete.push_back(retired.pipeline);
          return true;
        });
        break;
      }
    }
    for (const Variant& variant : missing) {
      const Result<VkPipeline> pipeline = create(variant, layout, moduleOf(variant)->spirv);
      if (!pipeline) {
        destroy(replacements);
        return pipeline.error();
      }
      replacements.push_back({variant, *pipeline});
    }
  }
  for (const VkPipeline pipeline : complete) table_.destroyPipeline(device_, pipeline, allocator_);
  return static_cast<std::uint32_t>(replacements.size());
}

Result<VkPipeline> Pipelines::create(const Variant& variant, VkPipelineLayout layout,
                                     std::span<const std::uint32_t> spirv) const {
  VkShaderModuleCreateInfo info{};
  info.sType = VK_STRUCTURE_TYPE_SHADER_MODULE_CREATE_INFO;
  info.codeSize = spirv.size_bytes();
  info.pCode = spirv.data();
  VkShaderModule module = VK_NULL_HANDLE;
  if (const VkResult result = table_.createShaderModule(device_, &info, allocator_, &module);
      result != VK_SUCCESS) {
    return vulkanError("vkCreateShaderModule", result);
  }
  const Result<VkPipeline> pipeline = create(variant, layout, module);
  table_.destroyShaderModule(device_, module, allocator_);
  return pipeline;
}

Result<VkPipeline> Pipelines::create(const Variant& variant, VkPipelineLayout layout,
                                     VkShaderModule module) const {
  const SpecializationConstants constants = specializationConstants(variant);
  std::array<VkSpecializationMapEntry, constants.values.size()> entries{};
  for (std::uint32_t id = 0; id < constants.count; ++id) entries[id] = {id, id * 4, 4};
  VkSpecializationInfo specialization{};
  specialization.mapEntryCount = constants.count;
  specialization.pMapEntries = entries.data();
  specialization.dataSize = std::size_t{constants.count} * 4;
  specialization.pData = constants.values.data();

  VkComputePipelineCreateInfo info{};
  info.sType = VK_STRUCTURE_TYPE_COMPUTE_PIPELINE_CREATE_INFO;
  info.stage.sType = VK_STRUCTURE_TYPE_PIPELINE_SHADER_STAGE_CREATE_INFO;
  info.stage.stage = VK_SHADER_STAGE_COMPUTE_BIT;
  info.stage.module = module;
  info.stage.pName = "main";
  info.stage.pSpecializationInfo = &specialization;
  info.layout = layout;

  VkPipeline pipeline = VK_NULL_HANDLE;
  if (const VkResult result =
          table_.createComputePipelines(device_, cache_, 1, &info, allocator_, &pipeline);
      result != VK_SUCCESS) {
    return vulkanError("vkCreateComputePipelines", result);
  }
  static constexpr std::array<const char*, 4> names{"dermis palette ", "dermis skin ",
                                                    "dermis visibility", "dermis clear"};
  std::string name = names[static_cast<std::size_t>(variant.kernel)];
  if (variant.kernel == Kernel::palette || variant.kernel == Kernel::skin)
    name += methodName(variant.method);
  nameObject(table_, device_, VK_OBJECT_TYPE_PIPELINE, pipeline, name);
  return pipeline;
}

VkPipeline Pipelines::find(const Variant& variant) const {
  const std::shared_lock lock(mutex_);
  const auto entry = pipelines_.find(variant.key());
  return entry == pipelines_.end() ? VK_NULL_HANDLE : entry->second.pipeline;
}

}  // namespace dermis::vulkan
