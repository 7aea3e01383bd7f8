// A small engine around a SceneRecorder: frames with a fence each, several under way at once, and
// its output read back.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <deque>
#include <functional>
#include <map>
#include <span>
#include <stdexcept>
#include <utility>
#include <vector>

#include "dermis/scene.h"
#include "dermis/vulkan/context.h"
#include "dermis/vulkan/scene_recorder.h"
#include "kit/buffer.h"
#include "kit/device.h"
#include "rigged.h"
#include "scene_meshes.h"

namespace dermis::test {

/// What a frame did, and what it took to record it.
struct LastFrame : SceneStatistics::Frame, vulkan::RecorderStatistics {};

class SystemEngine {
 public:
  static constexpr bool hasGpu = true;

  SystemEngine(samples::Device& device, const vulkan::Context& context,
               const vulkan::SceneRecorderDescription& description);
  ~SystemEngine();
  SystemEngine(const SystemEngine&) = delete;
  SystemEngine& operator=(const SystemEngine&) = delete;

  vulkan::SceneRecorder& recorder() { return recorder_; }
  Scene& scene() const { return recorder_.scene(); }
  Scene* operator->() const { return &scene(); }

  // -- What is in it. Vertices are counted, and pipelines prepared: those of an instance with its
  // mesh, pose and method. A test that changes these to others prepares more.
  MeshHandle addMesh(const PackedMesh& mesh);
  PoseHandle addPose(std::span<const JointMatrix> pose, const PoseOptions& options = {});
  InstanceHandle addInstance(const InstanceDescription& description);
  /// A pose that the GPU writes is written by a command before `record`, and marked; again if the
  /// frame is abandoned.
  void writePose(PoseHandle pose, std::span<const JointMatrix> matrices);
  /// The same for the morph weights of an instance that the GPU writes.
  void writeWeights(InstanceHandle instance, std::span<const float> weights);

  // -- Frames.
  /// Begins the next one, once at most `underWay` of those before are not complete.
  void begin(std::uint32_t underWay = 0);
  /// Records it, with the engine's barriers around, and submits it.
  void submit(const vulkan::BufferRange& visibility = {}) { must(trySubmit(visibility)); }
  /// Where `record` fails an empty command buffer is submitted.
  Result<void> trySubmit(const vulkan::BufferRange& visibility = {});
  /// Records it, calls `meanwhile`, and says that it was not submitted.
  void abandon(
      const vulkan::BufferRange& visibility = {}, const std::function<void()>& meanwhile = [] {});
  void runFrame() {
    begin();
    submit();
  }
  /// Waits for all frames. The system learns of it by the next `begin`.
  void finish() { waitUntilUnderWay(0); }
  std::uint64_t frame() const { return frame_; }
  std::uint64_t completedFrame() const { return completedFrame_; }
  /// The last `record` had nothing to do but copies.
  bool isIdle() const { return lastFrame().dispatches == 0 || lastFrame().copies != 0; }
  /// Of the last `record`.
  LastFrame lastFrame() const { return {scene().statistics().lastFrame, recorder_.statistics()}; }

  // -- The output.
  /// All bytes, as of the last frame that was submitted.
  std::vector<std::byte> readOutput();
  void fillOutput(std::byte value);
  Streams read(InstanceHandle instance);
  Streams read(std::span<const std::byte> bytes, InstanceHandle instance) const;
  std::uint32_t vertexCount(MeshHandle mesh) const { return vertexCounts_.at(key(mesh)); }

  /// A pose that the GPU writes, or that belongs to a figure.
  std::vector<JointMatrix> readPose(PoseHandle pose);
  /// What the rig of a pose drives: so many joints.
  Driven readDriven(PoseHandle pose, std::uint32_t joints = drivenJoints);
  /// Submits what `record` records, and waits for it and all before.
  void submitNow(const std::function<void(VkCommandBuffer)>& record);
  void recordBarrier(VkCommandBuffer commandBuffer, Use before, Use after) const;

  /// Called in each frame before and behind the system's commands.
  std::function<void(VkCommandBuffer)> beforeRecord, afterRecord;
  /// The system records into a secondary command buffer, which the frame's executes.
  bool recordsSecondary = false;
  /// For tests of what happens without: the engine's own barriers around `record`, those around
  /// writes to poses, and each of them.
  bool recordsBarriers = true, recordsPoseBarriers = true;
  std::function<bool(Use before, Use after)> forgetsBarrier;

 private:
  struct SubmittedFrame {
    std::uint64_t frame = 0;
    VkFence fence = VK_NULL_HANDLE;
    VkCommandBuffer commandBuffer = VK_NULL_HANDLE;
  };
  static std::pair<std::uint32_t, std::uint32_t> key(MeshHandle mesh) {
    return {mesh.index, mesh.generation};
  }
  std::vector<std::byte> readRange(const vulkan::BufferRange& range);
  void writeGpuPoses(VkCommandBuffer commandBuffer);
  VkCommandBuffer beginCommands();
  Result<void> recordInSecondary(VkCommandBuffer primary, const vulkan::BufferRange& visibility);
  Result<void> recordFrame(VkCommandBuffer commandBuffer, const vulkan::BufferRange& visibility);
  VkFence submitCommands(VkCommandBuffer commandBuffer);
  void waitFor(const SubmittedFrame& frame);
  void waitUntilUnderWay(std::uint32_t count);

  samples::Device& device_;
  std::uint64_t outputSize_;  ///< as of the last `record`
  bool outputGrows_;
  vulkan::SceneRecorder recorder_;
  std::map<std::pair<std::uint32_t, std::uint32_t>, std::uint32_t> vertexCounts_;
  std::deque<SubmittedFrame> submitted_;
  std::vector<VkCommandBuffer> secondaries_;
  struct GpuWrite {
    PoseHandle pose;          ///< or …
    InstanceHandle instance;  ///< … whose morph weights are written
    std::vector<std::byte> bytes;
  };
  Result<vulkan::BufferRange> rangeOf(const GpuWrite& write) const {
    return write.pose ? recorder_.poseRange(write.pose) : recorder_.weightsRange(write.instance);
  }
  std::vector<GpuWrite> gpuWrites_;  ///< not submitted yet
  std::uint64_t frame_ = 0, completedFrame_ = 0;
  samples::MappedBuffer readBack_;
};

}  // namespace dermis::test
