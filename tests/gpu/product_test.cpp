// The product of methods, inputs and outputs, by pairs, over random meshes with awkward counts:
// what `dermis verify` runs, with the validation layer watching.

#include <gtest/gtest.h>

#include "intercepted_device.h"
#include "test_device.h"
#include "verification_product.h"

namespace dermis::test {
namespace {

class ProductTest : public DeviceTest {
 protected:
  /// One case in every `step`.
  void verify(vulkan::Context& context, std::size_t step) {
    const std::vector<samples::RandomCase> cases = samples::randomCases(context.limits());
    EXPECT_GE(cases.size(), 77u) << "every two formats of positions, normals and tangents meet";
    std::uint64_t compared = 0, exempt = 0, onlyUnit = 0;
    for (std::size_t index = 0; index < cases.size(); index += step) {
      const samples::RandomCase& random = cases[index];
      SCOPED_TRACE(random.inputName() + " -> " + random.output.name() + ", " +
                   std::string(methodName(random.method)));
      const Result<std::vector<samples::VerifiedInstance>> verified =
          samples::verifyRandomCase(device(), context, random);
      ASSERT_TRUE(verified.ok()) << verified.error().message;
      for (const samples::VerifiedInstance& instance : *verified) {
        EXPECT_EQ(instance.wrong, "");
        EXPECT_TRUE(instance.passed())
            << "the first is vertex " << instance.comparison.firstFailure;
        const Comparison& comparison = instance.comparison;
        EXPECT_EQ(comparison.compared + comparison.exempt.onlyFinite, random.vertices);
        compared += comparison.compared;
        exempt += comparison.exempt.onlyFinite;
        onlyUnit += comparison.onlyUnitNormals + comparison.onlyUnitTangents;
      }
    }
    // Hardly any may escape the comparison, whatever the reference says of itself.
    EXPECT_LE(exempt, compared / 1000);
    EXPECT_LE(onlyUnit, compared / 500);
    RecordProperty("compared", std::to_string(compared));
    RecordProperty("exempt", std::to_string(exempt));
    RecordProperty("onlyUnit", std::to_string(onlyUnit));
  }
};

TEST_F(ProductTest, EveryCombinationIsInsideItsBounds) {
  verify(context(), 1);
}

TEST_F(ProductTest, WithoutPushDescriptors) {
  useDevice(false);
  verify(context(), 4);
}

TEST_F(ProductTest, WithoutStoresOfLessThanAWord) {
  vulkan::DeviceDescription description = device().description();
  description.enabledFeatures = nullptr;
  Result<vulkan::Context> words = vulkan::Context::create(description);
  ASSERT_TRUE(words.ok()) << words.error().message;
  ASSERT_FALSE(words->limits().storage16Bit);
  verify(*words, 4);
}

TEST_F(ProductTest, WithTheFourStorageBuffersThatEveryDeviceHas) {
  InterceptedDevice few(device().description());
  few.changeLimits(
      [](VkPhysicalDeviceLimits& limits) { limits.maxPerStageDescriptorStorageBuffers = 4; });
  Result<vulkan::Context> four = vulkan::Context::create(few.description());
  ASSERT_TRUE(four.ok()) << four.error().message;
  ASSERT_EQ(four->limits().maxStorageBuffersPerStage, 4u);
  verify(*four, 4);
}

}  // namespace
}  // namespace dermis::test
