// The product of methods, inputs and outputs, by each instruction set.

#include "verify_product.h"

#include "dermis/cpu/skin.h"

namespace dermis::test {
namespace {

class CpuProductTest : public ::testing::TestWithParam<std::string_view> {
 protected:
  ~CpuProductTest() override { EXPECT_TRUE(cpu::setTarget({}).ok()); }
};

TEST_P(CpuProductTest, EveryCombinationIsInsideItsBounds) {
  samples::CpuTarget target{std::string(GetParam())};
  verifyProduct(target, 1);
}

INSTANTIATE_TEST_SUITE_P(Instructions, CpuProductTest, ::testing::ValuesIn(cpu::targetNames()),
                         [](const auto& instructions) { return std::string(instructions.param); });

}  // namespace
}  // namespace dermis::test
