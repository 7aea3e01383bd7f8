#include "dermis/vulkan/context.h"

#include <algorithm>
#include <array>
#include <string>

#include "abi.h"
#include "dermis_kernels.h"
#include "plan/check.h"
#include "vulkan/defaults.h"
#include "vulkan/state.h"

namespace dermis::vulkan {
namespace {

Error missingHandle(const char* name) {
  return {ErrorCode::invalidArgument, std::string("DeviceDescription::") + name + " is null"};
}

Result<void> checkDescription(const DeviceDescription& description) {
  if (description.instance == VK_NULL_HANDLE) return missingHandle("instance");
  if (description.physicalDevice == VK_NULL_HANDLE) return missingHandle("physicalDevice");
  if (description.device == VK_NULL_HANDLE) return missingHandle("device");
  if (description.getInstanceProcAddr == nullptr) return missingHandle("getInstanceProcAddr");
  if (description.apiVersion == 0) {
    return Error{ErrorCode::invalidArgument,
                 "DeviceDescription::apiVersion is 0: state the lower of the API versions of "
                 "instance and device, for example VK_API_VERSION_1_1"};
  }
  if (description.apiVersion < VK_API_VERSION_1_1) {
    return Error{ErrorCode::missingFeature,
                 "Dermis needs Vulkan 1.1, but the engine enabled " +
                     std::to_string(VK_API_VERSION_MAJOR(description.apiVersion)) + "." +
                     std::to_string(VK_API_VERSION_MINOR(description.apiVersion))};
  }
  return {};
}

/// What the kernels for CPU devices need.
struct CpuDeviceFeatures {
  bool scalarBlockLayout = false, shaderInt64 = false;
};

/// The features that Dermis uses, as they are stated one by one or in the pNext chain.
CpuDeviceFeatures readFeatures(const DeviceDescription& description) {
  CpuDeviceFeatures features{description.hasScalarBlockLayout, description.hasShaderInt64};
  for (const auto* next = static_cast<const VkBaseInStructure*>(description.enabledFeatures);
       next != nullptr; next = next->pNext) {
    switch (next->sType) {
      case VK_STRUCTURE_TYPE_PHYSICAL_DEVICE_SCALAR_BLOCK_LAYOUT_FEATURES:
        features.scalarBlockLayout |=
            reinterpret_cast<const VkPhysicalDeviceScalarBlockLayoutFeatures*>(next)
                ->scalarBlockLayout == VK_TRUE;
        break;
      case VK_STRUCTURE_TYPE_PHYSICAL_DEVICE_VULKAN_1_2_FEATURES:
        features.scalarBlockLayout |=
            reinterpret_cast<const VkPhysicalDeviceVulkan12Features*>(next)->scalarBlockLayout ==
            VK_TRUE;
        break;
      case VK_STRUCTURE_TYPE_PHYSICAL_DEVICE_FEATURES_2:
        features.shaderInt64 |=
            reinterpret_cast<const VkPhysicalDeviceFeatures2*>(next)->features.shaderInt64 ==
            VK_TRUE;
        break;
      default:
        break;
    }
  }
  return features;
}

/// Uses texel buffers if they can hold the storage buffer range that Vulkan guarantees. The range
/// is then limited to their size: on NVIDIA, texel buffers have 2 GiB and ranges 4 GiB.
void chooseTexelBuffers(const VkPhysicalDeviceLimits& device, DeviceLimits& limits) {
  const std::uint64_t most = std::uint64_t{device.maxTexelBufferElements} * abi::TEXEL_BYTES;
  if (limits.maxStorageBuffersPerStage < storageBuffersWanted ||
      most < DeviceLimits().maxStorageBufferRange)
    return;
  limits.texelBuffers = true;
  limits.maxStorageBufferRange = std::min(limits.maxStorageBufferRange, most);
  limits.minStorageBufferOffsetAlignment =
      std::max(limits.minStorageBufferOffsetAlignment,
               static_cast<std::uint32_t>(device.minTexelBufferOffsetAlignment));
}

}  // namespace

ContextState::~ContextState() {
  pipelines.reset();
  if (table.destroyPipelineLayout != nullptr)
    table.destroyPipelineLayout(device, pipelineLayout, allocator);
  if (table.destroyDescriptorSetLayout != nullptr)
    table.destroyDescriptorSetLayout(device, setLayout, allocator);
}

Result<void> ContextState::createLayouts() {
  std::array<VkDescriptorSetLayoutBinding, abi::BINDING_COUNT + abi::TEXEL_BINDING_COUNT>
      bindings{};
  const std::uint32_t count = bindingCount() + texelBindingCount();
  for (std::uint32_t binding = 0; binding < count; ++binding) {
    bindings[binding] = {binding,
                         binding < bindingCount() ? VK_DESCRIPTOR_TYPE_STORAGE_BUFFER
                                                  : VK_DESCRIPTOR_TYPE_UNIFORM_TEXEL_BUFFER,
                         1, VK_SHADER_STAGE_COMPUTE_BIT, nullptr};
  }
  VkDescriptorSetLayoutCreateInfo setInfo{};
  setInfo.sType = VK_STRUCTURE_TYPE_DESCRIPTOR_SET_LAYOUT_CREATE_INFO;
  if (pushesDescriptors()) setInfo.flags = VK_DESCRIPTOR_SET_LAYOUT_CREATE_PUSH_DESCRIPTOR_BIT_KHR;
  setInfo.bindingCount = count;
  setInfo.pBindings = bindings.data();
  if (const VkResult result =
          table.createDescriptorSetLayout(device, &setInfo, allocator, &setLayout);
      result != VK_SUCCESS) {
    setLayout = VK_NULL_HANDLE;  // what a failed call leaves there is undefined
    return vulkanError("vkCreateDescriptorSetLayout", result);
  }
  const VkPushConstantRange range{VK_SHADER_STAGE_COMPUTE_BIT, 0, sizeof(abi::VisibilityPush)};
  VkPipelineLayoutCreateInfo layoutInfo{};
  layoutInfo.sType = VK_STRUCTURE_TYPE_PIPELINE_LAYOUT_CREATE_INFO;
  layoutInfo.setLayoutCount = 1;
  layoutInfo.pSetLayouts = &setLayout;
  layoutInfo.pushConstantRangeCount = 1;
  layoutInfo.pPushConstantRanges = &range;
  if (const VkResult result =
          table.createPipelineLayout(device, &layoutInfo, allocator, &pipelineLayout);
      result != VK_SUCCESS) {
    pipelineLayout = VK_NULL_HANDLE;
    return vulkanError("vkCreatePipelineLayout", result);
  }
  nameObject(table, device, VK_OBJECT_TYPE_DESCRIPTOR_SET_LAYOUT, setLayout, "dermis");
  nameObject(table, device, VK_OBJECT_TYPE_PIPELINE_LAYOUT, pipelineLayout, "dermis");
  return {};
}

Context::Context() = default;
Context::~Context() = default;
Context::Context(Context&&) noexcept = default;
Context& Context::operator=(Context&&) noexcept = default;

Result<Context> Context::create(const DeviceDescription& description) {
  if (Result<void> good = checkDescription(description); !good) return good.error();
  Result<DispatchTable> table = loadDispatchTable(description);
  if (!table) return table.error();

  Context context;
  context.state_ = std::make_unique<ContextState>(description);
  ContextState& state = *context.state_;
  state.table = *table;

  VkPhysicalDeviceProperties properties{};
  state.table.getPhysicalDeviceProperties(description.physicalDevice, &properties);
  // Whole words: NVIDIA reports 2^32 - 1.
  state.limits.maxStorageBufferRange = properties.limits.maxStorageBufferRange & ~3u;
  state.limits.minStorageBufferOffsetAlignment =
      static_cast<std::uint32_t>(properties.limits.minStorageBufferOffsetAlignment);
  state.limits.maxWorkgroupCountX = properties.limits.maxComputeWorkGroupCount[0];
  state.limits.maxWorkgroupCountY = properties.limits.maxComputeWorkGroupCount[1];
  state.limits.maxStorageBuffersPerStage = properties.limits.maxPerStageDescriptorStorageBuffers;
  state.limits.separateRanges = state.pushesDescriptors();
  state.timestampPeriod = properties.limits.timestampPeriod;
  const CpuDeviceFeatures features = readFeatures(description);

  state.limits.comparisonMethods = !kernels::find("skin_comparison").empty();
  const DeviceDefaults defaults = defaultsOf(state.table, description.physicalDevice, properties);
  state.tuning = defaults.tuning;
  state.limits.stagedStores = description.stagedStores.value_or(defaults.stagedStores);
  if (description.texelBuffers.value_or(defaults.texelBuffers) && features.scalarBlockLayout &&
      features.shaderInt64)
    chooseTexelBuffers(properties.limits, state.limits);
  if (properties.limits.maxPerStageDescriptorStorageBuffers < abi::MIN_BINDING_COUNT) {
    return Error{ErrorCode::missingFeature,
                 std::string("device '") + properties.deviceName + "' allows " +
                     std::to_string(properties.limits.maxPerStageDescriptorStorageBuffers) +
                     " storage buffers per stage, but Dermis needs " +
                     std::to_string(abi::MIN_BINDING_COUNT)};
  }

  if (Result<void> good = state.createLayouts(); !good) return good.error();
  state.pipelines = std::make_unique<Pipelines>(state.table, description, state.limits);
  return context;
}

const DeviceLimits& Context::limits() const {
  return state_->limits;
}

Tuning Context::tuning() const {
  return state_->tuning;
}

Result<void> ContextState::prepare(std::span<const PipelineId> ids) const {
  for (const PipelineId id : ids) {
    if (Result<void> built = pipelines->build(id, pipelineLayout); !built) return built;
  }
  return {};
}

Result<void> ContextState::prepare(const PipelineNeeds& needs, const Tuning& withTuning) const {
  const Result<std::vector<PipelineId>> all = dermis::pipelines(needs, limits, withTuning);
  if (!all) return all.error();
  return prepare(*all);
}

Result<void> Context::prepare(const PipelineNeeds& needs,
                              const std::optional<Tuning>& tuning) const {
  return state_->prepare(needs, tuning.value_or(state_->tuning));
}

Result<void> Context::prepare(std::span<const PipelineId> ids) const {
  return state_->prepare(ids);
}

Result<std::uint32_t> Context::replaceKernels(std::span<const KernelModule> modules,
                                              std::uint64_t frame,
                                              std::uint64_t completedFrame) const {
  if (!modules.empty() && state_->kernelSource.get == nullptr) {
    return Error{ErrorCode::invalidArgument,
                 "replaceKernels needs DeviceDescription::kernelSource: without it, pipelines that "
                 "are created later would use the kernels of the library"};
  }
  for (const KernelModule& module : modules) {
    if (module.spirv.empty()) {
      return Error{ErrorCode::invalidArgument,
                   "the new kernel '" + std::string(module.name) + "' is empty"};
    }
  }
  if (completedFrame >= frame) {
    return Error{ErrorCode::invalidArgument,
                 "frame " + std::to_string(frame) + " is the next frame, but frame " +
                     std::to_string(completedFrame) + " is already complete"};
  }
  return state_->pipelines->replace(modules, state_->pipelineLayout, frame, completedFrame);
}

}  // namespace dermis::vulkan
