// Acceleration structures and rays on a device that has them, for tests: what an engine's ray
// tracer does, as little of it as possible.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <memory>
#include <span>
#include <vector>

#include "kit/buffer.h"
#include "kit/device.h"

#define DERMIS_TEST_RAY_TRACING_FUNCTIONS(X)  \
  X(AllocateDescriptorSets)                   \
  X(CmdBindDescriptorSets)                    \
  X(CmdBindPipeline)                          \
  X(CmdBuildAccelerationStructuresKHR)        \
  X(CmdDispatch)                              \
  X(CreateAccelerationStructureKHR)           \
  X(CreateComputePipelines)                   \
  X(CreateDescriptorPool)                     \
  X(CreateDescriptorSetLayout)                \
  X(CreatePipelineLayout)                     \
  X(CreateShaderModule)                       \
  X(DestroyAccelerationStructureKHR)          \
  X(DestroyDescriptorPool)                    \
  X(DestroyDescriptorSetLayout)               \
  X(DestroyPipeline)                          \
  X(DestroyPipelineLayout)                    \
  X(DestroyShaderModule)                      \
  X(GetAccelerationStructureBuildSizesKHR)    \
  X(GetAccelerationStructureDeviceAddressKHR) \
  X(GetBufferDeviceAddressKHR)                \
  X(UpdateDescriptorSets)

namespace dermis::test {

/// The functions of a device that was opened with `DeviceOptions::rayTracing`.
struct RayTracingFunctions {
  explicit RayTracingFunctions(const samples::Device& device);
#define DERMIS_DECLARE(name) PFN_vk##name name = nullptr;
  DERMIS_TEST_RAY_TRACING_FUNCTIONS(DERMIS_DECLARE)
#undef DERMIS_DECLARE
};

VkDeviceAddress addressOf(const samples::Device& device, const RayTracingFunctions& functions,
                          const samples::MappedBuffer& buffer);

/// The geometry of a bottom-level structure.
VkAccelerationStructureGeometryKHR geometryOf(
    const VkAccelerationStructureGeometryTrianglesDataKHR& triangles);

/// An acceleration structure of one geometry, with the memory that building it takes. It can be
/// refitted.
class AccelerationStructure {
 public:
  AccelerationStructure(samples::Device& device, const RayTracingFunctions& functions,
                        VkAccelerationStructureTypeKHR type,
                        const VkAccelerationStructureGeometryKHR& geometry,
                        std::uint32_t primitiveCount);
  ~AccelerationStructure();
  AccelerationStructure(const AccelerationStructure&) = delete;
  AccelerationStructure& operator=(const AccelerationStructure&) = delete;

  /// Records a build, or an update of what was built.
  void record(VkCommandBuffer commandBuffer, VkBuildAccelerationStructureModeKHR mode,
              const VkAccelerationStructureGeometryKHR& geometry);

  VkAccelerationStructureKHR handle() const { return handle_; }
  VkDeviceAddress address() const;

 private:
  samples::Device& device_;
  const RayTracingFunctions& functions_;
  VkAccelerationStructureTypeKHR type_;
  std::uint32_t primitiveCount_;
  samples::MappedBuffer memory_, scratch_;
  VkAccelerationStructureKHR handle_ = VK_NULL_HANDLE;
};

/// A top-level structure with one bottom-level structure in it, untransformed.
class RayScene {
 public:
  RayScene(samples::Device& device, const RayTracingFunctions& functions,
           const AccelerationStructure& bottom);
  void build(VkCommandBuffer commandBuffer);
  VkAccelerationStructureKHR handle() const { return top_->handle(); }

 private:
  samples::MappedBuffer instance_;
  VkAccelerationStructureGeometryKHR geometry_{};
  std::unique_ptr<AccelerationStructure> top_;
};

struct Ray {
  std::array<float, 4> origin{};     ///< the fourth is not read
  std::array<float, 4> direction{};  ///< likewise
};

/// A compute pipeline that casts rays with ray queries: the ray of index i is asked where it meets
/// triangle i of the scene, whatever it meets besides.
class RayCaster {
 public:
  /// `casts`: how often `record` is called, each time with its own rays and results.
  RayCaster(samples::Device& device, const RayTracingFunctions& functions, std::uint32_t casts);
  ~RayCaster();
  RayCaster(const RayCaster&) = delete;
  RayCaster& operator=(const RayCaster&) = delete;

  /// Returns the number of the cast.
  std::size_t record(VkCommandBuffer commandBuffer, const RayScene& scene,
                     std::span<const Ray> rays);

  /// For each ray, after the GPU is done: the distance, or -1 where the ray misses.
  std::vector<float> distances(std::size_t cast) const;

 private:
  struct Cast {
    samples::MappedBuffer rays, distances;
  };

  void createLayouts();
  void createPipeline();
  VkDescriptorSet makeSet(const RayScene& scene, const Cast& cast);

  samples::Device& device_;
  const RayTracingFunctions& functions_;
  VkDescriptorSetLayout setLayout_ = VK_NULL_HANDLE;
  VkPipelineLayout layout_ = VK_NULL_HANDLE;
  VkPipeline pipeline_ = VK_NULL_HANDLE;
  VkDescriptorPool pool_ = VK_NULL_HANDLE;
  std::vector<Cast> casts_;
};

}  // namespace dermis::test
