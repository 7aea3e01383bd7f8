// Centres of rotation against the formula itself, summed over all triangles without an index.

#include "dermis/mesh.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <bit>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <limits>
#include <numbers>
#include <random>
#include <span>
#include <string>
#include <thread>
#include <utility>
#include <vector>

#include <glm/geometric.hpp>
#include <glm/vec3.hpp>

#include "centers.h"
#include "centers/pair_index.h"
#include "kit/solve_centers.h"
#include "random_rig.h"

namespace dermis {
namespace {

using test::OwnedMesh;
using test::vectorAt;
using test::Weights;

struct Surface {
  OwnedMesh mesh;
  std::uint32_t jointCount = 0;
  std::vector<std::uint32_t> triangles;
};

std::vector<float> solved(Surface& surface) {
  Result<std::vector<float>> result =
      test::centersOf(surface.mesh.view(), surface.jointCount, surface.triangles);
  EXPECT_TRUE(result.ok()) << (result ? "" : result.error().message);
  return result ? std::move(*result) : std::vector<float>{};
}

CenterOfRotationSolver solverOf(Surface& surface) {
  return CenterOfRotationSolver::make(surface.mesh.view(), surface.jointCount, surface.triangles)
      .value();
}

double sizeOf(const OwnedMesh& mesh) {
  glm::dvec3 low(std::numeric_limits<double>::infinity()), high(-low);
  for (std::size_t vertex = 0; vertex < mesh.vertexCount(); ++vertex) {
    low = glm::min(low, vectorAt(mesh.positions, vertex));
    high = glm::max(high, vectorAt(mesh.positions, vertex));
  }
  return glm::length(high - low);
}

Weights weightsOf(const OwnedMesh& mesh, std::size_t vertex) {
  Weights weights;
  double sum = 0;
  for (std::size_t slot = 0; slot < mesh.influencesPerVertex; ++slot) {
    const std::size_t i = vertex * mesh.influencesPerVertex + slot;
    const double weight = static_cast<double>(mesh.weights[i]);
    if (weight != 0) weights[mesh.joints[i]] += weight;
    sum += weight;
  }
  for (auto& [joint, weight] : weights) weight /= sum;
  return weights;
}

std::vector<glm::dvec3> directSum(const Surface& surface) {
  const OwnedMesh& mesh = surface.mesh;
  std::vector<Weights> vertices;
  for (std::size_t vertex = 0; vertex < mesh.vertexCount(); ++vertex)
    vertices.push_back(weightsOf(mesh, vertex));
  const test::DirectSum sum(mesh.positions, vertices, surface.triangles);
  std::vector<glm::dvec3> centers;
  for (std::size_t vertex = 0; vertex < mesh.vertexCount(); ++vertex)
    centers.push_back(sum.center(vertices[vertex]).value_or(vectorAt(mesh.positions, vertex)));
  return centers;
}

/// Triangles between any three vertices, some of them without area; joints twice in a vertex,
/// vertices of no joint or one, weights that sum to anything.
Surface randomSurface(std::uint32_t seed, std::uint32_t vertexCount, std::uint32_t triangleCount,
                      std::uint32_t jointCount, std::uint32_t influences) {
  std::mt19937 engine(seed);
  const auto below = [&](std::uint32_t count) {
    return std::uniform_int_distribution<std::uint32_t>(0, count - 1)(engine);
  };
  const auto between = [&](float low, float high) {
    return std::uniform_real_distribution<float>(low, high)(engine);
  };
  Surface surface;
  surface.jointCount = jointCount;
  surface.mesh.influencesPerVertex = influences;
  for (std::uint32_t vertex = 0; vertex < vertexCount; ++vertex) {
    for (int i = 0; i < 3; ++i) surface.mesh.positions.push_back(between(-3, 3));
    const std::uint32_t used = below(influences + 1);
    for (std::uint32_t slot = 0; slot < influences; ++slot) {
      surface.mesh.joints.push_back(below(jointCount));
      surface.mesh.weights.push_back(slot < used ? between(0.01f, 2) : 0);
    }
  }
  for (std::uint32_t i = 0; i < 3 * triangleCount; ++i) {
    surface.triangles.push_back(below(vertexCount));
  }
  return surface;
}

void expectDirectSum(Surface& surface, const std::string& what) {
  const std::vector<float> centers = solved(surface);
  const std::vector<glm::dvec3> expected = directSum(surface);
  ASSERT_EQ(centers.size(), 3 * expected.size());
  for (std::size_t vertex = 0; vertex < expected.size(); ++vertex) {
    ASSERT_LE(glm::distance(vectorAt(centers, vertex), expected[vertex]),
              1e-6 * sizeOf(surface.mesh))
        << what << ", vertex " << vertex;
  }
}

TEST(CentersOfRotation, EqualTheDirectSum) {
  for (std::uint32_t influences = 1; influences <= 6; ++influences) {
    for (std::uint32_t seed = 1; seed <= 12; ++seed) {
      Surface surface = randomSurface(100 * influences + seed, 50, 20 * seed, 3 + seed, influences);
      expectDirectSum(surface,
                      std::to_string(influences) + " influences, seed " + std::to_string(seed));
      if (testing::Test::HasFatalFailure()) return;
    }
  }
}

/// Few enough different weights that triangles are merged.
TEST(CentersOfRotation, EqualTheDirectSumWhereWeightsRecur) {
  for (std::uint32_t seed = 1; seed <= 10; ++seed) {
    Surface surface = randomSurface(seed, 80, 300, 3, 3);
    std::mt19937 engine(seed);
    for (float& weight : surface.mesh.weights) {
      weight = static_cast<float>(std::uniform_int_distribution<int>(0, 2)(engine));
    }
    expectDirectSum(surface, "seed " + std::to_string(seed));
  }
}

/// By one pair of joints, before anything is rounded to float32; groups that fill the lanes of the
/// loop and that do not.
TEST(CentersOfRotation, SumSimilaritiesInDoublePrecision) {
  std::mt19937 engine(1);
  std::uniform_real_distribution<double> between(0, 1);
  for (std::size_t count = 1; count <= 40; ++count) {
    std::vector<std::array<centers::Influence, 2>> influences;
    for (std::size_t i = 0; i < count; ++i) {
      const double weight = between(engine);
      influences.push_back({centers::Influence{3, weight}, {65535, 1 - weight}});
    }
    std::vector<centers::Group> groups;
    for (const auto& pair : influences) {
      groups.push_back({pair, {between(engine), between(engine), between(engine), 1}});
    }
    const centers::Influence low{3, count % 2 == 0 ? 1.0 : between(engine)};
    const centers::Influence high{65535, count % 3 == 0 ? 1.0 : 1 - low.weight};
    centers::Moment expected;
    for (const centers::Group& group : groups) {
      const double t = group.influences[0].weight, u = group.influences[1].weight;
      const double difference = low.weight * u - high.weight * t;
      expected.add(group.moment, low.weight * high.weight * t * u *
                                     std::exp(-difference * difference / (0.1 * 0.1)));
    }
    const centers::PairIndex index(groups);
    for (const bool swapped : {false, true}) {
      centers::Moment sum;
      index.addSimilar(swapped ? high : low, swapped ? low : high, sum);
      EXPECT_NEAR(sum.x, expected.x, 1e-13 * expected.x) << count;
      EXPECT_NEAR(sum.y, expected.y, 1e-13 * expected.y) << count;
      EXPECT_NEAR(sum.z, expected.z, 1e-13 * expected.z) << count;
      EXPECT_NEAR(sum.sum, expected.sum, 1e-13 * expected.sum) << count;
    }
  }
}

/// A tube around the z axis from 0 to 1. The second joint's weight is z.
Surface tube(std::uint32_t rings, std::uint32_t sides) {
  Surface surface;
  surface.jointCount = 2;
  surface.mesh.influencesPerVertex = 2;
  for (std::uint32_t ring = 0; ring <= rings; ++ring) {
    const float z = static_cast<float>(ring) / static_cast<float>(rings);
    for (std::uint32_t side = 0; side < sides; ++side) {
      const double angle = 2 * std::numbers::pi * side / sides;
      for (const double xy : {std::cos(angle), std::sin(angle)}) {
        surface.mesh.positions.push_back(static_cast<float>(xy));
      }
      surface.mesh.positions.push_back(z);
      surface.mesh.joints.insert(surface.mesh.joints.end(), {0, 1});
      surface.mesh.weights.insert(surface.mesh.weights.end(), {1 - z, z});
      if (ring == rings) continue;
      const std::uint32_t here = ring * sides, a = here + side, b = here + (side + 1) % sides;
      surface.triangles.insert(surface.triangles.end(), {a, b, a + sides, b, b + sides, a + sides});
    }
  }
  return surface;
}

TEST(CentersOfRotation, OfATubeLieOnItsAxisByWeight) {
  const std::uint32_t rings = 200, sides = 12;
  Surface surface = tube(rings, sides);
  const std::vector<float> centers = solved(surface);
  // The first and last rings have one influence.
  for (std::uint32_t vertex = sides; vertex < rings * sides; ++vertex) {
    // Weights along the tube are w, so that the sum is an integral over w.
    const double own = static_cast<double>(surface.mesh.weights[2 * vertex + 1]);
    const int steps = 1000;
    double moment = 0, sum = 0;
    for (int step = 0; step < steps; ++step) {
      const double w = (step + 0.5) / steps;
      const double similar = w * (1 - w) * std::exp(-(own - w) * (own - w) / 0.01);
      moment += similar * w;
      sum += similar;
    }
    const glm::dvec3 center = vectorAt(centers, vertex);
    EXPECT_LE(std::hypot(center.x, center.y), 1e-6) << "vertex " << vertex;
    EXPECT_NEAR(center.z, moment / sum, 1e-4) << "vertex " << vertex;
  }
}

TEST(CentersOfRotation, OfEqualWeightsAreOneCentroid) {
  Surface surface = tube(6, 7);
  for (float& weight : surface.mesh.weights) weight = 3;
  const std::vector<float> centers = solved(surface);
  for (std::size_t vertex = 0; vertex < surface.mesh.vertexCount(); ++vertex) {
    EXPECT_LE(glm::distance(vectorAt(centers, vertex), glm::dvec3(0, 0, 0.5)), 1e-6);
  }
}

void expectOwnPositions(Surface& surface) {
  EXPECT_EQ(solved(surface), surface.mesh.positions);
}

TEST(CentersOfRotation, AreTheVerticesWhereThereAreNone) {
  Surface one = tube(5, 6);
  one.mesh.influencesPerVertex = 1;
  one.mesh.joints.assign(one.mesh.vertexCount(), 1);
  one.mesh.weights.assign(one.mesh.vertexCount(), 0.25f);
  expectOwnPositions(one);

  Surface twice = tube(5, 6);  // the same joint in both slots
  for (std::uint32_t& joint : twice.mesh.joints) joint = 1;
  expectOwnPositions(twice);

  Surface none = tube(5, 6);
  for (float& weight : none.mesh.weights) weight = 0;
  expectOwnPositions(none);

  Surface withoutTriangles = tube(5, 6);
  withoutTriangles.triangles.clear();
  expectOwnPositions(withoutTriangles);

  Surface withoutArea = tube(5, 6);
  for (std::size_t i = 0; i < withoutArea.triangles.size(); i += 3) {
    withoutArea.triangles[i + 2] = withoutArea.triangles[i];
  }
  expectOwnPositions(withoutArea);

  Surface dissimilar = tube(5, 6);  // the triangles' vertices have other joints
  dissimilar.jointCount = 4;
  OwnedMesh& mesh = dissimilar.mesh;
  const OwnedMesh copy = mesh;
  for (const std::uint32_t joint : copy.joints) mesh.joints.push_back(joint + 2);
  for (const float x : copy.positions) mesh.positions.push_back(x);
  for (const float weight : copy.weights) mesh.weights.push_back(weight);
  const std::vector<float> centers = solved(dissimilar);
  const std::size_t half = centers.size() / 2;
  EXPECT_TRUE(std::equal(centers.begin() + static_cast<std::ptrdiff_t>(half), centers.end(),
                         mesh.positions.begin() + static_cast<std::ptrdiff_t>(half)));
  EXPECT_FALSE(std::equal(centers.begin(), centers.begin() + static_cast<std::ptrdiff_t>(half),
                          mesh.positions.begin()));
}

TEST(CentersOfRotation, TakeNoNoticeOfTrianglesWithoutArea) {
  Surface surface = randomSurface(5, 40, 60, 4, 3);
  const std::vector<float> expected = solved(surface);
  for (std::uint32_t vertex = 0; vertex < 40; ++vertex) {
    surface.triangles.insert(surface.triangles.begin(), {vertex, vertex, 39 - vertex});
  }
  EXPECT_EQ(solved(surface), expected);
}

TEST(CentersOfRotation, AreTheSameToTheBitHoweverTheyAreCut) {
  Surface surface = randomSurface(1, 1000, 2000, 7, 4);
  const std::vector<float> expected = solved(surface);
  CenterOfRotationSolver made = solverOf(surface);
  for (const std::uint32_t threads : {0u, 1u, 2u, 3u, 7u, 100u})
    EXPECT_EQ(samples::solveCenters(made, threads), expected) << threads << " threads";
  surface = {};  // the solver has what it needs
  const CenterOfRotationSolver solver = std::move(made);
  ASSERT_EQ(solver.vertexCount(), 1000u);
  for (const std::size_t size : {1u, 7u, 333u, 1000u}) {
    std::vector<float> centers(3000, std::nanf(""));
    for (std::size_t end = 1000; end > 0;) {
      const std::size_t first = end - std::min(end, size);
      ASSERT_TRUE(solver.solve(static_cast<std::uint32_t>(first),
                               std::span(centers).subspan(3 * first, 3 * (end - first))));
      end = first;
    }
    EXPECT_EQ(centers, expected) << "pieces of " << size;
  }
}

TEST(CentersOfRotation, AreSolvedByThreadsOfTheEngine) {
  Surface surface = randomSurface(2, 500, 800, 6, 4);
  const std::vector<float> expected = solved(surface);
  const CenterOfRotationSolver solver = solverOf(surface);
  std::vector<float> centers(1500);
  std::vector<std::thread> threads;
  for (std::uint32_t i = 0; i < 5; ++i) {
    threads.emplace_back([&, i] {
      EXPECT_TRUE(solver.solve(100 * i, std::span(centers).subspan(std::size_t{300} * i, 300)));
    });
  }
  for (std::thread& thread : threads) thread.join();
  EXPECT_EQ(centers, expected);
}

TEST(CentersOfRotation, RefusePiecesOutsideTheMesh) {
  Surface surface = randomSurface(3, 20, 30, 4, 2);
  const CenterOfRotationSolver solver = solverOf(surface);
  std::vector<float> centers(63, 7.0f);
  const auto refused = [&](std::uint32_t first, std::size_t size) {
    const Result<void> result = solver.solve(first, std::span(centers).first(size));
    return !result.ok() && result.error().code == ErrorCode::invalidArgument;
  };
  EXPECT_TRUE(refused(0, 63));
  EXPECT_TRUE(refused(20, 3));
  EXPECT_TRUE(refused(0, 4));
  EXPECT_TRUE(refused(std::numeric_limits<std::uint32_t>::max(), 3));
  EXPECT_EQ(centers, std::vector<float>(63, 7.0f));
  EXPECT_TRUE(solver.solve(20, {}));
  EXPECT_TRUE(solver.solve(19, std::span(centers).first(3)));
}

TEST(CentersOfRotation, ToolsTellTheCallingThreadHowFarTheyAre) {
  Surface surface = randomSurface(4, 2000, 500, 5, 3);
  const CenterOfRotationSolver solver = solverOf(surface);
  const std::thread::id caller = std::this_thread::get_id();
  for (const std::uint32_t threads : {1u, 3u}) {
    std::vector<float> fractions;
    samples::solveCenters(solver, threads, [&](float fraction) {
      fractions.push_back(fraction);
      EXPECT_EQ(std::this_thread::get_id(), caller);
    });
    // 2000 vertices are many jobs.
    EXPECT_GE(fractions.size(), threads == 1 ? 10u : 1u);
    EXPECT_EQ(fractions.back(), 1);
    EXPECT_TRUE(std::is_sorted(fractions.begin(), fractions.end()));
    EXPECT_EQ(std::count(fractions.begin(), fractions.end(), 1.0f), 1);
  }
}

TEST(CentersOfRotation, SayWhatIsWrong) {
  Surface surface = randomSurface(6, 20, 30, 4, 2);
  surface.mesh.name = "Fox";
  const auto expectError = [](Surface wrong, ErrorCode code, const std::string& words) {
    const Result<std::vector<float>> result =
        test::centersOf(wrong.mesh.view(), wrong.jointCount, wrong.triangles);
    ASSERT_FALSE(result.ok()) << words;
    const Error& error = result.error();
    EXPECT_EQ(error.code, code) << words;
    EXPECT_NE(error.message.find("mesh 'Fox'"), std::string::npos) << error.message;
    EXPECT_NE(error.message.find(words), std::string::npos) << error.message;
  };
  Surface wrong = surface;
  wrong.triangles[3 * 17 + 1] = 20;
  expectError(wrong, ErrorCode::invalidArgument, "triangle 17: vertex 20 is outside");
  wrong = surface;
  wrong.triangles.pop_back();
  expectError(wrong, ErrorCode::invalidArgument, "89 vertex indices");
  wrong = surface;
  wrong.jointCount = 0;
  expectError(wrong, ErrorCode::invalidArgument, "not 0");
  wrong.jointCount = maxPoseJoints + 1;
  expectError(wrong, ErrorCode::invalidArgument, "not 65537");
  wrong.jointCount = 1;
  expectError(wrong, ErrorCode::invalidMesh, "vertex");
  wrong = surface;
  wrong.mesh.positions[3 * 11] = std::nanf("");
  expectError(wrong, ErrorCode::invalidMesh, "vertex 11");
  EXPECT_EQ(test::centersOf(MeshView{}, 1, {}).error().code, ErrorCode::invalidMesh);
}

TEST(CentersOfRotation, ReadEveryStoredForm) {
  // Two sets, integer weights, positions with a scale and an offset: the same as plain floats.
  const std::array<std::uint8_t, 12> positions{0, 0, 0, 255, 0, 0, 0, 255, 0, 0, 0, 255};
  const std::array<std::uint16_t, 4> joints{0, 1, 2, 0}, otherJoints{7, 8, 7, 8};
  const std::array<std::uint8_t, 4> weights{51, 204, 102, 153}, otherWeights{204, 51, 153, 102};
  const std::array<std::uint32_t, 9> triangles{0, 1, 2, 1, 2, 3, 3, 1, 0};
  MeshView stored;
  stored.vertexCount = 4;
  const std::array<std::uint16_t, 12> wide{0, 0, 0, 65535, 0, 0, 0, 65535, 0, 0, 0, 65535};
  stored.positions = {wide.data(), 4, 6, ComponentType::unorm16, 3};
  stored.positionScale = {2, 3, 4};
  stored.positionOffset = {-1, 0, 5};
  const std::array<InfluenceSet, 2> sets{
      InfluenceSet{{joints.data(), 4, 2, ComponentType::uint16, 1},
                   {weights.data(), 4, 1, ComponentType::unorm8, 1}},
      InfluenceSet{{otherJoints.data(), 4, 2, ComponentType::uint16, 1},
                   {otherWeights.data(), 4, 1, ComponentType::unorm8, 1}}};
  stored.influenceSets = sets;

  Surface plain;
  plain.jointCount = 9;
  plain.triangles.assign(triangles.begin(), triangles.end());
  plain.mesh.influencesPerVertex = 2;
  const float scale[] = {2, 3, 4}, offset[] = {-1, 0, 5};
  for (std::size_t i = 0; i < 12; ++i) {
    plain.mesh.positions.push_back((positions[i] != 0 ? scale[i % 3] : 0) + offset[i % 3]);
  }
  for (std::size_t i = 0; i < 4; ++i) {
    plain.mesh.joints.insert(plain.mesh.joints.end(), {joints[i], otherJoints[i]});
    plain.mesh.weights.insert(plain.mesh.weights.end(), {static_cast<float>(weights[i]),
                                                         static_cast<float>(otherWeights[i])});
  }
  const Result<std::vector<float>> centers = test::centersOf(stored, 9, triangles);
  ASSERT_TRUE(centers.ok());
  EXPECT_EQ(*centers, solved(plain));
  EXPECT_NE(*centers, plain.mesh.positions);
}

TEST(CentersOfRotation, ScaleWithTheMeshAsFarAsFloatsGo) {
  Surface surface = randomSurface(8, 60, 90, 5, 4);
  const std::vector<float> plain = solved(surface);
  for (const float scale : {0x1p-100f, 0x1p-40f, 0x1p60f, 0x1p125f}) {
    Surface scaled = surface;
    for (float& x : scaled.mesh.positions) x *= scale;
    std::vector<float> expected = plain;
    for (float& x : expected) x *= scale;
    EXPECT_EQ(solved(scaled), expected) << scale;
  }
}

TEST(CentersOfRotation, DoNotDependOnTheSumOfWeights) {
  Surface surface = randomSurface(9, 60, 90, 5, 4);
  const std::vector<float> plain = solved(surface);
  for (const float scale : {0x1p-100f, 0x1p100f}) {
    Surface scaled = surface;
    for (float& weight : scaled.mesh.weights) weight *= scale;
    EXPECT_EQ(solved(scaled), plain) << scale;
  }
}

TEST(CentersOfRotation, TakeAWeightThatPackDropsForNone) {
  Surface surface = tube(5, 6);
  for (std::size_t i = 0; i < surface.mesh.weights.size(); i += 2) {
    surface.mesh.weights[i] = 1e-30f;
    surface.mesh.weights[i + 1] = 1;
  }
  expectOwnPositions(surface);
}

TEST(CentersOfRotation, AreFiniteAndWithinTheMeshForAnyNumbers) {
  for (std::uint32_t seed = 1; seed <= 300; ++seed) {
    Surface surface = randomSurface(seed, 30, 60, 4, 4);
    std::mt19937 engine(seed);
    const auto magnitude = [&](double low, double high) {
      return std::pow(10.0, std::uniform_real_distribution<double>(low, high)(engine));
    };
    constexpr double largest = std::numeric_limits<float>::max();
    const double place = std::min(magnitude(-45, 40), largest);
    float least = 0, most = 0;
    for (float& x : surface.mesh.positions) {
      const double wide = seed % 2 == 0 ? place : std::min(magnitude(-45, 40), largest);
      x = static_cast<float>(std::copysign(wide, static_cast<double>(x)));
      least = std::min(least, x);
      most = std::max(most, x);
    }
    for (float& weight : surface.mesh.weights) {
      if (weight != 0) weight = static_cast<float>(magnitude(-45, seed % 3 == 0 ? 38 : -30));
    }
    for (const float x : solved(surface)) {
      ASSERT_TRUE(std::isfinite(x)) << "seed " << seed;
      ASSERT_GE(x, least) << "seed " << seed;
      ASSERT_LE(x, most) << "seed " << seed;
    }
  }
}

}  // namespace
}  // namespace dermis
