// A solid through cross-sections, for limbs and the trunk.
#pragma once

#include <vector>

#include "sdf.h"

namespace dermis::models {

// A cross-section at a position along the axis: two half ellipses that meet at the sides.
struct Section {
  double along;
  double centerSide;
  double centerFront;
  double halfWidth;
  double front;
  double back;
};

// The coordinate system of a loft: an origin and three orthogonal unit vectors. They may be
// left-handed.
struct Frame {
  Vec3 origin;
  Vec3 side;
  Vec3 along;
  Vec3 front;

  Vec3 toLocal(const Vec3& point) const;
  Vec3 toModel(const Vec3& local) const;
};

// The section at a position along the axis, interpolated between the two nearest sections by cubic
// Hermite curves.
Section sectionAt(const std::vector<Section>& sections, double along);

// The loft through `sections`, which must ascend along the axis. Its flat ends are rounded over
// `endBlend` meters.
Solid loft(const Frame& frame, std::vector<Section> sections, double endBlend);

}  // namespace dermis::models
