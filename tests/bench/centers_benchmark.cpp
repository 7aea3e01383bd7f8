// Finding centers of rotation, at import.

#include <benchmark/benchmark.h>

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <stdexcept>
#include <string>
#include <vector>

#include "dermis/gltf.h"
#include "kit/random_rig.h"
#include "kit/solve_centers.h"
#include "test_paths.h"

namespace dermis::bench {
namespace {

/// A mesh to find centers of; triangles of three indices each.
struct Surface {
  samples::OwnedMesh mesh;
  std::uint32_t jointCount = 0;
  std::vector<std::uint32_t> triangles;
};

/// All primitives of the sample figure as one mesh.
Surface figure() {
  const Result<gltf::Model> model = gltf::load(std::string(test::sampleModels) + "/figure.glb");
  if (!model) throw std::runtime_error(model.error().message);
  Surface surface;
  for (const gltf::SkinnedPrimitive& skinned : model->skinnedPrimitives) {
    const gltf::Primitive& part = model->meshes[skinned.mesh].primitives[skinned.primitive];
    const auto first = static_cast<std::uint32_t>(surface.mesh.positions.size() / 3);
    for (const std::uint32_t index : part.triangles) surface.triangles.push_back(first + index);
    surface.mesh.positions.insert(surface.mesh.positions.end(), part.positions.begin(),
                                  part.positions.end());
    const gltf::Influences& influences = part.influences.at(0);  // uint8, float32
    for (const std::byte joint : influences.joints) {
      surface.mesh.joints.push_back(std::to_integer<std::uint32_t>(joint));
      surface.jointCount = std::max(surface.jointCount, surface.mesh.joints.back() + 1);
    }
    const auto* weights = reinterpret_cast<const float*>(influences.weights.data());
    surface.mesh.weights.insert(surface.mesh.weights.end(), weights,
                                weights + influences.joints.size());
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
