#include "error_check.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <utility>

#include "dermis/verify/accuracy.h"
#include "dermis/verify/reference.h"

namespace dermis::viewer {
namespace {

double distance(const reference::Double3& expected, const float* actual) {
  double sum = 0;
  for (std::size_t axis = 0; axis < 3; ++axis) {
    const double difference = expected[axis] - static_cast<double>(actual[axis]);
    sum += difference * difference;
  }
  return std::sqrt(sum);
}

Result<void> checkPart(const cli::ScenePart& part, std::size_t index, const CheckRequest& request,
                       const SkinnedFigure& figure, FigureError& result) {
  std::vector<float>& errors = result.errors.emplace_back(part.primitive->vertexCount, 0.0f);
  const std::vector<float>& positions = figure.positions[index];
  if (part.mesh == nullptr || positions.empty()) return {};
  const Result<reference::SkinnedMesh> expected = reference::skin(
      part.mesh->view(), request.pose.pose(part), figure.method, request.pose.morphs[index]);
  if (!expected) return expected.error();
  for (std::size_t vertex = 0; vertex < errors.size(); ++vertex) {
    const reference::VertexBounds& bounds = expected->bounds[vertex];
    if (bounds.onlyFinite || bounds.undefined) continue;
    // A value that is not finite counts as the largest possible error.
    constexpr double most = static_cast<double>(std::numeric_limits<float>::max());
    const double apart = distance(expected->positions[vertex], &positions[3 * vertex]);
    const double error = apart < most ? apart : most;
    errors[vertex] = static_cast<float>(error);
    result.greatest = std::max(result.greatest, error);
    if (bounds.position > 0) {
      result.greatestPartOfBound = std::max(result.greatestPartOfBound, error / bounds.position);
    }
  }
  return {};
}

}  // namespace

Result<CheckResult> checkErrors(const cli::Scene& scene, const CheckRequest& request) {
  CheckResult result;
  result.clip = request.clip;
  result.time = request.time;
  for (const SkinnedFigure& figure : request.figures) {
    FigureError& checked = result.figures.emplace_back();
    checked.method = figure.method;
    for (std::size_t index = 0; index < scene.parts.size(); ++index) {
      if (Result<void> done = checkPart(scene.parts[index], index, request, figure, checked); !done)
        return done.error();
    }
  }
  return result;
}

void ErrorCheck::begin(CheckRequest request) {
  isBusy_ = true;
  thread_ = std::jthread([this, request = std::move(request)] {
    Result<CheckResult> result = checkErrors(*scene_, request);
    const std::lock_guard lock(mutex_);
    done_.emplace(std::move(result));
  });
}

std::optional<Result<CheckResult>> ErrorCheck::poll() {
  if (!isBusy_) return std::nullopt;
  {
    const std::lock_guard lock(mutex_);
    if (!done_) return std::nullopt;
  }
  thread_.join();
  isBusy_ = false;
  return std::exchange(done_, std::nullopt);
}

}  // namespace dermis::viewer
