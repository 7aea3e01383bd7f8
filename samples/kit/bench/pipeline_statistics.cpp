#include "kit/bench/pipeline_statistics.h"

#include <array>

#define DERMIS_STATISTICS_FUNCTIONS(X)  \
  X(DestroyDevice)                      \
  X(CreateShaderModule)                 \
  X(DestroyShaderModule)                \
  X(CreateDescriptorSetLayout)          \
  X(DestroyDescriptorSetLayout)         \
  X(CreatePipelineLayout)               \
  X(DestroyPipelineLayout)              \
  X(CreateComputePipelines)             \
  X(DestroyPipeline)                    \
  X(GetPipelineExecutablePropertiesKHR) \
  X(GetPipelineExecutableStatisticsKHR) \
  X(GetPipelineExecutableInternalRepresentationsKHR)

namespace dermis::samples {

std::optional<std::uint64_t> CompiledKernel::instructionCount() const {
  for (const auto& [name, value] : statistics) {
    // The names that Mesa's drivers use.
    if (name == "Instructions" || name == "Instruction Count") return value;
  }
  return std::nullopt;
}

namespace {

bool hasStatistics(const Device& device) {
  if (!device.hasExtension(VK_KHR_PIPELINE_EXECUTABLE_PROPERTIES_EXTENSION_NAME)) return false;
  VkPhysicalDevicePipelineExecutablePropertiesFeaturesKHR statistics{};
  statistics.sType = VK_STRUCTURE_TYPE_PHYSICAL_DEVICE_PIPELINE_EXECUTABLE_PROPERTIES_FEATURES_KHR;
  VkPhysicalDeviceFeatures2 features{};
  features.sType = VK_STRUCTURE_TYPE_PHYSICAL_DEVICE_FEATURES_2;
  features.pNext = &statistics;
  device.functions().GetPhysicalDeviceFeatures2(device.physicalDevice(), &features);
  return statistics.pipelineExecutableInfo == VK_TRUE;
}

VkDevice createDevice(const Device& device) {
  VkPhysicalDevicePipelineExecutablePropertiesFeaturesKHR statistics{};
  statistics.sType = VK_STRUCTURE_TYPE_PHYSICAL_DEVICE_PIPELINE_EXECUTABLE_PROPERTIES_FEATURES_KHR;
  statistics.pipelineExecutableInfo = VK_TRUE;
  const float priority = 1;
  VkDeviceQueueCreateInfo queueInfo{};
  queueInfo.sType = VK_STRUCTURE_TYPE_DEVICE_QUEUE_CREATE_INFO;
  queueInfo.queueFamilyIndex = device.queueFamily();
  queueInfo.queueCount = 1;
  queueInfo.pQueuePriorities = &priority;
  const char* extension = VK_KHR_PIPELINE_EXECUTABLE_PROPERTIES_EXTENSION_NAME;
  VkDeviceCreateInfo info{};
  info.sType = VK_STRUCTURE_TYPE_DEVICE_CREATE_INFO;
  info.pNext = &statistics;
  info.queueCreateInfoCount = 1;
  info.pQueueCreateInfos = &queueInfo;
  info.enabledExtensionCount = 1;
  info.ppEnabledExtensionNames = &extension;
  VkDevice made = VK_NULL_HANDLE;
  if (device.functions().CreateDevice(device.physicalDevice(), &info, nullptr, &made) != VK_SUCCESS)
    return VK_NULL_HANDLE;
  return made;
}

std::uint64_t valueOf(const VkPipelineExecutableStatisticKHR& statistic) {
  switch (statistic.format) {
    case VK_PIPELINE_EXECUTABLE_STATISTIC_FORMAT_INT64_KHR:
      return static_cast<std::uint64_t>(statistic.value.i64);
    case VK_PIPELINE_EXECUTABLE_STATISTIC_FORMAT_UINT64_KHR:
      return statistic.value.u64;
    default:
      return 0;
  }
}

}  // namespace

struct PipelineStatistics::Functions {
#define DERMIS_DECLARE(name) PFN_vk##name name = nullptr;
  DERMIS_STATISTICS_FUNCTIONS(DERMIS_DECLARE)
#undef DERMIS_DECLARE
};

PipelineStatistics::PipelineStatistics() : functions_(std::make_unique<Functions>()) {}

std::unique_ptr<PipelineStatistics> PipelineStatistics::create(const Device& device) {
  if (!hasStatistics(device)) return nullptr;
  std::unique_ptr<PipelineStatistics> statistics(new PipelineStatistics);
  const VkDevice made = createDevice(device);
  if (made == VK_NULL_HANDLE) return nullptr;
#define DERMIS_LOAD(name)        \
  statistics->functions_->name = \
      reinterpret_cast<PFN_vk##name>(device.functions().GetDeviceProcAddr(made, "vk" #name));
  DERMIS_STATISTICS_FUNCTIONS(DERMIS_LOAD)
#undef DERMIS_LOAD
  statistics->device_ = made;
  if (!statistics->createLayouts()) return nullptr;
  return statistics;
}

PipelineStatistics::~PipelineStatistics() {
  if (device_ == VK_NULL_HANDLE) return;
  functions_->DestroyPipelineLayout(device_, pipelineLayout_, nullptr);
  functions_->DestroyDescriptorSetLayout(device_, setLayout_, nullptr);
  functions_->DestroyDevice(device_, nullptr);
}

// The layouts that `PipelineDescription` describes, without the texel buffers.
bool PipelineStatistics::createLayouts() {
  std::array<VkDescriptorSetLayoutBinding, storageBuffersWanted> bindings{};
  for (std::uint32_t binding = 0; binding < bindings.size(); ++binding) {
    bindings[binding].binding = binding;
    bindings[binding].descriptorType = VK_DESCRIPTOR_TYPE_STORAGE_BUFFER;
    bindings[binding].descriptorCount = 1;
    bindings[binding].stageFlags = VK_SHADER_STAGE_COMPUTE_BIT;
  }
  VkDescriptorSetLayoutCreateInfo setInfo{};
  setInfo.sType = VK_STRUCTURE_TYPE_DESCRIPTOR_SET_LAYOUT_CREATE_INFO;
  setInfo.bindingCount = static_cast<std::uint32_t>(bindings.size());
  setInfo.pBindings = bindings.data();
  if (functions_->CreateDescriptorSetLayout(device_, &setInfo, nullptr, &setLayout_) != VK_SUCCESS)
    return false;
  const VkPushConstantRange range{VK_SHADER_STAGE_COMPUTE_BIT, 0,
                                  sizeof(DispatchCommand::constants)};
  VkPipelineLayoutCreateInfo info{};
  info.sType = VK_STRUCTURE_TYPE_PIPELINE_LAYOUT_CREATE_INFO;
  info.setLayoutCount = 1;
  info.pSetLayouts = &setLayout_;
  info.pushConstantRangeCount = 1;
  info.pPushConstantRanges = &range;
  return functions_->CreatePipelineLayout(device_, &info, nullptr, &pipelineLayout_) == VK_SUCCESS;
}

VkPipeline PipelineStatistics::createPipeline(VkShaderModule module,
                                              const std::vector<std::uint32_t>& constants,
                                              bool withAssembly) const {
  std::vector<VkSpecializationMapEntry> entries;
  for (std::uint32_t id = 0; id < constants.size(); ++id) entries.push_back({id, id * 4, 4});
  VkSpecializationInfo specialization{};
  specialization.mapEntryCount = static_cast<std::uint32_t>(entries.size());
  specialization.pMapEntries = entries.data();
  specialization.dataSize = constants.size() * 4;
  specialization.pData = constants.data();
  VkComputePipelineCreateInfo info{};
  info.sType = VK_STRUCTURE_TYPE_COMPUTE_PIPELINE_CREATE_INFO;
  info.flags = VK_PIPELINE_CREATE_CAPTURE_STATISTICS_BIT_KHR;
  if (withAssembly) info.flags |= VK_PIPELINE_CREATE_CAPTURE_INTERNAL_REPRESENTATIONS_BIT_KHR;
  info.stage.sType = VK_STRUCTURE_TYPE_PIPELINE_SHADER_STAGE_CREATE_INFO;
  info.stage.stage = VK_SHADER_STAGE_COMPUTE_BIT;
  info.stage.module = module;
  info.stage.pName = "main";
  info.stage.pSpecializationInfo = &specialization;
  info.layout = pipelineLayout_;
  VkPipeline pipeline = VK_NULL_HANDLE;
  if (functions_->CreateComputePipelines(device_, VK_NULL_HANDLE, 1, &info, nullptr, &pipeline) !=
      VK_SUCCESS)
    return VK_NULL_HANDLE;
  return pipeline;
}

CompiledKernel PipelineStatistics::read(VkPipeline pipeline, bool withAssembly) const {
  CompiledKernel kernel;
  VkPipelineInfoKHR pipelineInfo{};
  pipelineInfo.sType = VK_STRUCTURE_TYPE_PIPELINE_INFO_KHR;
  pipelineInfo.pipeline = pipeline;
  VkPipelineExecutablePropertiesKHR properties{};
  properties.sType = VK_STRUCTURE_TYPE_PIPELINE_EXECUTABLE_PROPERTIES_KHR;
  std::uint32_t count = 1;
  functions_->GetPipelineExecutablePropertiesKHR(device_, &pipelineInfo, &count, &properties);
  kernel.subgroupSize = properties.subgroupSize;

  VkPipelineExecutableInfoKHR info{};
  info.sType = VK_STRUCTURE_TYPE_PIPELINE_EXECUTABLE_INFO_KHR;
  info.pipeline = pipeline;
  functions_->GetPipelineExecutableStatisticsKHR(device_, &info, &count, nullptr);
  VkPipelineExecutableStatisticKHR empty{};
  empty.sType = VK_STRUCTURE_TYPE_PIPELINE_EXECUTABLE_STATISTIC_KHR;
  std::vector<VkPipelineExecutableStatisticKHR> statistics(count, empty);
  functions_->GetPipelineExecutableStatisticsKHR(device_, &info, &count, statistics.data());
  for (const VkPipelineExecutableStatisticKHR& statistic : statistics)
    kernel.statistics.emplace_back(statistic.name, valueOf(statistic));
  if (!withAssembly) return kernel;

  const auto readTexts = [&](VkPipelineExecutableInternalRepresentationKHR* texts) {
    functions_->GetPipelineExecutableInternalRepresentationsKHR(device_, &info, &count, texts);
  };
  readTexts(nullptr);
  VkPipelineExecutableInternalRepresentationKHR unread{};
  unread.sType = VK_STRUCTURE_TYPE_PIPELINE_EXECUTABLE_INTERNAL_REPRESENTATION_KHR;
  std::vector<VkPipelineExecutableInternalRepresentationKHR> texts(count, unread);
  readTexts(texts.data());
  std::vector<std::string> contents(count);
  for (std::uint32_t index = 0; index < count; ++index) {
    contents[index].resize(texts[index].dataSize);
    texts[index].pData = contents[index].data();
  }
  readTexts(texts.data());
  if (!contents.empty()) kernel.assembly = contents.back();
  return kernel;
}

std::optional<CompiledKernel> PipelineStatistics::compile(
    const vulkan::PipelineDescription& pipeline, bool withAssembly) const {
  VkShaderModuleCreateInfo info{};
  info.sType = VK_STRUCTURE_TYPE_SHADER_MODULE_CREATE_INFO;
  info.codeSize = pipeline.spirv.size_bytes();
  info.pCode = pipeline.spirv.data();
  VkShaderModule module = VK_NULL_HANDLE;
  if (functions_->CreateShaderModule(device_, &info, nullptr, &module) != VK_SUCCESS)
    return std::nullopt;
  const VkPipeline created = createPipeline(module, pipeline.constants, withAssembly);
  functions_->DestroyShaderModule(device_, module, nullptr);
  if (created == VK_NULL_HANDLE) return std::nullopt;
  const CompiledKernel kernel = read(created, withAssembly);
  functions_->DestroyPipeline(device_, created, nullptr);
  return kernel;
}

}  // namespace dermis::samples
