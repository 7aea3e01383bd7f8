// A solid through cross-sections: how limbs and the trunk are modelled.
#pragma once

#include <vector>

#include "sdf.h"

namespace dermis::models {

// A cross-section at a place along the axis: two half ellipses that meet at the sides.
struct Section {
  double along;
  double centreSide;
  double centreFront;
  double halfWidth;
  double front;
  double back;
};

// Where a loft lies: three unit vectors at right angles to one another. They may be left-handed.
struct Frame {
  Vec3 origin;
  Vec3 side;
  Vec3 along;
  Vec3 front;

  Vec3 toLocal(const Vec3& point) const;
  Vec3 toModel(const Vec3& local) const;
};

// The section at a place along the axis, between the two nearest ones by cubic Hermite curves.
Section sectionAt(const std::vector<Section>& sections, double along);

// The loft through `sections`, in ascending order along the axis; its flat ends are rounded over
// `endBlend` metres.
Solid loft(const Frame& frame, std::vector<Section> sections, double endBlend);

}  // namespace dermis::models
