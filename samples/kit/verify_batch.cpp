#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <optional>

#include "dermis/verify/reference.h"
#include "kit/verification_product.h"

namespace dermis::samples {
namespace {

/// The box of all finite positions.
Box boxOf(const std::vector<reference::Double3>& positions) {
  std::array<double, 3> low, high;
  low.fill(std::numeric_limits<double>::infinity());
  high.fill(-std::numeric_limits<double>::infinity());
  for (const reference::Double3& position : positions) {
    for (std::size_t axis = 0; axis < 3; ++axis) {
      if (!std::isfinite(position[axis])) continue;
      low[axis] = std::min(low[axis], position[axis]);
      high[axis] = std::max(high[axis], position[axis]);
    }
  }
  Box box;
  for (std::size_t axis = 0; axis < 3; ++axis) {
    box.min[axis] = static_cast<float>(low[axis]);
    box.max[axis] = static_cast<float>(high[axis]);
  }
  return box;
}

/// A box with sides of positive length: larger than the positions need or, if `clamps`, too small
/// for them, unless they are close together.
Box storageBox(const std::vector<reference::Double3>& positions, bool clamps) {
  Box box = boxOf(positions);
  for (std::size_t axis = 0; axis < 3; ++axis) {
    if (!(box.max[axis] >= box.min[axis])) box.min[axis] = box.max[axis] = 0;
    // Keeps the box in the range that snorm16 supports.
    box.min[axis] = std::clamp(box.min[axis], -1e37f, 1e37f);
    box.max[axis] = std::clamp(box.max[axis], -1e37f, 1e37f);
    const float side = box.max[axis] - box.min[axis];
    const float margin = clamps ? -0.2f * side : 0.05f * side;
    // The margin is large enough not to be lost in the rounding of large numbers.
    const float least = 0.01f + 1e-6f * std::max(std::abs(box.min[axis]), std::abs(box.max[axis]));
    box.min[axis] -= margin + least;
    box.max[axis] += margin + least;
  }
  return box;
}

class BatchVerifier {
 public:
  BatchVerifier(BatchTarget& target, std::span<const InstanceToVerify> instances,
                const OutputCase& output)
      : target_(target), instances_(instances), output_(output) {}

  Result<std::vector<VerifiedInstance>> verify(bool thorough) {
    for (std::size_t index = 0; index < instances_.size(); ++index)
      boxes_.push_back(storageBox(instances_[index].expected->positions, index % 2 == 1));
    results_.resize(instances_.size());

    std::vector<std::size_t> all;
    for (std::size_t index = 0; index < instances_.size(); ++index) all.push_back(index);
    Result<Frames> frames = run(std::byte{0xa5}, all);
    if (!frames) return frames.error();
    for (std::size_t index = 0; index < instances_.size(); ++index) {
      if (Result<void> done = compareAttributes(frames->now.instances[index], index); !done)
        return done.error();
      if (output_.layout.motion != Motion::none) {
        if (Result<void> done = compareMotion(*frames, index); !done) return done.error();
      }
      if (output_.layout.bounds) checkBounds(frames->now.instances[index], index);
      checkClamped(frames->now.instances[index], index);
    }
    if (thorough) {
      if (Result<void> done = repeat(*frames, all); !done) return done.error();
    }
    for (const BatchResult* frame : {&frames->before, &frames->now, &frames->settled})
      checkUntouched(*frame);
    return results_;
  }

 private:
  /// The verified frame and, if there is motion, the frames before and after.
  struct Frames {
    BatchResult before, now, settled;
  };

  void checkUntouched(const BatchResult& frame) {
    if (frame.untouchedBytesChanged == 0) return;
    fail(0, std::to_string(frame.untouchedBytesChanged) +
                " bytes between attributes were changed; the first is " + frame.firstChanged);
  }

  Result<void> repeat(const Frames& frames, std::span<const std::size_t> all) {
    const Result<Frames> again = run(std::byte{0x5a}, all);
    if (!again) return again.error();
    for (const std::size_t index : all) {
      // A byte that was not written keeps its old value, which differs between the two runs.
      if (again->now.instances[index].streams != frames.now.instances[index].streams)
        fail(index, "a byte of an attribute was not written, or two runs wrote different values");
      const Result<Frames> own = run(std::byte{0xa5}, {&index, 1});
      if (!own) return own.error();
      if (own->now.instances[0].streams != frames.now.instances[index].streams)
        fail(index, "skinned alone, the instance has different bits");
    }
    return {};
  }

  SkinRequest requestOf(std::size_t index) const {
    const InstanceToVerify& instance = instances_[index];
    SkinRequest request;
    request.mesh = instance.packed;
    request.pose = instance.pose;
    request.method = instance.method;
    request.morphs = instance.morphs;
    request.previousPose = instance.previousPose;
    request.previousMorphs = instance.previousMorphs;
    request.box = boxes_[index];
    return request;
  }

  Result<Frames> run(std::byte poison, std::span<const std::size_t> indices) const {
    RunOptions options;
    options.tuning = output_.tuning;
    options.output = output_.layout;
    options.poison = poison;
    const std::unique_ptr<BatchRunner> runner = target_.runner(options);
    const bool moves = output_.layout.motion != Motion::none;
    std::vector<SkinRequest> now, before, settled;
    for (const std::size_t index : indices) {
      now.push_back(requestOf(index));
      before.push_back(now.back());
      before.back().pose = now.back().previousPose;
      before.back().morphs = now.back().previousMorphs;
      before.back().restartsMotion = moves;
      settled.push_back(now.back());
      settled.back().settles = moves;
    }
    Frames frames;
    if (moves) {
      Result<BatchResult> result = runner->run(before);
      if (!result) return result.error();
      frames.before = std::move(*result);
    }
    Result<BatchResult> result = runner->run(now);
    if (!result) return result.error();
    frames.now = std::move(*result);
    if (moves) {
      Result<BatchResult> last = runner->run(settled);
      if (!last) return last.error();
      frames.settled = std::move(*last);
    }
    return frames;
  }

  Result<void> compareAttributes(const SkinnedVertices& skinned, std::size_t index) {
    const InstanceToVerify& instance = instances_[index];
    const Result<Comparison> comparison =
        compareWithReference(*instance.expected, skinned.view(), instance.exemptions);
    if (!comparison) return comparison.error();
    results_[index].comparison = *comparison;
    results_[index].status = skinned.status;
    return {};
  }

  Result<void> compareMotion(const Frames& frames, std::size_t index) {
    constexpr auto positions = static_cast<std::size_t>(Stream::positions);
    constexpr auto previous = static_cast<std::size_t>(Stream::previousPositions);
    const auto& before = frames.before.instances[index].streams;
    const auto& now = frames.now.instances[index].streams;
    const auto& settled = frames.settled.instances[index].streams;
    if (before[previous] != before[positions])
      fail(index, "when motion restarts, previous positions are not the current ones");
    if (output_.layout.motion == Motion::kept && now[previous] != before[positions])
      fail(index, "previous positions are not those of the frame before");
    if (settled[positions] != now[positions] || settled[previous] != now[positions])
      fail(index, "after settling, previous positions are not the current ones");
    SkinnedView view;
    view.positions = frames.now.instances[index].attribute(Stream::previousPositions);
    view.box = boxes_[index];
    const InstanceToVerify& instance = instances_[index];
    const Result<Comparison> comparison =
        compareWithReference(*instance.expectedBefore, view, instance.exemptionsBefore);
    if (!comparison) return comparison.error();
    if (comparison->exempt != comparison->expectedExempt)
      fail(index, "of the previous positions, " + std::to_string(comparison->exempt.onlyFinite) +
                      " were checked only for being finite (expected " +
                      std::to_string(comparison->expectedExempt.onlyFinite) + "), " +
                      std::to_string(comparison->exempt.skipped) + " were skipped (expected " +
                      std::to_string(comparison->expectedExempt.skipped) + ")");
    if (comparison->failures != 0) {
      fail(index, std::to_string(comparison->failures) +
                      " previous positions are outside their bound; the first is vertex " +
                      std::to_string(comparison->firstFailure));
    }
    return {};
  }

  void checkBounds(const SkinnedVertices& skinned, std::size_t index) {
    const std::optional<Box> box = skinned.result.box();
    if (!box) return fail(index, "there is no box of the positions");
    if (skinned.positions.empty()) return checkBoundsNear(*box, index);
    // float32 positions are exactly those that the box was computed from.
    for (std::size_t axis = 0; axis < 3; ++axis) {
      float low = std::numeric_limits<float>::infinity(), high = -low;
      for (std::size_t i = axis; i < skinned.positions.size(); i += 3) {
        low = std::min(low, skinned.positions[i]);
        high = std::max(high, skinned.positions[i]);
      }
      if (box->min[axis] != low || box->max[axis] != high)
        fail(index, "the box is not that of the positions");
    }
  }

  /// The box must be as accurate as the positions. If rounding decides the positions of some
  /// vertices, the box may be larger than that of the other vertices.
  void checkBoundsNear(const Box& box, std::size_t index) {
    const reference::SkinnedMesh& expected = *instances_[index].expected;
    std::vector<reference::Double3> certain;
    double allowed = 0;
    bool mayBeLarger = false;
    for (std::size_t vertex = 0; vertex < expected.positions.size(); ++vertex) {
      const reference::VertexBounds& bounds = expected.bounds[vertex];
      if (bounds.onlyFinite) {
        mayBeLarger = true;
        continue;
      }
      certain.push_back(expected.positions[vertex]);
      allowed = std::max(allowed, bounds.position);
    }
    const Box expectedBox = boxOf(certain);
    for (std::size_t axis = 0; axis < 3; ++axis) {
      const auto reaches = [&](float actual, float wanted, double sign) {
        const double value = static_cast<double>(wanted);
        const double far = sign * (static_cast<double>(actual) - value);
        const double tolerance = allowed + 1e-7 * std::abs(value);
        return far >= -tolerance && (mayBeLarger || far <= tolerance);
      };
      if (!certain.empty() && !(reaches(box.min[axis], expectedBox.min[axis], -1) &&
                                reaches(box.max[axis], expectedBox.max[axis], 1)))
        fail(index, "the box is not that of the positions");
    }
  }

  void checkClamped(const SkinnedVertices& skinned, std::size_t index) {
    if (!isSnormPosition(output_.layout.positions)) return;
    const Box& box = boxes_[index];
    std::uint32_t outside = 0, unsure = 0;
    for (const reference::Double3& position : instances_[index].expected->positions) {
      double farthest = 0;
      for (std::size_t axis = 0; axis < 3; ++axis) {
        const double low = static_cast<double>(box.min[axis]);
        const double high = static_cast<double>(box.max[axis]);
        farthest = std::max(farthest, std::abs(2 * position[axis] - low - high) / (high - low));
      }
      if (farthest > 1) ++outside;
      if (!(std::abs(farthest - 1) > 1e-4)) ++unsure;
    }
    const std::uint32_t counted = skinned.result.clampedVertices;
    if ((counted > outside ? counted - outside : outside - counted) > unsure) {
      fail(index, std::to_string(counted) + " vertices were counted as clamped, but " +
                      std::to_string(outside) + " are outside the box");
    }
  }

  void fail(std::size_t index, const std::string& what) {
    std::string& wrong = results_[index].wrong;
    wrong += wrong.empty() ? what : "; " + what;
  }

  BatchTarget& target_;
  std::span<const InstanceToVerify> instances_;
  const OutputCase& output_;
  std::vector<Box> boxes_;
  std::vector<VerifiedInstance> results_;
};

}  // namespace

Result<std::vector<VerifiedInstance>> verifyBatch(BatchTarget& target,
                                                  std::span<const InstanceToVerify> instances,
                                                  const OutputCase& output, bool thorough) {
  return BatchVerifier(target, instances, output).verify(thorough);
}

}  // namespace dermis::samples
