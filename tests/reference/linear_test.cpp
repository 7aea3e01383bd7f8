// Linear blend skinning in the reference: v' = (Σ w_j C_j) v, and what it is known to do to a tube.

#include <algorithm>

#include "reference_rig.h"

namespace dermis::test {
namespace {

TEST(ReferenceLinear, PositionsAreTheBlendedMatrixTimesThePoint) {
  RigRandom random(1);
  std::vector<JointMatrix> pose;
  for (int joint = 0; joint < 7; ++joint) {  // any affine transform
    pose.push_back(jointOf(glm::dmat3(random.vector(2), random.vector(2), random.vector(2)),
                           random.vector(3)));
  }
  OwnedMesh mesh = scatteredMesh(random, 500, 7, 5);
  const reference::AnalyzedMesh result = skinned(mesh, pose, Method::linear);
  ASSERT_EQ(result.positions.size(), 500u);
  for (std::size_t vertex = 0; vertex < 500; ++vertex) {
    glm::dvec3 expected(0.0);
    double sum = 0;
    for (std::size_t slot = 0; slot < 5; ++slot) {
      const JointMatrix& joint = pose[mesh.joints[vertex * 5 + slot]];
      const double weight = static_cast<double>(mesh.weights[vertex * 5 + slot]);
      expected += weight * (linearOf(joint) * bindPosition(mesh, vertex) + offsetOf(joint));
      sum += weight;
    }
    expectNear(toVector(result.positions[vertex]), expected / sum, 1e-14 * 10);
  }
}

TEST(ReferenceLinear, OneInfluenceIsItsJoint) {
  const std::array pose{jointOf(diagonalMatrix(2, 3, 4), {10, 20, 30}), JointMatrix{}};
  OwnedMesh mesh;
  addVertex(mesh, {1, 1, 1}, {{0, 1.0f}});
  addVertex(mesh, {1, 2, 3}, {{1, 0.125f}});
  const reference::AnalyzedMesh result = skinned(mesh, pose, Method::linear);
  EXPECT_EQ(result.positions[0], (reference::Double3{12, 23, 34}));
  EXPECT_EQ(result.positions[1], (reference::Double3{1, 2, 3}));
}

/// The radius that a point at radius 1 keeps between two joints twisted by `angle` about its axis.
double radiusRatio(double angle, double weight, Method method) {
  OwnedMesh mesh;
  addVertex(mesh, {1, 0, 0.5},
            {{0, static_cast<float>(1 - weight)}, {1, static_cast<float>(weight)}});
  const std::array pose{JointMatrix{}, jointOf(rotationAbout({0, 0, 1}, angle))};
  const reference::Double3 p = skinned(mesh, pose, method).positions[0];
  EXPECT_NEAR(p[2], 0.5, 1e-7);
  return std::hypot(p[0], p[1]);
}

TEST(ReferenceLinear, Truth09_CandyWrapperRadius) {
  for (const double degrees : {10.0, 60.0, 90.0, 120.0, 150.0, 179.0, 180.0}) {
    const double angle = degrees * pi / 180;
    for (const double weight : {0.0, 0.125, 0.25, 0.5, 0.625, 1.0}) {
      const double sine = std::sin(angle / 2);
      EXPECT_NEAR(radiusRatio(angle, weight, Method::linear),
                  std::sqrt(std::max(0.0, 1 - 4 * weight * (1 - weight) * sine * sine)), 1.5e-7)
          << degrees << " degrees, weight " << weight;
    }
  }
  EXPECT_NEAR(radiusRatio(pi / 2, 0.5, Method::linear), 0.7071, 5e-5);
  EXPECT_NEAR(radiusRatio(pi * 2 / 3, 0.5, Method::linear), 0.5, 1e-7);
  EXPECT_NEAR(radiusRatio(pi, 0.5, Method::linear), 0, 1e-7);
}

/// The deviation of a tube's volume ratio from what it is for infinitely many rings and sides must
/// fall as 1/N².
void expectVolumeRatio(const JointMatrix& joint, Method method, double expected, double length) {
  double error[3];
  int index = 0;
  for (const std::uint32_t count : {16u, 32u, 64u}) {
    Tube tube = tubeOf(count, count, length, 0.5);
    error[index++] = volumeRatio(tube, joint, method) - expected;
  }
  EXPECT_NEAR(error[2], 0, 3e-3);
  if (std::abs(error[0]) < 1e-6) return;  // the ratio does not depend on the number of sides
  EXPECT_NEAR(error[0] / error[1], 4, 0.4);
  EXPECT_NEAR(error[1] / error[2], 4, 0.2);
}

TEST(ReferenceLinear, Truth10_TwistLosesTwoThirdsOfSquaredSine) {
  for (const double degrees : {45.0, 90.0, 120.0, 180.0}) {
    const double sine = std::sin(degrees * pi / 360);
    for (const double length : {0.5, 3.0}) {
      SCOPED_TRACE(testing::Message() << degrees << " degrees, length " << length);
      const JointMatrix joint = jointOf(rotationAbout({0, 0, 1}, degrees * pi / 180));
      expectVolumeRatio(joint, Method::linear, 1 - 2.0 / 3 * sine * sine, length);
    }
  }
}

TEST(ReferenceLinear, Truth11_BendLosesAThirdOfSquaredSine) {
  for (const double degrees : {45.0, 90.0, 120.0, 180.0}) {
    const double sine = std::sin(degrees * pi / 360);
    for (const double length : {0.5, 3.0}) {
      for (const double height : {0.0, 0.2 * length}) {  // of the line on the axis
        SCOPED_TRACE(testing::Message() << degrees << " degrees, length " << length);
        const glm::dmat3 bend = rotationAbout({1, 0, 0}, degrees * pi / 180);
        const glm::dvec3 pivot(0, 0, height);
        expectVolumeRatio(jointOf(bend, pivot - bend * pivot), Method::linear,
                          1 - 1.0 / 3 * sine * sine, length);
      }
    }
  }
}

}  // namespace
}  // namespace dermis::test
