// Skins batches on a device and waits for them: for commands and tests, where an engine would keep
// its buffers and go on.
#pragma once

#include <array>
#include <cstddef>
#include <span>
#include <string>
#include <vector>

#include "batch_layout.h"
#include "buffer.h"
#include "dermis/plan.h"
#include "dermis/result.h"
#include "dermis/verify/accuracy.h"
#include "dermis/vulkan/context.h"
#include "device.h"

namespace dermis::samples {

/// What became of one request.
struct SkinnedVertices {
  std::vector<float> positions;  ///< 3 a vertex; empty where they are not stored as float32
  std::vector<float> normals;    ///< likewise, or where the mesh has none
  PoseStatus status;             ///< all 0 for linear
  InstanceResult result;         ///< where it was asked for
  /// The attributes as they are stored, tightly packed, by `Stream`.
  std::array<std::vector<std::byte>, streamCount> streams;
  std::array<VertexFormat, streamCount> formats{};
  Box box;

  /// One of them, for `compare`.
  SkinnedAttribute attribute(Stream stream) const;
  SkinnedView view() const;
};

struct RunOptions {
  Tuning tuning;
  OutputLayout output;
  std::byte poison{0xa5};  ///< what stands in the outputs before
  bool countUntouched = true;
};

struct BatchResult {
  std::vector<SkinnedVertices> instances;
  std::size_t dispatches = 0;
  std::uint64_t untouchedBytesChanged =
      0;  ///< bytes outside the attributes that are not as they were, where they are counted
  std::string firstChanged;  ///< which is the first of them: "byte 12 of the positions' buffer"
};

/// Skins one batch after another into the same outputs, as an engine does frame by frame.
class BatchRunner {
 public:
  BatchRunner(Device& device, vulkan::Context& context, const RunOptions& options)
      : device_(device), context_(context), options_(options) {}

  /// Outputs are as the last run left them where they are as large as they were; else poisoned.
  Result<BatchResult> run(std::span<const SkinRequest> requests);

 private:
  Result<void> makeOutputs(const Plan& plan);
  vulkan::OutputBuffers outputRanges() const;
  BatchResult readBack(const Plan& plan, const MappedBuffer& palettes,
                       const MappedBuffer& results) const;
  void countChangedBytes(BatchResult& result) const;

  Device& device_;
  vulkan::Context& context_;
  RunOptions options_;
  BatchLayout layout_;
  std::array<MappedBuffer, streamCount> outputs_;
};

/// One batch on its own.
Result<BatchResult> runBatch(Device& device, vulkan::Context& context,
                             std::span<const SkinRequest> requests, const RunOptions& options = {});

}  // namespace dermis::samples
