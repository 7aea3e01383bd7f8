// All centres of rotation of a mesh, on one thread.
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "dermis/centers_of_rotation.h"

namespace dermis::test {

inline Result<std::vector<float>> centersOf(const MeshView& mesh, std::uint32_t jointCount,
                                            std::span<const std::uint32_t> triangles) {
  const Result<CenterOfRotationSolver> solver =
      CenterOfRotationSolver::make(mesh, jointCount, triangles);
  if (!solver) return solver.error();
  std::vector<float> centers(std::size_t{3} * solver->vertexCount());
  if (Result<void> solved = solver->solve(0, centers); !solved) return solved.error();
  return centers;
}

}  // namespace dermis::test
