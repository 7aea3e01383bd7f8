// Skins a batch on a device and waits for it: for commands and tests, where an engine would keep
// its buffers and go on.
#pragma once

#include <span>
#include <vector>

#include "buffer.h"
#include "dermis/plan.h"
#include "dermis/result.h"
#include "dermis/types.h"
#include "dermis/vulkan/context.h"
#include "device.h"

namespace dermis::samples {

/// One instance: its mesh, pose and method.
struct SkinRequest {
  const PackedMesh* mesh = nullptr;
  std::span<const JointMatrix> palette;
  bool mayScale = true;
  Method method = Method::dualQuaternion;
};

struct SkinnedVertices {
  std::vector<float> positions;  ///< 3 a vertex
  std::vector<float> normals;    ///< likewise, empty where the mesh has none
  PaletteStatus status;          ///< all 0 for linear
};

struct RunOptions {
  Tuning tuning;
  /// Bytes of a vertex in the output: position, normal, then bytes that must stay as they are. 0:
  /// as few as needed.
  std::uint32_t stride = 0;
  bool normals = true;  ///< where a mesh has them
};

struct BatchResult {
  std::vector<SkinnedVertices> instances;
  std::size_t dispatches = 0;
  std::uint64_t untouchedBytesChanged =
      0;  ///< bytes outside the attributes that are not as they were
};

/// Meshes that are the same object are uploaded once.
Result<BatchResult> runBatch(Device& device, vulkan::Context& context,
                             std::span<const SkinRequest> requests, const RunOptions& options = {});

}  // namespace dermis::samples
