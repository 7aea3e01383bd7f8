// Every method of the reference against its formula, written down a second time (by_hand.h), with
// rigid joints and with joints that scale, shear or mirror: those go in two phases in all methods
// but linear blending.

#include <functional>
#include <initializer_list>
#include <limits>
#include <string>

#include "by_hand.h"
#include "dual_quat.h"
#include "reference_rig.h"

namespace dermis::test {
namespace {

/// With joints of each kind, and so many influences.
void expectFormula(std::uint64_t seed, Method method,
                   std::initializer_list<std::uint32_t> influences, const Tolerance& tolerance,
                   const std::function<Moved(const ByHand&)>& formula, double mostAngle = pi) {
  RigRandom random(seed);
  for (const Joints kind : allJoints) {
    for (const std::uint32_t count : influences) {
      SCOPED_TRACE(testing::Message() << methodName(method) << ", joints of kind "
                                      << static_cast<int>(kind) << ", " << count << " influences");
      const std::vector<JointMatrix> pose = randomJoints(random, kind, 20, mostAngle);
      OwnedMesh mesh = scatteredMesh(random, 200, 20, count);
      mesh.bulgeStrengths.assign(200, 0.375f);
      expectFormula(mesh, pose, method, tolerance, formula);
    }
  }
}

// ---- What is true of all

TEST(ReferenceMethods, OneInfluenceIsItsJointWhateverTheMethod) {
  RigRandom random(1);
  for (const Joints kind : allJoints) {
    const std::vector<JointMatrix> pose = randomJoints(random, kind, 40);
    OwnedMesh mesh = meshWithShares(random, 300, 40, 1);
    for (const Method method : allMethods) {
      const reference::AnalyzedMesh result = skinned(mesh, pose, method);
      for (std::size_t vertex = 0; vertex < 300; ++vertex) {
        const JointMatrix& joint = pose[mesh.joints[vertex]];
        expectNear(toVector(result.positions[vertex]),
                   linearOf(joint) * bindPosition(mesh, vertex) + offsetOf(joint), 1e-13);
        const glm::dmat3 c = linearOf(joint);
        expectNear(toVector(result.normals[vertex]),
                   glm::normalize(glm::transpose(glm::inverse(c)) * bindNormal(mesh, vertex)),
                   1e-12);
        EXPECT_FALSE(result.conditioning[vertex].signAmbiguous) << methodName(method);
      }
    }
  }
}

TEST(ReferenceMethods, EqualJointsAreOneJointWhateverTheMethod) {
  RigRandom random(2);
  for (const Joints kind : allJoints) {
    for (int trial = 0; trial < 30; ++trial) {
      const std::vector<JointMatrix> pose(5, randomJoint(random, kind));
      OwnedMesh mesh = meshWithShares(random, 10, 5, 4);
      for (const Method method : allMethods) {
        const reference::AnalyzedMesh result = skinned(mesh, pose, method);
        for (std::size_t vertex = 0; vertex < 10; ++vertex) {
          const glm::dmat3 c = linearOf(pose[0]);
          expectNear(toVector(result.positions[vertex]),
                     c * bindPosition(mesh, vertex) + offsetOf(pose[0]), 1e-13);
          expectNear(toVector(result.normals[vertex]),
                     glm::normalize(glm::transpose(glm::inverse(c)) * bindNormal(mesh, vertex)),
                     1e-12);
        }
      }
    }
  }
}

// Joints that only shift: every method is linear blending.
TEST(ReferenceMethods, TranslationsBlendLinearlyWhateverTheMethod) {
  RigRandom random(3);
  const std::vector<JointMatrix> pose =
      poseOf(10, [&] { return jointOf(glm::dmat3(1.0), random.vector(2)); });
  OwnedMesh mesh = meshWithShares(random, 200, 10, 4);
  for (const Method method : allMethods) {
    const reference::AnalyzedMesh result = skinned(mesh, pose, method);
    expectPositions(result, 1e-14, [&](std::size_t vertex) {
      return ByHand(mesh, vertex, pose).linear(bindPosition(mesh, vertex));
    });
  }
}

// S alone, common to all joints: it is applied in bind space, before whatever the method does.
void expectAScaledMesh(const glm::dvec3& scale, double tolerance) {
  SCOPED_TRACE(testing::Message() << "scaled by " << scale.x << ", " << scale.y << ", " << scale.z);
  RigRandom random(4);
  for (int trial = 0; trial < 20; ++trial) {
    std::vector<JointMatrix> rigid, scaled;
    for (int joint = 0; joint < 6; ++joint) {
      const glm::dmat3 rotation = exactRotation(random);  // so that R S is stored exactly
      const glm::dvec3 translation = random.vector(2);
      rigid.push_back(jointOf(rotation, translation));
      scaled.push_back(jointOf(rotation * diagonalMatrix(scale.x, scale.y, scale.z), translation));
    }
    OwnedMesh small = meshWithShares(random, 50, 6, 3), large = small;
    for (auto values : {&OwnedMesh::positions, &OwnedMesh::centersOfRotation}) {
      for (std::size_t i = 0; i < small.positions.size(); ++i) {
        (small.*values)[i] = std::round((small.*values)[i] * 1024) / 1024;
        (large.*values)[i] =
            (small.*values)[i] * static_cast<float>(scale[static_cast<int>(i % 3)]);
      }
    }
    for (const Method method : allMethods) {
      const reference::AnalyzedMesh result = skinned(small, scaled, method);
      const reference::AnalyzedMesh expected = skinned(large, rigid, method);
      for (std::size_t vertex = 0; vertex < 50; ++vertex) {
        if (expected.conditioning[vertex].signAmbiguous) continue;
        expectNear(toVector(result.positions[vertex]), toVector(expected.positions[vertex]),
                   tolerance);
        if (scale.x != scale.y) continue;  // normals are not scaled as positions are
        expectNear(toVector(result.normals[vertex]), toVector(expected.normals[vertex]), 1e-12);
      }
    }
  }
}

TEST(ReferenceMethods, AScaleInBindSpaceIsAScaledMeshWhateverTheMethod) {
  expectAScaledMesh({0.5, 2, 4}, 1e-12);
}

TEST(ReferenceMethods, Truth19_AScaleOf100IsKeptWhateverTheMethod) {
  expectAScaledMesh({100, 100, 100}, 1e-11);
}

TEST(ReferenceMethods, ThoseWithACenterOfRotationRefuseAMeshWithout) {
  RigRandom random(6);
  OwnedMesh mesh = scatteredMesh(random, 10, 4, 2);
  mesh.name = "Fox";
  mesh.centersOfRotation.clear();
  const std::vector<JointMatrix> pose(4);
  for (const Method method : allMethods) {
    const Result<reference::AnalyzedMesh> result = reference::analyze(mesh.view(), pose, method);
    ASSERT_EQ(result.ok(), !needsCentersOfRotation(method)) << methodName(method);
    if (result) continue;
    EXPECT_EQ(result.error().code, ErrorCode::invalidArgument);
    EXPECT_EQ(result.error().message, "mesh 'Fox': " + std::string(methodName(method)) +
                                          " needs centers of rotation, but it has none");
  }
}

// ---- Linear blending: v' = (Σ w_j C_j) v

TEST(ReferenceMethods, LinearPositionsAreTheBlendedMatrixTimesThePoint) {
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

TEST(ReferenceMethods, LinearOneInfluenceIsItsJointExactly) {
  const std::array pose{jointOf(diagonalMatrix(2, 3, 4), {10, 20, 30}), JointMatrix{}};
  OwnedMesh mesh;
  addVertex(mesh, {1, 1, 1}, {{0, 1.0f}});
  addVertex(mesh, {1, 2, 3}, {{1, 0.125f}});
  const reference::AnalyzedMesh result = skinned(mesh, pose, Method::linear);
  EXPECT_EQ(result.positions[0], (reference::Double3{12, 23, 34}));
  EXPECT_EQ(result.positions[1], (reference::Double3{1, 2, 3}));
}

// ---- Quaternion and translation (Hejl 2004)

TEST(ReferenceMethods, QuaternionTranslationIsHejlsFormula) {
  expectFormula(10, Method::quaternionTranslation, {2, 3, 4, 7}, 1e-12, [](const ByHand& vertex) {
    glm::dvec3 translation(0.0);
    for (const ByHand::Influence& influence : vertex.influences)
      translation += influence.weight * offsetOf(influence.matrix);
    return Moved{vertex.rotation * (vertex.m * vertex.position) + translation,
                 vertex.turnedNormal(vertex.rotation)};
  });
}

// ---- Matrix logarithms

TEST(ReferenceMethods, TheSeriesInTheseTestsAreRight) {
  RigRandom random(11);
  for (int trial = 0; trial < 200; ++trial) {
    const glm::dvec3 axis = random.direction();
    const double angle = random.between(0.01, 3);
    const glm::dmat4 c = matrixOf(rotationAbout(axis, angle), random.vector(1));
    const glm::dmat4 logarithm = logarithmOf(c);
    EXPECT_LE(largestEntry(exponentialOf(logarithm) - c), 1e-12);
    // Of a rotation it is [angle · axis]×.
    EXPECT_NEAR(logarithm[0][1], angle * axis.z, 1e-11);
    EXPECT_NEAR(logarithm[1][2], angle * axis.x, 1e-11);
    EXPECT_NEAR(logarithm[2][0], angle * axis.y, 1e-11);
  }
}

TEST(ReferenceMethods, LogMatrixIsTheExponentialOfTheMeanLogarithm) {
  expectFormula(
      12, Method::logMatrix, {2, 3, 4}, 1e-11,
      [](const ByHand& vertex) {
        glm::dmat4 mean(0.0);
        for (const ByHand::Influence& influence : vertex.influences) {
          mean += influence.weight *
                  logarithmOf(matrixOf(influence.parts.rotation, influence.parts.translation));
        }
        const glm::dmat4 blended = exponentialOf(mean);
        return Moved{glm::dvec3(blended * glm::dvec4(vertex.m * vertex.position, 1)),
                     vertex.turnedNormal(glm::dmat3(blended))};
      },
      3.0);
}

// A rotation beyond half a turn from the pivot is taken the short way from rest, not from there.
TEST(ReferenceMethods, LogMatrixMayGoTheLongWayRound) {
  const auto turn = [](double degrees) {
    return jointOf(rotationAbout({0, 0, 1}, degrees * pi / 180));
  };
  OwnedMesh mesh;
  addVertex(mesh, {1, 0, 0}, {{0, 0.5f}, {1, 0.5f}});
  const std::array pose{turn(170), turn(-170)};  // 20° apart, across 180°
  expectNear(toVector(skinned(mesh, pose, Method::logMatrix).positions[0]), {1, 0, 0}, 1e-6);
  for (const Method method : {Method::dualQuaternion, Method::dualQuaternionIterative})
    expectNear(toVector(skinned(mesh, pose, method).positions[0]), {-1, 0, 0}, 1e-6);
}

// ---- Iterative dual quaternions: the blend in which the joints' screws cancel

TEST(ReferenceMethods, IterativeBlendingIsWhereTheLogarithmsCancel) {
  RigRandom random(13);
  std::size_t compared = 0;
  for (int trial = 0; trial < 200; ++trial) {
    // Near to each other, for a matrix logarithm knows no hemispheres.
    const glm::dmat3 base = rotationAbout(random.direction(), random.between(-pi, pi));
    const std::vector<JointMatrix> pose = poseOf(4, [&] {
      return jointOf(base * rotationAbout(random.direction(), random.between(-1.2, 1.2)),
                     random.vector(1));
    });
    OwnedMesh mesh;
    std::vector<float> weights;
    for (int i = 0; i < 4; ++i) weights.push_back(static_cast<float>(random.between(0.1, 1)));
    for (const glm::dvec3& p :
         {glm::dvec3(0.0), glm::dvec3(1, 0, 0), glm::dvec3(0, 1, 0), glm::dvec3(0, 0, 1)}) {
      addVertex(mesh, p, {{0, weights[0]}, {1, weights[1]}, {2, weights[2]}, {3, weights[3]}});
    }
    mesh.normals.assign(12, 0.0f);
    const reference::AnalyzedMesh result = skinned(mesh, pose, Method::dualQuaternionIterative);
    glm::dmat4 b(1.0);
    b[3] = glm::dvec4(toVector(result.positions[0]), 1);
    for (int i = 0; i < 3; ++i) {
      b[i] = glm::dvec4(toVector(result.positions[static_cast<std::size_t>(i) + 1]) -
                            toVector(result.positions[0]),
                        0);
    }
    glm::dmat4 residual(0.0);
    for (const ByHand::Influence& influence : ByHand(mesh, 0, pose).influences) {
      residual +=
          influence.weight * logarithmOf(glm::inverse(b) * matrixOf(influence.parts.rotation,
                                                                    influence.parts.translation));
    }
    // Joints in float32 scale a little, which the points show and the logarithm does not: 2e-7.
    EXPECT_LE(largestEntry(residual), 5e-7);
    ++compared;
  }
  EXPECT_EQ(compared, 200u);
}

// ---- Spherical blending (Kavan and Žára 2005)

glm::dvec3 unitAxis(const glm::dmat3& rotation) {
  const Quaternion q = quaternionOf(rotation);
  return glm::normalize(glm::dvec3(q[1], q[2], q[3]));
}

/// The least-squares solution over all pairs; of least length, where `free` is a direction that
/// the equations do not say anything of.
glm::dvec3 centerByHand(const ByHand& vertex, const glm::dvec3* free) {
  glm::dmat3 square(0.0);
  glm::dvec3 right(0.0);
  for (const ByHand::Influence& a : vertex.influences) {
    for (const ByHand::Influence& b : vertex.influences) {
      const glm::dmat3 rows = a.parts.rotation - b.parts.rotation;
      square += glm::transpose(rows) * rows;
      right += glm::transpose(rows) * (b.parts.translation - a.parts.translation);
    }
  }
  // What is perpendicular to `free` stays as it is.
  if (free != nullptr) square += glm::outerProduct(*free, *free);
  return glm::inverse(square) * right;
}

Moved sphericalByHand(const ByHand& vertex, const glm::dvec3& center) {
  return {vertex.rotation * (vertex.m * vertex.position - center) + vertex.rigidLinear(center),
          vertex.turnedNormal(vertex.rotation)};
}

TEST(ReferenceMethods, SphericalBlendTurnsAboutThePointOfLeastSquares) {
  expectFormula(14, Method::sphericalBlend, {3, 4, 6}, 1e-9, [](const ByHand& vertex) {
    // Hardly any three joints turn alike.
    return sphericalByHand(vertex, centerByHand(vertex, nullptr));
  });
}

// Two rotations agree along the axis of the one that leads from the first to the second.
TEST(ReferenceMethods, SphericalBlendOfTwoJointsIsThePseudoInverse) {
  expectFormula(15, Method::sphericalBlend, {2}, 1e-9, [](const ByHand& vertex) {
    const glm::dvec3 axis = unitAxis(glm::transpose(vertex.influences[0].parts.rotation) *
                                     vertex.influences[1].parts.rotation);
    const glm::dvec3 center = centerByHand(vertex, &axis);
    EXPECT_NEAR(glm::dot(center, axis), 0, 1e-9);
    return sphericalByHand(vertex, center);
  });
}

// A joint's own: both lie where the first's children turn.
TEST(ReferenceMethods, SphericalBlendFindsTheJointWhereTwoBonesMeet) {
  RigRandom random(16);
  for (int trial = 0; trial < 200; ++trial) {
    const glm::dvec3 elbow = random.vector(1);
    const glm::dmat3 bend = rotationAbout(random.direction(), random.between(0.1, 3));
    const std::array pose{JointMatrix{}, jointOf(bend, elbow - bend * elbow)};
    OwnedMesh mesh;
    const auto p = glm::dvec3(glm::vec3(elbow));
    addVertex(mesh, p, {{0, 0.375f}, {1, 0.625f}});
    const glm::dvec3 beside(glm::vec3(elbow + random.direction()));
    addVertex(mesh, beside, {{0, 0.375f}, {1, 0.625f}});
    const reference::AnalyzedMesh result = skinned(mesh, pose, Method::sphericalBlend);
    expectNear(toVector(result.positions[0]), p, 1e-5);
    EXPECT_NEAR(glm::length(toVector(result.positions[1]) - p), glm::length(beside - p), 1e-5)
        << "on a sphere about it";
  }
}

TEST(ReferenceMethods, SphericalBlendOfACommonAxisIsFinite) {
  RigRandom random(17);
  for (int trial = 0; trial < 300; ++trial) {
    const glm::dvec3 axis = random.direction();
    const glm::dmat3 first = rotationAbout(random.direction(), random.between(-pi, pi));
    const std::vector<JointMatrix> pose = poseOf(4, [&] {
      return jointOf(first * rotationAbout(axis, random.between(-1, 1)), random.vector(1));
    });
    OwnedMesh mesh = scatteredMesh(random, 5, 4, 4);
    const reference::AnalyzedMesh result = skinned(mesh, pose, Method::sphericalBlend);
    for (std::size_t vertex = 0; vertex < 5; ++vertex) {
      ASSERT_TRUE(isFiniteVector(result.positions[vertex]));
      // The least of two singular values says how far what is left of rounding is thrown.
      const ByHand byHand(mesh, vertex, pose);
      const Moved expected = sphericalByHand(byHand, centerByHand(byHand, &axis));
      if (result.conditioning[vertex].signAmbiguous) continue;
      expectNear(toVector(result.positions[vertex]), expected.position,
                 1e-6 * (1 + result.conditioning[vertex].leverage));
    }
  }
}

// Its influence on the center does not depend on its weight. `pack` drops it or not.
TEST(ReferenceMethods, SphericalBlendHasNoBoundForWeightsThatPackingMayDrop) {
  const std::array pose{jointOf(rotationAbout({0, 0, 1}, 1), {1, 0, 0}),
                        jointOf(rotationAbout({0, 1, 0}, 2), {0, 0, 1})};
  for (const float weight : {0x1p-50f, 0x1p-48f, 0x1p-26f, 0x1.fp-25f, 0x1p-24f}) {
    OwnedMesh mesh;
    addVertex(mesh, {1, 2, 3}, {{0, 1 - weight}, {1, weight}});
    const bool isKept = weight >= 0x1p-24f;
    const bool isDropped = weight < 0x1p-49f;
    const auto packed = pack(mesh.view(), 2);
    ASSERT_TRUE(packed.ok());
    if (isDropped || isKept) {
      EXPECT_EQ(packed->info().requiredJoints, isKept ? 2u : 1u) << weight;
    }
    for (const Method method : {Method::sphericalBlend, Method::dualQuaternion}) {
      const reference::AnalyzedMesh result = skinned(mesh, pose, method);
      EXPECT_EQ(result.conditioning[0].signAmbiguous,
                method == Method::sphericalBlend && !isKept && !isDropped)
          << weight;
    }
  }
}

// No center is better than another: it stays where it is, at 0.
TEST(ReferenceMethods, SphericalBlendOfEqualRotationsIsLinear) {
  RigRandom random(18);
  for (int trial = 0; trial < 100; ++trial) {
    const glm::dmat3 rotation = rotationAbout(random.direction(), random.between(-pi, pi));
    const std::vector<JointMatrix> pose =
        poseOf(4, [&] { return jointOf(rotation, random.vector(1)); });
    OwnedMesh mesh = scatteredMesh(random, 5, 4, 4);
    const reference::AnalyzedMesh result = skinned(mesh, pose, Method::sphericalBlend);
    expectPositions(result, 1e-14, [&](std::size_t vertex) {
      return ByHand(mesh, vertex, pose).linear(bindPosition(mesh, vertex));
    });
  }
}

// Rotations that differ by less than 1e-3: the center must not fly off.
TEST(ReferenceMethods, SphericalBlendOfNearlyEqualRotationsStaysNear) {
  RigRandom random(19);
  for (const double angle : {1e-7, 1e-5, 1e-4, 5e-4, 2e-3, 1e-2}) {
    for (int trial = 0; trial < 50; ++trial) {
      const std::vector<JointMatrix> pose = poseOf(
          4, [&] { return jointOf(rotationAbout(random.direction(), angle), random.vector(1)); });
      OwnedMesh mesh = scatteredMesh(random, 5, 4, 4);
      const reference::AnalyzedMesh result = skinned(mesh, pose, Method::sphericalBlend);
      for (std::size_t vertex = 0; vertex < 5; ++vertex) {
        ASSERT_TRUE(isFiniteVector(result.positions[vertex]));
        // All joints move the point nearly alike but for their translations.
        expectNear(toVector(result.positions[vertex]),
                   ByHand(mesh, vertex, pose).linear(bindPosition(mesh, vertex)),
                   0.02 + 3 * angle * (1 + result.conditioning[vertex].leverage));
      }
    }
  }
}

// ---- Between linear blending and dual quaternions

TEST(ReferenceMethods, BlendedIsTheMeanOfBothByItsWeight) {
  RigRandom random(20);
  for (const Joints kind : allJoints) {
    const std::vector<JointMatrix> pose = randomJoints(random, kind, 20);
    OwnedMesh mesh = meshWithShares(random, 400, 20, 4);
    for (std::size_t vertex = 0; vertex < 100; ++vertex)
      mesh.dualQuaternionWeights[vertex] = std::array{0.0f, 0.25f, 0.5f, 1.0f}[vertex % 4];
    const reference::AnalyzedMesh linear = skinned(mesh, pose, Method::linear),
                                  dual = skinned(mesh, pose, Method::dualQuaternion),
                                  result = skinned(mesh, pose, Method::blended);
    for (std::size_t vertex = 0; vertex < 400; ++vertex) {
      const auto share = static_cast<double>(mesh.dualQuaternionWeights[vertex]);
      const auto mean = [&](const reference::Double3& a, const reference::Double3& b) {
        return (1 - share) * toVector(a) + share * toVector(b);
      };
      expectNear(toVector(result.positions[vertex]),
                 mean(linear.positions[vertex], dual.positions[vertex]), 1e-15);
      const glm::dvec3 normal = mean(linear.normals[vertex], dual.normals[vertex]);
      if (glm::length(normal) > 1e-3)
        expectNear(toVector(result.normals[vertex]), glm::normalize(normal), 1e-12);
      if (share == 0) {
        EXPECT_EQ(result.positions[vertex], linear.positions[vertex]);
      }
      if (share == 1) {
        EXPECT_EQ(result.positions[vertex], dual.positions[vertex]);
      }
    }
  }
}

TEST(ReferenceMethods, BlendedTakesTheMeshsWeightWhereTheVerticesHaveNone) {
  RigRandom random(21);
  const std::vector<JointMatrix> pose = randomJoints(random, Joints::rigid, 8);
  OwnedMesh mesh = scatteredMesh(random, 50, 8, 3);
  const reference::AnalyzedMesh linear = skinned(mesh, pose, Method::linear),
                                dual = skinned(mesh, pose, Method::dualQuaternion);
  for (const float share : {0.0f, 0.125f, 0.5f, 1.0f}) {
    MeshView view = mesh.view();
    if (share != 0.5f) view.dualQuaternionWeight = share;  // a half unless it says otherwise
    const reference::AnalyzedMesh result = skinned(view, pose, Method::blended);
    expectPositions(result, 1e-15, [&](std::size_t vertex) {
      return (1 - static_cast<double>(share)) * toVector(linear.positions[vertex]) +
             static_cast<double>(share) * toVector(dual.positions[vertex]);
    });
  }
}

// ---- Centres of rotation (Le and Hodgins 2016)

TEST(ReferenceMethods, CenterOfRotationIsItsFormula) {
  expectFormula(22, Method::centerOfRotation, {2, 4, 7}, 1e-12, [](const ByHand& vertex) {
    return Moved{vertex.rotation * (vertex.m * (vertex.position - vertex.center)) +
                     vertex.linear(vertex.center),
                 vertex.turnedNormal(vertex.rotation)};
  });
}

// ---- Bulge control

TEST(ReferenceMethods, BulgeControlLeadsFromDualQuaternionsToCentersOfRotation) {
  RigRandom random(25);
  for (const Joints kind : allJoints) {
    const std::vector<JointMatrix> pose = randomJoints(random, kind, 20);
    OwnedMesh mesh = meshWithShares(random, 400, 20, 4);
    for (std::size_t vertex = 0; vertex < 100; ++vertex)
      mesh.bulgeStrengths[vertex] = std::array{0.0f, 0.25f, 0.5f, 1.0f}[vertex % 4];
    const reference::AnalyzedMesh dual = skinned(mesh, pose, Method::dualQuaternion),
                                  centered = skinned(mesh, pose, Method::centerOfRotation),
                                  result = skinned(mesh, pose, Method::bulgeControlled);
    for (std::size_t vertex = 0; vertex < 400; ++vertex) {
      const auto strength = static_cast<double>(mesh.bulgeStrengths[vertex]);
      expectNear(toVector(result.positions[vertex]),
                 (1 - strength) * toVector(dual.positions[vertex]) +
                     strength * toVector(centered.positions[vertex]),
                 1e-13);
      // All three turn alike.
      EXPECT_EQ(result.normals[vertex], dual.normals[vertex]);
      EXPECT_EQ(result.normals[vertex], centered.normals[vertex]);
    }
  }
}

TEST(ReferenceMethods, BulgeControlIsItsFormula) {
  expectFormula(26, Method::bulgeControlled, {4}, 1e-12, [](const ByHand& vertex) {
    return Moved{vertex.dualQuaternions(vertex.position) -
                     0.375 * (vertex.dualQuaternions(vertex.center) - vertex.linear(vertex.center)),
                 vertex.turnedNormal(vertex.rotation)};
  });
}

TEST(ReferenceMethods, BulgeControlTakesTheMeshsStrengthWhereTheVerticesHaveNone) {
  RigRandom random(27);
  const std::vector<JointMatrix> pose = randomJoints(random, Joints::rigid, 8);
  OwnedMesh mesh = scatteredMesh(random, 50, 8, 3);
  const reference::AnalyzedMesh dual = skinned(mesh, pose, Method::dualQuaternion),
                                centered = skinned(mesh, pose, Method::centerOfRotation);
  for (const float strength : {0.0f, 0.125f, 1.0f}) {
    MeshView view = mesh.view();
    if (strength != 1) view.bulgeStrength = strength;  // all of it unless it says otherwise
    const reference::AnalyzedMesh result = skinned(view, pose, Method::bulgeControlled);
    expectPositions(result, 1e-14, [&](std::size_t vertex) {
      return (1 - static_cast<double>(strength)) * toVector(dual.positions[vertex]) +
             static_cast<double>(strength) * toVector(centered.positions[vertex]);
    });
  }
}

// A share of another type, from a view with gaps, is the same share.
TEST(ReferenceMethods, SharesOfEveryType) {
  RigRandom random(28);
  const std::vector<JointMatrix> pose = randomJoints(random, Joints::rigid, 8);
  OwnedMesh mesh = scatteredMesh(random, 4, 8, 3);
  const std::vector<std::uint8_t> bytes{0, 7, 51, 7, 204, 7, 255};  // every other one
  const std::vector<std::uint16_t> shorts{0, 13107, 52428, 65535};
  const std::vector<float> parts{0, 0.2f, 0.8f, 1};
  OwnedMesh expected = mesh;
  expected.dualQuaternionWeights = expected.bulgeStrengths = parts;
  for (const Method method : {Method::blended, Method::bulgeControlled}) {
    const reference::AnalyzedMesh whole = skinned(expected, pose, method);
    for (const AttributeView& shares :
         {AttributeView{bytes.data(), 4, 2, ComponentType::unorm8, 1},
          AttributeView{shorts.data(), 4, 2, ComponentType::unorm16, 1}}) {
      MeshView view = mesh.view();
      view.dualQuaternionWeights = view.bulgeStrengths = shares;
      const reference::AnalyzedMesh result = skinned(view, pose, method);
      expectPositions(result, 1e-7, whole);
    }
  }
}

// ---- Two phases in all of them

// The blended S is applied in bind space: rigid joints' answer to the scaled point.
TEST(ReferenceMethods, WhatIsScaledIsThenMovedRigidly) {
  RigRandom random(29);
  for (const Joints kind : {Joints::scaled, Joints::mirrored, Joints::mixed}) {
    for (int trial = 0; trial < 30; ++trial) {
      // Rotations that float32 holds, so that the rigid part alone can be a joint too.
      std::vector<JointMatrix> pose, rigid;
      for (int joint = 0; joint < 3; ++joint) {
        const bool mirrors = kind == Joints::mirrored || (kind == Joints::mixed && joint == 1);
        const double sign = mirrors ? -1 : 1;
        const glm::dmat3 rotation = exactRotation(random);
        const glm::dvec3 t = random.vector(1);
        pose.push_back(jointOf(rotation * diagonalMatrix(sign * 0.5, sign * 2, sign * 1.25), t));
        rigid.push_back(jointOf(rotation, t));
      }
      OwnedMesh mesh = scatteredMesh(random, 1, 3, 3);
      mesh.weights = {0.5f, 0.125f, 0.375f};
      const ByHand byHand(mesh, 0, pose);
      OwnedMesh scaled = mesh;
      const auto scale = [&](std::vector<float>& values) {
        const glm::dvec3 p = byHand.m * glm::dvec3(values[0], values[1], values[2]);
        for (int i = 0; i < 3; ++i) values[static_cast<std::size_t>(i)] = static_cast<float>(p[i]);
      };
      scale(scaled.positions);
      for (const Method method : rigidMethods) {
        // Those take the center by the joints themselves, scale and all.
        if (needsCentersOfRotation(method)) continue;
        const reference::AnalyzedMesh result = skinned(mesh, pose, method);
        if (result.conditioning[0].signAmbiguous) continue;
        expectNear(toVector(result.positions[0]),
                   toVector(skinned(scaled, rigid, method).positions[0]), 1e-6);
      }
    }
  }
}

}  // namespace
}  // namespace dermis::test
