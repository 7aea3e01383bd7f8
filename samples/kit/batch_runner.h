// Skins batches on a device or on the CPU, and waits for them. For commands and tests. An engine
// keeps its buffers and does not wait.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <functional>
#include <map>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "dermis/clips.h"
#include "dermis/mesh.h"
#include "dermis/plan.h"
#include "dermis/result.h"
#include "dermis/rig.h"
#include "dermis/verify.h"
#include "dermis/vulkan/context.h"
#include "kit/buffer.h"
#include "kit/device.h"

namespace dermis::samples {

/// One instance: its mesh, pose and method. Spans refer to the caller's memory.
struct SkinRequest {
  const PackedMesh* mesh = nullptr;
  std::span<const JointMatrix> pose;
  JointPromise promise = JointPromise::scaling;
  Method method = Method::dualQuaternion;
  std::span<const MorphWeight> morphs = {};
  Box box = {};  ///< for snorm16 positions
  bool restartsMotion = false;
  bool settles = false;
};

enum class Arrangement : std::uint8_t {
  interleaved,         ///< one buffer; the attributes of a vertex are adjacent
  planar,              ///< one buffer; each attribute of an instance is a separate array
  directionsTogether,  ///< the same, but normals and tangents are adjacent in one array
  separate,            ///< a buffer for each attribute
};

/// How skinned vertices are stored. Normals and tangents are written if the mesh has them.
struct OutputLayout {
  VertexFormat positions = VertexFormat::float32x3;
  VertexFormat normals = VertexFormat::float32x3;
  VertexFormat tangents = VertexFormat::none;
  bool motion = false;
  bool bounds = false;
  Arrangement arrangement = Arrangement::interleaved;
  std::uint32_t gap = 0;     ///< bytes after each vertex (interleaved) or element; never written
  std::uint32_t before = 0;  ///< bytes before each instance (interleaved); never written
};

/// The buffers of a batch.
struct BatchLayout {
  std::map<const PackedMesh*, std::uint64_t>
      meshOffsets;  ///< a mesh that several requests share is stored once
  std::vector<PoseDescription> poseDescriptions;
  std::vector<std::span<const JointMatrix>> poses;  ///< in the same order
  std::vector<Job> jobs;                            ///< of the requests
  std::uint64_t meshesSize = 0, posesSize = 0;
  ByStream<std::uint64_t> outputs{};
  bool oneOutput = true;

  Batch batch() const {
    return {poseDescriptions, jobs, meshesSize, posesSize, outputs, oneOutput};
  }
};

BatchLayout layOutBatch(std::span<const SkinRequest> requests, const OutputLayout& output);

/// The result of one request.
struct SkinnedVertices {
  std::vector<float> positions;      ///< 3 per vertex; empty if they are not stored as float32
  std::vector<float> normals;        ///< likewise; also empty if the mesh has none
  std::optional<PoseStatus> status;  ///< on a device; all 0 for linear
  InstanceResult result;             ///< if it was requested
  /// The stored attributes, tightly packed, by `Stream`.
  std::array<std::vector<std::byte>, streamCount> streams;
  std::array<VertexFormat, streamCount> formats{};
  Box box;

  /// One of the streams, for `compareWithReference`.
  SkinnedAttribute attribute(Stream stream) const;
  SkinnedView view() const;
};

struct RunOptions {
  /// On the CPU, a job has at most `workgroupSize` vertices of `instancesPerInvocation` instances.
  Tuning tuning;
  std::string instructions;  ///< CPU instruction set of `cpu::targetNames`; empty: chosen by target
  OutputLayout output;
  std::byte poison{0xa5};  ///< initial contents of the outputs
  bool countUntouched = true;
};

struct BatchResult {
  std::vector<SkinnedVertices> instances;
  std::size_t dispatches = 0;
  /// Changed bytes outside the attributes, if `countUntouched`.
  std::uint64_t untouchedBytesChanged = 0;
  std::string firstChanged;  ///< the first of them: "byte 12 of the positions' buffer"
};

/// Skins one batch after another into the same outputs, as an engine does in each frame. Packed
/// meshes must outlive it and must not change.
class BatchRunner {
 public:
  virtual ~BatchRunner() = default;
  BatchRunner(const BatchRunner&) = delete;
  BatchRunner& operator=(const BatchRunner&) = delete;

  /// Outputs keep the contents of the last run if their sizes are the same; otherwise they are
  /// filled with `poison`.
  Result<BatchResult> run(std::span<const SkinRequest> requests);

 protected:
  explicit BatchRunner(const RunOptions& options) : options_(options) {}
  /// Skins `layout_`. Returns status and result of each instance; vertices are in the outputs.
  virtual Result<BatchResult> skin() = 0;
  virtual std::span<const std::byte> outputBytes(std::size_t stream) const = 0;
  std::size_t outputOf(std::size_t stream) const { return layout_.oneOutput ? 0 : stream; }

  RunOptions options_;
  BatchLayout layout_;

 private:
  void readOutputs(BatchResult& result) const;
  void countChangedBytes(BatchResult& result) const;
};

/// A division of the work among invocations or jobs. It must not change any bit of the result.
struct Division {
  std::string name;
  Tuning tuning;
  std::string instructions;
};

/// What a rig reads in one pose.
struct RigInput {
  std::vector<JointMatrix> written;
  std::vector<float> givenWeights;
};
/// What it drives there.
struct DrivenPose {
  std::vector<JointMatrix> joints;
  std::vector<float> weights;  ///< all of the rig
};

/// A device, or the CPU, that skins batches.
class BatchTarget {
 public:
  virtual ~BatchTarget() = default;
  virtual std::string name() const = 0;
  virtual DeviceLimits limits() const = 0;
  virtual std::span<const Method> methods() const = 0;
  /// The first is the default.
  virtual std::vector<Division> divisions() const = 0;
  virtual std::unique_ptr<BatchRunner> runner(const RunOptions& options) = 0;
  /// What figures that play these layers have as poses: figure by figure, one for each skin.
  virtual Result<std::vector<std::vector<JointMatrix>>> samplePoses(
      const PackedClips& bank, std::span<const std::vector<ClipLayer>> plays) = 0;
  /// The morph weights of a node of the skeleton for each of these figures.
  virtual Result<std::vector<std::vector<float>>> sampleWeights(
      const PackedClips& bank, std::span<const std::vector<ClipLayer>> plays,
      std::uint32_t node) = 0;
  /// What a rig drives in each of these poses.
  virtual Result<std::vector<DrivenPose>> drivePoses(const PackedRig& rig,
                                                     std::span<const RigInput> inputs) = 0;

  /// Runs a single batch.
  Result<BatchResult> run(std::span<const SkinRequest> requests, const RunOptions& options = {}) {
    return runner(options)->run(requests);
  }
};

/// Device and context must outlive it.
class VulkanTarget : public BatchTarget {
 public:
  VulkanTarget(Device& device, vulkan::Context& context) : device_(device), context_(context) {}
  std::string name() const override;
  DeviceLimits limits() const override;
  std::span<const Method> methods() const override;
  std::vector<Division> divisions() const override;
  std::unique_ptr<BatchRunner> runner(const RunOptions& options) override;
  /// As a scene samples them.
  Result<std::vector<std::vector<JointMatrix>>> samplePoses(
      const PackedClips& bank, std::span<const std::vector<ClipLayer>> plays) override;
  /// As a scene hands them to a rig.
  Result<std::vector<std::vector<float>>> sampleWeights(
      const PackedClips& bank, std::span<const std::vector<ClipLayer>> plays,
      std::uint32_t node) override;
  /// As a scene drives them.
  Result<std::vector<DrivenPose>> drivePoses(const PackedRig& rig,
                                             std::span<const RigInput> inputs) override;

 private:
  Device& device_;
  vulkan::Context& context_;
};

/// Whether `--device NAME` is cpu or reference.
inline bool needsNoVulkan(std::string_view device) {
  return device == "cpu" || device == "reference";
}

/// Skins with dermis::cpu. `instructions` is one of `cpu::targetNames`; empty: the best.
class CpuTarget : public BatchTarget {
 public:
  explicit CpuTarget(std::string instructions = {}) : instructions_(std::move(instructions)) {}
  std::string name() const override;
  DeviceLimits limits() const override;
  std::span<const Method> methods() const override;
  std::vector<Division> divisions() const override;
  std::unique_ptr<BatchRunner> runner(const RunOptions& options) override;
  Result<std::vector<std::vector<JointMatrix>>> samplePoses(
      const PackedClips& bank, std::span<const std::vector<ClipLayer>> plays) override;
  Result<std::vector<std::vector<float>>> sampleWeights(
      const PackedClips& bank, std::span<const std::vector<ClipLayer>> plays,
      std::uint32_t node) override;
  Result<std::vector<DrivenPose>> drivePoses(const PackedRig& rig,
                                             std::span<const RigInput> inputs) override;

 private:
  std::string instructions_;
};

/// Runs a single batch on a device.
Result<BatchResult> runBatch(Device& device, vulkan::Context& context,
                             std::span<const SkinRequest> requests, const RunOptions& options = {});

/// Skins many batches in parallel: a thread for each target, all targets of the same kind.
///
/// Mesa's lavapipe compiles a kernel in the thread of the queue that first executes it. To compile
/// on all cores, each thread needs its own device.
class TargetPool {
 public:
  /// Creates another target that gives the same results as the first.
  using MakeTarget = std::function<Result<std::shared_ptr<BatchTarget>>()>;
  /// The pool uses at most `threads` targets, including `first`. More targets are created when
  /// there is work for them. If one cannot be created, the pool uses fewer.
  TargetPool(std::shared_ptr<BatchTarget> first, MakeTarget makeTarget, std::size_t threads);

  BatchTarget& first() { return *targets_.front(); }

  using Task = std::function<Result<void>(std::size_t index, BatchTarget& target)>;
  struct Work {
    std::size_t tasks = 0;
    /// The first `pinnedTasks` tasks run on the same targets in every call, as long as the pool has
    /// the same number of targets, because those targets have the pipelines already.
    std::size_t pinnedTasks = 0;
    /// Called after each task that succeeds, by one thread at a time.
    std::function<void()> done = [] {};
  };
  /// Calls `task` for each index below `work.tasks`, and returns when all tasks have ended. If
  /// tasks fail, it returns the error of the lowest index and starts no task above that index.
  /// Exceptions of a task are rethrown.
  Result<void> run(const Work& work, const Task& task);

 private:
  void makeTargets(std::size_t count);

  std::vector<std::shared_ptr<BatchTarget>> targets_;
  MakeTarget makeTarget_;
  std::size_t threads_;
};

}  // namespace dermis::samples
