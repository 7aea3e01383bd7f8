// The product of methods, inputs and outputs, by pairs, over random meshes with awkward counts:
// what `dermis verify` runs, with the validation layer watching.

#include <gtest/gtest.h>

#include "test_device.h"
#include "verification_product.h"

namespace dermis::test {
namespace {

class ProductTest : public DeviceTest {
 protected:
  void verifyAll(vulkan::Context& context) {
    const std::vector<samples::RandomCase> cases = samples::randomCases(context.limits());
    EXPECT_GE(cases.size(), 77u) << "every two formats of positions, normals and tangents meet";
    for (const samples::RandomCase& random : cases) {
      SCOPED_TRACE(random.inputName() + " -> " + random.output.name() + ", " +
                   std::string(methodName(random.method)));
      const Result<std::vector<samples::VerifiedInstance>> verified =
          samples::verifyRandomCase(device(), context, random);
      ASSERT_TRUE(verified.ok()) << verified.error().message;
      for (const samples::VerifiedInstance& instance : *verified) {
        EXPECT_EQ(instance.wrong, "");
        EXPECT_EQ(instance.comparison.failures, 0u)
            << "the first is vertex " << instance.comparison.firstFailure;
      }
    }
  }
};

TEST_F(ProductTest, EveryCombinationIsInsideItsBounds) {
  verifyAll(context());
}

}  // namespace
}  // namespace dermis::test
