// Every method and variant on the device, against the reference.
#pragma once

#include <string>
#include <vector>

#include "batch_runner.h"
#include "dermis/accuracy.h"
#include "skinned_scene.h"

namespace dermis::cli {

/// One primitive in one pose with one method and variant.
struct VerifiedCase {
  std::string part;
  std::string method;
  std::string pose;     ///< "rest pose", "clip 0 'walk' at 0.341 s"
  std::string variant;  ///< "64 invocations, 4 instances each, normals"
  Comparison comparison;
  PaletteStatus status;
  /// Floats that differ in any bit from the first variant's: none may.
  std::uint64_t differingFloats = 0;

  bool passed() const {
    return comparison.passed() && differingFloats == 0 &&
           comparison.compared + comparison.onlyFinite != 0;
  }
  std::string failure() const;  ///< a sentence, where it did not pass
};

struct PoseToVerify {
  std::uint32_t clip = gltf::none;
  double time = 0;
  std::string name;
};

/// The rest pose, and each clip at its beginning, two times within, and its end.
std::vector<PoseToVerify> posesToVerify(const gltf::Model& model);

/// All parts with all methods in one batch, once for each variant.
Result<std::vector<VerifiedCase>> verifyPose(samples::Device& device, vulkan::Context& context,
                                             const Scene& scene, const PoseToVerify& pose);

}  // namespace dermis::cli
