#include "vulkan/pipelines.h"

#include <array>
#include <span>
#include <string>

#include "dermis/vulkan/kernels.h"

namespace dermis::vulkan {

namespace {

/// Whether a device with these features may have the module for a variant.
Result<void> checkFeatures(const Variant& variant, const DeviceLimits& limits) {
  for (const std::uint8_t unit : variant.units) {
    if (unit >= 4 || (limits.storage16Bit && (unit == 2 || limits.storage8Bit))) continue;
    return Error{ErrorCode::missingFeature,
                 "a variant that stores less than a word at a time needs storageBuffer16BitAccess "
                 "and, for single bytes, storageBuffer8BitAccess"};
  }
  if (variant.wideStores && !(limits.scalarBlockLayout && limits.shaderInt64)) {
    return Error{ErrorCode::missingFeature,
                 "a variant that stores more than a word at a time needs scalarBlockLayout and "
                 "shaderInt64"};
  }
  return {};
}

}  // namespace

Pipelines::~Pipelines() {
  for (const auto& [key, pipeline] : pipelines_)
    table_.destroyPipeline(device_, pipeline, allocator_);
}

Result<void> Pipelines::build(const Variant& variant, VkPipelineLayout layout) {
  if (find(variant) != VK_NULL_HANDLE) return {};
  if (Result<void> good = checkFeatures(variant, limits_); !good) return good;
  const std::span<const std::uint32_t> spirv = kernelSpirv(variant, limits_);
  if (spirv.empty()) {
    return Error{ErrorCode::missingFeature, "this build of Dermis has no kernel for " +
                                                std::string(methodName(variant.method)) +
                                                " in that layout"};
  }
  VkShaderModuleCreateInfo info{};
  info.sType = VK_STRUCTURE_TYPE_SHADER_MODULE_CREATE_INFO;
  info.codeSize = spirv.size_bytes();
  info.pCode = spirv.data();
  VkShaderModule module = VK_NULL_HANDLE;
  if (const VkResult result = table_.createShaderModule(device_, &info, allocator_, &module);
      result != VK_SUCCESS) {
    return vulkanError("vkCreateShaderModule", result);
  }
  // Not under the lock: a compile takes long, and `record` must not wait for it.
  const Result<VkPipeline> pipeline = create(variant, layout, module);
  table_.destroyShaderModule(device_, module, allocator_);
  if (!pipeline) return pipeline.error();

  const std::unique_lock lock(mutex_);
  if (!pipelines_.try_emplace(variant.key(), *pipeline).second)
    table_.destroyPipeline(device_, *pipeline, allocator_);  // another thread was faster
  return {};
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
  return entry == pipelines_.end() ? VK_NULL_HANDLE : entry->second;
}

}  // namespace dermis::vulkan
