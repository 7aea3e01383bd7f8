// MeshFinding centres of rotation, at import.

#include <benchmark/benchmark.h>

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <vector>

#include "models.h"
#include "random_rig.h"
#include "solve_centers.h"

namespace dermis::bench {
namespace {

/// A mesh to find centres of; triangles of three indices each.
struct Surface {
  samples::OwnedMesh mesh;
  std::uint32_t jointCount = 0;
  std::vector<std::uint32_t> triangles;
};

Surface figure() {
  const models::Model model = models::figureModel();
  Surface surface;
  surface.triangles = model.mesh.indices;
  for (const models::Vec3& position : model.mesh.positions) {
    for (int axis = 0; axis < 3; ++axis)
      surface.mesh.positions.push_back(static_cast<float>(position[axis]));
  }
  for (const models::Influences& influences : model.mesh.influences) {
    for (std::size_t slot = 0; slot < 4; ++slot) {
      surface.mesh.joints.push_back(influences.joints[slot]);
      surface.mesh.weights.push_back(influences.weights[slot]);
      surface.jointCount = std::max(surface.jointCount, influences.joints[slot] + 1u);
    }
  }
  return surface;
}

/// 10,000 vertices and 20,000 triangles, all of the same four joints, no two of the same weights.
Surface worst() {
  constexpr std::uint32_t count = 10'000;
  Surface surface;
  surface.jointCount = 4;
  surface.mesh = samples::randomMesh(1, count, 4, 4);
  for (std::uint32_t vertex = 0; vertex < count; ++vertex) {
    for (std::uint32_t slot = 0; slot < 4; ++slot) {
      surface.mesh.joints[4 * std::size_t{vertex} + slot] = slot;
      surface.mesh.weights[4 * std::size_t{vertex} + slot] =
          1.1f + std::sin(static_cast<float>(vertex * (slot + 1)));
    }
    for (const std::uint32_t step : {7u, 31u}) {
      for (const std::uint32_t corner : {vertex, vertex + step, vertex + 2 * step})
        surface.triangles.push_back(corner % count);
    }
  }
  return surface;
}

void measure(benchmark::State& state, Surface (*make)()) {
  Surface surface = make();
  const MeshView mesh = surface.mesh.view();
  for ([[maybe_unused]] auto iteration : state) {
    const Result<CenterOfRotationSolver> solver =
        CenterOfRotationSolver::make(mesh, surface.jointCount, surface.triangles);
    if (!solver) return state.SkipWithError(solver.error().message.c_str());
    samples::solveCenters(*solver, static_cast<std::uint32_t>(state.range(0)));
  }
}

BENCHMARK_CAPTURE(measure, figure, figure)
    ->Name("centers/figure")
    ->ArgName("threads")
    ->Arg(1)
    ->Arg(2)
    ->UseRealTime()
    ->Unit(benchmark::kMillisecond);
BENCHMARK_CAPTURE(measure, worst, worst)
    ->Name("centers/worst")
    ->ArgName("threads")
    ->Arg(1)
    ->Arg(2)
    ->UseRealTime()
    ->Iterations(1)
    ->Unit(benchmark::kMillisecond);

}  // namespace
}  // namespace dermis::bench
