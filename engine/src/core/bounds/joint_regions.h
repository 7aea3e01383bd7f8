// Joints of which only a region is known, as in all poses of a clip, and the box of their mesh.
#pragma once

#include <cstdint>
#include <vector>

#include "bounds/extent.h"
#include "dermis/mesh.h"
#include "linear_algebra.h"

namespace dermis::bounds {

/// The matrix C = R S of a joint is any that fits these numbers.
struct JointRegion {
  AffineMap map;   ///< the center: |C p − map p| ≤ shift + turn |bind p| + slack |p|
  AffineMap bind;  ///< from bind space to the frame of the joint
  double shift = 0, turn = 0, slack = 0;
  double spread = 0;           ///< ‖C − map‖ of the linear parts
  double least = 1, most = 1;  ///< of the singular values of C; `least` is 0 if C may mirror
  math::Vec4 rotation;         ///< of the center
  double angle = 0;            ///< of R against it; at least π if nothing is known
};

/// Where the points v and v' may be to which two joints move a point.
struct Chord {
  double length = 0;  ///< |v − v'|
  double error = 0;   ///< how far v − v' may be from that of the centers
};

class JointRegions {
 public:
  virtual ~JointRegions() = default;
  /// For all points of an extent. Indices of the pose.
  virtual Chord chord(std::uint32_t first, std::uint32_t second, const Extent& extent) const = 0;
  /// How far the rotation between two joints may be from that of the centers; radians, as `angle`.
  virtual double angle(std::uint32_t first, std::uint32_t second) const = 0;

  std::vector<JointRegion> joints;
};

/// As `skinnedBounds`, for all poses whose joints are in the regions.
Box skinnedBounds(const JointBounds& jointBounds, const JointRegions& regions, Method method,
                  JointPromise promise);

}  // namespace dermis::bounds
