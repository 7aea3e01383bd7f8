// Dual-quaternion blending of rigid joints in the reference: what it keeps, and which influence
// decides the signs.

#include <algorithm>

#include "dermis/verify.h"
#include "reference_rig.h"

namespace dermis::test {
namespace {

/// The angle, in degrees from 0 to 360, by which (1, 0, 0) is turned about z.
double angleOf(const reference::Double3& p) {
  const double angle = std::atan2(p[1], p[0]) * 180 / pi;
  return angle < -1e-5 ? angle + 360 : angle;
}

double blendedAngle(std::span<const JointMatrix> pose, std::initializer_list<RigInfluence> slots) {
  OwnedMesh mesh;
  mesh.influencesPerVertex = static_cast<std::uint32_t>(slots.size());
  addVertex(mesh, {1, 0, 0}, slots);
  return angleOf(skinned(mesh, pose, Method::dualQuaternion).positions[0]);
}

TEST(ReferenceDualQuaternion, HalfTurnsAboutEveryAxis) {
  RigRandom random(2);
  std::vector<glm::dvec3> axes{{1, 0, 0}, {0, 1, 0}, {0, 0, 1}, {1, 1, 0}, {0, -1, 1}};
  for (int trial = 0; trial < 50; ++trial) axes.push_back(random.direction());
  for (const glm::dvec3& axis : axes) {
    const std::array pose{jointOf(rotationAbout(axis, pi), {1, 2, 3})};
    OwnedMesh mesh;
    addVertex(mesh, {0.5, -0.25, 2}, {{0, 1.0f}});
    expectNear(toVector(skinned(mesh, pose, Method::dualQuaternion).positions[0]),
               linearOf(pose[0]) * glm::dvec3(0.5, -0.25, 2) + offsetOf(pose[0]), 1e-14);
  }
}

TEST(ReferenceDualQuaternion, DuplicatesAreAddedUpBeforeThePivotIsChosen) {
  const std::array pose{turnAboutZ(0), turnAboutZ(140), turnAboutZ(220)};
  // No single slot of joint 2 is the strongest, together they are.
  const double once = blendedAngle(pose, {{0, 0.3125f}, {1, 0.25f}, {2, 0.4375f}});
  const double twice = blendedAngle(pose, {{2, 0.21875f}, {0, 0.3125f}, {1, 0.25f}, {2, 0.21875f}});
  EXPECT_NEAR(twice, once, 1e-12);
  EXPECT_GT(std::abs(once - blendedAngle(pose, {{0, 0.4375f}, {1, 0.25f}, {2, 0.3125f}})), 30);
}

TEST(ReferenceDualQuaternion, WeightsOfOneJointThatAddUpToATieAreATie) {
  // 60/255 + 67/255 is 127/255, whatever double makes of the quotients: joint 0 is the pivot.
  const std::array pose{turnAboutZ(0), turnAboutZ(140), turnAboutZ(220)};
  const std::uint8_t joints[] = {0, 0, 1, 2};
  const float position[] = {1, 0, 0};
  for (std::uint32_t total = 2; total <= 127; ++total) {
    for (std::uint32_t part = 1; 2 * part <= total; ++part) {
      const std::uint8_t weights[] = {
          static_cast<std::uint8_t>(part), static_cast<std::uint8_t>(total - part),
          static_cast<std::uint8_t>(total), static_cast<std::uint8_t>(total)};
      const InfluenceSet set{{joints, 1, 4, ComponentType::uint8, 4},
                             {weights, 1, 4, ComponentType::unorm8, 4}};
      MeshView mesh;
      mesh.vertexCount = 1;
      mesh.positions = attributeView(position, 1, 3);
      mesh.influenceSets = {&set, 1};
      const Result<reference::AnalyzedMesh> result =
          reference::analyze(mesh, pose, Method::dualQuaternion);
      ASSERT_TRUE(result.ok());
      ASSERT_NEAR(angleOf(result->positions[0]), 0, 1e-4)
          << part << " + " << total - part << " against " << total;
    }
  }
}

// "On the weights as stored": a difference that dividing by the sum rounds away still counts.
TEST(ReferenceDualQuaternion, ThePivotIsChosenBeforeNormalizing) {
  const std::array pose{turnAboutZ(0), turnAboutZ(140), turnAboutZ(220)};
  RigRandom random(5);
  const float tiny = std::ldexp(1.0f, -53);
  int collapsing = 0;
  for (int trial = 0; trial < 2000; ++trial) {
    const auto strong = static_cast<float>(random.between(0.95, 0.999));
    const auto weak = static_cast<float>(random.between(0.94, 0.95));
    // Joint 2 is stronger than joint 0 by one unit of double.
    const double stronger = static_cast<double>(strong) + static_cast<double>(tiny);
    ASSERT_GT(stronger, static_cast<double>(strong));
    const double sum = static_cast<double>(strong) + static_cast<double>(weak) + stronger;
    if (static_cast<double>(strong) / sum == stronger / sum) ++collapsing;
    const double angle = blendedAngle(pose, {{0, strong}, {1, weak}, {2, strong}, {2, tiny}});
    // Nearly a third each: Truth 13 with the third as pivot is 236°, with the first 0°.
    ASSERT_NEAR(angle, 236.03, 3) << strong << " " << weak;
  }
  EXPECT_GT(collapsing, 0) << "the test would not notice";
}

// The dot product of two turns about one axis is the cosine of half the angle between them.
TEST(ReferenceDualQuaternion, SaysWhereTheSignIsArbitrary) {
  const auto short180 = [](double dot) { return turnAboutZ(180 - 2 * std::asin(dot) * 180 / pi); };
  const std::array pose{JointMatrix{},  turnAboutZ(180), short180(5e-6),
                        short180(2e-5), short180(-2e-5), turnAboutZ(170)};
  OwnedMesh mesh;
  for (std::uint32_t joint = 1; joint < 6; ++joint) {
    addVertex(mesh, {1, 0, 0}, {{0, 0.5f}, {joint, 0.5f}});
  }
  addVertex(mesh, {1, 0, 0}, {{0, 1.0f}, {1, 0.0f}});
  const reference::AnalyzedMesh result = skinned(mesh, pose, Method::dualQuaternion);
  const bool expected[] = {true, true, false, false, false, false};
  for (std::size_t vertex = 0; vertex < 6; ++vertex) {
    EXPECT_EQ(result.conditioning[vertex].signAmbiguous, expected[vertex]) << vertex;
    EXPECT_TRUE(isFiniteVector(result.positions[vertex]));
  }
}

TEST(ReferenceDualQuaternion, ConditioningIsWhatItsCommentSays) {
  // σ = 3 and |t| = 5 come from different joints.
  const std::array pose{jointOf(diagonalMatrix(3, 1, 2), {0, 1, 0}),
                        jointOf(glm::dmat3(1.0), {3, 0, 4}), jointOf(diagonalMatrix(9, 9, 9))};
  OwnedMesh mesh;
  addVertex(mesh, {0, 2, 0}, {{0, 0.5f}, {1, 0.5f}});
  addVertex(mesh, {0, 2, 0}, {{1, 1.0f}, {2, 0.0f}});
  for (const Method method : allMethods) {
    const reference::AnalyzedMesh result = skinned(mesh, pose, method);
    EXPECT_NEAR(result.conditioning[0].scale, 5 + 3 * 2, 1e-12);
    // A center of rotation counts twice.
    const glm::dvec3 center(mesh.centersOfRotation[0], mesh.centersOfRotation[1],
                            mesh.centersOfRotation[2]);
    const double besides = needsCentersOfRotation(method) ? 2 * glm::length(center) : 0;
    EXPECT_NEAR(result.conditioning[0].distance, 2 + besides, 1e-15);
    EXPECT_NEAR(result.conditioning[1].scale, 5 + 1 * 2, 1e-12);
    EXPECT_FALSE(result.conditioning[0].degenerate);
    EXPECT_EQ(result.conditioning[1].rigidShortcut, 0);
  }
}

// Half the angle between two quaternions of equal weight is a quarter of that between their
// rotations.
TEST(ReferenceDualQuaternion, SaysHowLongTheBlendIs) {
  OwnedMesh mesh;
  mesh.influencesPerVertex = 2;
  addVertex(mesh, {1, 0, 0}, {{0, 0.5f}, {1, 0.5f}});
  for (const double angle : {0.0, 1.0, 3.0}) {
    const std::array pose{jointOf(glm::dmat3(1.0)),
                          jointOf(rotationAbout(glm::dvec3(0, 0, 1), angle))};
    for (const Method method : {Method::dualQuaternion, Method::sphericalBlend, Method::blended}) {
      EXPECT_NEAR(skinned(mesh, pose, method).conditioning[0].blendLength, std::cos(angle / 4),
                  1e-7);
    }
    EXPECT_EQ(skinned(mesh, pose, Method::linear).conditioning[0].blendLength, 1);
    EXPECT_EQ(skinned(mesh, pose, Method::logMatrix).conditioning[0].blendLength, 1);
  }
}

// A joint of which |CᵀC − 1| ≤ 8e-6 is not decomposed by kernels; the reference decomposes it, and
// says how much that may matter.
TEST(ReferenceDualQuaternion, TakesNoShortCutForNearlyRigidJoints) {
  OwnedMesh mesh;
  addVertex(mesh, {1, 0, 0}, {{0, 1.0f}});
  mesh.normals = {0, 0, 1};
  const auto skinnedBy = [&](double scale) {
    const std::array pose{jointOf(diagonalMatrix(scale, scale, scale))};
    return skinned(mesh, pose, Method::dualQuaternion);
  };
  for (const int steps : {-60, -4, 4, 30}) {  // of 2⁻²³: CᵀC − 1 is at most 7.2e-6
    const double scale = 1 + steps * std::ldexp(1.0, -23 + (steps < 0 ? -1 : 0));
    const reference::AnalyzedMesh result = skinnedBy(scale);
    EXPECT_NEAR(result.positions[0][0], scale, 1e-15);
    EXPECT_NEAR(result.conditioning[0].rigidShortcut, std::abs(scale - 1), 1e-14);
    EXPECT_TRUE(result.conditioning[0].normalRotatedOnly);
  }
  for (const double scale : {1 + std::ldexp(1.0, -14), 1 - std::ldexp(1.0, -14), 2.0}) {
    const reference::AnalyzedMesh result = skinnedBy(scale);
    EXPECT_NEAR(result.positions[0][0], scale, 1e-15);
    EXPECT_EQ(result.conditioning[0].rigidShortcut, 0);
    EXPECT_FALSE(result.conditioning[0].normalRotatedOnly);
  }
}

// Truth 19: a mirror is no rotation, though CᵀC is 1.
TEST(ReferenceDualQuaternion, MirrorsAreNotRigid) {
  OwnedMesh mesh;
  addVertex(mesh, {1, 0, 0}, {{0, 1.0f}});
  mesh.normals = {0, 0, 1};
  for (const glm::dmat3& mirror : {diagonalMatrix(-1, 1, 1), glm::dmat3(-1.0)}) {
    const std::array pose{jointOf(mirror)};
    EXPECT_FALSE(skinned(mesh, pose, Method::dualQuaternion).conditioning[0].normalRotatedOnly);
  }
}

// What kernels take for rigid they turn and shift, no more: the bound has to allow for what that
// leaves out, also where a shear this small lies in one direction.
TEST(ReferenceDualQuaternion, Truth16_JointsTakenForRigidStayInsideTheBound) {
  RigRandom random(6);
  double worst = 0;
  int taken = 0;
  for (int trial = 0; trial < 20000; ++trial) {
    // A stretch along one axis, of up to 12e-6: then each entry of CᵀC − 1 may be below 8e-6.
    const glm::dvec3 axis = trial % 2 == 0 ? random.direction() : glm::normalize(glm::dvec3(1));
    const glm::dmat3 rotation = rotationAbout(random.direction(), random.between(-pi, pi));
    const glm::dmat3 stretch =
        glm::dmat3(1.0) + glm::outerProduct(axis, axis) * random.between(-12e-6, 12e-6);
    const std::array pose{jointOf(rotation * stretch)};
    const glm::dmat3 c = linearOf(pose[0]);
    const glm::dmat3 gram = glm::transpose(c) * c - glm::dmat3(1.0);
    double deviation = 0;
    for (int i = 0; i < 9; ++i) deviation = std::max(deviation, std::abs(gram[i / 3][i % 3]));
    if (deviation > 8e-6) continue;
    OwnedMesh mesh;
    addVertex(mesh, axis, {{0, 1.0f}});
    mesh.normals = {0, 0, 1};
    const reference::AnalyzedMesh result = skinned(mesh, pose, Method::dualQuaternion);
    if (!result.conditioning[0].normalRotatedOnly) continue;  // not taken for rigid
    ++taken;
    const double error =
        glm::length(rotation * bindPosition(mesh, 0) - toVector(result.positions[0]));
    worst = std::max(worst, error / result.bounds[0].position);
  }
  EXPECT_GT(taken, 1000);
  EXPECT_LE(worst, 1) << "of the bound";
}

}  // namespace
}  // namespace dermis::test
