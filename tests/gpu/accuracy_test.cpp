// The GPU against the reference: every vertex of random rigs inside the bounds of the accuracy
// contract.

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <functional>
#include <random>
#include <tuple>

#include <glm/gtc/quaternion.hpp>
#include <glm/mat3x3.hpp>

#include "dermis/mesh.h"
#include "dermis/verify.h"
#include "kit/batch_runner.h"
#include "random_rig.h"
#include "test_device.h"

namespace dermis::test {
namespace {

struct Case {
  std::uint32_t vertices;
  std::uint32_t joints;
  std::uint32_t influences;
};

class AccuracyTest : public DeviceTest,
                     public ::testing::WithParamInterface<std::tuple<Method, Rigidity, Case>> {};

Comparison skinAndCompare(samples::Device& device, vulkan::Context& context, OwnedMesh& mesh,
                          std::span<const JointMatrix> pose, Method method) {
  Result<PackedMesh> packed = pack(mesh.view(), static_cast<std::uint32_t>(pose.size()));
  EXPECT_TRUE(packed.ok()) << (packed ? "" : packed.error().message);
  const samples::SkinRequest request{&*packed, pose, JointPromise::scaling, method};
  samples::RunOptions options;
  options.output.gap = 8;
  Result<samples::BatchResult> result = samples::runBatch(device, context, {&request, 1}, options);
  EXPECT_TRUE(result.ok()) << (result ? "" : result.error().message);
  if (!result) return {};
  EXPECT_EQ(result->untouchedBytesChanged, 0u);
  const samples::SkinnedVertices& skinned = result->instances[0];
  Result<reference::SkinnedMesh> expected = reference::skin(mesh.view(), pose, method);
  EXPECT_TRUE(expected.ok());
  // All joints are finite: no vertex is without an answer.
  const Exemptions exemptions{exemptionsOf(*expected).onlyFinite, 0};
  Result<Comparison> comparison = compareWithReference(*expected, skinned.view(), exemptions);
  EXPECT_TRUE(comparison.ok());
  return *comparison;
}

TEST_P(AccuracyTest, EveryVertexIsInsideItsBound) {
  const auto [method, rigidity, counts] = GetParam();
  OwnedMesh mesh = randomMesh(1, counts.vertices, counts.joints, counts.influences);
  const std::vector<JointMatrix> pose = randomPose(2, counts.joints, rigidity);
  const Comparison comparison = skinAndCompare(device(), context(), mesh, pose, method);
  RecordProperty("worstPosition", std::to_string(comparison.worstPosition));
  RecordProperty("worstNormal", std::to_string(comparison.worstNormal));
  EXPECT_TRUE(comparison.passed())
      << "positions up to " << comparison.worstPosition << " of the bound, vertex "
      << comparison.worstPositionVertex << "; normals up to " << comparison.worstNormal
      << ", vertex " << comparison.worstNormalVertex << "; " << comparison.failures
      << " failures, the first at " << comparison.firstFailure;
  EXPECT_EQ(comparison.compared + comparison.exempt.onlyFinite, mesh.vertexCount());
  // Hardly any may escape the comparison, whatever the reference says of itself.
  EXPECT_LE(comparison.exempt.onlyFinite, mesh.vertexCount() / 1000);
  EXPECT_LE(comparison.onlyUnitNormals, mesh.vertexCount() / 1000);
}

std::string caseName(const ::testing::TestParamInfo<AccuracyTest::ParamType>& info) {
  const auto [method, rigidity, counts] = info.param;
  const char* rigidities[] = {"rigid", "scale", "shear", "mirrored", "oneAxisMirrored"};
  return std::string(methodName(method)) + "_" + rigidities[static_cast<int>(rigidity)] + "_" +
         std::to_string(counts.vertices) + "v_" + std::to_string(counts.joints) + "j_" +
         std::to_string(counts.influences) + "i";
}

INSTANTIATE_TEST_SUITE_P(
    RandomRigs, AccuracyTest,
    ::testing::Combine(::testing::ValuesIn(allMethods),
                       ::testing::Values(Rigidity::rigid, Rigidity::uniformScale, Rigidity::shear,
                                         Rigidity::mirrored, Rigidity::mirroredAlongOneAxis),
                       ::testing::Values(Case{1, 1, 1}, Case{63, 2, 2}, Case{64, 3, 4},
                                         Case{65, 300, 4}, Case{1234, 50, 8}, Case{5000, 300, 17})),
    caseName);
// More vertices than 16 bits count.
INSTANTIATE_TEST_SUITE_P(LargeRigs, AccuracyTest,
                         ::testing::Combine(::testing::ValuesIn(allMethods),
                                            ::testing::Values(Rigidity::shear),
                                            ::testing::Values(Case{70001, 300, 4})),
                         caseName);

/// Joints that a test makes itself, each from its own random numbers.
class JointsTest : public DeviceTest {
 protected:
  double normal() { return std::normal_distribution<double>()(engine_); }
  double between(double low, double high) {
    return std::uniform_real_distribution<double>(low, high)(engine_);
  }
  glm::dmat3 rotation() {
    return glm::mat3_cast(glm::normalize(glm::dquat(normal(), normal(), normal(), normal())));
  }
  glm::dmat3 rotationAbout(const glm::dvec3& axis, double angle) {
    return glm::mat3_cast(glm::angleAxis(angle, axis));
  }
  JointMatrix joint(const glm::dmat3& linear, double reach) {
    JointMatrix matrix;
    for (int row = 0; row < 3; ++row) {
      for (int column = 0; column < 3; ++column) {
        matrix.m[row][column] = static_cast<float>(linear[column][row]);
      }
      matrix.m[row][3] = static_cast<float>(reach * between(-1, 1));
    }
    return matrix;
  }

  samples::BatchResult skin(OwnedMesh& mesh, std::span<const JointMatrix> pose, Method method) {
    const Result<PackedMesh> packed = pack(mesh.view(), static_cast<std::uint32_t>(pose.size()));
    EXPECT_TRUE(packed.ok());
    const samples::SkinRequest request{&*packed, pose, JointPromise::scaling, method};
    samples::RunOptions options;
    options.output.tangents = VertexFormat::float32x4;
    Result<samples::BatchResult> result =
        samples::runBatch(device(), context(), {&request, 1}, options);
    EXPECT_TRUE(result.ok()) << (result ? "" : result.error().message);
    return *result;
  }
  Comparison compared(OwnedMesh& mesh, std::span<const JointMatrix> pose, Method method) {
    return compared(mesh, pose, method, skin(mesh, pose, method));
  }
  Comparison compared(OwnedMesh& mesh, std::span<const JointMatrix> pose, Method method,
                      const samples::BatchResult& result) {
    const reference::SkinnedMesh expected = *reference::skin(mesh.view(), pose, method);
    const Exemptions exemptions{exemptionsOf(expected).onlyFinite, 0};
    return *compareWithReference(expected, result.instances[0].view(), exemptions);
  }

 private:
  std::mt19937 engine_{5};
};

double largestRowSum(const JointMatrix& matrix) {
  double largest = 0;
  for (int a = 0; a < 3; ++a) {
    double sum = 0;
    for (int b = 0; b < 3; ++b) {
      double entry = a == b ? -1 : 0;
      for (int row = 0; row < 3; ++row) {
        entry += static_cast<double>(matrix.m[row][a]) * static_cast<double>(matrix.m[row][b]);
      }
      sum += std::abs(entry);
    }
    largest = std::max(largest, sum);
  }
  return largest;
}

// What is not decomposed is not only stretched: the quaternion read off it would be turned by more.
TEST_F(JointsTest, OnEitherSideOfTheThresholdOfRigidJoints) {
  constexpr std::uint32_t count = 2000;
  OwnedMesh mesh = randomMesh(3, 20000, count, 1);
  addTangents(mesh, 4);
  for (const auto& [least, greatest, rigid] :
       {std::tuple{6.8e-6, 7.5e-6, true}, {7.5e-6, 8.5e-6, false}, {8.6e-6, 9.2e-6, false}}) {
    std::vector<JointMatrix> pose;
    while (pose.size() < count) {
      glm::dmat3 linear = rotation();
      for (int i = 0; i < 9; ++i) linear[i / 3][i % 3] += between(-4e-6, 4e-6);
      const JointMatrix candidate = joint(linear, 0);
      const double sum = largestRowSum(candidate);
      if (sum >= least && sum <= greatest) pose.push_back(candidate);
    }
    for (const Method method : allMethods) {
      const samples::BatchResult result = skin(mesh, pose, method);
      const std::uint32_t nonRigid = result.instances[0].status->nonRigidJoints;
      if (method != Method::linear) {
        EXPECT_LE(nonRigid, rigid ? 0u : count);
        EXPECT_GE(nonRigid, least > 8.5e-6 ? count : 0u);
      }
      const Comparison comparison = compared(mesh, pose, method, result);
      EXPECT_TRUE(comparison.passed())
          << methodName(method) << ", row sums from " << least << ": " << comparison.failures
          << " failures, positions " << comparison.worstPosition << " of the bound, normals "
          << comparison.worstNormal << ", tangents " << comparison.worstTangent;
      EXPECT_EQ(comparison.compared, mesh.vertexCount());
    }
  }
}

// A file's rotations, rounded to float32, need no decomposition.
TEST_F(JointsTest, RotationsThatWereRoundedAreRigid) {
  constexpr std::uint32_t count = 5000;
  OwnedMesh mesh = randomMesh(3, 100, count, 1);
  std::vector<JointMatrix> pose;
  for (std::uint32_t i = 0; i < count; ++i) pose.push_back(joint(rotation(), 1));
  EXPECT_EQ(skin(mesh, pose, Method::dualQuaternion).instances[0].status->nonRigidJoints, 0u);
}

// Joints as far from a rotation, from each other and from 1 as float32 allows.
TEST_F(JointsTest, AtTheEdgesOfFloat32) {
  using Make = std::function<JointMatrix(std::uint32_t)>;
  const auto stretched = [this](double x, double y, double z) {
    return rotation() * glm::dmat3(x, 0, 0, 0, y, 0, 0, 0, z);
  };
  const auto power = [this](double greatest) { return std::pow(10, between(-greatest, greatest)); };
  struct Kind {
    const char* name;
    Make make;
    bool compared = true;  ///< false: only asked to be finite, but for `linear`
  };
  const std::vector<Kind> kinds{
      {"stretch", [&](std::uint32_t) { return joint(stretched(1000, 1, 1), 1); }},
      {"squash and stretch", [&](std::uint32_t) { return joint(stretched(100, 0.1, 0.1), 1); }},
      {"any stretch", [&](std::uint32_t) { return joint(stretched(power(3), 1, power(3)), 1); }},
      {"shear",
       [&](std::uint32_t) {
         return joint(rotation() * glm::dmat3(1, 0, 0, 30 * normal(), 1, 0, 0, normal(), 1), 1);
       }},
      {"nearly rigid",
       [&](std::uint32_t) {
         const auto near = [&] { return 1 + between(-1e-6, 1e-6); };
         return joint(stretched(near(), near(), near()), 1);
       }},
      {"half turns",
       [&](std::uint32_t j) {
         const glm::dvec3 axis = glm::normalize(glm::dvec3(1, 0.1 * normal(), 0.1 * normal()));
         return joint(rotationAbout(axis, j % 2 == 0 ? 0 : 3.14159265 * between(0.99, 0.9999)), 1);
       }},
      {"far", [&](std::uint32_t) { return joint(rotation(), 1e20); }},
      {"tiny", [&](std::uint32_t) { return joint(stretched(1e-30, 1e-30, 1e-30), 1e-30); }},
      {"huge", [&](std::uint32_t) { return joint(stretched(1e18, 1e18, 1e18), 1e18); }},
      {"huge and tiny",
       [&](std::uint32_t j) {
         const double scale = j % 2 == 0 ? 1e6 : 1e-6;
         return joint(stretched(scale, scale, scale), 1);
       }},
      {"flat", [&](std::uint32_t) { return joint(stretched(1, 1, 0), 1); }},
      {"subnormal", [&](std::uint32_t) { return joint(stretched(3e-39, 3e-39, 3e-39), 1e-39); },
       false},
  };
  OwnedMesh mesh = randomMesh(3, 1500, 12, 4);
  addTangents(mesh, 4);
  for (const Kind& kind : kinds) {
    for (int repeat = 0; repeat < 2; ++repeat) {
      std::vector<JointMatrix> pose;
      for (std::uint32_t j = 0; j < 12; ++j) pose.push_back(kind.make(j));
      for (const Method method : allMethods) {
        const Comparison comparison = compared(mesh, pose, method);
        EXPECT_TRUE(comparison.passed())
            << kind.name << ", " << methodName(method) << ": " << comparison.failures
            << " failures, positions " << comparison.worstPosition << " of the bound, normals "
            << comparison.worstNormal << ", tangents " << comparison.worstTangent;
        EXPECT_EQ(comparison.compared + comparison.exempt.onlyFinite, mesh.vertexCount());
        if (method == Method::linear || kind.compared) {
          EXPECT_LE(comparison.exempt.onlyFinite, mesh.vertexCount() / 20) << kind.name;
        } else {
          // Vertices without influences are compared all the same.
          EXPECT_GE(comparison.exempt.onlyFinite, mesh.vertexCount() * 9 / 10) << kind.name;
        }
      }
    }
  }
}

}  // namespace
}  // namespace dermis::test
