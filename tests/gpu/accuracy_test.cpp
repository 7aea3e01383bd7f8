// The GPU against the reference: every vertex of random rigs inside the bounds of the accuracy
// contract.

#include <gtest/gtest.h>

#include <tuple>

#include "batch_runner.h"
#include "dermis/accuracy.h"
#include "dermis/pack.h"
#include "random_rig.h"
#include "test_device.h"

namespace dermis::test {
namespace {

struct Case {
  std::uint32_t vertices;
  std::uint32_t joints;
  std::uint32_t influences;
};

class AccuracyTest : public DeviceTest,
                     public ::testing::WithParamInterface<std::tuple<Method, Rigidity, Case>> {};

Comparison skinAndCompare(samples::Device& device, vulkan::Context& context, OwnedMesh& mesh,
                          std::span<const JointMatrix> pose, Method method) {
  Result<PackedMesh> packed = pack(mesh.view(), static_cast<std::uint32_t>(pose.size()));
  EXPECT_TRUE(packed.ok()) << (packed ? "" : packed.error().message);
  const samples::SkinRequest request{&*packed, pose, true, method};
  samples::RunOptions options;
  options.output.gap = 8;
  Result<samples::BatchResult> result = samples::runBatch(device, context, {&request, 1}, options);
  EXPECT_TRUE(result.ok()) << (result ? "" : result.error().message);
  if (!result) return {};
  EXPECT_EQ(result->untouchedBytesChanged, 0u);
  const samples::SkinnedVertices& skinned = result->instances[0];
  Result<reference::SkinnedMesh> expected = reference::skin(mesh.view(), pose, method);
  EXPECT_TRUE(expected.ok());
  // All joints are finite: no vertex is without an answer.
  const Exemptions exemptions{exemptionsOf(*expected, method).onlyFinite, 0};
  Result<Comparison> comparison = compare(*expected, skinned.view(), method, exemptions);
  EXPECT_TRUE(comparison.ok());
  return *comparison;
}

TEST_P(AccuracyTest, EveryVertexIsInsideItsBound) {
  const auto [method, rigidity, counts] = GetParam();
  OwnedMesh mesh = randomMesh(1, counts.vertices, counts.joints, counts.influences);
  const std::vector<JointMatrix> pose = randomPose(2, counts.joints, rigidity);
  const Comparison comparison = skinAndCompare(device(), context(), mesh, pose, method);
  RecordProperty("worstPosition", std::to_string(comparison.worstPosition));
  RecordProperty("worstNormal", std::to_string(comparison.worstNormal));
  EXPECT_TRUE(comparison.passed())
      << "positions up to " << comparison.worstPosition << " of the bound, vertex "
      << comparison.worstPositionVertex << "; normals up to " << comparison.worstNormal
      << ", vertex " << comparison.worstNormalVertex << "; " << comparison.failures
      << " failures, the first at " << comparison.firstFailure;
  EXPECT_EQ(comparison.compared + comparison.exempt.onlyFinite, mesh.vertexCount());
  // Hardly any may escape the comparison, whatever the reference says of itself.
  EXPECT_LE(comparison.exempt.onlyFinite, mesh.vertexCount() / 1000);
  EXPECT_LE(comparison.onlyUnitNormals, mesh.vertexCount() / 1000);
}

std::string caseName(const ::testing::TestParamInfo<AccuracyTest::ParamType>& info) {
  const auto [method, rigidity, counts] = info.param;
  const char* rigidities[] = {"rigid", "scale", "shear", "mirrored", "oneAxisMirrored"};
  return std::string(methodName(method)) + "_" + rigidities[static_cast<int>(rigidity)] + "_" +
         std::to_string(counts.vertices) + "v_" + std::to_string(counts.joints) + "j_" +
         std::to_string(counts.influences) + "i";
}

INSTANTIATE_TEST_SUITE_P(
    RandomRigs, AccuracyTest,
    ::testing::Combine(::testing::ValuesIn(allMethods),
                       ::testing::Values(Rigidity::rigid, Rigidity::uniformScale, Rigidity::shear,
                                         Rigidity::mirrored, Rigidity::mirroredAlongOneAxis),
                       ::testing::Values(Case{1, 1, 1}, Case{63, 2, 2}, Case{64, 3, 4},
                                         Case{65, 300, 4}, Case{1234, 50, 8}, Case{70001, 300, 4},
                                         Case{5000, 300, 17})),
    caseName);

}  // namespace
}  // namespace dermis::test
