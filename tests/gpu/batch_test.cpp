// Batches on the device: many instances in few dispatches, each as if it were alone.

#include <gtest/gtest.h>

#include <algorithm>
#include <bit>
#include <cmath>
#include <limits>

#include "dermis/verify.h"
#include "kit/batch_runner.h"
#include "random_rig.h"
#include "test_device.h"

namespace dermis::test {
namespace {

class BatchTest : public DeviceTest {
 protected:
  samples::BatchResult run(std::span<const samples::SkinRequest> requests,
                           const samples::RunOptions& options = {}) {
    Result<samples::BatchResult> result = samples::runBatch(device(), context(), requests, options);
    EXPECT_TRUE(result.ok()) << (result ? "" : result.error().message);
    return result ? std::move(*result) : samples::BatchResult{};
  }
};

PackedMesh packed(OwnedMesh& mesh, std::uint32_t jointCount) {
  return *pack(mesh.view(), jointCount);
}

std::uint64_t countDifferingBits(const std::vector<float>& a, const std::vector<float>& b) {
  if (a.size() != b.size()) return ~std::uint64_t{0};
  std::uint64_t count = 0;
  for (std::size_t i = 0; i < a.size(); ++i) {
    if (std::bit_cast<std::uint32_t>(a[i]) != std::bit_cast<std::uint32_t>(b[i])) ++count;
  }
  return count;
}

void expectSameBits(const samples::SkinnedVertices& a, const samples::SkinnedVertices& b) {
  EXPECT_EQ(countDifferingBits(a.positions, b.positions), 0u);
  EXPECT_EQ(countDifferingBits(a.normals, b.normals), 0u);
}

bool isFinite(const std::vector<float>& values) {
  return std::all_of(values.begin(), values.end(),
                     [](float value) { return std::isfinite(value); });
}

struct Crowd {
  std::vector<OwnedMesh> meshes;
  std::vector<PackedMesh> packedMeshes;
  std::vector<std::vector<JointMatrix>> poses;
  std::vector<samples::SkinRequest> requests;
};

Crowd makeCrowd(std::uint32_t instances) {
  Crowd crowd;
  const std::uint32_t vertices[] = {65, 200, 1234}, influences[] = {1, 4, 7};
  for (std::uint32_t mesh = 0; mesh < 3; ++mesh) {
    crowd.meshes.push_back(randomMesh(mesh, vertices[mesh], 30, influences[mesh]));
    crowd.packedMeshes.push_back(packed(crowd.meshes.back(), 30));
  }
  for (std::uint32_t instance = 0; instance < instances; ++instance) {
    crowd.poses.push_back(
        randomPose(100 + instance, 30, instance % 5 == 0 ? Rigidity::shear : Rigidity::rigid));
  }
  for (std::uint32_t instance = 0; instance < instances; ++instance) {
    crowd.requests.push_back({&crowd.packedMeshes[instance % 3], crowd.poses[instance],
                              JointPromise::scaling,
                              instance % 7 < 3 ? Method::linear : Method::dualQuaternion});
  }
  return crowd;
}

TEST_F(BatchTest, AThousandInstancesOfThreeMeshesTakeAtMostSixDispatches) {
  const Crowd crowd = makeCrowd(1000);
  const samples::BatchResult batch = run(crowd.requests);
  ASSERT_EQ(batch.instances.size(), 1000u);
  EXPECT_LE(batch.dispatches, 6u);
  // Each instance, bit for bit, as if it were alone.
  for (std::size_t instance = 0; instance < 1000; instance += 41) {
    SCOPED_TRACE(instance);
    expectSameBits(batch.instances[instance], run({&crowd.requests[instance], 1}).instances[0]);
  }
}

TEST_F(BatchTest, EveryInstanceAgreesWithTheReference) {
  Crowd crowd = makeCrowd(60);
  const samples::BatchResult batch = run(crowd.requests);
  for (std::size_t instance = 0; instance < crowd.requests.size(); ++instance) {
    const samples::SkinRequest& request = crowd.requests[instance];
    OwnedMesh& mesh = crowd.meshes[instance % 3];
    const reference::SkinnedMesh expected =
        *reference::skin(mesh.view(), request.pose, request.method);
    const samples::SkinnedVertices& skinned = batch.instances[instance];
    const Comparison comparison = *compareWithReference(expected, skinned.view());
    EXPECT_TRUE(comparison.passed()) << "instance " << instance << ": " << comparison.worstPosition
                                     << ", " << comparison.worstNormal;
  }
}

// TRUTHS 20: the result does not depend on how the work is cut up.
TEST_F(BatchTest, TuningAndDescriptorsChangeNoBit) {
  const Crowd crowd = makeCrowd(20);
  const samples::BatchResult first = run(crowd.requests);
  for (const bool pushDescriptors : {true, false}) {
    useDevice(pushDescriptors);
    for (const Tuning tuning :
         {Tuning{8, 1}, Tuning{16, 2}, Tuning{32, 5, 1000}, Tuning{8, 32, 0, 16}, Tuning{128, 4}}) {
      samples::RunOptions options;
      options.tuning = tuning;
      const samples::BatchResult other = run(crowd.requests, options);
      for (std::size_t i = 0; i < crowd.requests.size(); ++i)
        expectSameBits(first.instances[i], other.instances[i]);
    }
  }
}

TEST_F(BatchTest, BytesBetweenTheAttributesAreNeverTouched) {
  const Crowd crowd = makeCrowd(9);
  for (const std::uint32_t gap : {0u, 4u, 8u, 76u}) {
    samples::RunOptions options;
    options.output.gap = gap;
    EXPECT_EQ(run(crowd.requests, options).untouchedBytesChanged, 0u) << gap;
  }
}

TEST_F(BatchTest, NanInAPoseAffectsThatInstanceAlone) {
  Crowd crowd = makeCrowd(12);
  const samples::BatchResult before = run(crowd.requests);
  crowd.poses[4][3].m[1][1] = std::numeric_limits<float>::quiet_NaN();
  crowd.poses[6][0].m[0][3] = std::numeric_limits<float>::infinity();
  const samples::BatchResult after = run(crowd.requests);
  for (std::size_t instance = 0; instance < 12; ++instance) {
    if (instance == 4 || instance == 6) {
      EXPECT_FALSE(isFinite(after.instances[instance].positions));
    } else {
      expectSameBits(before.instances[instance], after.instances[instance]);
    }
    const bool isDualQuaternion = crowd.requests[instance].method == Method::dualQuaternion;
    EXPECT_EQ(after.instances[instance].status->nonFiniteJoints,
              isDualQuaternion && (instance == 4 || instance == 6) ? 1u : 0u);
  }
}

TEST_F(BatchTest, SingularJointsGiveFiniteVertices) {
  OwnedMesh mesh = randomMesh(7, 500, 6, 4);
  const PackedMesh packedMesh = packed(mesh, 6);
  std::vector<JointMatrix> pose = randomPose(8, 6, Rigidity::rigid);
  for (int row = 0; row < 3; ++row) {
    for (int column = 0; column < 3; ++column) pose[0].m[row][column] = 0;  // rank 0
    pose[1].m[row][1] = pose[1].m[row][2] = 0;                              // rank 1
    pose[2].m[row][0] = 0;                                                  // rank 2
    for (int column = 0; column < 3; ++column) pose[3].m[row][column] *= 1e-25f;
    for (int column = 0; column < 3; ++column) pose[4].m[row][column] *= 1e15f;
  }
  for (const Method method : allMethods) {
    for (const JointPromise promise : {JointPromise::scaling, JointPromise::rigid}) {
      const samples::SkinRequest request{&packedMesh, pose, promise, method};
      const samples::SkinnedVertices skinned = run({&request, 1}).instances[0];
      EXPECT_TRUE(isFinite(skinned.positions));
      EXPECT_TRUE(isFinite(skinned.normals));
    }
  }
}

TEST_F(BatchTest, TheStatusTellsWhatAPoseHolds) {
  OwnedMesh mesh = randomMesh(9, 100, 20, 4);
  const PackedMesh packedMesh = packed(mesh, 20);
  const std::vector<JointMatrix> rigid = randomPose(10, 20, Rigidity::rigid),
                                 shear = randomPose(10, 20, Rigidity::shear);
  const std::vector<samples::SkinRequest> requests{{&packedMesh, rigid, JointPromise::scaling},
                                                   {&packedMesh, shear, JointPromise::scaling},
                                                   {&packedMesh, shear, JointPromise::scaleIgnored},
                                                   {&packedMesh, rigid, JointPromise::scaleIgnored},
                                                   {&packedMesh, rigid, JointPromise::rigid},
                                                   {&packedMesh, shear, JointPromise::rigid}};
  const samples::BatchResult result = run(requests);
  const auto expectStatus = [&](std::size_t index, std::uint32_t twoPhase, std::uint32_t nonRigid,
                                std::uint32_t undeclared) {
    const PoseStatus& status = *result.instances[index].status;
    EXPECT_EQ(status.twoPhase, twoPhase) << index;
    EXPECT_EQ(status.nonRigidJoints, nonRigid) << index;
    EXPECT_EQ(status.undeclaredScale, undeclared) << index;
    EXPECT_EQ(status.nonFiniteJoints, 0u) << index;
  };
  expectStatus(0, 0, 0, 0);
  expectStatus(1, 1, 20, 0);
  expectStatus(2, 0, 20, 20);
  expectStatus(3, 0, 0, 0);
  expectStatus(4, 0, 0, 0);
  expectStatus(5, 0, 20, 20);
  // A rigid pose is skinned alike whatever was promised.
  expectSameBits(result.instances[0], result.instances[3]);
  expectSameBits(result.instances[0], result.instances[4]);
}

TEST_F(BatchTest, AVertexWithoutWeightStaysInBindPose) {
  OwnedMesh mesh = randomMesh(11, 64, 4, 4);
  std::fill(mesh.weights.begin(), mesh.weights.end(), 0.0f);
  const PackedMesh packedMesh = packed(mesh, 4);
  const std::vector<JointMatrix> pose = randomPose(12, 4, Rigidity::shear);
  for (const Method method : allMethods) {
    const samples::SkinRequest request{&packedMesh, pose, JointPromise::scaling, method};
    EXPECT_EQ(run({&request, 1}).instances[0].positions, mesh.positions);
  }
}

TEST_F(BatchTest, TheMostJointsAPoseMayHave) {
  OwnedMesh mesh = randomMesh(13, 2000, maxPoseJoints, 4);
  mesh.joints[0] = maxPoseJoints - 1;
  mesh.weights[0] = 1;
  const PackedMesh packedMesh = packed(mesh, maxPoseJoints);
  EXPECT_EQ(packedMesh.info().requiredJoints, maxPoseJoints);
  const std::vector<JointMatrix> pose = randomPose(14, maxPoseJoints, Rigidity::rigid);
  for (const Method method : allMethods) {
    const samples::SkinRequest request{&packedMesh, pose, JointPromise::scaleIgnored, method};
    const samples::SkinnedVertices skinned = run({&request, 1}).instances[0];
    const reference::SkinnedMesh expected = *reference::skin(mesh.view(), pose, method);
    EXPECT_TRUE(compareWithReference(expected, skinned.view())->passed());
  }
}

}  // namespace
}  // namespace dermis::test
