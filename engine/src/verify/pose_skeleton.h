// What `diagnose` knows of a skeleton, and the pose that is right by it.
#pragma once

#include <cstdint>
#include <string_view>
#include <vector>

#include "dermis/result.h"
#include "dermis/verify.h"
#include "verify/pose_probe.h"

namespace dermis::diagnosis {

/// The skeleton of a `PoseInput` in double precision.
struct PoseSkeleton {
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

/// The nodes, parents first. Roots have the parent `noJoint`. Empty if parents form a cycle.
std::vector<std::uint32_t> orderOf(const std::vector<std::uint32_t>& parents);

/// Fails as `diagnose` does.
Result<PoseSkeleton> skeletonOf(const PoseInput& input);

/// The global transforms of all nodes.
Pose globalsOf(const PoseSkeleton& skeleton, const Pose& locals);
/// The right pose: needs a skeleton that is complete.
Pose rebuild(const PoseSkeleton& skeleton, const Pose& globals);

}  // namespace dermis::diagnosis
