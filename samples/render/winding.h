// Which way round triangles are when they are skinned.
#pragma once

#include <span>

#include "dermis/types.h"

namespace dermis::samples {

/// Whether most joints of a pose mirror: then triangles are wound the other way.
bool isMirrored(std::span<const JointMatrix> pose);

}  // namespace dermis::samples
