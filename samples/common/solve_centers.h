// All centres of rotation of a mesh, found by several threads: how a tool drives a solver.
#pragma once

#include <cstdint>
#include <functional>
#include <vector>

#include "dermis/centers_of_rotation.h"

namespace dermis::samples {

/// 3 floats a vertex. `threadCount`: threads at work, the calling thread among them; 0 means as
/// many as the machine runs at once. The result is the same to the bit. `progress` is called on the
/// calling thread with the part that is done: rising, and 1 at last.
std::vector<float> solveCenters(const CenterOfRotationSolver& solver, std::uint32_t threadCount,
                                const std::function<void(float)>& progress = {});

}  // namespace dermis::samples
