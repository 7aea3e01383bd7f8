// A crowd that plays clips in a scene, on a device or on the CPU.
#pragma once

#include <cstdint>
#include <memory>

#include "dermis/result.h"
#include "kit/bench/crowd.h"
#include "kit/device.h"

namespace dermis::samples {

/// A scene with a figure and an instance for each instance of a crowd. Each figure plays two clips
/// at once (`clipPair`). Positions and normals are float32x3, the method is dual quaternions.
class ClipCrowd {
 public:
  /// `crowd` must have clips. It must outlive this object, and so must `open`.
  static Result<std::unique_ptr<ClipCrowd>> onDevice(OpenDevice& open, const Crowd& crowd);
  static Result<std::unique_ptr<ClipCrowd>> onCpu(const Crowd& crowd);
  virtual ~ClipCrowd() = default;

  /// Skins the next frame. All figures play on, so that all poses are sampled, composed and
  /// converted anew. Returns seconds: on a device those of the frame's commands, as
  /// `TimedBatches::skin`; on the CPU those of the whole frame, from `beginFrame` until all of
  /// `threads` are done. A device ignores `threads`.
  virtual Result<double> skin(std::uint32_t threads) = 0;

  /// Compares some instances of the last frame with `reference::skin` in the poses of `samplePose`.
  /// Fails with `invalidData` if one differs.
  virtual Result<void> check() = 0;
};

}  // namespace dermis::samples
