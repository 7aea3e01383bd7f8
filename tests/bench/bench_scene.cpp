#include "bench_scene.h"

#include <chrono>
#include <cstdio>
#include <cstdlib>
#include <cstring>

#include "dermis/vulkan/context.h"

namespace dermis::bench {
namespace {

[[noreturn]] void stop(const Error& error) {
  std::fprintf(stderr, "dermis bench: error: %s\n", error.message.c_str());
  std::exit(1);
}

template <typename T>
T orStop(Result<T> result) {
  if (!result) stop(result.error());
  return std::move(*result);
}

void orStop(Result<void> result) {
  if (!result) stop(result.error());
}

}  // namespace

samples::OpenDevice* benchDevice() {
  static std::optional<samples::OpenDevice> open = []() -> std::optional<samples::OpenDevice> {
    samples::DeviceOptions options;
    if (const char* name = std::getenv("DERMIS_DEVICE"); name != nullptr) options.device = name;
    Result<samples::OpenDevice> result = samples::openDevice(options);
    if (!result) {
      std::fprintf(stderr, "dermis bench: %s\n", result.error().message.c_str());
      return std::nullopt;
    }
    return std::move(*result);
  }();
  return open ? &*open : nullptr;
}

double timedSubmission(samples::Device& device, VkCommandBuffer commandBuffer) {
  const auto begin = std::chrono::steady_clock::now();
  orStop(device.submitAndWait(commandBuffer));
  return std::chrono::duration<double>(std::chrono::steady_clock::now() - begin).count();
}

BenchScene::BenchScene(samples::OpenDevice& open, std::span<const samples::SkinRequest> requests,
                       const samples::OutputLayout& output, const Tuning& tuning)
    : open_(open), layout_(samples::layOutBatch(requests, output)) {
  orStop(makePlan(layout_.batch(), open.context.limits(), tuning, plan_));
  orStop(open.context.prepare(plan_.pipelines()));
  const auto make = [&](BufferRole role) {
    const BufferRequirement requirement = plan_.buffer(role);
    return orStop(samples::MappedBuffer::create(*open.device, requirement.size, requirement.usage));
  };
  meshes_ = make(BufferRole::meshes);
  matrices_ = make(BufferRole::poses);
  tables_ = make(BufferRole::tables);
  palettes_ = make(BufferRole::palettes);
  results_ = make(BufferRole::results);
  output_ = make(BufferRole::positions);
  for (const auto& [mesh, offset] : layout_.meshOffsets)
    std::memcpy(meshes_.bytes().data() + offset, mesh->bytes().data(), mesh->bytes().size());
  for (std::size_t index = 0; index < layout_.poses.size(); ++index) {
    std::memcpy(matrices_.bytes().data() + layout_.poseDescriptions[index].matrixOffset,
                layout_.poses[index].data(), layout_.poses[index].size_bytes());
  }
  orStop(writeTables(plan_, tables_.bytes()));
  bindings_.emplace(orStop(open.context.createBindings(
      {meshes_.range(), matrices_.range(), tables_.range(), palettes_.range(),
       ByStream<vulkan::BufferRange>::all(output_.range()), results_.range()})));

  samples::Device& device = *open.device;
  commandBuffer_ = device.allocateCommandBuffer();
  VkCommandBufferBeginInfo begin{};
  begin.sType = VK_STRUCTURE_TYPE_COMMAND_BUFFER_BEGIN_INFO;
  device.functions().BeginCommandBuffer(commandBuffer_, &begin);
  open.context.recordBarrier(commandBuffer_, Use::dermis, Use::dermis);
  orStop(open.context.record(commandBuffer_, plan_, *bindings_));
  device.functions().EndCommandBuffer(commandBuffer_);
  // The first time drivers compile, and memory is touched.
  skin();
}

double BenchScene::skin() {
  return timedSubmission(*open_.device, commandBuffer_);
}

}  // namespace dermis::bench
