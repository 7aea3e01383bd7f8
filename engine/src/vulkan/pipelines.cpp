#include "vulkan/pipelines.h"

#include <array>
#include <string>

#include "dermis/vulkan/kernels.h"
#include "vulkan/object_name.h"
#include "vulkan/vulkan_error.h"

namespace dermis::vulkan {

Pipelines::~Pipelines() {
  for (const auto& [key, pipeline] : pipelines_)
    table_.destroyPipeline(device_, pipeline, allocator_);
  for (const Module& module : modules_)
    table_.destroyShaderModule(device_, module.module, allocator_);
}

Result<void> Pipelines::createModule(const Variant& variant) {
  if (moduleOf(variant) != VK_NULL_HANDLE) return {};  // shared with others
  const std::span<const std::uint32_t> spirv = kernelSpirv(variant, limits_);
  VkShaderModuleCreateInfo info{};
  info.sType = VK_STRUCTURE_TYPE_SHADER_MODULE_CREATE_INFO;
  info.codeSize = spirv.size_bytes();
  info.pCode = spirv.data();
  Module module{spirv.data(), VK_NULL_HANDLE};
  if (const VkResult result = table_.createShaderModule(device_, &info, allocator_, &module.module);
      result != VK_SUCCESS) {
    return vulkanError("vkCreateShaderModule", result);
  }
  nameObject(table_, device_, VK_OBJECT_TYPE_SHADER_MODULE, module.module,
             variant.kernel == Kernel::palette ? "dermis palette" : "dermis skin");
  modules_.push_back(module);
  return {};
}

Result<void> Pipelines::create() {
  Variant palette;
  palette.kernel = Kernel::palette;
  if (Result<void> made = createModule(palette); !made) return made;
  const bool oneOutput = limits_.maxStorageBuffersPerStage < storageBuffersWanted;
  const std::uint8_t leastUnit = oneOutput || !limits_.storage16Bit ? 4
                                 : !limits_.storage8Bit             ? 2
                                                                    : 1;
  for (const Method method : allMethods) {
    for (const Motion motion : {Motion::none, Motion::kept}) {
      Variant variant;
      variant.method = method;
      variant.motion = motion;
      for (std::uint8_t unit = 4; unit >= leastUnit; unit /= 2) {
        variant.units[0] = unit;
        if (Result<void> made = createModule(variant); !made) return made;
      }
      if (limits_.maxTexelBufferElements == 0) continue;
      variant.units[0] = 4;
      variant.texels = true;
      if (Result<void> made = createModule(variant); !made) return made;
      variant.pairs = limits_.shaderInt64;
      if (Result<void> made = createModule(variant); !made) return made;
    }
  }
  return {};
}

VkShaderModule Pipelines::moduleOf(const Variant& variant) const {
  const std::uint32_t* code = kernelSpirv(variant, limits_).data();
  for (const Module& module : modules_) {
    if (module.code == code) return module.module;
  }
  return VK_NULL_HANDLE;
}

Result<void> Pipelines::build(const Variant& variant, VkPipelineLayout layout) {
  if (find(variant) != VK_NULL_HANDLE) return {};
  const VkShaderModule module = moduleOf(variant);
  if (module == VK_NULL_HANDLE) {
    return Error{ErrorCode::missingFeature,
                 "a variant that stores less than a word at a time needs storageBuffer16BitAccess "
                 "and, for single bytes, storageBuffer8BitAccess"};
  }

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
  // Not under the lock: a compile takes long, and `record` must not wait for it.
  if (const VkResult result =
          table_.createComputePipelines(device_, cache_, 1, &info, allocator_, &pipeline);
      result != VK_SUCCESS) {
    return vulkanError("vkCreateComputePipelines", result);
  }
  const std::string name = variant.kernel == Kernel::palette
                               ? std::string("dermis palette")
                               : "dermis skin " + std::string(methodName(variant.method));
  nameObject(table_, device_, VK_OBJECT_TYPE_PIPELINE, pipeline, name);

  const std::unique_lock lock(mutex_);
  if (!pipelines_.try_emplace(variant.key(), pipeline).second) {
    table_.destroyPipeline(device_, pipeline, allocator_);  // another thread was faster
  }
  return {};
}

VkPipeline Pipelines::find(const Variant& variant) const {
  const std::shared_lock lock(mutex_);
  const auto entry = pipelines_.find(variant.key());
  return entry == pipelines_.end() ? VK_NULL_HANDLE : entry->second;
}

}  // namespace dermis::vulkan
