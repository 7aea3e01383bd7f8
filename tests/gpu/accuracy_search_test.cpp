// The bounds on a GPU that is only as exact as Vulkan demands, and how near to them the worst
// vertices come that a search finds. DERMIS_SEARCH_GENERATIONS searches for longer and prints a
// line for each case: that is how the fitted numbers of docs/accuracy.md were found.

#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <map>
#include <span>
#include <string>
#include <utility>
#include <vector>

#include "dermis/mesh.h"
#include "dermis/verify.h"
#include "inexact_context.h"
#include "kit/batch_runner.h"
#include "kit/verification_product.h"
#include "test_device.h"
#include "worst_rig.h"

namespace dermis::test {
namespace {

constexpr Arithmetic exact{"exact", {}};
constexpr Arithmetic mixed{"mixed", {Side::mixed, Side::mixed}};
constexpr Arithmetic fused{"fused", {.fuses = true}};
constexpr Arithmetic fusedMixed{
    "fused, mixed", {.division = Side::mixed, .inverseRoot = Side::mixed, .fuses = true}};
constexpr std::array allInexact{Arithmetic{"up", {Side::up, Side::up}},
                                Arithmetic{"down", {Side::down, Side::down}}, mixed, fused,
                                fusedMixed};

class InexactTest : public DeviceTest {
 protected:
  Result<samples::BatchResult> skin(vulkan::Context& context, OwnedMesh& mesh,
                                    std::span<const JointMatrix> pose, Method method) {
    const Result<PackedMesh> packed = pack(mesh.view(), static_cast<std::uint32_t>(pose.size()));
    if (!packed) return packed.error();
    const samples::SkinRequest request{&*packed, pose, JointPromise::scaling, method};
    samples::RunOptions options;
    options.output.tangents = VertexFormat::float32x4;
    options.countUntouched = false;
    return samples::runBatch(device(), context, {&request, 1}, options);
  }
};

TEST_F(InexactTest, OperationsErrByTwoUnitsInTheLastPlace) {
  OwnedMesh mesh = randomMesh(1, 3000, 24, 4);
  const std::vector<JointMatrix> pose = randomPose(2, 24, Rigidity::rigid);
  for (const Arithmetic& arithmetic : {exact, allInexact[0], allInexact[1], mixed}) {
    Inexact inexact(device().description(), arithmetic);
    ASSERT_TRUE(inexact.context.ok());
    const auto result = skin(*inexact.context, mesh, pose, Method::linear);
    ASSERT_TRUE(result.ok());
    const std::vector<float>& normals = result->instances[0].normals;
    EXPECT_EQ(changedOperations != 0, arithmetic.inexactness.division != Side::none);
    // The length of a normal is off by what the inverse root is off by.
    double least = 2, greatest = 0;
    for (std::size_t i = 0; i < normals.size(); i += 3) {
      const float* n = &normals[i];
      const double length = std::hypot(static_cast<double>(n[0]), static_cast<double>(n[1]),
                                       static_cast<double>(n[2]));
      least = std::min(least, length);
      greatest = std::max(greatest, length);
    }
    const bool up = arithmetic.inexactness.inverseRoot == Side::up ||
                    arithmetic.inexactness.inverseRoot == Side::mixed;
    const bool down = arithmetic.inexactness.inverseRoot == Side::down ||
                      arithmetic.inexactness.inverseRoot == Side::mixed;
    EXPECT_EQ(greatest > 1 + 2.2e-7, up) << arithmetic.name << ": " << greatest - 1;
    EXPECT_EQ(least < 1 - 2.2e-7, down) << arithmetic.name << ": " << least - 1;
    EXPECT_LT(greatest, 1 + 6e-7);
    EXPECT_GT(least, 1 - 6e-7);
  }
}

TEST_F(InexactTest, EveryVertexIsInsideItsBoundOnAnyConformingGpu) {
  OwnedMesh mesh = randomMesh(1, 2000, 24, 4);
  addTangents(mesh, 4);
  std::map<std::pair<Method, Rigidity>, reference::SkinnedMesh> expectations;
  for (const Arithmetic& arithmetic : allInexact) {
    Inexact inexact(device().description(), arithmetic);
    ASSERT_TRUE(inexact.context.ok());
    for (const Method method : allMethods) {
      for (const Rigidity rigidity : {Rigidity::rigid, Rigidity::uniformScale, Rigidity::shear,
                                      Rigidity::mirrored, Rigidity::mirroredAlongOneAxis}) {
        const std::vector<JointMatrix> pose = randomPose(2, 24, rigidity);
        const auto result = skin(*inexact.context, mesh, pose, method);
        ASSERT_TRUE(result.ok());
        const auto [expected, isNew] = expectations.try_emplace({method, rigidity});
        if (isNew) expected->second = *reference::skin(mesh.view(), pose, method);
        const Exemptions exemptions{exemptionsOf(expected->second).onlyFinite, 0};
        const auto comparison =
            compareWithReference(expected->second, result->instances[0].view(), exemptions);
        ASSERT_TRUE(comparison.ok());
        EXPECT_TRUE(comparison->passed())
            << arithmetic.name << ", " << methodName(method) << ", " << static_cast<int>(rigidity)
            << ": positions " << comparison->worstPosition << " of the bound, normals "
            << comparison->worstNormal << ", tangents " << comparison->worstTangent;
        EXPECT_GE(comparison->compared + 2, mesh.vertexCount());
      }
    }
  }
}

// No test device rounds `fma` once, so that nothing else executes what most GPUs do.
TEST_F(InexactTest, RandomCasesAreVerifiedWhereFmaRoundsOnce) {
  Inexact inexact(device().description(), fused);
  ASSERT_TRUE(inexact.context.ok());
  samples::VulkanTarget target(device(), *inexact.context);
  const bool hasBounds = context().limits().maxStorageBuffersPerStage >= storageBuffersWanted;
  std::uint64_t compared = 0, exempt = 0;
  for (const Method method : allMethods) {
    for (const Rigidity rigidity : {Rigidity::rigid, Rigidity::uniformScale, Rigidity::shear,
                                    Rigidity::mirrored, Rigidity::mirroredAlongOneAxis}) {
      for (const std::uint32_t influences : {1u, 2u, 3u, 4u, 5u, 17u}) {
        samples::RandomCase random;
        random.method = method;
        random.rigidity = rigidity;
        random.vertices = 257;
        random.joints = 40;
        random.influences = influences;
        random.output.layout.tangents = VertexFormat::float32x4;
        random.output.layout.bounds = hasBounds && influences % 2 == 0;
        const auto verified = samples::verifyRandomCase(target, random);
        ASSERT_TRUE(verified.ok()) << verified.error().message;
        for (const samples::VerifiedInstance& instance : *verified) {
          EXPECT_TRUE(instance.passed())
              << methodName(method) << ", " << static_cast<int>(rigidity) << ", " << influences
              << " influences: " << instance.wrong << ", " << instance.comparison.failures
              << " vertices outside their bounds";
          compared += instance.comparison.compared;
          exempt += instance.comparison.exempt.onlyFinite;
        }
      }
    }
  }
  EXPECT_GT(changedOperations, 1000u);
  EXPECT_LE(exempt, compared / 100);
}

double distance(const float* actual, const double* expected) {
  return std::hypot(static_cast<double>(actual[0]) - expected[0],
                    static_cast<double>(actual[1]) - expected[1],
                    static_cast<double>(actual[2]) - expected[2]);
}

/// The largest error ÷ bound that was found.
struct Worst {
  double position = 0, normal = 0, tangent = 0;
  double largest() const { return std::max({position, normal, tangent}); }
};

struct Search {
  const char* name;
  JointRange range;
  std::uint32_t influences = 4;
};

class AccuracySearchTest : public InexactTest {
 protected:
  void SetUp() override {
    InexactTest::SetUp();
    const char* text = std::getenv("DERMIS_SEARCH_GENERATIONS");
    if (text == nullptr) return;
    generations_ = std::atoi(text);
    prints_ = true;
  }

  Worst worstOf(vulkan::Context& context, Method method, const Search& search,
                const char* arithmetic) {
    WorstRig rig(1, search.influences > 8 ? 150 : 450, search.influences, search.range);
    for (int generation = 0; generation < generations_; ++generation) {
      rig.propose();
      rig.judge(shares(context, method, rig));
    }
    Worst worst;
    for (std::size_t i = 0; i < rig.worst().size(); ++i) {
      double& kind = i % 3 == 0 ? worst.position : i % 3 == 1 ? worst.normal : worst.tangent;
      kind = std::max(kind, rig.worst()[i]);
    }
    if (prints_) {
      std::printf("%-5s %-25s %-12s %2u influences: position %.2f normal %.2f tangent %.2f\n",
                  arithmetic, std::string(methodName(method)).c_str(), search.name,
                  search.influences, worst.position, worst.normal, worst.tangent);
      std::fflush(stdout);
    }
    return worst;
  }

  void expectInside(const Arithmetic& arithmetic, std::span<const Search> searches) {
    Inexact inexact(device().description(), arithmetic);
    ASSERT_TRUE(inexact.context.ok());
    for (const Method method : allMethods) {
      for (const Search& search : searches) {
        const Worst worst = worstOf(*inexact.context, method, search, arithmetic.name);
        EXPECT_LE(worst.largest(), 1)
            << methodName(method) << ", " << search.name << ": positions " << worst.position
            << ", normals " << worst.normal << ", tangents " << worst.tangent;
        // A bound that nothing comes near to would prove nothing.
        if (search.influences <= 4) {
          EXPECT_GE(worst.largest(), 0.08) << methodName(method);
        }
      }
    }
  }

 private:
  /// Every third vertex is judged by its position, its normal, its tangent.
  std::vector<double> shares(vulkan::Context& context, Method method, WorstRig& rig) {
    const auto result = skin(context, rig.mesh(), rig.pose(), method);
    const auto expected = reference::skin(rig.mesh().view(), rig.pose(), method);
    if (!result || !expected) {
      ADD_FAILURE();
      return std::vector<double>(rig.vertexCount());
    }
    const samples::SkinnedVertices& skinned = result->instances[0];
    const auto* tangents = reinterpret_cast<const float*>(skinned.attribute(Stream::tangents).data);
    std::vector<double> found;
    for (std::size_t i = 0; i < rig.vertexCount(); ++i) {
      const reference::VertexBounds& bounds = expected->bounds[i];
      const float* actual = i % 3 == 0   ? &skinned.positions[i * 3]
                            : i % 3 == 1 ? &skinned.normals[i * 3]
                                         : tangents + i * 4;
      const double* wanted = i % 3 == 0   ? expected->positions[i].data()
                             : i % 3 == 1 ? expected->normals[i].data()
                                          : expected->tangents[i].data();
      const double bound = i % 3 == 0   ? bounds.position
                           : i % 3 == 1 ? bounds.normal
                                        : bounds.tangent;
      found.push_back(bounds.onlyFinite || bound < 0 ? 0 : distance(actual, wanted) / bound);
    }
    return found;
  }

  int generations_ = 6;
  bool prints_ = false;
};

const std::array everyRange{
    Search{"rigid", {}},
    Search{"nearly_rigid", {.translation = 0.01, .deviation = 3.5e-6}},
    Search{"scaled", {.scale = 100}},
    Search{"stretched", {.stretch = 31.6}},
    Search{"far_and_tiny", {.scale = 1e20, .translation = 1e-10}},
    Search{"opposed", {}, 64},
};

TEST_F(AccuracySearchTest, TheWorstVerticesAreInsideTheirBounds) {
  expectInside(exact, everyRange);
}

TEST_F(AccuracySearchTest, TheWorstVerticesAreInsideTheirBoundsOnAnyConformingGpu) {
  expectInside(mixed, everyRange);
}

TEST_F(AccuracySearchTest, TheWorstVerticesAreInsideTheirBoundsWhereFmaRoundsOnce) {
  expectInside(fusedMixed, everyRange);
}

TEST_F(AccuracySearchTest, TheWorstVerticesByTheNumberOfInfluences) {
  std::vector<Search> searches;
  for (const std::uint32_t influences : {1u, 2u, 16u}) {
    searches.push_back({"rigid", {}, influences});
  }
  expectInside(mixed, searches);
}

}  // namespace
}  // namespace dermis::test
