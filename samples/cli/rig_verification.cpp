#include "rig_verification.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdint>

#include "dermis/rig.h"
#include "dermis/verify.h"

namespace dermis::cli {
namespace {

/// Counts numbers of joints, or weights.
class Compared {
 public:
  /// Adds an element of which a number may be off by `bound`.
  void add(std::uint32_t element, float value, double expected, double bound) {
    if (!std::isfinite(bound)) {
      isUndefined_ = true;
      return;
    }
    const double error = std::abs(double{value} - expected);
    const double share = error == 0 ? 0 : error / bound;
    comparison_.largestPositionError = std::max(comparison_.largestPositionError, error);
    if (share > comparison_.worstPosition) {
      comparison_.worstPosition = share;
      comparison_.worstPositionVertex = element;
    }
    isWrong_ = isWrong_ || !(share <= 1);
  }

  void endElement(std::uint32_t element) {
    if (isWrong_ && comparison_.failures++ == 0) comparison_.firstFailure = element;
    ++(isUndefined_ ? comparison_.exempt.skipped : comparison_.compared);
    comparison_.expectedExempt = comparison_.exempt;
    isWrong_ = isUndefined_ = false;
  }

  const Comparison& comparison() const { return comparison_; }

 private:
  Comparison comparison_;
  bool isWrong_ = false, isUndefined_ = false;
};

/// `found`: what the rig of the skin drives in the pose.
Result<void> compareDriven(const SceneRig& rig, const samples::RigInput& input,
                           const samples::DrivenPose& found, VerifiedCase verified,
                           std::vector<VerifiedCase>& cases) {
  const Result<reference::EvaluatedRig> expected =
      reference::evaluateRig(*rig.view, input.written, input.givenWeights);
  if (!expected) return expected.error();
  Compared ofJoints, ofWeights;
  for (std::uint32_t joint = 0; joint < found.joints.size(); ++joint) {
    for (std::size_t i = 0; i < 12; ++i) {
      ofJoints.add(joint, found.joints[joint].m[i / 4][i % 4],
                   expected->joints[joint][i / 4][i % 4],
                   expected->jointBounds[joint][i / 4][i % 4]);
    }
    ofJoints.endElement(joint);
  }
  verified.variant = "driven joints";
  verified.comparison = ofJoints.comparison();
  if (!found.joints.empty()) cases.push_back(verified);
  for (std::uint32_t weight = 0; weight < found.weights.size(); ++weight) {
    ofWeights.add(weight, found.weights[weight], expected->weights[weight],
                  expected->weightBounds[weight]);
    ofWeights.endElement(weight);
  }
  verified.variant = weightsVariant;
  verified.comparison = ofWeights.comparison();
  if (!found.weights.empty()) cases.push_back(verified);
  return {};
}

constexpr std::size_t posesAtOnce = 32;

}  // namespace

Result<std::vector<VerifiedCase>> verifyRigs(samples::BatchTarget& target, const Scene& scene,
                                             std::span<const PoseToVerify> poses) {
  std::vector<VerifiedCase> cases;
  for (const auto& [skin, rig] : scene.rigs) {
    for (std::span rest = poses; !rest.empty();) {
      const std::span some = rest.first(std::min(rest.size(), posesAtOnce));
      rest = rest.subspan(some.size());
      std::vector<samples::RigInput> inputs;
      for (const PoseToVerify& pose : some)
        inputs.push_back(rigInput(scene, skin, pose.clip, pose.time));
      const Result<std::vector<samples::DrivenPose>> found = target.drivePoses(rig.packed, inputs);
      if (!found) return found.error();
      for (std::size_t i = 0; i < some.size(); ++i) {
        VerifiedCase verified;
        verified.part = fmt::format("the rig of skin {}", skin);
        verified.method = rigMethod;
        verified.pose = some[i].name;
        if (Result<void> done = compareDriven(rig, inputs[i], (*found)[i], verified, cases); !done)
          return done.error();
      }
    }
  }
  return cases;
}

}  // namespace dermis::cli
