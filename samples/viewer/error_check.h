// How far what the device skinned is from the reference in double precision: on a thread of its
// own, for the reference is made to be right, not fast.
#pragma once

#include <array>
#include <cstdint>
#include <mutex>
#include <optional>
#include <thread>
#include <vector>

#include "skinned_scene.h"

namespace dermis::viewer {

/// What a scene looked like: a pose, and what was skinned by it.
struct SkinnedFigure {
  Method method = Method::dualQuaternion;
  std::vector<std::vector<float>> positions;  ///< by part, 3 a vertex; empty: a fixed part
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
  double greatestPartOfBound = 0;          ///< the largest error ÷ what is allowed there
};
struct CheckResult {
  std::uint32_t clip = gltf::none;
  double time = 0;
  std::vector<FigureError> figures;
};

class ErrorCheck {
 public:
  /// `scene` must outlive it.
  explicit ErrorCheck(const cli::Scene& scene) : scene_(&scene) {}

  bool isBusy() const { return isBusy_; }
  /// Not while it is busy.
  void begin(CheckRequest request);
  /// What came of it, once. Fails as `reference::skin`.
  std::optional<Result<CheckResult>> poll();

 private:
  const cli::Scene* scene_;
  bool isBusy_ = false;
  std::mutex mutex_;
  std::optional<Result<CheckResult>> done_;
  std::jthread thread_;  // last, so that it ends first
};

/// The same, now.
Result<CheckResult> checkErrors(const cli::Scene& scene, const CheckRequest& request);

}  // namespace dermis::viewer
