// Rigs for tests of the reference: random numbers, joint matrices from formulas, small meshes. Made
// by other formulas than the code under test uses (Rodrigues instead of quaternions).
#pragma once

#include <gtest/gtest.h>

#include <array>
#include <cmath>
#include <cstdint>
#include <initializer_list>
#include <numbers>
#include <random>
#include <span>
#include <vector>

#include <glm/geometric.hpp>
#include <glm/mat3x3.hpp>
#include <glm/matrix.hpp>
#include <glm/vec3.hpp>

#include "joint_of.h"
#include "random_rig.h"
#include "verify/conditioning.h"

namespace dermis::test {

inline constexpr double pi = std::numbers::pi;

/// Move vertices that have the same weights and inputs by one rigid motion, if the joints are
/// rigid.
inline constexpr std::array rigidMethods{
    Method::dualQuaternion,  Method::dualQuaternionIterative, Method::logMatrix,
    Method::sphericalBlend,  Method::quaternionTranslation,   Method::centerOfRotation,
    Method::bulgeControlled,
};

class RigRandom {
 public:
  explicit RigRandom(std::uint64_t seed) : engine_(seed) {}
  double between(double low, double high) {
    return std::uniform_real_distribution<double>(low, high)(engine_);
  }
  std::uint32_t below(std::uint32_t count) {
    return std::uniform_int_distribution<std::uint32_t>(0, count - 1)(engine_);
  }
  glm::dvec3 vector(double reach) {
    return {between(-reach, reach), between(-reach, reach), between(-reach, reach)};
  }
  glm::dvec3 direction() {
    glm::dvec3 v(0.0);
    while (glm::length(v) < 0.1 || glm::length(v) > 1) v = vector(1);
    return glm::normalize(v);
  }

 private:
  std::mt19937_64 engine_;
};

/// Rodrigues' formula.
inline glm::dmat3 rotationAbout(const glm::dvec3& axis, double angle) {
  const glm::dvec3 n = glm::normalize(axis);
  glm::dmat3 rotation;
  for (int column = 0; column < 3; ++column) {
    glm::dvec3 e(0.0);
    e[column] = 1;
    rotation[column] = std::cos(angle) * e + std::sin(angle) * glm::cross(n, e) +
                       (1 - std::cos(angle)) * glm::dot(n, e) * n;
  }
  return rotation;
}

/// So many joints, made one by one.
template <typename Make>
std::vector<JointMatrix> poseOf(int count, const Make& make) {
  std::vector<JointMatrix> pose;
  while (count-- > 0) pose.push_back(make());
  return pose;
}

inline JointMatrix turnAboutZ(double degrees, const glm::dvec3& translation = {0, 0, 0}) {
  return jointOf(rotationAbout({0, 0, 1}, degrees * pi / 180), translation);
}

/// The 3×3 of a joint as stored, rounding to float32 included.
inline glm::dmat3 linearOf(const JointMatrix& joint) {
  glm::dmat3 linear;
  for (int row = 0; row < 3; ++row) {
    for (int column = 0; column < 3; ++column) {
      linear[column][row] = static_cast<double>(joint.m[row][column]);
    }
  }
  return linear;
}

inline glm::dvec3 offsetOf(const JointMatrix& joint) {
  return {joint.m[0][3], joint.m[1][3], joint.m[2][3]};
}

/// One of the 24 rotations that float32 holds exactly: products of quarter turns.
inline glm::dmat3 exactRotation(RigRandom& random) {
  glm::dmat3 rotation(1.0);
  for (int turn = 0; turn < 6; ++turn) {
    const std::uint32_t axis = random.below(3);
    glm::dmat3 quarter(0.0);
    const int a = static_cast<int>(axis), b = (a + 1) % 3, c = (a + 2) % 3;
    quarter[a][a] = 1;
    quarter[b][c] = 1;
    quarter[c][b] = -1;
    if (random.below(2) == 0) rotation = quarter * rotation;
  }
  return rotation;
}

struct RigInfluence {
  std::uint32_t joint;
  float weight;
};

inline void append(std::vector<float>& values, const glm::dvec3& vector) {
  for (int i = 0; i < 3; ++i) values.push_back(static_cast<float>(vector[i]));
}

/// Its center of rotation is a point by the way: half way to (0.2, −0.4, 0.6).
inline void addVertex(OwnedMesh& mesh, const glm::dvec3& position,
                      std::initializer_list<RigInfluence> influences) {
  append(mesh.positions, position);
  append(mesh.centersOfRotation, 0.5 * position + glm::dvec3(0.1, -0.2, 0.3));
  std::uint32_t slot = 0;
  for (const RigInfluence& influence : influences) {
    mesh.joints.push_back(influence.joint);
    mesh.weights.push_back(influence.weight);
    ++slot;
  }
  for (; slot < mesh.influencesPerVertex; ++slot) {
    mesh.joints.push_back(0);
    mesh.weights.push_back(0);
  }
}

/// Vertices and centres of rotation within the unit cube, every slot with a weight, no joint twice
/// in a vertex.
inline OwnedMesh scatteredMesh(RigRandom& random, std::uint32_t vertices, std::uint32_t jointCount,
                               std::uint32_t influences) {
  OwnedMesh mesh;
  mesh.influencesPerVertex = influences;
  RigRandom centers(vertices);  // their own: the rest does not depend on them
  for (std::uint32_t vertex = 0; vertex < vertices; ++vertex) {
    append(mesh.centersOfRotation, centers.vector(1));
    const glm::dvec3 normal = random.direction();
    std::vector<std::uint32_t> joints(jointCount);
    for (std::uint32_t i = 0; i < jointCount; ++i) joints[i] = i;
    for (int i = 0; i < 3; ++i) {
      mesh.positions.push_back(static_cast<float>(random.between(-1, 1)));
      mesh.normals.push_back(static_cast<float>(normal[i]));
    }
    for (std::uint32_t slot = 0; slot < influences; ++slot) {
      std::swap(joints[slot], joints[slot + random.below(jointCount - slot)]);
      mesh.joints.push_back(joints[slot]);
      mesh.weights.push_back(static_cast<float>(random.between(0.05, 1)));
    }
  }
  return mesh;
}

inline glm::dvec3 toVector(const reference::Double3& v) {
  return {v[0], v[1], v[2]};
}

inline glm::dvec3 bindPosition(const OwnedMesh& mesh, std::size_t vertex) {
  return {mesh.positions[3 * vertex], mesh.positions[3 * vertex + 1],
          mesh.positions[3 * vertex + 2]};
}

inline glm::dvec3 bindNormal(const OwnedMesh& mesh, std::size_t vertex) {
  return {mesh.normals[3 * vertex], mesh.normals[3 * vertex + 1], mesh.normals[3 * vertex + 2]};
}

/// The reference's answer; a mesh that it refuses fails the test.
inline reference::AnalyzedMesh skinned(const MeshView& mesh, std::span<const JointMatrix> pose,
                                       Method method, std::span<const MorphWeight> morphs = {}) {
  Result<reference::AnalyzedMesh> result = reference::analyze(mesh, pose, method, morphs);
  EXPECT_TRUE(result.ok()) << (result ? "" : result.error().message);
  if (!result) return {};
  return std::move(*result);
}
inline reference::AnalyzedMesh skinned(OwnedMesh& mesh, std::span<const JointMatrix> pose,
                                       Method method) {
  return skinned(mesh.view(), pose, method);
}

inline void expectNear(const glm::dvec3& actual, const glm::dvec3& expected, double tolerance) {
  EXPECT_LE(glm::length(actual - expected), tolerance)
      << "(" << actual.x << ", " << actual.y << ", " << actual.z << ") instead of (" << expected.x
      << ", " << expected.y << ", " << expected.z << ")";
}

/// `expected(vertex)` for the position of every vertex.
template <typename Expected>
void expectPositions(const reference::AnalyzedMesh& actual, double tolerance,
                     const Expected& expected) {
  for (std::size_t vertex = 0; vertex < actual.positions.size(); ++vertex) {
    SCOPED_TRACE(vertex);
    expectNear(toVector(actual.positions[vertex]), expected(vertex), tolerance);
  }
}
inline void expectPositions(const reference::AnalyzedMesh& actual, double tolerance,
                            const reference::AnalyzedMesh& expected) {
  expectPositions(actual, tolerance,
                  [&](std::size_t vertex) { return toVector(expected.positions[vertex]); });
}

inline bool isFiniteVector(const reference::Double3& v) {
  return std::isfinite(v[0]) && std::isfinite(v[1]) && std::isfinite(v[2]);
}

/// A closed tube along z from −length/2 to length/2 between joints 0 and 1, whose weights change
/// linearly along all of it. Its centres of rotation lie on the axis.
struct Tube {
  OwnedMesh mesh;
  std::vector<std::array<std::uint32_t, 3>> triangles;
};

inline Tube tubeOf(std::uint32_t rings, std::uint32_t sides, double length, double radius) {
  Tube tube;
  tube.mesh.influencesPerVertex = 2;
  const auto add = [&](const glm::dvec3& position, double along) {
    addVertex(tube.mesh, position,
              {{0, static_cast<float>(1 - along)}, {1, static_cast<float>(along)}});
    tube.mesh.centersOfRotation.resize(tube.mesh.centersOfRotation.size() - 3);
    append(tube.mesh.centersOfRotation, {0, 0, position.z});
  };
  for (std::uint32_t ring = 0; ring <= rings; ++ring) {
    const double along = static_cast<double>(ring) / rings;
    for (std::uint32_t side = 0; side < sides; ++side) {
      const double angle = 2 * pi * side / sides;
      add({radius * std::cos(angle), radius * std::sin(angle), (along - 0.5) * length}, along);
    }
  }
  const std::uint32_t bottom = (rings + 1) * sides, top = bottom + 1;
  add({0, 0, -0.5 * length}, 0);
  add({0, 0, 0.5 * length}, 1);
  for (std::uint32_t side = 0; side < sides; ++side) {
    const std::uint32_t next = (side + 1) % sides;
    for (std::uint32_t ring = 0; ring < rings; ++ring) {
      const std::uint32_t low = ring * sides, high = low + sides;
      tube.triangles.push_back({low + side, low + next, high + next});
      tube.triangles.push_back({low + side, high + next, high + side});
    }
    tube.triangles.push_back({bottom, next, side});
    tube.triangles.push_back({top, rings * sides + side, rings * sides + next});
  }
  return tube;
}

/// The volume that the triangles enclose, by tetrahedra from the origin.
template <typename Position>
double signedVolume(const Tube& tube, const Position& position) {
  double volume = 0;
  for (const auto& [a, b, c] : tube.triangles) {
    volume += glm::dot(position(a), glm::cross(position(b), position(c))) / 6;
  }
  return volume;
}

/// The volume of the tube posed by {identity, joint}, over that at rest.
inline double volumeRatio(Tube& tube, const JointMatrix& joint, Method method) {
  const std::array pose{JointMatrix{}, joint};
  const reference::AnalyzedMesh result = skinned(tube.mesh, pose, method);
  const double after =
      signedVolume(tube, [&](std::uint32_t v) { return toVector(result.positions[v]); });
  return after / signedVolume(tube, [&](std::uint32_t v) { return bindPosition(tube.mesh, v); });
}

}  // namespace dermis::test
