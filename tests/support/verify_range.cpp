#include "verify_range.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <bit>
#include <cmath>
#include <limits>
#include <random>
#include <span>
#include <string>
#include <vector>

#include <glm/gtc/quaternion.hpp>
#include <glm/mat3x3.hpp>

#include "dermis/mesh.h"
#include "dermis/verify.h"
#include "joint_of.h"
#include "random_rig.h"

namespace dermis::test {
namespace {

constexpr std::uint32_t count = 64;

class Random {
 public:
  explicit Random(std::uint32_t seed) : engine_(seed) {}

  double between(double low, double high) {
    return low + (high - low) * (static_cast<double>(engine_()) / 4294967296.0);
  }
  std::uint32_t bits() { return static_cast<std::uint32_t>(engine_()); }
  glm::dmat3 rotation() {
    glm::dvec4 q;
    do {
      for (int i = 0; i < 4; ++i) q[i] = between(-1, 1);
    } while (glm::dot(q, q) > 1 || glm::dot(q, q) < 0.01);
    q /= std::sqrt(glm::dot(q, q));
    return glm::mat3_cast(glm::dquat(q[3], q[0], q[1], q[2]));
  }

 private:
  std::mt19937 engine_;
};

/// Vertex v follows joint 0 and, by a quarter, joint v + 1: rotations must be right, because the
/// rotation of a single joint does not show. Positions have length 1, centers of rotation 1/4.
OwnedMesh pairMesh(std::uint32_t vertices) {
  OwnedMesh mesh = randomMesh(3, vertices, 1, 2);
  addTangents(mesh, 4);
  const auto setLength = [](float* v, double length) {
    const double factor = length / std::hypot(double{v[0]}, double{v[1]}, double{v[2]});
    for (int i = 0; i < 3; ++i) v[i] = static_cast<float>(factor * double{v[i]});
  };
  for (std::uint32_t v = 0; v < vertices; ++v) {
    setLength(&mesh.positions[v * 3], 1);
    setLength(&mesh.centersOfRotation[v * 3], 0.25);
    mesh.joints[v * 2] = 0;
    mesh.joints[v * 2 + 1] = v + 1;
    mesh.weights[v * 2] = 0.75f;
    mesh.weights[v * 2 + 1] = 0.25f;
  }
  return mesh;
}

/// Skins a mesh and compares every vertex. `where` names the case.
class Verifier {
 public:
  Verifier(samples::BatchTarget& target, OwnedMesh& mesh, std::uint32_t joints)
      : target_(target), view_(mesh.view()), packed_(pack(view_, joints).value()) {
    options_.output.tangents = VertexFormat::float32x4;
    options_.output.bounds = target.limits().maxStorageBuffersPerStage >= storageBuffersWanted;
    options_.countUntouched = false;
    runner_ = target.runner(options_);
  }

  Comparison verify(std::span<const JointMatrix> pose, Method method, const std::string& where) {
    const samples::SkinRequest request{&packed_, pose, JointPromise::scaling, method};
    const Result<samples::BatchResult> result = runner_->run({&request, 1});
    EXPECT_TRUE(result.ok()) << (result ? "" : result.error().message);
    if (!result) return {};
    const reference::SkinnedMesh expected = reference::skin(view_, pose, method).value();
    const samples::SkinnedVertices& skinned = result->instances[0];
    const Comparison comparison =
        compareWithReference(expected, skinned.view(), exemptionsOf(expected)).value();
    EXPECT_TRUE(comparison.passed())
        << target_.name() << ", " << where << ", " << methodName(method) << ": "
        << comparison.failures << " failures, the first is vertex " << comparison.firstFailure
        << "; positions " << comparison.worstPosition << " of the bound, normals "
        << comparison.worstNormal << ", tangents " << comparison.worstTangent;
    return comparison;
  }

 private:
  samples::BatchTarget& target_;
  MeshView view_;
  PackedMesh packed_;
  samples::RunOptions options_;
  std::unique_ptr<samples::BatchRunner> runner_;
};

}  // namespace

void verifyThinMirrors(samples::BatchTarget& target) {
  OwnedMesh mesh = pairMesh(count);
  Verifier verifier(target, mesh, count + 1);
  Random random(1);
  for (const double size : {0x1p-90, 1e-9, 1.0, 1e9, 0x1p98}) {
    // −det = size³ · thickness.
    const double edge = 0x1p-100 * std::max(1.0, 1 / size);
    for (const double share : {0.0, 0.5, 2.0}) {
      std::vector<JointMatrix> pose{JointMatrix()};
      for (std::uint32_t joint = 0; joint < count; ++joint) {
        glm::dvec3 sizes(size);
        sizes[static_cast<int>(joint % 3)] *= -share * edge;
        // The thin axis is one of the result's, so that products of the determinant do not cancel.
        pose.push_back(jointOf(diagonalMatrix(sizes.x, sizes.y, sizes.z) * random.rotation()));
      }
      for (const Method method : target.methods()) {
        const Comparison comparison = verifier.verify(
            pose, method, "size " + std::to_string(size) + ", " + std::to_string(share));
        const bool isOutside = share == 0.5 && method != Method::linear;
        EXPECT_EQ(comparison.exempt, (Exemptions{isOutside ? count : 0, 0, 0}))
            << methodName(method) << ", size " << size << ", " << share;
      }
    }
  }
  // Scaled to entries of 1/2, the determinant is −2^-126 + 0.9 · 2^-126 + 0.9 · 2^-126: not
  // negative, unless denormals are flushed.
  JointMatrix flat;
  const float rows[3][3] = {{1, 1, 1}, {0, 1, -1}, {-0.9f * 0x1p-123f, 0, -0x1p-123f}};
  for (int row = 0; row < 3; ++row) std::copy_n(rows[row], 3, flat.m[row]);
  std::vector<JointMatrix> pose(count + 1, flat);
  pose[0] = JointMatrix();
  for (const Method method : target.methods())
    EXPECT_EQ(verifier.verify(pose, method, "flat").exempt, Exemptions()) << methodName(method);
}

void verifyTinyJoints(samples::BatchTarget& target) {
  OwnedMesh mesh = pairMesh(count);
  Verifier verifier(target, mesh, count + 1);
  Random random(2);
  for (const double side : {1.0, -1.0}) {
    // At the least size of a rotation, a mirror is already too thin.
    const double least = side < 0 ? 0x1p-100 : 0.5 * 0x1p-100;
    for (const double size :
         {1.01 * least, 0.99 * least, 0x1p-110, 0x1p-119, 0x1p-125, 1e-39, 1e-42}) {
      std::vector<JointMatrix> pose;
      for (std::uint32_t joint = 0; joint <= count; ++joint)
        pose.push_back(jointOf(side * size * random.rotation(), {0, 1e-30, random.between(-1, 1)}));
      const std::string where = std::to_string(side) + " * 2^" + std::to_string(std::log2(size));
      for (const Method method : target.methods()) {
        const Comparison comparison = verifier.verify(pose, method, where);
        const bool isOutside = size < least && method != Method::linear;
        EXPECT_EQ(comparison.exempt, (Exemptions{isOutside ? count : 0, 0, 0}))
            << methodName(method) << ", " << where;
      }
    }
  }
}

void verifyLargeNumbers(samples::BatchTarget& target) {
  struct Sizes {
    double translation = 1, scale = 1, position = 1, direction = 1;
  };
  const double inside = 0x1p99, outside = 1.01 * 0x1p100, most = 3e38;
  Random random(3);
  for (const auto& [sizes, isInside] : {
           std::pair{Sizes{inside, 1, 1, 1}, true},
           std::pair{Sizes{1, inside, 1, 1}, true},
           std::pair{Sizes{1, 1, inside, 1}, true},
           std::pair{Sizes{1, 0x1p-90, inside, 1}, true},
           std::pair{Sizes{1, inside, 0x1p-130, 1}, true},
           std::pair{Sizes{1, 0x1p50, 0x1p49, 1}, true},
           std::pair{Sizes{1, 1, 1, inside}, true},
           std::pair{Sizes{1, 1, 1, 1.01 * 0x1p-100}, true},
           std::pair{Sizes{outside, 1, 1, 1}, false},
           std::pair{Sizes{1, outside, 1, 1}, false},
           std::pair{Sizes{1, 1, outside, 1}, false},
           std::pair{Sizes{1, outside, 1e-30, 1}, false},
           std::pair{Sizes{1, 0x1p51, 0x1p50, 1}, false},
           std::pair{Sizes{1, 1, 1, outside}, false},
           std::pair{Sizes{1, 1, 1, 0.99 * 0x1p-100}, false},
           std::pair{Sizes{most, 1, 1, 1}, false},
           std::pair{Sizes{1, most, 1, 1}, false},
           std::pair{Sizes{1, 1, most, 1}, false},
           std::pair{Sizes{most, most, most, most}, false},
       }) {
    OwnedMesh mesh = pairMesh(count);
    std::vector<JointMatrix> pose{JointMatrix()};
    for (std::uint32_t v = 0; v < count; ++v) {
      if (v % 2 == 1) {
        pose.push_back(jointOf(random.rotation(), {1, 2, 3}));
        continue;
      }
      const glm::dvec3 direction = random.rotation()[0];
      pose.push_back(jointOf(sizes.scale * random.rotation(), sizes.translation * direction));
      for (std::size_t i = v * 3; i < v * 3 + 3; ++i) {
        mesh.positions[i] *= static_cast<float>(sizes.position);
        mesh.centersOfRotation[i] *= static_cast<float>(sizes.position);
        mesh.normals[i] *= static_cast<float>(sizes.direction);
      }
    }
    Verifier verifier(target, mesh, count + 1);
    for (const Method method : target.methods()) {
      const std::string where = "translation " + std::to_string(std::log2(sizes.translation)) +
                                ", scale " + std::to_string(std::log2(sizes.scale)) +
                                ", position " + std::to_string(std::log2(sizes.position)) +
                                ", direction " + std::to_string(std::log2(sizes.direction));
      const Comparison comparison = verifier.verify(pose, method, where);
      EXPECT_EQ(comparison.exempt, (Exemptions{0, 0, isInside ? 0 : count / 2}))
          << methodName(method) << ", " << where;
    }
  }
}

void verifyEntriesOfAnySize(samples::BatchTarget& target) {
  constexpr std::uint32_t vertices = 500;
  OwnedMesh mesh = pairMesh(vertices);
  Verifier verifier(target, mesh, vertices + 1);
  Random random(4);
  for (const bool isSmall : {false, true}) {
    for (const double reach : {1, 8, 20, 40, 64, 80, 100, 120}) {
      std::vector<JointMatrix> pose(vertices + 1);
      for (std::uint32_t joint = 1; joint <= vertices; ++joint) {
        for (auto& row : pose[joint].m) {
          for (int column = 0; column < 3; ++column) {
            const double size = std::exp2(random.between(-reach, isSmall ? 0 : reach));
            row[column] = static_cast<float>(random.between(-2, 2) * size);
          }
        }
      }
      for (const Method method : {Method::linear, Method::dualQuaternion}) {
        const Comparison comparison =
            verifier.verify(pose, method, "entries of 2^" + std::to_string(reach));
        if (reach < 90) {
          EXPECT_GE(comparison.compared, vertices / 20) << methodName(method) << ", " << reach;
        }
      }
    }
  }
}

namespace {

constexpr int hostileKinds = 23;

JointMatrix hostileJoint(Random& random, int kind) {
  const auto scaled = [&random](double x, double y, double z) {
    return random.rotation() * diagonalMatrix(x, y, z);
  };
  const auto placed = [&random](const glm::dmat3& linear, double reach = 10) {
    return jointOf(linear, {random.between(-reach, reach), random.between(-reach, reach),
                            random.between(-reach, reach)});
  };
  switch (kind) {
    case 0:
      return placed(random.rotation());
    case 1:
      return placed(random.rotation(), 1e20);
    case 2:
      return placed(scaled(1e15, 1e15, 1e15));
    case 3:
      return placed(scaled(1e-15, 1e-15, 1e-15));
    case 4:
      return placed(scaled(1e6, 1, 1e-6));
    case 5:
      return placed(scaled(-1, 1, 1));
    case 6:
      return placed(scaled(-1, -1, -1));
    case 7:
      return placed(scaled(0, 1, 1));
    case 8:
      return placed(scaled(0, 0, 1));
    case 9:
      return placed(scaled(0, 0, 0));
    case 10: {
      JointMatrix joint = placed(random.rotation());
      joint.m[1][1] = std::numeric_limits<float>::quiet_NaN();
      return joint;
    }
    case 11: {
      JointMatrix joint = placed(random.rotation());
      joint.m[0][3] = std::numeric_limits<float>::infinity();
      return joint;
    }
    case 12:
      return placed(scaled(1e-30, 1e-30, 1e-30));
    case 13:
      return placed(scaled(1e-42, 1e-42, 1e-42));
    case 14:
      return placed(scaled(1e30, 1, 1));
    case 15:
      return placed(scaled(1.000001, 1, 0.999999));
    case 16:
      return placed(scaled(3, 0.3, 1) * random.rotation());
    case 17:
      return placed(random.rotation(), 3e37);
    case 18:
      return placed(scaled(1e-20, 1, 1));
    case 19:
      return placed(scaled(-1e-3, 1, 1));
    case 20: {
      glm::dmat3 linear;
      for (int i = 0; i < 9; ++i) linear[i / 3][i % 3] = random.between(-2, 2);
      return placed(linear);
    }
    case 21:
      return placed(scaled(1e18, 1e-18, 1));
    default: {
      JointMatrix joint;
      for (auto& row : joint.m) {
        // Any sign, exponent and mantissa of a finite number.
        for (int column = 0; column < 3; ++column) {
          row[column] =
              std::bit_cast<float>((random.bits() & 0x807fffffu) | (random.bits() % 255) << 23);
        }
      }
      return joint;
    }
  }
}

}  // namespace

void verifyHostilePoses(samples::BatchTarget& target, std::uint32_t influences, int repeats) {
  Random random(5);
  constexpr std::uint32_t joints = 12;
  OwnedMesh mesh = randomMesh(influences, 120, joints, influences);
  addTangents(mesh, 6);
  Verifier verifier(target, mesh, joints);
  std::uint64_t compared = 0;
  for (int run = 0; run < hostileKinds * repeats; ++run) {
    const int kind = run % hostileKinds;
    const int other = static_cast<int>(random.bits() % hostileKinds);
    std::vector<JointMatrix> pose;
    for (std::uint32_t joint = 0; joint < joints; ++joint) {
      const std::uint32_t choice = random.bits() % 6;
      pose.push_back(hostileJoint(random, choice < 3 ? kind : choice == 3 ? other : 0));
    }
    const std::string where = std::to_string(kind) + " and " + std::to_string(other);
    for (const Method method : target.methods())
      compared += verifier.verify(pose, method, where).compared;
  }
  const std::uint64_t all = std::uint64_t{120} * hostileKinds * target.methods().size();
  EXPECT_GE(compared, all * static_cast<std::uint64_t>(repeats) / 3);
}

}  // namespace dermis::test
