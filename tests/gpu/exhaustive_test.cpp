// Every format with every other, and every method with the formats of positions and normals: what
// ProductTest covers by pairs. Too long for every change; tests/run.sh nightly runs it, with the
// files that are built for it with DERMIS_EXHAUSTIVE.

#include <gtest/gtest.h>

#include <array>

#include "kit/verification_product.h"
#include "test_device.h"

namespace dermis::test {
namespace {

constexpr std::array rigidities{samples::Rigidity::rigid, samples::Rigidity::shear,
                                samples::Rigidity::mirrored};

/// Whether a vertex without gaps can be stored (`OutputAttribute`).
bool areWords(VertexFormat positions, VertexFormat normals, VertexFormat tangents) {
  return (formatSize(positions) + formatSize(normals) + formatSize(tangents)) % 4 == 0;
}

class ExhaustiveTest : public DeviceTest {
 protected:
  /// Counts cases, so that each has an input and a cut of its own.
  void verify(Method method, VertexFormat positions, VertexFormat normals, VertexFormat tangents) {
    const std::size_t number = cases_++;
    samples::RandomCase random;
    random.method = method;
    random.rigidity = rigidities[number % rigidities.size()];
    random.vertices = 65;
    random.joints = 40;
    random.influences = static_cast<std::uint32_t>(1 + number % 5);
    random.output.layout.positions = positions;
    random.output.layout.normals = normals;
    random.output.layout.tangents = tangents;
    random.output.layout.gap = static_cast<std::uint32_t>(number % 2) * 4;
    random.output.layout.bounds = number % 2 == 0;
    samples::VulkanTarget target(device(), context());
    const Result<std::vector<samples::VerifiedInstance>> verified =
        samples::verifyRandomCase(target, random);
    ASSERT_TRUE(verified.ok()) << verified.error().message;
    ASSERT_EQ(verified->size(), 3u);
    for (const samples::VerifiedInstance& instance : *verified) {
      EXPECT_TRUE(instance.passed())
          << random.output.name() << ", " << methodName(method) << ": " << instance.wrong << ", "
          << instance.comparison.failures << " vertices outside their bounds, the first is "
          << instance.comparison.firstFailure;
      const Comparison& comparison = instance.comparison;
      EXPECT_EQ(comparison.compared + comparison.exempt.onlyFinite, random.vertices);
      compared_ += comparison.compared;
      exempt_ += comparison.exempt.onlyFinite;
    }
  }
  /// Hardly any vertex may escape the comparison, whatever the reference says of itself.
  void TearDown() override {
    EXPECT_LE(exempt_, compared_ / 1000);
    DeviceTest::TearDown();
  }

  std::size_t cases_ = 0;
  std::uint64_t compared_ = 0, exempt_ = 0;
};

TEST_F(ExhaustiveTest, EveryFormatWithEveryOther) {
  for (const VertexFormat positions : samples::verifiedPositionFormats) {
    for (const VertexFormat normals : samples::verifiedNormalFormats) {
      for (const VertexFormat tangents : samples::verifiedTangentFormats) {
        if (areWords(positions, normals, tangents))
          verify(Method::dualQuaternion, positions, normals, tangents);
      }
    }
  }
  EXPECT_EQ(cases_, 230u);
}

TEST_F(ExhaustiveTest, EveryMethodWithEveryFormat) {
  for (const Method method : allMethods) {
    for (const VertexFormat positions : samples::verifiedPositionFormats) {
      for (const VertexFormat normals : samples::verifiedNormalFormats) {
        std::size_t tangents = cases_;
        const auto format = [&] {
          return samples::verifiedTangentFormats[tangents % samples::verifiedTangentFormats.size()];
        };
        while (!areWords(positions, normals, format())) ++tangents;
        verify(method, positions, normals, format());
      }
    }
  }
  EXPECT_EQ(cases_, 540u);
}

}  // namespace
}  // namespace dermis::test
