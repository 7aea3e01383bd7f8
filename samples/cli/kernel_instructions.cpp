#include "kernel_instructions.h"

#include <array>
#include <span>
#include <string_view>
#include <unordered_map>
#include <vector>

#ifndef DERMIS_NO_SPIRV_TOOLS
#include <spirv-tools/optimizer.hpp>
#endif

#include "dermis/vulkan/context.h"

#define DERMIS_STATISTICS_FUNCTIONS(X) \
  X(DestroyDevice)                     \
  X(CreateShaderModule)                \
  X(DestroyShaderModule)               \
  X(CreateDescriptorSetLayout)         \
  X(DestroyDescriptorSetLayout)        \
  X(CreatePipelineLayout)              \
  X(DestroyPipelineLayout)             \
  X(CreateComputePipelines)            \
  X(DestroyPipeline)                   \
  X(GetPipelineExecutableStatisticsKHR)

namespace dermis::cli {

#ifndef DERMIS_NO_SPIRV_TOOLS

namespace {

// SPIR-V 1.3, section 3.32: first and last opcodes of the groups of instructions that are counted.
constexpr std::uint32_t opFunction = 54, opFunctionEnd = 56;
constexpr std::uint32_t opExtInst = 12;
constexpr std::uint32_t opLoad = 61, opStore = 62;
constexpr std::uint32_t opConvertFToU = 109, opQuantizeToF16 = 116;
constexpr std::uint32_t opSNegate = 126, opSMulExtended = 152;
constexpr std::uint32_t opAny = 154, opFUnordGreaterThanEqual = 191;
constexpr std::uint32_t opShiftRightLogical = 194, opBitCount = 205;
constexpr std::uint32_t opAtomicLoad = 227, opAtomicXor = 242;

bool isCounted(std::uint32_t opcode) {
  const auto within = [opcode](std::uint32_t first, std::uint32_t last) {
    return opcode >= first && opcode <= last;
  };
  return opcode == opExtInst || within(opLoad, opStore) || within(opConvertFToU, opQuantizeToF16) ||
         within(opSNegate, opSMulExtended) || within(opAny, opFUnordGreaterThanEqual) ||
         within(opShiftRightLogical, opBitCount) || within(opAtomicLoad, opAtomicXor);
}

}  // namespace

std::vector<std::uint32_t> specializedSpirv(const vulkan::PipelineDescription& pipeline) {
  const std::vector<std::uint32_t>& constants = pipeline.constants;
  std::unordered_map<std::uint32_t, std::vector<std::uint32_t>> values;
  for (std::uint32_t id = 0; id < constants.size(); ++id) values[id] = {constants[id]};

  spvtools::Optimizer optimizer(SPV_ENV_VULKAN_1_1);
  optimizer.RegisterPass(spvtools::CreateSetSpecConstantDefaultValuePass(values));
  optimizer.RegisterPass(spvtools::CreateFreezeSpecConstantValuePass());
  optimizer.RegisterPass(spvtools::CreateFoldSpecConstantOpAndCompositePass());
  optimizer.RegisterPerformancePasses();
  spvtools::OptimizerOptions options;
  options.set_run_validator(false);
  std::vector<std::uint32_t> specialized;
  if (!optimizer.Run(pipeline.spirv.data(), pipeline.spirv.size(), &specialized, options))
    return {};
  return specialized;
}

std::optional<std::uint64_t> spirvInstructionCount(const vulkan::PipelineDescription& pipeline) {
  const std::vector<std::uint32_t> words = specializedSpirv(pipeline);
  constexpr std::size_t headerWords = 5;
  std::uint64_t count = 0;
  bool inFunction = false;
  for (std::size_t place = headerWords; place < words.size();) {
    const std::uint32_t opcode = words[place] & 0xffffu, length = words[place] >> 16;
    if (length == 0) return std::nullopt;
    if (opcode == opFunction) inFunction = true;
    if (opcode == opFunctionEnd) inFunction = false;
    if (inFunction && isCounted(opcode)) ++count;
    place += length;
  }
  if (count == 0) return std::nullopt;
  return count;
}

#else

std::vector<std::uint32_t> specializedSpirv(const vulkan::PipelineDescription&) {
  return {};
}

std::optional<std::uint64_t> spirvInstructionCount(const vulkan::PipelineDescription&) {
  return std::nullopt;
}

#endif

namespace {

bool hasStatistics(const samples::Device& device) {
  if (!device.hasExtension(VK_KHR_PIPELINE_EXECUTABLE_PROPERTIES_EXTENSION_NAME)) return false;
  VkPhysicalDevicePipelineExecutablePropertiesFeaturesKHR statistics{};
  statistics.sType = VK_STRUCTURE_TYPE_PHYSICAL_DEVICE_PIPELINE_EXECUTABLE_PROPERTIES_FEATURES_KHR;
  VkPhysicalDeviceFeatures2 features{};
  features.sType = VK_STRUCTURE_TYPE_PHYSICAL_DEVICE_FEATURES_2;
  features.pNext = &statistics;
  device.functions().GetPhysicalDeviceFeatures2(device.physicalDevice(), &features);
  return statistics.pipelineExecutableInfo == VK_TRUE;
}

VkDevice createDevice(const samples::Device& device) {
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

std::unique_ptr<PipelineStatistics> PipelineStatistics::create(const samples::Device& device) {
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
                                              const std::vector<std::uint32_t>& constants) const {
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

std::optional<std::uint64_t> PipelineStatistics::readCount(VkPipeline pipeline) const {
  VkPipelineExecutableInfoKHR info{};
  info.sType = VK_STRUCTURE_TYPE_PIPELINE_EXECUTABLE_INFO_KHR;
  info.pipeline = pipeline;
  std::uint32_t count = 0;
  functions_->GetPipelineExecutableStatisticsKHR(device_, &info, &count, nullptr);
  VkPipelineExecutableStatisticKHR empty{};
  empty.sType = VK_STRUCTURE_TYPE_PIPELINE_EXECUTABLE_STATISTIC_KHR;
  std::vector<VkPipelineExecutableStatisticKHR> statistics(count, empty);
  functions_->GetPipelineExecutableStatisticsKHR(device_, &info, &count, statistics.data());
  for (const VkPipelineExecutableStatisticKHR& statistic : statistics) {
    // The names that Mesa's drivers use.
    const std::string_view name = statistic.name;
    if (name == "Instructions" || name == "Instruction Count") return valueOf(statistic);
  }
  return std::nullopt;
}

std::optional<std::uint64_t> PipelineStatistics::instructionCount(
    const vulkan::PipelineDescription& pipeline) const {
  VkShaderModuleCreateInfo info{};
  info.sType = VK_STRUCTURE_TYPE_SHADER_MODULE_CREATE_INFO;
  info.codeSize = pipeline.spirv.size_bytes();
  info.pCode = pipeline.spirv.data();
  VkShaderModule module = VK_NULL_HANDLE;
  if (functions_->CreateShaderModule(device_, &info, nullptr, &module) != VK_SUCCESS)
    return std::nullopt;
  const VkPipeline created = createPipeline(module, pipeline.constants);
  functions_->DestroyShaderModule(device_, module, nullptr);
  if (created == VK_NULL_HANDLE) return std::nullopt;
  const std::optional<std::uint64_t> count = readCount(created);
  functions_->DestroyPipeline(device_, created, nullptr);
  return count;
}

}  // namespace dermis::cli
