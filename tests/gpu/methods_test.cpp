// Every method on the device: the truths that can be seen there.

#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <bit>
#include <cmath>
#include <limits>
#include <numbers>
#include <string>
#include <vector>

#include <glm/gtc/quaternion.hpp>
#include <glm/matrix.hpp>

#include "dermis/mesh.h"
#include "dermis/verify.h"
#include "dual_quat.h"
#include "exhaustive.h"
#include "joint_of.h"
#include "kit/batch_runner.h"
#include "random_rig.h"
#include "test_device.h"
#include "verify/conditioning.h"

namespace dermis::test {
namespace {

constexpr double pi = std::numbers::pi;
constexpr float nan = std::numeric_limits<float>::quiet_NaN();

JointMatrix turnAboutZ(double degrees) {
  return jointOf(glm::mat3_cast(glm::angleAxis(degrees * pi / 180, glm::dvec3(0, 0, 1))));
}

class SomeMethodsTest : public DeviceTest {
 protected:
  samples::BatchResult run(std::span<const samples::SkinRequest> requests,
                           samples::RunOptions options = {}) {
    options.output.tangents = VertexFormat::float32x4;  // of meshes that have them
    Result<samples::BatchResult> result = samples::runBatch(device(), context(), requests, options);
    EXPECT_TRUE(result.ok()) << (result ? "" : result.error().message);
    return result ? std::move(*result) : samples::BatchResult{};
  }
  samples::SkinnedVertices skin(OwnedMesh& mesh, std::span<const JointMatrix> pose, Method method) {
    const PackedMesh packedMesh = *pack(mesh.view(), static_cast<std::uint32_t>(pose.size()));
    const samples::SkinRequest request{&packedMesh, pose, JointPromise::scaling, method};
    samples::BatchResult result = run({&request, 1});
    return result.instances.empty() ? samples::SkinnedVertices{} : std::move(result.instances[0]);
  }
  /// Whether every vertex is inside its bound.
  Comparison compared(OwnedMesh& mesh, std::span<const JointMatrix> pose, Method method) {
    const samples::SkinnedVertices skinned = skin(mesh, pose, method);
    const Result<reference::SkinnedMesh> expected = reference::skin(mesh.view(), pose, method);
    EXPECT_TRUE(expected.ok());
    return *compareWithReference(*expected, skinned.view());
  }
};

class MethodTest : public SomeMethodsTest, public ::testing::WithParamInterface<Method> {};

/// Every attribute, by the byte.
void expectSameBytes(const samples::SkinnedVertices& a, const samples::SkinnedVertices& b,
                     const std::string& what) {
  for (std::size_t stream = 0; stream < streamCount; ++stream)
    EXPECT_TRUE(a.streams[stream] == b.streams[stream]) << what << ", stream " << stream;
  EXPECT_FALSE(a.streams[0].empty());
}

// ---- 20: no bit depends on how the work is cut up

struct MixedCrowd {
  std::vector<OwnedMesh> meshes;
  std::vector<PackedMesh> packedMeshes;
  std::vector<std::vector<JointMatrix>> poses;
  std::vector<samples::SkinRequest> requests;
};

/// Rigid and scaled instances of three meshes.
MixedCrowd crowdOf(Method method) {
  MixedCrowd crowd;
  const std::uint32_t vertices[] = {65, 200, 333}, influences[] = {1, 4, 7};
  for (std::uint32_t mesh = 0; mesh < 3; ++mesh) {
    OwnedMesh& owned =
        crowd.meshes.emplace_back(randomMesh(mesh, vertices[mesh], 30, influences[mesh]));
    addTangents(owned, mesh);
    crowd.packedMeshes.push_back(*pack(owned.view(), 30));
  }
  for (std::uint32_t instance = 0; instance < 12; ++instance) {
    crowd.poses.push_back(
        randomPose(100 + instance, 30, instance % 4 == 0 ? Rigidity::shear : Rigidity::rigid));
  }
  for (std::uint32_t instance = 0; instance < 12; ++instance) {
    crowd.requests.push_back(
        {&crowd.packedMeshes[instance % 3], crowd.poses[instance], JointPromise::scaling, method});
  }
  return crowd;
}

TEST_P(MethodTest, Truth20_TuningChangesNoBit) {
  const MixedCrowd crowd = crowdOf(GetParam());
  const samples::BatchResult first = run(crowd.requests);
  ASSERT_EQ(first.instances.size(), crowd.requests.size());
  constexpr std::array tunings{Tuning{8, 1}, Tuning{16, 2}, Tuning{32, 5, 1000},
                               Tuning{8, 32, 0, 16}, Tuning{128, 4}};
  for (const bool pushDescriptors : {true, false}) {
    useDevice(pushDescriptors);
    for (std::size_t number = 0; number < tunings.size(); ++number) {
      // Two in turn, and one without push descriptors.
      const std::size_t turn = (number + std::size_t(GetParam())) % tunings.size();
      if (!isExhaustive && turn >= (pushDescriptors ? 2u : 1u)) continue;
      const Tuning tuning = tunings[number];
      samples::RunOptions options;
      options.tuning = tuning;
      const samples::BatchResult other = run(crowd.requests, options);
      for (std::size_t i = 0; i < crowd.requests.size(); ++i) {
        expectSameBytes(first.instances[i], other.instances[i],
                        "workgroups of " + std::to_string(tuning.workgroupSize) + ", instance " +
                            std::to_string(i));
      }
    }
  }
}

// First, last, alone, among all other methods, and beside a palette that may scale or not.
TEST_P(MethodTest, Truth20_ThePlaceInTheBatchChangesNoBit) {
  const MixedCrowd crowd = crowdOf(GetParam());
  const samples::BatchResult together = run(crowd.requests);
  std::vector<samples::SkinRequest> backwards(crowd.requests.rbegin(), crowd.requests.rend());
  for (const Method method : allMethods) {
    backwards.insert(backwards.begin() + 3,
                     {&crowd.packedMeshes[1], crowd.poses[2], JointPromise::scaling, method});
  }
  const samples::BatchResult among = run(backwards);
  for (std::size_t i = 0; i < crowd.requests.size(); ++i) {
    const std::size_t place = backwards.size() - 1 - i;
    const std::size_t moved =
        i >= crowd.requests.size() - 3 ? crowd.requests.size() - 1 - i : place;
    expectSameBytes(together.instances[i], among.instances[moved], std::to_string(i));
    expectSameBytes(together.instances[i], run({&crowd.requests[i], 1}).instances[0],
                    "alone, " + std::to_string(i));
  }
}

// Alone, a mesh of up to two influences gets a kernel for two; beside one of nine, the kernel for
// any number.
TEST_P(MethodTest, Truth20_TheVariantForFewerInfluencesChangesNoBit) {
  OwnedMesh nine = randomMesh(2, 100, 10, 9);
  const PackedMesh packedNine = *pack(nine.view(), 10);
  for (const std::uint32_t influences : {1u, 2u, 3u, 4u}) {
    OwnedMesh few = randomMesh(influences, 500, 10, influences);
    const PackedMesh packedFew = *pack(few.view(), 10);
    for (const Rigidity rigidity :
         {Rigidity::rigid, Rigidity::shear, Rigidity::mirrored, Rigidity::mirroredAlongOneAxis}) {
      const std::vector<JointMatrix> pose = randomPose(3, 10, rigidity);
      const std::vector<samples::SkinRequest> requests{
          {&packedFew, pose, JointPromise::scaling, GetParam()},
          {&packedNine, pose, JointPromise::scaling, GetParam()}};
      expectSameBytes(run(requests).instances[0], run({&requests[0], 1}).instances[0],
                      std::to_string(influences));
    }
  }
}

// A rigid pose whose palette may scale is skinned by the two-phase kernel, with S left out.
TEST_P(MethodTest, Truth20_NoPromiseChangesABitOfARigidPose) {
  OwnedMesh mesh = randomMesh(4, 300, 10, 4);
  const PackedMesh packedMesh = *pack(mesh.view(), 10);
  const std::vector<JointMatrix> pose = randomPose(5, 10, Rigidity::rigid);
  const samples::SkinRequest may{&packedMesh, pose, JointPromise::scaling, GetParam()},
      mayNot{&packedMesh, pose, JointPromise::scaleIgnored, GetParam()},
      rigid{&packedMesh, pose, JointPromise::rigid, GetParam()};
  expectSameBytes(run({&may, 1}).instances[0], run({&mayNot, 1}).instances[0], "rigid");
  expectSameBytes(run({&may, 1}).instances[0], run({&rigid, 1}).instances[0], "promised rigid");
}

// ---- 14: an influence of weight 0 is none

TEST_P(MethodTest, Truth14_AnInfluenceOfWeightZeroHasNoEffectInAnyBit) {
  for (const Rigidity rigidity : {Rigidity::rigid, Rigidity::shear}) {
    OwnedMesh mesh = randomMesh(5, 300, 8, 4), without = mesh;
    for (std::size_t slot = 0; slot < mesh.joints.size(); ++slot) {
      if (mesh.joints[slot] == 7) mesh.weights[slot] = without.weights[slot] = 0;
      if (mesh.weights[slot] == 0) without.joints[slot] = 0;
      // Without weight a joint outside the pose is none either.
      if (mesh.weights[slot] == 0 && slot % 3 == 0) mesh.joints[slot] = 0xffffffffu;
    }
    const std::vector<JointMatrix> pose = randomPose(6, 8, rigidity);
    const samples::SkinnedVertices expected = skin(without, pose, GetParam());
    const float infinity = std::numeric_limits<float>::infinity();
    for (const float bad : {nan, infinity, -infinity, 3e38f}) {
      // A finite joint that scales puts all of its palette through two phases, which change no bit
      // of what rigid joints do.
      std::vector<JointMatrix> broken = pose;
      for (auto& row : broken[7].m) std::fill_n(row, 4, bad);
      expectSameBytes(skin(mesh, broken, GetParam()), expected, std::to_string(bad));
    }
  }
}

TEST_P(MethodTest, AJointThatScalesKeepsThoseOfRigidJointsInsideTheirBounds) {
  OwnedMesh mesh = randomMesh(5, 300, 8, 4);
  for (std::size_t slot = 0; slot < mesh.joints.size(); ++slot) {
    if (mesh.joints[slot] == 7) mesh.weights[slot] = 0;
  }
  std::vector<JointMatrix> pose = randomPose(6, 8, Rigidity::rigid);
  for (auto& row : pose[7].m) std::fill_n(row, 4, 3e38f);
  const Comparison comparison = compared(mesh, pose, GetParam());
  EXPECT_TRUE(comparison.passed()) << comparison.worstPosition << ", " << comparison.worstNormal;
}

// A NaN where there is weight stays with the vertices that have it.
TEST_P(MethodTest, Truth14_ANaNStaysWithTheVerticesThatHaveItsJoint) {
  OwnedMesh mesh = randomMesh(7, 300, 8, 3);
  std::vector<JointMatrix> pose = randomPose(8, 8, Rigidity::rigid);
  const samples::SkinnedVertices before = skin(mesh, pose, GetParam());
  pose[2].m[1][1] = nan;
  const samples::SkinnedVertices after = skin(mesh, pose, GetParam());
  for (std::size_t vertex = 0; vertex < mesh.vertexCount(); ++vertex) {
    bool touched = false;
    for (std::size_t slot = 3 * vertex; slot < 3 * vertex + 3; ++slot)
      touched |= mesh.joints[slot] == 2 && mesh.weights[slot] != 0;
    bool same = true, finite = true;
    for (std::size_t i = 3 * vertex; i < 3 * vertex + 3; ++i) {
      finite &= std::isfinite(after.positions[i]);
      same &= std::bit_cast<std::uint32_t>(after.positions[i]) ==
              std::bit_cast<std::uint32_t>(before.positions[i]);
    }
    if (touched) {
      EXPECT_FALSE(finite) << vertex;
    } else {
      EXPECT_TRUE(same) << vertex;
    }
  }
}

// ---- 8: rigid joints, rigid result

TEST_P(MethodTest, Truth08_RigidJointsGiveARigidResult) {
  // Linear blending shrinks: there that is looked for.
  const bool shrinks = GetParam() == Method::linear || GetParam() == Method::blended;
  int shrunk = 0;
  // Four vertices a body, of the same weights and the same center of rotation.
  OwnedMesh mesh = randomMesh(9, 1000, 30, 4);
  for (std::size_t vertex = 0; vertex < 1000; ++vertex) {
    const std::size_t body = vertex / 4 * 4;
    for (std::size_t i = 0; i < 3; ++i) {
      mesh.positions[3 * vertex + i] = vertex % 4 == i + 1 ? 1.0f : 0.0f;
      mesh.centersOfRotation[3 * vertex + i] = mesh.centersOfRotation[3 * body + i];
    }
    for (std::size_t slot = 0; slot < 4; ++slot) {
      mesh.joints[4 * vertex + slot] = mesh.joints[4 * body + slot];
      mesh.weights[4 * vertex + slot] = mesh.weights[4 * body + slot];
    }
    mesh.bulgeStrengths[vertex] = mesh.bulgeStrengths[body];
  }
  const std::vector<JointMatrix> pose = randomPose(10, 30, Rigidity::rigid);
  const samples::SkinnedVertices skinned = skin(mesh, pose, GetParam());
  const reference::AnalyzedMesh expected = *reference::analyze(mesh.view(), pose, GetParam());
  for (std::size_t body = 0; body < 1000; body += 4) {
    const auto at = [&](std::size_t vertex) {
      const float* p = &skinned.positions[3 * vertex];
      return glm::dvec3(p[0], p[1], p[2]);
    };
    const glm::dmat3 r(at(body + 1) - at(body), at(body + 2) - at(body), at(body + 3) - at(body));
    const glm::dmat3 gram = glm::transpose(r) * r;
    const reference::Conditioning& conditioning = expected.conditioning[body + 1];
    if (conditioning.signAmbiguous) continue;
    if (shrinks) {
      if (glm::determinant(r) < 0.9) ++shrunk;
      continue;
    }
    // Differences of points that lie elsewhere.
    const double allowed = 3e-6 * conditioning.turning * (1 + conditioning.leverage);
    for (int i = 0; i < 9; ++i)
      EXPECT_NEAR(gram[i / 3][i % 3], i % 4 == 0 ? 1 : 0, allowed) << body;
    EXPECT_NEAR(glm::determinant(r), 1, allowed) << body;
  }
  EXPECT_EQ(shrunk > 50, shrinks);
}

// ---- 9, 12, 13: turns about one axis

/// The angle by which the first vertex' (1, 0, 0) was turned, and its distance from the axis.
struct Turned {
  double angle, radius;
};

Turned turnedOf(const samples::SkinnedVertices& skinned) {
  const auto x = static_cast<double>(skinned.positions[0]);
  const auto y = static_cast<double>(skinned.positions[1]);
  const double angle = std::atan2(y, x) * 180 / pi;
  return {angle < -1e-3 ? angle + 360 : angle, std::hypot(x, y)};
}

/// (1, 0, 0) between joints 0, 1, …; its center of rotation on the axis; of `blended` the dual
/// quaternions.
OwnedMesh pointOf(std::vector<float> weights) {
  OwnedMesh mesh;
  mesh.influencesPerVertex = static_cast<std::uint32_t>(weights.size());
  mesh.positions = {1, 0, 0};
  mesh.centersOfRotation = {0, 0, 0};
  mesh.dualQuaternionWeights = {1};
  for (std::uint32_t joint = 0; joint < weights.size(); ++joint) mesh.joints.push_back(joint);
  mesh.weights = std::move(weights);
  return mesh;
}

/// Which turn: linear blending none, iterative blending and logarithms at constant speed, the rest
/// as dual quaternions.
bool turnsAsDualQuaternions(Method method) {
  return method != Method::linear && method != Method::dualQuaternionIterative &&
         method != Method::logMatrix;
}

TEST_P(MethodTest, Truth09_CandyWrapper) {
  for (const double degrees : {60.0, 90.0, 120.0, 179.0}) {
    const std::vector<JointMatrix> pose{JointMatrix{}, turnAboutZ(degrees)};
    for (const float weight : {0.25f, 0.5f, 0.75f}) {
      OwnedMesh mesh = pointOf({1 - weight, weight});
      const Turned turned = turnedOf(skin(mesh, pose, GetParam()));
      const double w = static_cast<double>(weight), half = degrees * pi / 360;
      const double sine = std::sin(half);
      const bool linear = GetParam() == Method::linear;
      EXPECT_NEAR(turned.radius, linear ? std::sqrt(1 - 4 * w * (1 - w) * sine * sine) : 1, 1e-6);
      if (linear) continue;
      const double byDlb = 2 * std::atan2(w * sine, 1 - w + w * std::cos(half)) * 180 / pi;
      EXPECT_NEAR(turned.angle, turnsAsDualQuaternions(GetParam()) ? byDlb : w * degrees, 1e-4);
    }
  }
}

TEST_P(MethodTest, Truth12_TheLowerOfTwoStrongestJointsIsThePivot) {
  const std::vector<JointMatrix> pose{turnAboutZ(0), turnAboutZ(170), turnAboutZ(-170)};
  OwnedMesh mesh = pointOf({0.1f, 0.45f, 0.45f});
  const Turned turned = turnedOf(skin(mesh, pose, GetParam()));
  if (turnsAsDualQuaternions(GetParam())) {
    EXPECT_NEAR(turned.angle, 167.27, 0.005);
  } else if (GetParam() == Method::dualQuaternionIterative) {
    EXPECT_NEAR(turned.angle, 162, 0.001);
  } else if (GetParam() == Method::logMatrix) {
    EXPECT_NEAR(turned.angle, 0, 0.001);
  } else {
    EXPECT_NEAR(turned.radius, std::abs(0.1 - 0.9 * std::cos(10 * pi / 180)), 1e-6);
  }
}

TEST_P(MethodTest, Truth13_OnATieOfThreeTheLowestJointIsThePivot) {
  const std::vector<JointMatrix> pose{turnAboutZ(0), turnAboutZ(140), turnAboutZ(220)};
  const float third = 1.0f / 3, more = std::nextafter(third, 1.0f);
  const bool iterative = GetParam() == Method::dualQuaternionIterative;
  OwnedMesh tie = pointOf({third, third, third}), second = pointOf({third, more, third}),
            last = pointOf({third, third, more});
  if (GetParam() == Method::linear || GetParam() == Method::logMatrix) {
    // No pivot in them: a mean of points, 1 and twice cos 140°, or of angles, 0, 140 and −140.
    for (OwnedMesh* mesh : {&tie, &second, &last}) {
      const Turned turned = turnedOf(skin(*mesh, pose, GetParam()));
      const bool linear = GetParam() == Method::linear;
      EXPECT_NEAR(turned.angle, linear ? 180 : 0, 1e-3);
      EXPECT_NEAR(turned.radius, linear ? -(1 + 2 * std::cos(140 * pi / 180)) / 3 : 1, 1e-6);
    }
    return;
  }
  EXPECT_NEAR(turnedOf(skin(tie, pose, GetParam())).angle, 0, 1e-3);
  EXPECT_NEAR(turnedOf(skin(second, pose, GetParam())).angle, iterative ? 120 : 123.97, 0.006);
  EXPECT_NEAR(turnedOf(skin(last, pose, GetParam())).angle, iterative ? 240 : 236.03, 0.006);
}

// ---- 16 and 19: inside the bound, far from the origin and with an exporter's scale

TEST_P(MethodTest, Truth16_InsideItsBoundAt10000UnitsFromTheOrigin) {
  OwnedMesh mesh = randomMesh(11, 2000, 30, 4);
  const Comparison comparison =
      compared(mesh, randomPose(12, 30, Rigidity::rigid, 10000), GetParam());
  EXPECT_TRUE(comparison.passed()) << comparison.worstPosition << " of the bound";
  EXPECT_EQ(comparison.compared, 2000u);
}

TEST_P(MethodTest, Truth19_AScaleOf100IsKept) {
  OwnedMesh mesh = randomMesh(13, 2000, 30, 4);
  std::vector<JointMatrix> pose = randomPose(14, 30, Rigidity::rigid);
  for (JointMatrix& joint : pose) {
    for (auto& row : joint.m) {
      for (int column = 0; column < 3; ++column) row[column] *= 100;
    }
  }
  const Comparison comparison = compared(mesh, pose, GetParam());
  EXPECT_TRUE(comparison.passed()) << comparison.worstPosition << " of the bound";
  EXPECT_EQ(comparison.compared, 2000u);
  // One influence: its whole matrix, scale and mirror too.
  for (const Rigidity rigidity :
       {Rigidity::uniformScale, Rigidity::shear, Rigidity::mirroredAlongOneAxis}) {
    OwnedMesh single = randomMesh(15, 500, 30, 1);
    const std::vector<JointMatrix> joints = randomPose(16, 30, rigidity);
    const samples::SkinnedVertices skinned = skin(single, joints, GetParam());
    const reference::SkinnedMesh linear = *reference::skin(single.view(), joints, Method::linear);
    const reference::SkinnedMesh expected = *reference::skin(single.view(), joints, GetParam());
    for (std::size_t vertex = 0; vertex < 500; ++vertex) {
      for (std::size_t i = 0; i < 3; ++i) {
        EXPECT_NEAR(static_cast<double>(skinned.positions[3 * vertex + i]),
                    linear.positions[vertex][i], expected.bounds[vertex].position);
      }
    }
  }
}

// ---- What only some methods want

// Shares and centres of the whole mesh or of each vertex, as the reference reads them.
TEST_P(MethodTest, SharesMayBeTheMeshsOwn) {
  OwnedMesh mesh = randomMesh(17, 500, 20, 4);
  mesh.dualQuaternionWeights.clear();
  mesh.bulgeStrengths.clear();
  const std::vector<JointMatrix> pose = randomPose(18, 20, Rigidity::rigid);
  std::vector<samples::SkinnedVertices> all;
  for (const float share : {0.0f, 0.25f, 1.0f}) {
    MeshView view = mesh.view();
    view.dualQuaternionWeight = view.bulgeStrength = share;
    const PackedMesh packedMesh = *pack(view, 20);
    const samples::SkinRequest request{&packedMesh, pose, JointPromise::scaling, GetParam()};
    samples::BatchResult result = run({&request, 1});
    const Result<reference::SkinnedMesh> expected = reference::skin(view, pose, GetParam());
    EXPECT_TRUE(compareWithReference(*expected, result.instances[0].view())->passed()) << share;
    all.push_back(std::move(result.instances[0]));
  }
  const bool shares = GetParam() == Method::blended || GetParam() == Method::bulgeControlled;
  EXPECT_EQ(all[0].positions == all[1].positions, !shares);
  EXPECT_EQ(all[1].positions == all[2].positions, !shares);
}

// One pose as dual quaternions and as logarithms, in one batch.
TEST_P(MethodTest, APoseInTwoFormsIsTheSamePose) {
  const MixedCrowd crowd = crowdOf(GetParam());
  std::vector<samples::SkinRequest> requests;
  for (const samples::SkinRequest& request : crowd.requests) {
    requests.push_back(request);
    requests.push_back(
        {request.mesh, request.pose, JointPromise::scaling,
         GetParam() == Method::logMatrix ? Method::dualQuaternion : Method::logMatrix});
  }
  const samples::BatchResult alone = run(crowd.requests), both = run(requests);
  for (std::size_t i = 0; i < crowd.requests.size(); ++i) {
    expectSameBytes(alone.instances[i], both.instances[2 * i], std::to_string(i));
    if (GetParam() == Method::linear) continue;
    EXPECT_EQ(both.instances[2 * i].status->nonRigidJoints,
              both.instances[2 * i + 1].status->nonRigidJoints);
    EXPECT_EQ(both.instances[2 * i].status->twoPhase, both.instances[2 * i + 1].status->twoPhase);
  }
}

std::string nameOfCase(const ::testing::TestParamInfo<Method>& method) {
  return std::string(methodName(method.param));
}

// ---- what methods say of each other

TEST_F(SomeMethodsTest, BlendedWithAllWeightOnDualQuaternionsIsTheirsToTheBit) {
  for (const Rigidity rigidity : {Rigidity::rigid, Rigidity::shear, Rigidity::mirrored}) {
    OwnedMesh mesh = randomMesh(20, 500, 12, 5);
    addTangents(mesh, 21);
    std::fill(mesh.dualQuaternionWeights.begin(), mesh.dualQuaternionWeights.end(), 1.0f);
    const std::vector<JointMatrix> pose = randomPose(22, 12, rigidity);
    expectSameBytes(skin(mesh, pose, Method::blended), skin(mesh, pose, Method::dualQuaternion),
                    "all weight on dual quaternions");
  }
}

// DIB of two transforms is their screw motion.
TEST_F(SomeMethodsTest, Truth07_IterativeBlendingOfTwoJointsIsTheScrewBetweenThem) {
  constexpr std::uint32_t steps = 101;
  OwnedMesh mesh = randomMesh(23, steps, 2, 2);
  for (std::uint32_t step = 0; step < steps; ++step) {
    const float share = static_cast<float>(step) / (steps - 1);
    for (std::uint32_t slot = 0; slot < 2; ++slot) {
      mesh.joints[2 * step + slot] = slot;
      mesh.weights[2 * step + slot] = slot == 0 ? 1 - share : share;
    }
  }
  for (std::uint32_t seed = 0; seed < 10; ++seed) {
    const std::vector<JointMatrix> pose = randomPose(30 + seed, 2, Rigidity::rigid);
    const samples::SkinnedVertices skinned = skin(mesh, pose, Method::dualQuaternionIterative);
    const auto transform = [&pose](std::size_t joint) {
      return normalize(fromRigidMatrix(glm::dmat4x3(toColumns<glm::mat4x3>(pose[joint]))));
    };
    for (std::uint32_t step = 0; step < steps; ++step) {
      const DualQuatd between = screwInterpolate(transform(0), transform(1),
                                                 static_cast<double>(mesh.weights[2 * step + 1]));
      const glm::dvec3 bind(mesh.positions[3 * step], mesh.positions[3 * step + 1],
                            mesh.positions[3 * step + 2]);
      const glm::dvec3 expected = transformPoint(between, bind);
      const glm::dvec3 actual(skinned.positions[3 * step], skinned.positions[3 * step + 1],
                              skinned.positions[3 * step + 2]);
      EXPECT_LE(glm::length(actual - expected), 2e-5) << "pose " << seed << ", vertex " << step;
    }
  }
}

INSTANTIATE_TEST_SUITE_P(Methods, MethodTest, ::testing::ValuesIn(allMethods), nameOfCase);

}  // namespace
}  // namespace dermis::test
