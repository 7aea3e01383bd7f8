#include "system_engine.h"

#include <algorithm>
#include <cstring>

#include "dermis/layout.h"

namespace dermis::test {

SystemEngine::SystemEngine(samples::Device& device, const vulkan::Context& context,
                           const vulkan::SceneRecorderDescription& description)
    : device_(device),
      outputSize_(description.scene.outputCapacity.initial / 4 * 4),
      outputGrows_(description.output.buffer == VK_NULL_HANDLE),
      recorder_(must(vulkan::SceneRecorder::create(context, description))) {}

SystemEngine::~SystemEngine() {
  device_.functions().DeviceWaitIdle(device_.handle());
  for (const SubmittedFrame& frame : submitted_) waitFor(frame);
  for (const VkCommandBuffer secondary : secondaries_) device_.freeCommandBuffer(secondary);
}

MeshHandle SystemEngine::addMesh(const PackedMesh& mesh) {
  const MeshHandle handle = must(scene().addMesh(mesh));
  vertexCounts_[key(handle)] = mesh.vertexCount();
  return handle;
}

PoseHandle SystemEngine::addPose(std::span<const JointMatrix> pose, const PoseOptions& options) {
  const PoseHandle handle = must(scene().addPose(static_cast<std::uint32_t>(pose.size()), options));
  writePose(handle, pose);
  return handle;
}

InstanceHandle SystemEngine::addInstance(const InstanceDescription& description) {
  must(recorder_.prepare(description));
  return must(scene().addInstance(description));
}

void SystemEngine::writePose(PoseHandle pose, std::span<const JointMatrix> matrices) {
  if (recorder_.poseRange(pose).ok()) {
    std::erase_if(gpuWrites_, [&](const GpuWrite& write) { return write.pose == pose; });
    const auto bytes = std::as_bytes(matrices);
    gpuWrites_.push_back({pose, {}, {bytes.begin(), bytes.end()}});
    return;
  }
  const std::span<JointMatrix> mapped = must(scene().writePose(pose));
  if (mapped.size() != matrices.size()) throw std::runtime_error("the pose has another size");
  std::ranges::copy(matrices, mapped.begin());
}

void SystemEngine::writeWeights(InstanceHandle instance, std::span<const float> weights) {
  std::erase_if(gpuWrites_, [&](const GpuWrite& write) { return write.instance == instance; });
  const auto bytes = std::as_bytes(weights);
  gpuWrites_.push_back({{}, instance, {bytes.begin(), bytes.end()}});
}

std::vector<std::byte> SystemEngine::readRange(const vulkan::BufferRange& range) {
  const samples::MappedBuffer copy = must(
      samples::MappedBuffer::create(device_, range.size, VK_BUFFER_USAGE_TRANSFER_DST_BIT, true));
  submitNow([&](VkCommandBuffer commandBuffer) {
    recordBarrier(commandBuffer, Use::dermis, Use::copyRead);
    const VkBufferCopy all{range.offset, 0, range.size};
    device_.functions().CmdCopyBuffer(commandBuffer, range.buffer, copy.handle(), 1, &all);
    recordBarrier(commandBuffer, Use::copyWrite, Use::hostRead);
  });
  const std::span<const std::byte> bytes = copy.bytes();
  return {bytes.begin(), bytes.begin() + static_cast<std::ptrdiff_t>(range.size)};
}

std::vector<JointMatrix> SystemEngine::readPose(PoseHandle handle) {
  const std::vector<std::byte> bytes = readRange(must(recorder_.poseRange(handle)));
  std::vector<JointMatrix> pose(bytes.size() / sizeof(JointMatrix));
  std::memcpy(pose.data(), bytes.data(), bytes.size());
  return pose;
}

Driven SystemEngine::readDriven(PoseHandle handle, std::uint32_t joints) {
  const std::vector<std::byte> bytes = readRange(must(recorder_.drivenRange(handle)));
  const std::size_t size = joints * sizeof(JointMatrix);
  Driven driven{std::vector<JointMatrix>(joints),
                std::vector<float>((bytes.size() - size) / sizeof(float))};
  std::memcpy(driven.joints.data(), bytes.data(), size);
  if (bytes.size() != size)
    std::memcpy(driven.weights.data(), bytes.data() + size, bytes.size() - size);
  return driven;
}

void SystemEngine::writeGpuPoses(VkCommandBuffer commandBuffer) {
  std::erase_if(gpuWrites_, [&](const GpuWrite& write) { return !rangeOf(write).ok(); });
  if (gpuWrites_.empty()) return;
  if (recordsPoseBarriers) recordBarrier(commandBuffer, Use::dermis, Use::copyWrite);
  for (const GpuWrite& write : gpuWrites_) {
    const vulkan::BufferRange range = must(rangeOf(write));
    const std::size_t size = write.bytes.size();
    if (range.size != size) throw std::runtime_error("the pose has another size");
    device_.functions().CmdUpdateBuffer(commandBuffer, range.buffer, range.offset, size,
                                        write.bytes.data());
    if (write.pose) {
      must(scene().markWritten({&write.pose, 1}));
    } else {
      must(scene().markMorphsWritten({&write.instance, 1}));
    }
  }
  if (recordsPoseBarriers) recordBarrier(commandBuffer, Use::copyWrite, Use::dermis);
}

void SystemEngine::begin(std::uint32_t underWay) {
  waitUntilUnderWay(underWay);
  ++frame_;
  must(scene().beginFrame(frame_, completedFrame_));
}

Result<void> SystemEngine::recordFrame(VkCommandBuffer commandBuffer,
                                       const vulkan::BufferRange& visibility) {
  if (beforeRecord) beforeRecord(commandBuffer);
  writeGpuPoses(commandBuffer);
  if (recordsBarriers) recordBarrier(commandBuffer, Use::copyRead, Use::dermis);
  const Result<void> recorded = recordsSecondary ? recordInSecondary(commandBuffer, visibility)
                                                 : recorder_.record(commandBuffer, visibility);
  if (recordsBarriers) recordBarrier(commandBuffer, Use::dermis, Use::copyRead);
  if (afterRecord) afterRecord(commandBuffer);
  return recorded;
}

Result<void> SystemEngine::recordInSecondary(VkCommandBuffer primary,
                                             const vulkan::BufferRange& visibility) {
  const VkCommandBuffer secondary =
      device_.allocateCommandBuffer(VK_COMMAND_BUFFER_LEVEL_SECONDARY);
  secondaries_.push_back(secondary);
  VkCommandBufferInheritanceInfo inheritance{};
  inheritance.sType = VK_STRUCTURE_TYPE_COMMAND_BUFFER_INHERITANCE_INFO;
  VkCommandBufferBeginInfo begin{};
  begin.sType = VK_STRUCTURE_TYPE_COMMAND_BUFFER_BEGIN_INFO;
  begin.flags = VK_COMMAND_BUFFER_USAGE_ONE_TIME_SUBMIT_BIT;
  begin.pInheritanceInfo = &inheritance;
  device_.functions().BeginCommandBuffer(secondary, &begin);
  Result<void> recorded = recorder_.record(secondary, visibility);
  device_.functions().EndCommandBuffer(secondary);
  device_.functions().CmdExecuteCommands(primary, 1, &secondary);
  return recorded;
}

Result<void> SystemEngine::trySubmit(const vulkan::BufferRange& visibility) {
  const VkCommandBuffer commandBuffer = beginCommands();
  const Result<void> recorded = recordFrame(commandBuffer, visibility);
  if (recorded && outputGrows_) outputSize_ = scene().statistics().outputs.capacity;
  if (recorded) gpuWrites_.clear();
  submitted_.push_back({frame_, submitCommands(commandBuffer), commandBuffer});
  return recorded;
}

void SystemEngine::abandon(const vulkan::BufferRange& visibility,
                           const std::function<void()>& meanwhile) {
  const VkCommandBuffer commandBuffer = beginCommands();
  must(recordFrame(commandBuffer, visibility));
  device_.functions().EndCommandBuffer(commandBuffer);
  device_.freeCommandBuffer(commandBuffer);
  meanwhile();
  must(scene().abandonFrame(frame_));
}

VkCommandBuffer SystemEngine::beginCommands() {
  const VkCommandBuffer commandBuffer = device_.allocateCommandBuffer();
  VkCommandBufferBeginInfo begin{};
  begin.sType = VK_STRUCTURE_TYPE_COMMAND_BUFFER_BEGIN_INFO;
  begin.flags = VK_COMMAND_BUFFER_USAGE_ONE_TIME_SUBMIT_BIT;
  device_.functions().BeginCommandBuffer(commandBuffer, &begin);
  return commandBuffer;
}

VkFence SystemEngine::submitCommands(VkCommandBuffer commandBuffer) {
  device_.functions().EndCommandBuffer(commandBuffer);
  VkFenceCreateInfo fenceInfo{};
  fenceInfo.sType = VK_STRUCTURE_TYPE_FENCE_CREATE_INFO;
  VkFence fence = VK_NULL_HANDLE;
  VkSubmitInfo submit{};
  submit.sType = VK_STRUCTURE_TYPE_SUBMIT_INFO;
  submit.commandBufferCount = 1;
  submit.pCommandBuffers = &commandBuffer;
  if (device_.functions().CreateFence(device_.handle(), &fenceInfo, nullptr, &fence) !=
          VK_SUCCESS ||
      device_.functions().QueueSubmit(device_.queue(), 1, &submit, fence) != VK_SUCCESS)
    throw std::runtime_error("a frame could not be submitted");
  return fence;
}

void SystemEngine::waitFor(const SubmittedFrame& frame) {
  device_.functions().WaitForFences(device_.handle(), 1, &frame.fence, VK_TRUE, UINT64_MAX);
  device_.functions().DestroyFence(device_.handle(), frame.fence, nullptr);
  device_.freeCommandBuffer(frame.commandBuffer);
}

void SystemEngine::waitUntilUnderWay(std::uint32_t count) {
  while (submitted_.size() > count) {
    waitFor(submitted_.front());
    completedFrame_ = submitted_.front().frame;
    submitted_.pop_front();
  }
}

void SystemEngine::submitNow(const std::function<void(VkCommandBuffer)>& record) {
  const VkCommandBuffer commandBuffer = beginCommands();
  record(commandBuffer);
  waitFor({0, submitCommands(commandBuffer), commandBuffer});
}

void SystemEngine::recordBarrier(VkCommandBuffer commandBuffer, Use before, Use after) const {
  if (!forgetsBarrier || !forgetsBarrier(before, after))
    samples::recordBarrier(device_, commandBuffer, before, after);
}

std::vector<std::byte> SystemEngine::readOutput() {
  if (readBack_.bytes().size() < outputSize_) {
    readBack_ = must(samples::MappedBuffer::create(device_, outputSize_,
                                                   VK_BUFFER_USAGE_TRANSFER_DST_BIT, true));
  }
  submitNow([this](VkCommandBuffer commandBuffer) {
    recordBarrier(commandBuffer, Use::dermis, Use::copyRead);
    const VkBufferCopy all{0, 0, outputSize_};
    device_.functions().CmdCopyBuffer(commandBuffer, recorder_.outputBuffer(), readBack_.handle(),
                                      1, &all);
    recordBarrier(commandBuffer, Use::copyWrite, Use::hostRead);
  });
  const std::span<const std::byte> bytes = readBack_.bytes().first(outputSize_);
  return {bytes.begin(), bytes.end()};
}

void SystemEngine::fillOutput(std::byte value) {
  submitNow([&](VkCommandBuffer commandBuffer) {
    recordBarrier(commandBuffer, Use::dermis, Use::copyWrite);
    device_.functions().CmdFillBuffer(commandBuffer, recorder_.outputBuffer(), 0, VK_WHOLE_SIZE,
                                      std::to_integer<std::uint32_t>(value) * 0x01010101u);
    recordBarrier(commandBuffer, Use::copyWrite, Use::dermis | Use::copyRead | Use::copyWrite);
  });
}

Streams SystemEngine::read(InstanceHandle instance) {
  return read(readOutput(), instance);
}

Streams SystemEngine::read(std::span<const std::byte> bytes, InstanceHandle instance) const {
  const InstanceOutput output = must(scene().output(instance));
  return readStreams(bytes, output, vertexCount(output.mesh));
}

}  // namespace dermis::test
