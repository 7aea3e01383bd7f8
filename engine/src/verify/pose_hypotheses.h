// The mistakes that `diagnose` tests: what each does to a pose, and how it is undone.
#pragma once

#include <array>
#include <cstdint>
#include <functional>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "dermis/result.h"
#include "dermis/verify.h"
#include "verify/pose_probe.h"

namespace dermis::diagnosis {

/// The skeleton of a `PoseInput` in double precision.
struct Skeleton {
  BindSkeleton bind;
  std::vector<std::uint32_t> nodeOfJoint;
  std::vector<std::uint32_t> nodeParents;  ///< `noJoint` for roots; empty if not known
  std::vector<std::uint32_t> nodeOrder;    ///< parents before their children
  Pose locals;                             ///< of nodes; empty if not known
  std::vector<std::string_view> names;     ///< of joints

  bool hasLocals() const { return !locals.empty(); }
  /// Whether the right pose can be computed.
  bool isComplete() const { return hasLocals() && !bind.inverseBind.empty(); }
};

/// Fails as `diagnose` does.
Result<Skeleton> skeletonOf(const PoseInput& input);

/// The global transforms of all nodes.
Pose globalsOf(const Skeleton& skeleton, const Pose& locals);
/// The right pose: needs a skeleton that is complete.
Pose rebuild(const Skeleton& skeleton, const Pose& globals);

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
std::vector<Hypothesis> hypothesesFor(const Skeleton& skeleton);

/// What is not, and why.
std::vector<std::pair<PoseMistake, std::string>> untested(const PoseInput& input,
                                                          const MeshView& mesh);

}  // namespace dermis::diagnosis
