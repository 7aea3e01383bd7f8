// The product of methods, inputs and outputs, by each instruction set.

#include "verify_product.h"

#include "dermis/cpu.h"
#include "dermis/mesh.h"

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

// In float32, a mesh that is bound a million units from the origin has positions that are off by a
// tenth of a unit. How many of them are outside a box, and how large their own box is, is as
// uncertain.
TEST(VerifyBatchTest, AMeshBoundFarFromTheOriginPasses) {
  constexpr std::uint32_t joints = 6;
  constexpr float far = 1e6f;
  samples::CpuTarget target;
  samples::OwnedMesh mesh = samples::randomMesh(1, 2000, joints, 4);
  for (std::size_t i = 0; i < mesh.positions.size(); i += 3) {
    mesh.positions[i] += far;
    mesh.weights[i / 3 * 4] += 0.01f;  // a vertex without weight would stay there
  }
  const PackedMesh packed = pack(mesh.view(), joints).value();
  std::vector<JointMatrix> pose = samples::randomPose(2, joints, samples::Rigidity::rigid);
  for (JointMatrix& joint : pose) {
    for (auto& row : joint.m) row[3] -= row[0] * far;
  }
  for (const Method method : {Method::linear, Method::dualQuaternion}) {
    const reference::SkinnedMesh expected = reference::skin(mesh.view(), pose, method).value();
    samples::InstanceToVerify instance{&packed, pose, pose, {}, {}, method, &expected, &expected};
    instance.exemptions = instance.exemptionsBefore = exemptionsOf(expected);
    const std::vector<samples::InstanceToVerify> instances(2, instance);  // the second is clamped
    for (const VertexFormat format : {VertexFormat::snorm16x4, VertexFormat::float16x4}) {
      samples::OutputCase output;
      output.layout.positions = format;
      output.layout.bounds = true;
      for (const samples::VerifiedInstance& verified :
           samples::verifyBatch(target, instances, output).value())
        EXPECT_TRUE(verified.passed()) << methodName(method) << ": " << verified.wrong;
    }
  }
}

INSTANTIATE_TEST_SUITE_P(Instructions, CpuProductTest, ::testing::ValuesIn(cpu::targetNames()),
                         [](const auto& instructions) { return std::string(instructions.param); });

}  // namespace
}  // namespace dermis::test
