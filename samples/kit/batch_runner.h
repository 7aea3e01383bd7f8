// Skins batches on a device or on the CPU, and waits for them. For commands and tests. An engine
// keeps its buffers and does not wait.
#pragma once

#include <array>
#include <cstddef>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "dermis/plan.h"
#include "dermis/result.h"
#include "dermis/verify/accuracy.h"
#include "dermis/vulkan/context.h"
#include "kit/batch_layout.h"
#include "kit/buffer.h"
#include "kit/device.h"

namespace dermis::samples {

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

 private:
  std::string instructions_;
};

/// Runs a single batch on a device.
Result<BatchResult> runBatch(Device& device, vulkan::Context& context,
                             std::span<const SkinRequest> requests, const RunOptions& options = {});

}  // namespace dermis::samples
