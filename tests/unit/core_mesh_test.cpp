// Views, plain data and names: what crosses the interface.

#include <gtest/gtest.h>

#include <span>
#include <string>
#include <type_traits>
#include <vector>

#include <glm/mat4x3.hpp>
#include <glm/mat4x4.hpp>

#include "abi.h"
#include "dermis/layout.h"
#include "dermis/mesh.h"
#include "dermis/plan.h"
#include "dermis/result.h"
#include "dermis/scene.h"

namespace dermis::test {
namespace {

TEST(Mesh, ComponentsHaveTheSizeOfTheirType) {
  EXPECT_EQ(componentSize(ComponentType::float32), 4u);
  EXPECT_EQ(componentSize(ComponentType::float16), 2u);
  EXPECT_EQ(componentSize(ComponentType::snorm8), 1u);
  EXPECT_EQ(componentSize(ComponentType::snorm16), 2u);
  EXPECT_EQ(componentSize(ComponentType::unorm8), 1u);
  EXPECT_EQ(componentSize(ComponentType::unorm16), 2u);
  EXPECT_EQ(componentSize(ComponentType::uint8), 1u);
  EXPECT_EQ(componentSize(ComponentType::uint16), 2u);
  EXPECT_EQ(componentSize(ComponentType::uint32), 4u);
}

TEST(Mesh, FloatAttributesAreTightlyPacked) {
  const float data[8] = {};
  const AttributeView view = attributeView(data, 2, 4);
  EXPECT_EQ(view.data, data);
  EXPECT_EQ(view.count, 2u);
  EXPECT_EQ(view.stride, 16u);
  EXPECT_EQ(view.type, ComponentType::float32);
  EXPECT_EQ(view.components, 4u);
  EXPECT_TRUE(view);
  EXPECT_FALSE(AttributeView{});
}

// 12 floats a joint for linear blending (48 bytes); a dual quaternion has 8 (32 bytes).
TEST(Mesh, Truth15_JointMatricesAre48BytesDualQuaternions32) {
  EXPECT_EQ(sizeof(JointMatrix), 48u);
  EXPECT_EQ(abi::UNITS_OF_DUAL_QUATERNION * 16, 32u);
  EXPECT_TRUE(std::is_standard_layout_v<JointMatrix>);
  EXPECT_TRUE(std::is_trivially_copyable_v<JointMatrix>);
  const JointMatrix identity;
  for (int row = 0; row < 3; ++row) {
    for (int column = 0; column < 4; ++column)
      EXPECT_EQ(identity.m[row][column], row == column ? 1.0f : 0.0f);
  }
}

TEST(Mesh, GlmMatricesAreTransposedOnTheWay) {
  glm::mat4 matrix(1.0f);
  for (int column = 0; column < 4; ++column) {
    for (int row = 0; row < 3; ++row) matrix[column][row] = static_cast<float>(10 * row + column);
  }
  const JointMatrix joint = toJointMatrix(matrix);
  const glm::mat4x3 back = toColumns<glm::mat4x3>(joint);
  for (int column = 0; column < 4; ++column) {
    for (int row = 0; row < 3; ++row) {
      EXPECT_EQ(joint.m[row][column], static_cast<float>(10 * row + column));
      EXPECT_EQ(back[column][row], static_cast<float>(10 * row + column));
    }
  }
}

TEST(Mesh, ArraysOfColumnMajorMatricesAreTransposedOnTheWay) {
  std::vector<float> floats(3 * 16);
  for (std::size_t i = 0; i < floats.size(); ++i) floats[i] = static_cast<float>(i);
  std::vector<JointMatrix> joints(3);
  ASSERT_TRUE(toJointMatrices(floats, joints).ok());
  for (std::size_t joint = 0; joint < 3; ++joint) {
    for (std::size_t row = 0; row < 3; ++row) {
      for (std::size_t column = 0; column < 4; ++column)
        EXPECT_EQ(joints[joint].m[row][column], static_cast<float>(joint * 16 + column * 4 + row));
    }
  }
  EXPECT_TRUE(toJointMatrices({}, {}).ok());
  for (const std::size_t wrong : {47u, 32u, 0u}) {
    const Result<void> refused = toJointMatrices(std::span(floats).first(wrong), joints);
    ASSERT_FALSE(refused.ok()) << wrong;
    EXPECT_EQ(refused.error().code, ErrorCode::invalidArgument);
    EXPECT_EQ(refused.error().message,
              std::to_string(wrong) + " floats are not 4x4 matrices for 3 joints");
  }
}

TEST(Method, NamesGoBothWays) {
  EXPECT_EQ(methodName(Method::linear), "linear");
  EXPECT_EQ(methodName(Method::dualQuaternion), "dual_quaternion");
  EXPECT_EQ(methodName(Method::dualQuaternionIterative), "dual_quaternion_iterative");
  EXPECT_EQ(methodName(Method::logMatrix), "log_matrix");
  EXPECT_EQ(methodName(Method::sphericalBlend), "spherical_blend");
  EXPECT_EQ(methodName(Method::quaternionTranslation), "quaternion_translation");
  EXPECT_EQ(methodName(Method::blended), "blended");
  EXPECT_EQ(methodName(Method::centerOfRotation), "center_of_rotation");
  EXPECT_EQ(methodName(Method::bulgeControlled), "bulge_controlled");
  for (const Method method : allMethods) EXPECT_EQ(methodFromName(methodName(method)), method);
  for (const char* name : {"", "Linear", "dualQuaternion", "unknown", "linear "}) {
    EXPECT_EQ(methodFromName(name), std::nullopt) << name;
  }
  EXPECT_EQ(methodName(static_cast<Method>(200)), "unknown");
}

}  // namespace
}  // namespace dermis::test
