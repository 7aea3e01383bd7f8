// A small engine around a cpu::SceneRunner, with the calls of SystemEngine.
#pragma once

#include <cstdint>
#include <functional>
#include <map>
#include <random>
#include <span>
#include <vector>

#include "dermis/cpu.h"
#include "scene_meshes.h"

namespace dermis::test {

/// What a job of that instance alone writes.
std::vector<std::byte> skinOne(const PackedMesh& mesh, Method method, const VertexLayout& layout,
                               cpu::Instance instance);

class CpuEngine {
 public:
  static constexpr bool hasGpu = false;

  explicit CpuEngine(const SceneDescription& description, std::span<std::byte> output = {});

  cpu::SceneRunner& runner() { return runner_; }
  Scene& scene() const { return runner_.scene(); }
  Scene* operator->() const { return &scene(); }

  MeshHandle addMesh(const PackedMesh& mesh);
  void writePose(PoseHandle pose, std::span<const JointMatrix> matrices);

  void begin() { must(scene().beginFrame(frame() + 1, frame())); }
  /// Does the jobs of the frame on two threads, in a random order.
  void submit();
  /// Lists the jobs, calls `meanwhile`, and says that none was done.
  void abandon(const std::function<void()>& meanwhile);
  std::uint64_t frame() const { return scene().frame(); }
  std::uint64_t completedFrame() const { return scene().frame() - 1; }
  /// The last frame had nothing to do.
  bool isIdle() const { return jobCount_ == 0; }

  std::vector<std::byte> readOutput() const;
  Streams read(std::span<const std::byte> bytes, InstanceHandle instance) const;

  std::uint32_t verticesPerJob = 1 << 16;

 private:
  cpu::SceneRunner runner_;
  std::map<std::pair<std::uint32_t, std::uint32_t>, std::uint32_t> vertexCounts_;
  std::size_t jobCount_ = 0;
  std::mt19937 random_{1};
};

}  // namespace dermis::test
