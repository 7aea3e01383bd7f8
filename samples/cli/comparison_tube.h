// Measures what a method does to a straight tube of two joints that is twisted or bent. The numbers
// can be checked against theory.
#pragma once

#include <cstdint>

#include "dermis/layout.h"
#include "dermis/mesh.h"
#include "dermis/result.h"
#include "dermis/rig.h"
#include "method_options.h"

namespace dermis::cli {

inline constexpr double tubeTwistDegrees = 120;
inline constexpr double tubeBendDegrees = 90;

/// The skinned tube relative to the same tube in bind pose.
struct TubeShape {
  /// The smallest distance of a vertex from the axis of the tube in bind pose, in radii. Meaningful
  /// only for a twist.
  double leastRadius = 1;
  /// The smallest area of a ring of vertices across the tube.
  double leastSection = 1;
  /// The signed volume of the blend zone only, closed at its end rings.
  double volume = 1;
  /// The largest distance of a vertex from the bones, in radii: 1 if nothing bulges.
  double reach = 1;
};

struct TubeComparison {
  TubeShape twisted;  ///< by `tubeTwistDegrees` about its axis
  TubeShape bent;     ///< by `tubeBendDegrees` about a line perpendicular to its axis
};

/// Skins the tube with the reference, twisted, bent and in bind pose. The tube is that of the
/// sample bar, with finer subdivision: length 1, radius 0.1. Weights change linearly over the blend
/// zone of length 0.4 about its middle, where the second joint is. The origin of bind space is at
/// one end of the tube. Centers of rotation are the centers of the rings.
Result<TubeComparison> compareTube(Method method, const MethodShares& shares);

inline constexpr std::uint32_t tubeSegments = 16;

/// The tube bound to a chain through its joints and its end.
struct CurvedTube {
  PackedRig rig;              ///< three written joints
  PackedMesh mesh, straight;  ///< bound to the chain, and to the two joints
  TubeComparison shape;       ///< with `dualQuaternion`
};

Result<CurvedTube> makeCurvedTube();

}  // namespace dermis::cli
