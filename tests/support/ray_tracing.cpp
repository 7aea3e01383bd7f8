#include "ray_tracing.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cstring>
#include <utility>

#include "dermis/compilers.h"
#include "dermis/vulkan/drawing.h"

namespace dermis::test {
namespace {

// No device asks for more: the required limit of minAccelerationStructureScratchOffsetAlignment is
// 256, and acceleration structures stand at multiples of 256.
constexpr VkDeviceSize scratchAlignment = 256;

constexpr VkBufferUsageFlags storage = VK_BUFFER_USAGE_STORAGE_BUFFER_BIT;

constexpr VkBuildAccelerationStructureFlagsKHR buildFlags =
    VK_BUILD_ACCELERATION_STRUCTURE_ALLOW_UPDATE_BIT_KHR |
    VK_BUILD_ACCELERATION_STRUCTURE_PREFER_FAST_BUILD_BIT_KHR;

constexpr const char* casterText = R"(#version 460
#extension GL_EXT_ray_query : require
layout(local_size_x = 64) in;
struct Ray {
  vec4 origin;
  vec4 direction;
};
layout(set = 0, binding = 0) uniform accelerationStructureEXT scene;
layout(std430, set = 0, binding = 1) readonly buffer Rays { Ray rays[]; };
layout(std430, set = 0, binding = 2) writeonly buffer Distances { float distances[]; };
void main() {
  uint index = gl_GlobalInvocationID.x;
  if (index >= rays.length()) return;
  // Not opaque: every triangle on the way is a candidate, not only the nearest.
  rayQueryEXT query;
  rayQueryInitializeEXT(query, scene, gl_RayFlagsNoOpaqueEXT, 0xff, rays[index].origin.xyz, 0.0,
                        rays[index].direction.xyz, 10.0);
  float found = -1.0;
  while (rayQueryProceedEXT(query)) {
    if (rayQueryGetIntersectionPrimitiveIndexEXT(query, false) == int(index))
      found = rayQueryGetIntersectionTEXT(query, false);
  }
  distances[index] = found;
}
)";

void expectSuccess(VkResult result, const char* function) {
  EXPECT_EQ(result, VK_SUCCESS) << function;
}

samples::MappedBuffer makeBuffer(samples::Device& device, VkDeviceSize size,
                                 VkBufferUsageFlags usage) {
  Result<samples::MappedBuffer> buffer = samples::MappedBuffer::create(device, size, usage, true);
  EXPECT_TRUE(buffer.ok()) << (buffer ? "" : buffer.error().message);
  return buffer ? std::move(*buffer) : samples::MappedBuffer{};
}

VkAccelerationStructureBuildGeometryInfoKHR buildInfo(
    VkAccelerationStructureTypeKHR type, const VkAccelerationStructureGeometryKHR& geometry) {
  VkAccelerationStructureBuildGeometryInfoKHR info{};
  info.sType = VK_STRUCTURE_TYPE_ACCELERATION_STRUCTURE_BUILD_GEOMETRY_INFO_KHR;
  info.type = type;
  info.flags = buildFlags;
  info.geometryCount = 1;
  info.pGeometries = &geometry;
  return info;
}

}  // namespace

RayTracingFunctions::RayTracingFunctions(const samples::Device& device) {
#define DERMIS_LOAD(name)                \
  name = reinterpret_cast<PFN_vk##name>( \
      device.functions().GetDeviceProcAddr(device.handle(), "vk" #name));
  DERMIS_TEST_RAY_TRACING_FUNCTIONS(DERMIS_LOAD)
#undef DERMIS_LOAD
}

VkDeviceAddress addressOf(const samples::Device& device, const RayTracingFunctions& functions,
                          const samples::MappedBuffer& buffer) {
  VkBufferDeviceAddressInfo info{};
  info.sType = VK_STRUCTURE_TYPE_BUFFER_DEVICE_ADDRESS_INFO;
  info.buffer = buffer.handle();
  return functions.GetBufferDeviceAddressKHR(device.handle(), &info);
}

VkAccelerationStructureGeometryKHR geometryOf(
    const VkAccelerationStructureGeometryTrianglesDataKHR& triangles) {
  VkAccelerationStructureGeometryKHR geometry{};
  geometry.sType = VK_STRUCTURE_TYPE_ACCELERATION_STRUCTURE_GEOMETRY_KHR;
  geometry.geometryType = VK_GEOMETRY_TYPE_TRIANGLES_KHR;
  geometry.geometry.triangles = triangles;
  return geometry;
}

AccelerationStructure::AccelerationStructure(samples::Device& device,
                                             const RayTracingFunctions& functions,
                                             VkAccelerationStructureTypeKHR type,
                                             const VkAccelerationStructureGeometryKHR& geometry,
                                             std::uint32_t primitiveCount)
    : device_(device), functions_(functions), type_(type), primitiveCount_(primitiveCount) {
  const VkAccelerationStructureBuildGeometryInfoKHR info = buildInfo(type, geometry);
  VkAccelerationStructureBuildSizesInfoKHR sizes{};
  sizes.sType = VK_STRUCTURE_TYPE_ACCELERATION_STRUCTURE_BUILD_SIZES_INFO_KHR;
  functions.GetAccelerationStructureBuildSizesKHR(device.handle(),
                                                  VK_ACCELERATION_STRUCTURE_BUILD_TYPE_DEVICE_KHR,
                                                  &info, &primitiveCount, &sizes);
  memory_ = makeBuffer(device, sizes.accelerationStructureSize,
                       VK_BUFFER_USAGE_ACCELERATION_STRUCTURE_STORAGE_BIT_KHR |
                           VK_BUFFER_USAGE_SHADER_DEVICE_ADDRESS_BIT);
  scratch_ = makeBuffer(
      device, std::max(sizes.buildScratchSize, sizes.updateScratchSize) + scratchAlignment,
      storage | VK_BUFFER_USAGE_SHADER_DEVICE_ADDRESS_BIT);
  VkAccelerationStructureCreateInfoKHR createInfo{};
  createInfo.sType = VK_STRUCTURE_TYPE_ACCELERATION_STRUCTURE_CREATE_INFO_KHR;
  createInfo.buffer = memory_.handle();
  createInfo.size = sizes.accelerationStructureSize;
  createInfo.type = type;
  expectSuccess(
      functions.CreateAccelerationStructureKHR(device.handle(), &createInfo, nullptr, &handle_),
      "vkCreateAccelerationStructureKHR");
}

AccelerationStructure::~AccelerationStructure() {
  functions_.DestroyAccelerationStructureKHR(device_.handle(), handle_, nullptr);
}

void AccelerationStructure::record(VkCommandBuffer commandBuffer,
                                   VkBuildAccelerationStructureModeKHR mode,
                                   const VkAccelerationStructureGeometryKHR& geometry) {
  VkAccelerationStructureBuildGeometryInfoKHR info = buildInfo(type_, geometry);
  info.mode = mode;
  info.dstAccelerationStructure = handle_;
  if (mode == VK_BUILD_ACCELERATION_STRUCTURE_MODE_UPDATE_KHR)
    info.srcAccelerationStructure = handle_;
  info.scratchData.deviceAddress =
      (addressOf(device_, functions_, scratch_) + scratchAlignment - 1) / scratchAlignment *
      scratchAlignment;
  VkAccelerationStructureBuildRangeInfoKHR range{};
  range.primitiveCount = primitiveCount_;
  const VkAccelerationStructureBuildRangeInfoKHR* ranges = &range;
  functions_.CmdBuildAccelerationStructuresKHR(commandBuffer, 1, &info, &ranges);
}

VkDeviceAddress AccelerationStructure::address() const {
  VkAccelerationStructureDeviceAddressInfoKHR info{};
  info.sType = VK_STRUCTURE_TYPE_ACCELERATION_STRUCTURE_DEVICE_ADDRESS_INFO_KHR;
  info.accelerationStructure = handle_;
  return functions_.GetAccelerationStructureDeviceAddressKHR(device_.handle(), &info);
}

RayScene::RayScene(samples::Device& device, const RayTracingFunctions& functions,
                   const AccelerationStructure& bottom)
    : instance_(
          makeBuffer(device, sizeof(VkAccelerationStructureInstanceKHR), vulkan::buildInputUsage)) {
  VkAccelerationStructureInstanceKHR instance{};
  for (std::size_t axis = 0; axis < 3; ++axis) instance.transform.matrix[axis][axis] = 1;
  instance.mask = 0xff;
  instance.flags = VK_GEOMETRY_INSTANCE_TRIANGLE_FACING_CULL_DISABLE_BIT_KHR;
  instance.accelerationStructureReference = bottom.address();
  std::memcpy(instance_.bytes().data(), &instance, sizeof(instance));

  geometry_.sType = VK_STRUCTURE_TYPE_ACCELERATION_STRUCTURE_GEOMETRY_KHR;
  geometry_.geometryType = VK_GEOMETRY_TYPE_INSTANCES_KHR;
  geometry_.geometry.instances.sType =
      VK_STRUCTURE_TYPE_ACCELERATION_STRUCTURE_GEOMETRY_INSTANCES_DATA_KHR;
  geometry_.geometry.instances.data.deviceAddress = addressOf(device, functions, instance_);
  top_ = std::make_unique<AccelerationStructure>(
      device, functions, VK_ACCELERATION_STRUCTURE_TYPE_TOP_LEVEL_KHR, geometry_, 1);
}

void RayScene::build(VkCommandBuffer commandBuffer) {
  top_->record(commandBuffer, VK_BUILD_ACCELERATION_STRUCTURE_MODE_BUILD_KHR, geometry_);
}

RayCaster::RayCaster(samples::Device& device, const RayTracingFunctions& functions,
                     std::uint32_t casts)
    : device_(device), functions_(functions) {
  createLayouts();
  createPipeline();
  const std::array<VkDescriptorPoolSize, 2> sizes{
      {{VK_DESCRIPTOR_TYPE_ACCELERATION_STRUCTURE_KHR, casts},
       {VK_DESCRIPTOR_TYPE_STORAGE_BUFFER, 2 * casts}}};
  VkDescriptorPoolCreateInfo info{};
  info.sType = VK_STRUCTURE_TYPE_DESCRIPTOR_POOL_CREATE_INFO;
  info.maxSets = casts;
  info.poolSizeCount = static_cast<std::uint32_t>(sizes.size());
  info.pPoolSizes = sizes.data();
  expectSuccess(functions.CreateDescriptorPool(device.handle(), &info, nullptr, &pool_),
                "vkCreateDescriptorPool");
}

void RayCaster::createLayouts() {
  std::array<VkDescriptorSetLayoutBinding, 3> bindings{};
  for (std::uint32_t binding = 0; binding < bindings.size(); ++binding) {
    bindings[binding].binding = binding;
    bindings[binding].descriptorType = binding == 0 ? VK_DESCRIPTOR_TYPE_ACCELERATION_STRUCTURE_KHR
                                                    : VK_DESCRIPTOR_TYPE_STORAGE_BUFFER;
    bindings[binding].descriptorCount = 1;
    bindings[binding].stageFlags = VK_SHADER_STAGE_COMPUTE_BIT;
  }
  VkDescriptorSetLayoutCreateInfo setInfo{};
  setInfo.sType = VK_STRUCTURE_TYPE_DESCRIPTOR_SET_LAYOUT_CREATE_INFO;
  setInfo.bindingCount = static_cast<std::uint32_t>(bindings.size());
  setInfo.pBindings = bindings.data();
  expectSuccess(
      functions_.CreateDescriptorSetLayout(device_.handle(), &setInfo, nullptr, &setLayout_),
      "vkCreateDescriptorSetLayout");
  VkPipelineLayoutCreateInfo info{};
  info.sType = VK_STRUCTURE_TYPE_PIPELINE_LAYOUT_CREATE_INFO;
  info.setLayoutCount = 1;
  info.pSetLayouts = &setLayout_;
  expectSuccess(functions_.CreatePipelineLayout(device_.handle(), &info, nullptr, &layout_),
                "vkCreatePipelineLayout");
}

void RayCaster::createPipeline() {
  const Result<std::vector<std::uint32_t>> spirv =
      ShaderCompiler().compile({"caster.comp", casterText, ShaderStage::compute, {}});
  ASSERT_TRUE(spirv.ok()) << spirv.error().message;
  VkShaderModuleCreateInfo moduleInfo{};
  moduleInfo.sType = VK_STRUCTURE_TYPE_SHADER_MODULE_CREATE_INFO;
  moduleInfo.codeSize = spirv->size() * sizeof(std::uint32_t);
  moduleInfo.pCode = spirv->data();
  VkComputePipelineCreateInfo info{};
  info.sType = VK_STRUCTURE_TYPE_COMPUTE_PIPELINE_CREATE_INFO;
  info.stage.sType = VK_STRUCTURE_TYPE_PIPELINE_SHADER_STAGE_CREATE_INFO;
  info.stage.stage = VK_SHADER_STAGE_COMPUTE_BIT;
  info.stage.pName = "main";
  info.layout = layout_;
  expectSuccess(
      functions_.CreateShaderModule(device_.handle(), &moduleInfo, nullptr, &info.stage.module),
      "vkCreateShaderModule");
  expectSuccess(functions_.CreateComputePipelines(device_.handle(), VK_NULL_HANDLE, 1, &info,
                                                  nullptr, &pipeline_),
                "vkCreateComputePipelines");
  functions_.DestroyShaderModule(device_.handle(), info.stage.module, nullptr);
}

RayCaster::~RayCaster() {
  functions_.DestroyDescriptorPool(device_.handle(), pool_, nullptr);
  functions_.DestroyPipeline(device_.handle(), pipeline_, nullptr);
  functions_.DestroyPipelineLayout(device_.handle(), layout_, nullptr);
  functions_.DestroyDescriptorSetLayout(device_.handle(), setLayout_, nullptr);
}

VkDescriptorSet RayCaster::makeSet(const RayScene& scene, const Cast& cast) {
  VkDescriptorSetAllocateInfo info{};
  info.sType = VK_STRUCTURE_TYPE_DESCRIPTOR_SET_ALLOCATE_INFO;
  info.descriptorPool = pool_;
  info.descriptorSetCount = 1;
  info.pSetLayouts = &setLayout_;
  VkDescriptorSet set = VK_NULL_HANDLE;
  expectSuccess(functions_.AllocateDescriptorSets(device_.handle(), &info, &set),
                "vkAllocateDescriptorSets");

  const VkAccelerationStructureKHR handle = scene.handle();
  VkWriteDescriptorSetAccelerationStructureKHR structure{};
  structure.sType = VK_STRUCTURE_TYPE_WRITE_DESCRIPTOR_SET_ACCELERATION_STRUCTURE_KHR;
  structure.accelerationStructureCount = 1;
  structure.pAccelerationStructures = &handle;
  const std::array<VkDescriptorBufferInfo, 2> buffers{
      {{cast.rays.handle(), 0, VK_WHOLE_SIZE}, {cast.distances.handle(), 0, VK_WHOLE_SIZE}}};
  std::array<VkWriteDescriptorSet, 3> writes{};
  for (std::uint32_t binding = 0; binding < writes.size(); ++binding) {
    VkWriteDescriptorSet& write = writes[binding];
    write.sType = VK_STRUCTURE_TYPE_WRITE_DESCRIPTOR_SET;
    write.dstSet = set;
    write.dstBinding = binding;
    write.descriptorCount = 1;
    if (binding == 0) {
      write.pNext = &structure;
      write.descriptorType = VK_DESCRIPTOR_TYPE_ACCELERATION_STRUCTURE_KHR;
    } else {
      write.descriptorType = VK_DESCRIPTOR_TYPE_STORAGE_BUFFER;
      write.pBufferInfo = &buffers[binding - 1];
    }
  }
  functions_.UpdateDescriptorSets(device_.handle(), static_cast<std::uint32_t>(writes.size()),
                                  writes.data(), 0, nullptr);
  return set;
}

std::size_t RayCaster::record(VkCommandBuffer commandBuffer, const RayScene& scene,
                              std::span<const Ray> rays) {
  Cast cast{makeBuffer(device_, rays.size_bytes(), storage),
            makeBuffer(device_, rays.size() * sizeof(float), storage)};
  std::memcpy(cast.rays.bytes().data(), rays.data(), rays.size_bytes());
  const VkDescriptorSet set = makeSet(scene, cast);
  functions_.CmdBindPipeline(commandBuffer, VK_PIPELINE_BIND_POINT_COMPUTE, pipeline_);
  functions_.CmdBindDescriptorSets(commandBuffer, VK_PIPELINE_BIND_POINT_COMPUTE, layout_, 0, 1,
                                   &set, 0, nullptr);
  functions_.CmdDispatch(commandBuffer, static_cast<std::uint32_t>((rays.size() + 63) / 64), 1, 1);
  casts_.push_back(std::move(cast));
  return casts_.size() - 1;
}

std::vector<float> RayCaster::distances(std::size_t cast) const {
  const std::span<const std::byte> bytes = casts_[cast].distances.bytes();
  std::vector<float> distances(bytes.size() / sizeof(float));
  std::memcpy(distances.data(), bytes.data(), bytes.size());
  return distances;
}

}  // namespace dermis::test
