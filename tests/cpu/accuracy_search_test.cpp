// How near to their bounds the worst vertices come that a search finds, on the CPU.
// DERMIS_SEARCH_GENERATIONS searches for longer and prints a line for each case, as for the kernels
// of GPUs (tests/gpu/accuracy_search_test.cpp).

#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <string>
#include <vector>

#include "dermis/cpu.h"
#include "dermis/mesh.h"
#include "dermis/verify.h"
#include "worst_rig.h"

namespace dermis::test {
namespace {

/// Error ÷ bound: every third vertex is judged by its position, its normal, its tangent.
std::vector<double> shares(Method method, WorstRig& rig) {
  OwnedMesh& source = rig.mesh();
  const auto vertexCount = static_cast<std::uint32_t>(rig.vertexCount());
  const cpu::Mesh mesh =
      cpu::Mesh::create(pack(source.view(), static_cast<std::uint32_t>(rig.pose().size())).value())
          .value();
  cpu::Job job;
  job.mesh = &mesh;
  job.method = method;
  job.places =
      placeVertices({.normals = VertexFormat::float32x3, .tangents = VertexFormat::float32x4},
                    vertexCount)
          .value();
  std::vector<float> output(job.places.size / sizeof(float));
  cpu::Instance instance;
  instance.pose = rig.pose();
  instance.output.fill(output.data());
  job.instances = {&instance, 1};
  EXPECT_TRUE(cpu::skin(job).ok());
  const reference::SkinnedMesh expected =
      reference::skin(source.view(), rig.pose(), method).value();
  std::vector<double> found;
  for (std::size_t i = 0; i < vertexCount; ++i) {
    const reference::VertexBounds& bounds = expected.bounds[i];
    const float* const actual = output.data() + i * 10 + i % 3 * 3;
    const double* const wanted = i % 3 == 0   ? expected.positions[i].data()
                                 : i % 3 == 1 ? expected.normals[i].data()
                                              : expected.tangents[i].data();
    const double bound = std::array{bounds.position, bounds.normal, bounds.tangent}[i % 3];
    double square = 0;
    for (std::size_t axis = 0; axis < 3; ++axis) {
      const double off = static_cast<double>(actual[axis]) - wanted[axis];
      square += off * off;
    }
    found.push_back(bounds.onlyFinite || bound < 0 ? 0 : std::sqrt(square) / bound);
  }
  return found;
}

TEST(CpuAccuracySearchTest, TheWorstVerticesAreInsideTheirBounds) {
  struct Search {
    const char* name;
    JointRange range;
    std::uint32_t influences = 4;
  };
  const char* const text = std::getenv("DERMIS_SEARCH_GENERATIONS");
  const int generations = text == nullptr ? 6 : std::atoi(text);
  for (const Method method : allMethods) {
    if (isForComparison(method)) continue;
    for (const Search& search :
         {Search{"rigid", {}}, Search{"nearly_rigid", {.translation = 0.01, .deviation = 3.5e-6}},
          Search{"scaled", {.scale = 100}}, Search{"stretched", {.stretch = 31.6}},
          Search{"far_and_tiny", {.scale = 1e20, .translation = 1e-10}},
          Search{"two_influences", {}, 2}, Search{"opposed", {}, 64}}) {
      WorstRig rig(1, search.influences > 8 ? 150 : 450, search.influences, search.range);
      for (int generation = 0; generation < generations; ++generation) {
        rig.propose();
        rig.judge(shares(method, rig));
      }
      std::array<double, 3> worst{};
      for (std::size_t i = 0; i < rig.worst().size(); ++i)
        worst[i % 3] = std::max(worst[i % 3], rig.worst()[i]);
      if (text != nullptr) {
        std::printf("cpu   %-25s %-14s: position %.2f normal %.2f tangent %.2f\n",
                    std::string(methodName(method)).c_str(), search.name, worst[0], worst[1],
                    worst[2]);
      }
      const double largest = *std::ranges::max_element(worst);
      EXPECT_LE(largest, 1) << methodName(method) << ", " << search.name;
      // A bound that nothing comes near to would prove nothing.
      if (search.influences <= 4) {
        EXPECT_GE(largest, 0.08) << methodName(method) << ", " << search.name;
      }
    }
  }
}

}  // namespace
}  // namespace dermis::test
