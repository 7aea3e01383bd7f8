// The distance of skinned vertices from the reference in double precision. Computed on another
// thread, because the reference is slow.
#pragma once

#include <array>
#include <cstdint>
#include <mutex>
#include <optional>
#include <thread>
#include <vector>

#include "skinned_scene.h"

namespace dermis::viewer {

/// A figure of the last picture: its method, and its vertices as the device skinned them.
struct SkinnedFigure {
  Method method = Method::dualQuaternion;
  std::vector<std::vector<float>> positions;  ///< by part, 3 per vertex; empty for a fixed part
};
struct CheckRequest {
  std::uint32_t clip = gltf::none;
  double time = 0;
  cli::ScenePose pose;
  std::vector<SkinnedFigure> figures;
};

struct FigureError {
  Method method = Method::dualQuaternion;
  std::vector<std::vector<float>> errors;  ///< by part and vertex, in the model's unit
  double greatest = 0;                     ///< of all of them
  double greatestPartOfBound = 0;          ///< the largest error ÷ its bound
};
struct CheckResult {
  std::uint32_t clip = gltf::none;
  double time = 0;
  std::vector<FigureError> figures;
};

class ErrorCheck {
 public:
  /// `scene` must outlive this object.
  explicit ErrorCheck(const cli::Scene& scene) : scene_(&scene) {}

  bool isBusy() const { return isBusy_; }
  /// Must not be called while the check is busy.
  void begin(CheckRequest request);
  /// Returns the result, once. Fails like `reference::skin`.
  std::optional<Result<CheckResult>> poll();

 private:
  const cli::Scene* scene_;
  bool isBusy_ = false;
  std::mutex mutex_;
  std::optional<Result<CheckResult>> done_;
  std::jthread thread_;  // last, so that it ends first
};

/// The same check, synchronously.
Result<CheckResult> checkErrors(const cli::Scene& scene, const CheckRequest& request);

}  // namespace dermis::viewer
