// Fox walks on the CPU, skinned seldom and drawn between two updates (smooth_walk.h).
#include <gtest/gtest.h>

#include "cpu_engine.h"
#include "smooth_walk.h"

namespace dermis::test {
namespace {

TEST(SmoothWalkOnCpu, SeldomUpdatesAreAsSmoothAsTheBarsSay) {
  const auto data = testDataFolder();
  if (!data) GTEST_SKIP() << noTestData;
  SmoothWalk(*data).check<CpuEngine>(
      [](std::optional<CpuEngine>& engine) { engine.emplace(SceneDescription()); },
      [](CpuEngine&, const InstanceDescription&) {});
}

}  // namespace
}  // namespace dermis::test
