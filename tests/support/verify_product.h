// The product of methods, inputs and outputs, on one target.
#pragma once

#include <gtest/gtest.h>

#include <string>
#include <vector>

#include "kit/verification_product.h"

namespace dermis::test {

/// One case in every `step`.
inline void verifyProduct(samples::BatchTarget& target, std::size_t step,
                          samples::Coverage coverage = samples::Coverage::full) {
  const std::vector<samples::RandomCase> cases = samples::randomCases(target, coverage);
  if (coverage == samples::Coverage::full) {
    EXPECT_GE(cases.size(), 70u) << "every two formats of positions, normals and tangents meet";
  }
  std::uint64_t compared = 0, exempt = 0, onlyUnit = 0;
  for (std::size_t index = 0; index < cases.size(); index += step) {
    const samples::RandomCase& random = cases[index];
    SCOPED_TRACE(random.inputName() + " -> " + random.output.name() + ", " +
                 std::string(methodName(random.method)));
    const Result<std::vector<samples::VerifiedInstance>> verified =
        samples::verifyRandomCase(target, random);
    ASSERT_TRUE(verified.ok()) << verified.error().message;
    for (const samples::VerifiedInstance& instance : *verified) {
      EXPECT_EQ(instance.wrong, "");
      EXPECT_TRUE(instance.passed()) << "the first is vertex " << instance.comparison.firstFailure;
      const Comparison& comparison = instance.comparison;
      EXPECT_EQ(comparison.compared + comparison.exempt.onlyFinite, random.vertices);
      compared += comparison.compared;
      exempt += comparison.exempt.onlyFinite;
      onlyUnit += comparison.onlyUnitNormals + comparison.onlyUnitTangents;
    }
  }
  EXPECT_GT(compared, 1000u) << "else nothing was tested";
  // Hardly any may escape the comparison, whatever the reference says of itself.
  EXPECT_LE(exempt, compared / 1000);
  EXPECT_LE(onlyUnit, compared / 500);
  ::testing::Test::RecordProperty("compared", std::to_string(compared));
  ::testing::Test::RecordProperty("exempt", std::to_string(exempt));
  ::testing::Test::RecordProperty("onlyUnit", std::to_string(onlyUnit));
}

}  // namespace dermis::test
