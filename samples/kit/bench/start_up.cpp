#include "kit/bench/start_up.h"

#include <algorithm>
#include <chrono>
#include <span>

#include "dermis/vulkan/skinning_system.h"

namespace dermis::samples {
namespace {

/// Returns seconds. The device exists already, as in an engine.
Result<double> skinFirstFrame(Device& device, VkCommandBuffer commandBuffer, const Crowd& crowd,
                              bool mayScale) {
  const auto start = std::chrono::steady_clock::now();
  Result<vulkan::Context> context = vulkan::Context::create(device.description());
  if (!context) return context.error();
  vulkan::SkinningSystemDescription description;
  description.context = &*context;
  Result<vulkan::SkinningSystem> system = vulkan::SkinningSystem::create(description);
  if (!system) return system.error();

  const Result<MeshHandle> mesh = system->addMesh(*crowd.mesh);
  if (!mesh) return mesh.error();
  const Result<PoseHandle> pose = system->addPose(crowd.jointCount(), {.mayScale = mayScale});
  if (!pose) return pose.error();
  InstanceDescription instance;
  instance.mesh = *mesh;
  instance.pose = *pose;
  instance.layout = {.positions = VertexFormat::float32x3, .normals = VertexFormat::float32x3};
  if (Result<void> prepared = system->prepare(instance); !prepared) return prepared.error();
  if (const auto added = system->addInstance(instance); !added) return added.error();
  if (Result<void> begun = system->beginFrame(1, 0); !begun) return begun.error();
  const Result<std::span<JointMatrix>> matrices = system->writePose(*pose);
  if (!matrices) return matrices.error();
  std::ranges::copy(crowd.poses.front(), matrices->begin());

  VkCommandBufferBeginInfo begin{};
  begin.sType = VK_STRUCTURE_TYPE_COMMAND_BUFFER_BEGIN_INFO;
  device.functions().BeginCommandBuffer(commandBuffer, &begin);
  const Result<void> recorded = system->record(commandBuffer);
  device.functions().EndCommandBuffer(commandBuffer);
  if (!recorded) return recorded.error();
  if (Result<void> done = device.submitAndWait(commandBuffer); !done) return done.error();
  return std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
}

Result<double> measure(Device& device, const Crowd& crowd, bool mayScale) {
  const VkCommandBuffer commandBuffer = device.allocateCommandBuffer();
  const Result<double> seconds = skinFirstFrame(device, commandBuffer, crowd, mayScale);
  device.freeCommandBuffer(commandBuffer);
  return seconds;
}

}  // namespace

Result<StartUp> measureStartUp(OpenDevice& open, const Crowd& crowd) {
  const Result<double> usual = measure(*open.device, crowd, true);
  if (!usual) return usual.error();
  const Result<double> withoutScale = measure(*open.device, crowd, false);
  if (!withoutScale) return withoutScale.error();
  return StartUp{*usual, *withoutScale};
}

}  // namespace dermis::samples
