#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <optional>

#include "dermis/verify.h"
#include "kit/verification_product.h"

namespace dermis::samples {
namespace {

/// An interval along each axis, in double precision.
struct Range {
  std::array<double, 3> low, high;

  Range() {
    low.fill(std::numeric_limits<double>::infinity());
    high.fill(-std::numeric_limits<double>::infinity());
  }
};

/// The range of all finite positions.
Range rangeOf(const std::vector<reference::Double3>& positions) {
  Range range;
  for (const reference::Double3& position : positions) {
    for (std::size_t axis = 0; axis < 3; ++axis) {
      if (!std::isfinite(position[axis])) continue;
      range.low[axis] = std::min(range.low[axis], position[axis]);
      range.high[axis] = std::max(range.high[axis], position[axis]);
    }
  }
  return range;
}

/// A box with sides of positive length: larger than the positions need or, if `clamps`, too small
/// for them, unless they are close together.
Box storageBox(const std::vector<reference::Double3>& positions, bool clamps) {
  const Range range = rangeOf(positions);
  Box box;
  float longest = 0;
  for (std::size_t axis = 0; axis < 3; ++axis) {
    if (!(range.high[axis] >= range.low[axis])) continue;
    // Keeps the box in the range that snorm16 supports.
    box.min[axis] = static_cast<float>(std::clamp(range.low[axis], -1e37, 1e37));
    box.max[axis] = static_cast<float>(std::clamp(range.high[axis], -1e37, 1e37));
    longest = std::max(longest, box.max[axis] - box.min[axis]);
  }
  if (longest == 0) longest = 1;
  for (std::size_t axis = 0; axis < 3; ++axis) {
    const float side = box.max[axis] - box.min[axis];
    const float margin = clamps ? -0.2f * side : 0.05f * side;
    // The margin is large enough not to be lost in the rounding of large numbers.
    const float least =
        0.01f * longest + 1e-6f * std::max(std::abs(box.min[axis]), std::abs(box.max[axis]));
    box.min[axis] -= margin + least;
    box.max[axis] += margin + least;
  }
  return box;
}

/// Whether the position has a bound, and not only to be finite, if that.
bool hasBound(const reference::VertexBounds& bounds) {
  return !bounds.undefined && !bounds.outOfRange && !bounds.onlyFinite;
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
      if (output_.layout.motion) {
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
    request.box = boxes_[index];
    return request;
  }

  Result<Frames> run(std::byte poison, std::span<const std::size_t> indices) const {
    RunOptions options;
    options.tuning = output_.tuning;
    options.output = output_.layout;
    options.poison = poison;
    const std::unique_ptr<BatchRunner> runner = target_.runner(options);
    const bool moves = output_.layout.motion;
    std::vector<SkinRequest> now, before, settled;
    for (const std::size_t index : indices) {
      now.push_back(requestOf(index));
      before.push_back(now.back());
      before.back().pose = instances_[index].previousPose;
      before.back().morphs = instances_[index].previousMorphs;
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
    if (now[previous] != before[positions])
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
                      std::to_string(comparison->expectedExempt.skipped) + "), " +
                      std::to_string(comparison->exempt.outOfRange) +
                      " were out of range (expected " +
                      std::to_string(comparison->expectedExempt.outOfRange) + ")");
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

  /// Each vertex may be anywhere within its bound; this limits where the sides of the box are. The
  /// box may reach farther if a vertex has no bound.
  void checkBoundsNear(const Box& box, std::size_t index) {
    const reference::SkinnedMesh& expected = *instances_[index].expected;
    Range outermost, innermost;
    for (std::size_t vertex = 0; vertex < expected.positions.size(); ++vertex) {
      const reference::VertexBounds& bounds = expected.bounds[vertex];
      for (std::size_t axis = 0; axis < 3; ++axis) {
        if (!hasBound(bounds)) {
          outermost.low[axis] = -HUGE_VAL;
          outermost.high[axis] = HUGE_VAL;
          continue;
        }
        const double position = expected.positions[vertex][axis];
        outermost.low[axis] = std::min(outermost.low[axis], position - bounds.position);
        outermost.high[axis] = std::max(outermost.high[axis], position + bounds.position);
        innermost.low[axis] = std::min(innermost.low[axis], position + bounds.position);
        innermost.high[axis] = std::max(innermost.high[axis], position - bounds.position);
      }
    }
    for (std::size_t axis = 0; axis < 3; ++axis) {
      const auto low = static_cast<double>(box.min[axis]);
      const auto high = static_cast<double>(box.max[axis]);
      if (low < outermost.low[axis] || low > innermost.low[axis] || high < innermost.high[axis] ||
          high > outermost.high[axis])
        fail(index, "the box is not that of the positions");
    }
  }

  /// Whether a vertex is clamped is certain if it is farther from the side of the box than its
  /// bound and the rounding errors of storing it (`positionFormatBound`).
  void checkClamped(const SkinnedVertices& skinned, std::size_t index) {
    if (!isSnormPosition(output_.layout.positions)) return;
    const reference::SkinnedMesh& expected = *instances_[index].expected;
    const Box& box = boxes_[index];
    std::uint32_t outside = 0, uncertain = 0;
    for (std::size_t vertex = 0; vertex < expected.positions.size(); ++vertex) {
      const reference::VertexBounds& bounds = expected.bounds[vertex];
      bool isOutside = false, isInside = true;
      for (std::size_t axis = 0; axis < 3; ++axis) {
        const auto low = static_cast<double>(box.min[axis]);
        const auto high = static_cast<double>(box.max[axis]);
        const double center = (low + high) / 2, half = (high - low) / 2;
        const double beyond = std::abs(expected.positions[vertex][axis] - center) - half;
        const double tolerance =
            bounds.position + floatRounding * (4 * std::abs(center) + 8 * half);
        isOutside |= beyond > tolerance;
        isInside &= beyond < -tolerance;
      }
      if (!hasBound(bounds) || !(isOutside || isInside)) {
        ++uncertain;
      } else if (isOutside) {
        ++outside;
      }
    }
    const std::uint32_t counted = skinned.result.clampedVertices;
    if (counted < outside || counted > outside + uncertain) {
      fail(index, std::to_string(counted) + " vertices were counted as clamped, but " +
                      std::to_string(outside) + " to " + std::to_string(outside + uncertain) +
                      " are outside the box");
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
