// Vertices that are skinned in poses of a bank are as near to those of the source as the reference
// says: in double precision, and by the CPU in float32.
#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <cstdio>
#include <random>
#include <span>
#include <string>
#include <vector>

#include "clip_rig.h"
#include "clip_variants.h"
#include "dermis/mesh.h"
#include "dermis/verify.h"
#include "few_cases.h"
#include "kit/batch_runner.h"
#include "random_number.h"
#include "random_rig.h"

namespace dermis::test {
namespace {

constexpr std::uint32_t posesOfRig = fewer(16u, 4u), vertexCount = 60;
constexpr std::array boundedMethods{Method::linear, Method::dualQuaternion, Method::blended,
                                    Method::centerOfRotation, Method::bulgeControlled};

/// The largest error ÷ bound of a method.
struct Worst {
  double position = 0, normal = 0, tangent = 0;
  std::uint64_t compared = 0, onlyFinite = 0;

  void add(const Comparison& comparison) {
    position = std::max(position, comparison.worstPosition);
    normal = std::max(normal, comparison.worstNormal);
    tangent = std::max(tangent, comparison.worstTangent);
    compared += comparison.compared;
    onlyFinite += comparison.exempt.onlyFinite;
  }
};

/// What the reference has, rounded to float32. Its bounds have room for that.
class Rounded {
 public:
  explicit Rounded(const reference::SkinnedMesh& skinned) {
    const auto copy = [](std::vector<float>& to, const auto& from) {
      for (const auto& vector : from)
        for (const double value : vector) to.push_back(static_cast<float>(value));
    };
    copy(positions_, skinned.positions);
    copy(normals_, skinned.normals);
    copy(tangents_, skinned.tangents);
  }

  SkinnedView view() const {
    const auto count = static_cast<std::uint32_t>(positions_.size() / 3);
    return {{positions_.data(), count, 12, VertexFormat::float32x3},
            {normals_.data(), count, 12, VertexFormat::float32x3},
            {tangents_.data(), count, 16, VertexFormat::float32x4}};
  }

 private:
  std::vector<float> positions_, normals_, tangents_;
};

/// As large as the skeleton, with morph targets.
OwnedMesh meshOf(const PackedRig& rig, std::uint32_t seed) {
  OwnedMesh mesh = randomMesh(seed, vertexCount, rig.bank->jointCount(0), 4);
  addTangents(mesh, seed);
  addMorphs(mesh, seed, 1);
  const auto extent = static_cast<float>(rig.extent());
  for (float& value : mesh.positions) value *= extent;
  for (float& value : mesh.centersOfRotation) value *= extent;
  return mesh;
}

class ClipsSkin : public ::testing::Test {
 protected:
  void check(const PackedRig& rig, std::uint32_t seed) {
    if (rig.bank->jointCount(0) == 0) return;
    std::mt19937 random(seed);
    OwnedMesh mesh = meshOf(rig, seed);
    const Result<PackedMesh> packed = pack(mesh.view(), rig.bank->jointCount(0));
    ASSERT_TRUE(packed.ok()) << packed.error().message;
    for (std::uint32_t i = 0; i < posesOfRig; ++i) {
      const std::vector<ClipLayer> layers = randomLayers(rig, random);
      const MorphWeight morph{0, static_cast<float>(between(random, 0, 1))};
      const Result<reference::SampledPose> expected = rig.expected(layers, 0);
      ASSERT_TRUE(expected.ok()) << expected.error().message;
      const std::vector<JointMatrix> pose = rig.sample(layers);
      for (const Method method : boundedMethods) {
        SCOPED_TRACE(methodName(method));
        const auto source = reference::skin(mesh.view(), *expected, method, {&morph, 1});
        const auto bank = reference::skin(mesh.view(), pose, method, {&morph, 1});
        ASSERT_TRUE(source.ok()) << source.error().message;
        ASSERT_TRUE(bank.ok()) << bank.error().message;
        samples::SkinRequest request{.mesh = &*packed, .pose = pose, .method = method};
        request.morphs = {&morph, 1};
        samples::RunOptions options;
        options.output.tangents = VertexFormat::float32x4;
        const auto result = samples::CpuTarget().run({&request, 1}, options);
        ASSERT_TRUE(result.ok()) << result.error().message;
        compare(*source, Rounded(*bank).view(), exact_[static_cast<std::size_t>(method)]);
        compare(*source, result->instances[0].view(), cpu_[static_cast<std::size_t>(method)]);
        if (HasFatalFailure()) return;
      }
    }
  }

  void compare(const reference::SkinnedMesh& source, const SkinnedView& view, Worst& worst) {
    const Result<Comparison> comparison = compareWithReference(source, view, exemptionsOf(source));
    ASSERT_TRUE(comparison.ok()) << comparison.error().message;
    ASSERT_TRUE(comparison->passed())
        << "vertex " << comparison->firstFailure << ": " << comparison->worstPosition << ", "
        << comparison->worstNormal << ", " << comparison->worstTangent << " of the bounds";
    worst.add(*comparison);
  }

  /// Prints what was found, and requires that positions and normals use so much of their bounds.
  void expectUsed(const char* what, double share) const {
    for (const Method method : boundedMethods) {
      const Worst& exact = exact_[static_cast<std::size_t>(method)];
      const Worst& cpu = cpu_[static_cast<std::size_t>(method)];
      std::printf(
          "%s, %s: %.3f (CPU %.3f) of the bound, normals %.3f (%.3f), tangents %.3f (%.3f); %llu "
          "vertices, %llu only finite\n",
          what, methodName(method).data(), exact.position, cpu.position, exact.normal, cpu.normal,
          exact.tangent, cpu.tangent, static_cast<unsigned long long>(exact.compared),
          static_cast<unsigned long long>(exact.onlyFinite));
      EXPECT_GT(exact.position, hasFewCases ? 0.01 : share) << methodName(method);
      EXPECT_GT(exact.normal, hasFewCases ? 0.01 : share) << methodName(method);
    }
  }

  std::array<Worst, allMethods.size()> exact_, cpu_;
};

TEST_F(ClipsSkin, ModelsAreWithinTheirBounds) {
  forEachAnimatedModel(2, [&](gltf::Model model, std::uint32_t number) {
    PackedRig rig(std::move(model));
    if (rig.clips.empty() || !rig.pack()) return;
    check(rig, number);
  });
  expectUsed("models", 0.3);
}

/// Nodes with shear and scale, and clips with splines, spins, and scales that change their sign.
TEST_F(ClipsSkin, StretchedRigsAreWithinTheirBounds) {
  std::uint32_t seed = 0;
  for (const ClipVariant variant : clipVariants) {
    SCOPED_TRACE(clipVariantName(variant));
    PackedRig rig(withVariant(armRig(), variant, 1));
    ClipView additive = rig.clips[1];
    additive.additive = true;
    rig.clips.push_back(additive);
    rig.masks = {Floats(arm::nodeCount, 0.25f)};
    ASSERT_TRUE(rig.pack());
    check(rig, ++seed);
  }
  expectUsed("stretched", 0.3);
}

TEST_F(ClipsSkin, RefusesWhatHasNoBounds) {
  PackedRig rig(armRig());
  ASSERT_TRUE(rig.pack());
  OwnedMesh mesh = meshOf(rig, 1);
  reference::SampledPose pose = *rig.expected({}, 0);
  const auto messageOf = [&](Method method) {
    const Result<reference::SkinnedMesh> skinned = reference::skin(mesh.view(), pose, method);
    EXPECT_EQ(skinned.error().code, ErrorCode::invalidArgument);
    return skinned.error().message;
  };
  EXPECT_EQ(messageOf(Method::logMatrix),
            "log_matrix has no bounds for sampled poses; these have: linear, dual_quaternion, "
            "blended, center_of_rotation, bulge_controlled");
  pose.bounds.clear();
  EXPECT_EQ(messageOf(Method::linear),
            "the pose has no bounds: samplePose needs the bank for them");
}

/// A joint with a singular inverse bind matrix may be anywhere, but moves only its own vertices.
TEST_F(ClipsSkin, JointsWithoutBoundsExemptTheirVertices) {
  PackedRig rig(armRig());
  ASSERT_TRUE(rig.pack());
  OwnedMesh mesh = meshOf(rig, 1);
  reference::SampledPose pose = *rig.expected({}, 0);
  std::uint64_t moved = 0;
  for (std::size_t vertex = 0; vertex < mesh.vertexCount(); ++vertex) {
    const auto slots = std::span(mesh.joints).subspan(4 * vertex, 4);
    const auto weights = std::span(mesh.weights).subspan(4 * vertex, 4);
    bool moves = false;
    for (std::size_t i = 0; i < 4; ++i) moves |= slots[i] == 2 && weights[i] > 0;
    moved += moves ? 1 : 0;
  }
  ASSERT_GT(moved, 0u);
  for (const double atJoint : {1e30, HUGE_VAL}) {
    pose.bounds[2] = {atJoint, HUGE_VAL, HUGE_VAL};
    for (const Method method : boundedMethods) {
      const auto skinned = reference::skin(mesh.view(), pose, method);
      ASSERT_TRUE(skinned.ok());
      EXPECT_EQ(exemptionsOf(*skinned).outOfRange, moved) << methodName(method);
    }
  }
}

}  // namespace
}  // namespace dermis::test
