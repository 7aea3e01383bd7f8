// The mistakes that `diagnose` tests: what each does to a pose, and how it is undone.
#pragma once

#include <functional>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "dermis/verify.h"
#include "verify/pose_probe.h"
#include "verify/pose_skeleton.h"

namespace dermis::diagnosis {

/// One form of a mistake.
struct Hypothesis {
  /// Returns nothing if it cannot be computed.
  using Change = std::function<std::optional<Pose>(const Pose&)>;

  PoseMistake mistake = PoseMistake::none;
  std::string message;
  Change make;  ///< from the right pose to the wrong one; empty if it cannot be computed
  Change undo;  ///< from the wrong pose to the right one; empty if there is nothing to measure
  Change undoBind = {};  ///< the same for inverse bind matrices; empty if they are right
};

/// All that can be tested with this skeleton. Those that are more likely come first.
std::vector<Hypothesis> hypothesesFor(const PoseSkeleton& skeleton);

/// What is not, and why.
std::vector<std::pair<PoseMistake, std::string>> untested(const PoseInput& input,
                                                          const MeshView& mesh);

}  // namespace dermis::diagnosis
