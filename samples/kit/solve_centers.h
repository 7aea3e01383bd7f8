// Computes all centers of rotation of a mesh with several threads: an example of how a tool uses
// the solver.
#pragma once

#include <cstdint>
#include <functional>
#include <vector>

#include "dermis/mesh.h"

namespace dermis::samples {

/// Returns 3 floats per vertex. `threadCount` includes the calling thread; 0 means one for each
/// core. The result has the same bits for any number of threads. `progress` is called on the
/// calling thread with the completed fraction, which ascends to 1.
std::vector<float> solveCenters(const CenterOfRotationSolver& solver, std::uint32_t threadCount,
                                const std::function<void(float)>& progress = {});

}  // namespace dermis::samples
