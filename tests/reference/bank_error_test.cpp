// Vertices in poses that are off by exactly what the bounds of a sampled pose say are within the
// bounds of the vertices, and use much of them.

#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <cstdio>
#include <optional>
#include <random>
#include <string>
#include <vector>

#include <glm/geometric.hpp>
#include <glm/mat3x3.hpp>
#include <glm/matrix.hpp>
#include <glm/vec3.hpp>

#include "random_number.h"
#include "reference_rig.h"
#include "verify/joint.h"

namespace dermis::test {
namespace {

using glm::dmat3;
using glm::dvec3;

constexpr std::array boundedMethods{Method::linear, Method::dualQuaternion, Method::blended,
                                    Method::centerOfRotation, Method::bulgeControlled};

/// Numbers from which a case is made: random ones, which a search then changes.
class Genes {
 public:
  explicit Genes(std::uint32_t seed) : random_(seed) {}

  double between(double low, double high) {
    if (next_ == values_.size()) values_.push_back(test::between(random_, 0, 1));
    return low + (high - low) * values_[next_++];
  }
  bool chance() { return between(0, 1) < 0.5; }
  dvec3 vector(double reach) {
    const double x = between(-reach, reach), y = between(-reach, reach);
    return {x, y, between(-reach, reach)};
  }
  dvec3 direction() { return glm::normalize(vector(1) + dvec3(1e-9)); }
  dmat3 rotation(double most) {
    const dvec3 axis = direction();
    return rotationAbout(axis, between(0, most));
  }

  void rewind() { next_ = 0; }
  /// Changes some numbers, by between 1 and 1e-4.
  void change() {
    const double size = std::pow(10, -test::between(random_, 0, 4));
    for (std::uint32_t i = below(random_, 8) + 1; i > 0; --i) {
      double& value = values_[below(random_, values_.size())];
      value = std::clamp(value + size * test::between(random_, -1, 1), 0.0, 1.0);
    }
  }

 private:
  std::mt19937 random_;
  std::vector<double> values_;
  std::size_t next_ = 0;
};

struct ErrorKind {
  const char* name;
  double stretch;  ///< singular values are from 1 / (1 + stretch) to 1 + stretch
  bool mirrored;
  // How far joints are off: how their center moves, how they turn, how their shape changes.
  double shift, turn, shape;
};
constexpr std::array kinds{
    ErrorKind{"turned", 0, false, 1e-4, 1e-3, 0},
    ErrorKind{"rigid", 0, false, 1e-4, 1e-3, 1e-4},
    ErrorKind{"rigid, far off", 0, false, 0.1, 0.2, 0.05},
    ErrorKind{"turned far", 0, false, 0.1, 0.4, 0},
    ErrorKind{"stretched", 1, false, 1e-4, 1e-3, 1e-4},
    ErrorKind{"stretched, far off", 1, false, 0.1, 0.1, 0.03},
    ErrorKind{"much stretched", 9, false, 1e-4, 1e-3, 1e-4},
    ErrorKind{"mirrored", 1, true, 1e-4, 1e-3, 1e-3},
    ErrorKind{"nearly flat", 9, false, 0, 1e-3, 0.01},  // some joints may be mirrors or not
};
/// One error at a time.
constexpr std::array singleKinds{
    ErrorKind{"only shifted", 0, false, 0.01, 0, 0},
    ErrorKind{"only turned", 0, false, 0, 0.01, 0},
    ErrorKind{"only reshaped", 0, false, 0, 0, 0.01},
    ErrorKind{"stretched, only reshaped", 1, false, 0, 0, 0.01},
};

double norm(const dmat3& matrix) {
  return reference::singularValues(matrix).values[0];
}

dmat3 stretchedBy(double stretch, Genes& genes) {
  dmat3 matrix(1.0);
  for (int i = 0; i < 3; ++i) matrix[i] *= std::exp(genes.between(-1, 1) * std::log(1 + stretch));
  return matrix;
}

Transform transformOf(const dmat3& linear, const dvec3& translation) {
  Transform result;
  for (int row = 0; row < 3; ++row) {
    for (int column = 0; column < 4; ++column)
      result[static_cast<std::size_t>(row)][static_cast<std::size_t>(column)] =
          column < 3 ? linear[column][row] : translation[row];
  }
  return result;
}

/// The source's pose with bounds, and a bank's pose that reaches them.
struct Poses {
  reference::SampledPose source, bank;
};

Poses posesOf(const ErrorKind& kind, std::uint32_t jointCount, Genes& genes) {
  Poses poses;
  const dmat3 shared = genes.rotation(kind.turn);  // by which some joints turn together
  for (std::uint32_t joint = 0; joint < jointCount; ++joint) {
    const dmat3 axes = genes.rotation(pi);
    const dmat3 scaleShear = axes * stretchedBy(kind.stretch, genes) * glm::transpose(axes);
    const dmat3 linear = (kind.mirrored ? -1.0 : 1.0) * genes.rotation(0.7 * pi) * scaleShear;
    const dvec3 translation = genes.vector(1);
    const dmat3 toJoint = genes.rotation(pi) * stretchedBy(kind.stretch, genes);
    const JointMatrix inverseBind = jointOf(toJoint, genes.vector(1));

    const bool alone = genes.chance();
    const dmat3 turn = alone ? genes.rotation(kind.turn) : shared;
    dmat3 off(0.0);
    for (int column = 0; column < 3; ++column) off[column] = genes.vector(1) + dvec3(1e-9);
    off *= kind.shape * genes.between(0, 1) * norm(linear) / norm(off);
    const dmat3 moved = turn * linear + off;
    const dmat3 perDistance = (moved - linear) * glm::inverse(linearOf(inverseBind));
    const dvec3 direction = genes.direction();
    const dvec3 atJoint = direction * kind.shift * genes.between(0, 1);

    poses.source.joints.push_back(transformOf(linear, translation));
    poses.source.bounds.push_back({glm::length(atJoint), norm(perDistance), norm(off)});
    poses.source.inverseBind.push_back(inverseBind);
    poses.bank.joints.push_back(
        transformOf(moved, translation + atJoint + perDistance * offsetOf(inverseBind)));
    poses.bank.bounds.push_back({0, 0, 0});
    poses.bank.inverseBind.push_back(inverseBind);
  }
  return poses;
}

/// The largest error ÷ bound.
struct WorstShare {
  double position = 0, normal = 0, tangent = 0;
  int compared = 0, exempt = 0;
};

void compare(MeshView mesh, const Poses& poses, Method method, WorstShare& worst) {
  const auto source = reference::skin(mesh, poses.source, method);
  const auto bank = reference::skin(mesh, poses.bank, method);
  ASSERT_TRUE(source.ok() && bank.ok());
  const auto add = [](double& largest, const auto& a, const auto& b, double bound) {
    if (bound < 0) return;
    const double error = std::hypot(a[0] - b[0], a[1] - b[1], a[2] - b[2]);
    ASSERT_TRUE(std::isfinite(bound));
    ASSERT_LE(error, bound);
    if (error > 0) largest = std::max(largest, error / bound);
  };
  for (std::size_t vertex = 0; vertex < source->positions.size(); ++vertex) {
    const reference::VertexBounds& bounds = source->bounds[vertex];
    ASSERT_FALSE(bounds.undefined || bounds.outOfRange);
    if (bounds.onlyFinite) {
      ++worst.exempt;
      continue;
    }
    ++worst.compared;
    add(worst.position, source->positions[vertex], bank->positions[vertex], bounds.position);
    add(worst.normal, source->normals[vertex], bank->normals[vertex], bounds.normal);
    add(worst.tangent, source->tangents[vertex], bank->tangents[vertex], bounds.tangent);
    const bool sameHandedness = source->tangents[vertex][3] == bank->tangents[vertex][3];
    ASSERT_TRUE(sameHandedness || bounds.eitherHandedness) << vertex;
  }
}

std::string nameOf(const ErrorKind& kind, Method method) {
  return std::string(kind.name) + ", " + std::string(methodName(method));
}

TEST(BankError, BoundsWhatJointsAreOffBy) {
  constexpr std::uint32_t jointCount = 6, vertexCount = 40;
  for (const ErrorKind& kind : kinds) {
    for (const Method method : boundedMethods) {
      const std::string name = nameOf(kind, method);
      SCOPED_TRACE(name);
      WorstShare worst;
      for (std::uint32_t seed = 0; seed < 200; ++seed) {
        Genes genes(seed);
        OwnedMesh mesh = randomMesh(seed, vertexCount, jointCount, 1 + seed % 6);
        addTangents(mesh, seed);
        compare(mesh.view(), posesOf(kind, jointCount, genes), method, worst);
        if (HasFatalFailure()) return;
      }
      std::printf("%s: %.3f of the bound, normals %.3f, tangents %.3f; %d of %d exempt\n",
                  name.c_str(), worst.position, worst.normal, worst.tangent, worst.exempt,
                  worst.exempt + worst.compared);
      EXPECT_LE(2 * worst.exempt, worst.compared);
      EXPECT_GT(worst.position, 0.5);
      EXPECT_GT(worst.normal, 0.2);
      EXPECT_GT(worst.tangent, 0.3);
    }
  }
}

/// A joint that is nearly flat may be a mirror in the bank. Its polar decomposition is another one
/// then. Linear blending has none.
TEST(BankError, NothingIsKnownIfAJointMayBeAMirror) {
  const JointMatrix inverseBind;
  OwnedMesh mesh;
  mesh.influencesPerVertex = 1;
  addVertex(mesh, {1, 2, 3}, {{0, 1}});
  for (const double flatness : {1e-3, -1e-3}) {
    const dmat3 linear({1, 0, 0}, {0, 1, 0}, {0, 0, flatness});
    for (const double error : {0.5e-3, 2e-3}) {
      const reference::SampledPose pose{
          {transformOf(linear, dvec3(0.0))}, {{0, error, error}}, {inverseBind}};
      for (const Method method : boundedMethods) {
        const auto skinned = reference::skin(mesh.view(), pose, method);
        ASSERT_TRUE(skinned.ok());
        EXPECT_EQ(skinned->bounds[0].onlyFinite, method != Method::linear && error > 1e-3)
            << methodName(method) << ", " << flatness << ", " << error;
        EXPECT_TRUE(std::isfinite(skinned->bounds[0].position));
      }
    }
  }
}

/// A vertex with several joints.
OwnedMesh vertexOf(std::uint32_t jointCount, Genes& genes) {
  OwnedMesh mesh;
  mesh.influencesPerVertex = jointCount;
  append(mesh.positions, genes.vector(1));
  append(mesh.normals, genes.direction());
  append(mesh.tangents, genes.direction());
  mesh.tangents.push_back(1);
  append(mesh.centersOfRotation, genes.vector(1));
  mesh.dualQuaternionWeights = {static_cast<float>(genes.between(0, 1))};
  mesh.bulgeStrengths = {static_cast<float>(genes.between(0, 1))};
  for (std::uint32_t joint = 0; joint < jointCount; ++joint) {
    mesh.joints.push_back(joint);
    mesh.weights.push_back(static_cast<float>(genes.between(0.2, 1)));
  }
  return mesh;
}

/// Looks for the worst case: changes it, and keeps a change that makes error ÷ bound larger.
double searched(const ErrorKind& kind, Method method, std::uint32_t seed) {
  constexpr std::uint32_t jointCount = 3;
  std::optional<Genes> best;
  double most = -1;
  for (std::uint32_t i = 0; i < 3000; ++i) {
    Genes genes = i < 100 ? Genes(seed * 1000 + i) : *best;
    if (i >= 100) genes.change();
    genes.rewind();
    OwnedMesh mesh = vertexOf(jointCount, genes);
    WorstShare worst;
    compare(mesh.view(), posesOf(kind, jointCount, genes), method, worst);
    if (::testing::Test::HasFatalFailure()) return most;
    if (worst.position <= most) continue;
    most = worst.position;
    best = std::move(genes);
  }
  return most;
}

TEST(BankError, ASearchStaysWithinTheBoundsButComesNear) {
  for (const ErrorKind& kind : singleKinds) {
    for (const Method method : boundedMethods) {
      const std::string name = nameOf(kind, method);
      SCOPED_TRACE(name);
      double worst = 0;
      for (const std::uint32_t seed : {1u, 2u})
        worst = std::max(worst, searched(kind, method, seed));
      std::printf("%s: %.3f of the bound\n", name.c_str(), worst);
      EXPECT_GT(worst, 0.25);
    }
  }
}

}  // namespace
}  // namespace dermis::test
