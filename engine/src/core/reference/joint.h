// A joint matrix taken apart, in double precision.
#pragma once

#include <glm/mat3x3.hpp>
#include <glm/vec3.hpp>

#include "dermis/types.h"
#include "rigid.h"

namespace dermis::reference {

struct Joint {
  glm::dmat3 linear;
  glm::dvec3 translation;
  Rigid rigid;  ///< the rotation of the polar decomposition, and the translation
  glm::dmat3 scaleShear;
  double largest = 1;  ///< singular value
  bool finite = true;
  bool degenerate = false;
  bool rigidForKernels = false;
  double distanceFromRotation = 0;
};

/// A matrix that is not finite gives NaNs.
Joint takeApart(const JointMatrix& matrix);

}  // namespace dermis::reference
