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

}  // namespace

Result<std::vector<VerifiedCase>> verifyRigs(const Scene& scene,
                                             std::span<const PoseToVerify> poses) {
  std::vector<VerifiedCase> cases;
  for (const PoseToVerify& pose : poses) {
    for (const auto& [skin, rig] : scene.rigs) {
      const RigInput input = rigInput(scene, skin, pose.clip, pose.time);
      const Result<reference::EvaluatedRig> expected =
          reference::evaluateRig(*rig.view, input.written, input.givenWeights);
      if (!expected) return expected.error();
      std::vector<JointMatrix> joints(rig.packed.drivenJoints());
      std::vector<float> weights(rig.packed.givenWeights() + rig.packed.drivenWeights());
      const Result<void> evaluated =
          evaluateRig(rig.packed, input.written, input.givenWeights, joints, weights);
      if (!evaluated) return evaluated.error();
      VerifiedCase verified;
      verified.part = fmt::format("the rig of skin {}", skin);
      verified.method = rigMethod;
      verified.pose = pose.name;
      verified.variant = "driven joints";
      Compared ofJoints, ofWeights;
      for (std::uint32_t joint = 0; joint < joints.size(); ++joint) {
        for (std::size_t i = 0; i < 12; ++i) {
          ofJoints.add(joint, joints[joint].m[i / 4][i % 4], expected->joints[joint][i / 4][i % 4],
                       expected->jointBounds[joint][i / 4][i % 4]);
        }
        ofJoints.endElement(joint);
      }
      verified.comparison = ofJoints.comparison();
      if (!joints.empty()) cases.push_back(verified);
      for (std::uint32_t weight = 0; weight < weights.size(); ++weight) {
        ofWeights.add(weight, weights[weight], expected->weights[weight],
                      expected->weightBounds[weight]);
        ofWeights.endElement(weight);
      }
      verified.variant = weightsVariant;
      verified.comparison = ofWeights.comparison();
      if (!weights.empty()) cases.push_back(verified);
    }
  }
  return cases;
}

}  // namespace dermis::cli
