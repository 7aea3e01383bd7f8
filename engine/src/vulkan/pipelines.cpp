#include "vulkan/pipelines.h"

#include <algorithm>
#include <span>
#include <string>
#include <string_view>
#include <utility>

#include "abi.h"
#include "dermis_kernels.h"
#include "plan/check.h"
#include "plan/variant.h"

namespace dermis::vulkan {

namespace {

/// Without SPIR-V if this build does not have it.
PipelineDescription descriptionOf(const Variant& variant) {
  PipelineDescription description;
  description.name = pipelineName(variant);
  description.module = moduleName(variant);
  description.spirv = kernels::find(description.module);
  description.constants = constantsOf(variant);
  description.storageBuffers = variant.oneOutput ? abi::MIN_BINDING_COUNT : abi::BINDING_COUNT;
  description.texelBuffers = variant.texels ? abi::TEXEL_BINDING_COUNT : 0;
  return description;
}

/// Checks that a device with these features can use the module for a variant.
Result<void> checkFeatures(const Variant& variant, const DeviceLimits& limits) {
  if (variant.texels && !limits.texelBuffers) {
    return Error{ErrorCode::missingFeature,
                 "a pipeline that reads texel buffers needs scalarBlockLayout and shaderInt64"};
  }
  if (!variant.oneOutput && limits.maxStorageBuffersPerStage < storageBuffersWanted) {
    return Error{ErrorCode::missingFeature,
                 "the pipeline needs " + std::to_string(storageBuffersWanted) +
                     " storage buffers per stage: it was listed for the limits of another device"};
  }
  return {};
}

}  // namespace

Result<PipelineDescription> pipelineDescription(PipelineId id) {
  if (Result<void> good = checkPipeline(id); !good) return good.error();
  PipelineDescription description = descriptionOf(variantOf(id));
  if (!description.spirv.empty()) return description;
  return Error{ErrorCode::missingFeature,
               "this build of Dermis has no kernel '" + description.module + "'"};
}

Pipelines::~Pipelines() {
  destroy(pipelines_);
  for (const Retired& retired : retired_)
    table_.destroyPipeline(device_, retired.pipeline, allocator_);
}

Result<void> Pipelines::build(PipelineId id, VkPipelineLayout layout) {
  if (find(id) != VK_NULL_HANDLE) return {};
  if (Result<void> good = checkPipeline(id); !good) return good;
  if (Result<void> good = checkFeatures(variantOf(id), limits_); !good) return good;
  while (true) {
    const std::uint64_t began = generation();
    // Not under the lock: a compile takes long, and `record` must not wait for it.
    const Result<VkPipeline> pipeline = createFromSource(id, layout);
    if (!pipeline) return pipeline.error();

    const std::unique_lock lock(mutex_);
    if (generation_ == began && pipelines_.try_emplace(id, *pipeline).second) return {};
    table_.destroyPipeline(device_, *pipeline, allocator_);
    if (generation_ == began) return {};  // another thread was faster
    // Kernels were replaced in the meantime, so build it again.
  }
}

Result<VkPipeline> Pipelines::createFromSource(PipelineId id, VkPipelineLayout layout) const {
  PipelineDescription description = descriptionOf(variantOf(id));
  std::vector<std::uint32_t> words;
  if (kernelSource_.get != nullptr) {
    Result<std::vector<std::uint32_t>> spirv =
        kernelSource_.get(kernelSource_.user, description.module);
    if (!spirv) return spirv.error();
    words = std::move(*spirv);
    description.spirv = words;
  }
  if (!description.spirv.empty()) return create(description, layout);
  return Error{ErrorCode::missingFeature,
               (kernelSource_.get != nullptr ? "KernelSource::get returned no kernel '"
                                             : "this build of Dermis has no kernel '") +
                   description.module + "'"};
}

std::uint64_t Pipelines::generation() const {
  const std::shared_lock lock(mutex_);
  return generation_;
}

void Pipelines::destroy(const Built& pipelines) const {
  for (const auto& [id, pipeline] : pipelines)
    table_.destroyPipeline(device_, pipeline, allocator_);
}

Result<std::uint32_t> Pipelines::replace(std::span<const KernelModule> modules,
                                         VkPipelineLayout layout, std::uint64_t frame,
                                         std::uint64_t completedFrame) {
  const auto moduleOf = [&](PipelineId id) {
    const std::string name = moduleName(variantOf(id));
    return std::ranges::find(modules, std::string_view(name), &KernelModule::name);
  };
  Built replacements;
  std::vector<VkPipeline> complete;
  while (true) {
    // Pipelines that must be replaced and have no replacement yet. `build` may add some in the
    // meantime.
    std::vector<PipelineId> missing;
    {
      const std::unique_lock lock(mutex_);
      for (const auto& [id, pipeline] : pipelines_) {
        if (!modules.empty() && moduleOf(id) != modules.end() && !replacements.contains(id))
          missing.push_back(id);
      }
      if (missing.empty()) {
        if (!modules.empty()) ++generation_;
        for (const auto& [id, replacement] : replacements)
          retired_.push_back({std::exchange(pipelines_.at(id), replacement), frame});
        std::erase_if(retired_, [&](const Retired& retired) {
          if (retired.frame > completedFrame) return false;
          complete.push_back(retired.pipeline);
          return true;
        });
        break;
      }
    }
    for (const PipelineId id : missing) {
      PipelineDescription description = descriptionOf(variantOf(id));
      description.spirv = moduleOf(id)->spirv;
      const Result<VkPipeline> pipeline = create(description, layout);
      if (!pipeline) {
        destroy(replacements);
        return pipeline.error();
      }
      replacements.emplace(id, *pipeline);
    }
  }
  for (const VkPipeline pipeline : complete) table_.destroyPipeline(device_, pipeline, allocator_);
  return static_cast<std::uint32_t>(replacements.size());
}

Result<VkPipeline> Pipelines::create(const PipelineDescription& description,
                                     VkPipelineLayout layout) const {
  VkShaderModuleCreateInfo info{};
  info.sType = VK_STRUCTURE_TYPE_SHADER_MODULE_CREATE_INFO;
  info.codeSize = description.spirv.size_bytes();
  info.pCode = description.spirv.data();
  VkShaderModule module = VK_NULL_HANDLE;
  if (const VkResult result = table_.createShaderModule(device_, &info, allocator_, &module);
      result != VK_SUCCESS) {
    return vulkanError("vkCreateShaderModule", result);
  }
  const Result<VkPipeline> pipeline = create(description, layout, module);
  table_.destroyShaderModule(device_, module, allocator_);
  return pipeline;
}

Result<VkPipeline> Pipelines::create(const PipelineDescription& description,
                                     VkPipelineLayout layout, VkShaderModule module) const {
  const std::vector<std::uint32_t>& constants = description.constants;
  std::vector<VkSpecializationMapEntry> entries;
  for (std::uint32_t id = 0; id < constants.size(); ++id) entries.push_back({id, id * 4, 4});
  VkSpecializationInfo specialization{};
  specialization.mapEntryCount = static_cast<std::uint32_t>(entries.size());
  specialization.pMapEntries = entries.data();
  specialization.dataSize = constants.size() * 4;
  specialization.pData = constants.data();

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
  nameObject(table_, device_, VK_OBJECT_TYPE_PIPELINE, pipeline, "dermis: " + description.name);
  return pipeline;
}

VkPipeline Pipelines::find(PipelineId id) const {
  const std::shared_lock lock(mutex_);
  const auto entry = pipelines_.find(id);
  return entry == pipelines_.end() ? VK_NULL_HANDLE : entry->second;
}

}  // namespace dermis::vulkan
