// The winding order of triangles after skinning.
#pragma once

#include <span>

#include "dermis/types.h"

namespace dermis::samples {

/// Whether most joints of a pose mirror. Then skinning reverses the winding order.
bool isMirrored(std::span<const JointMatrix> pose);

}  // namespace dermis::samples
