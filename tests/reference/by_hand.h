// The mathematics of the methods a second time, by other means than the reference's: Newton's
// iteration for the polar decomposition, the outer product q qᵀ for the quaternion, matrices for
// the movement, series for exponentials and logarithms.
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <functional>
#include <span>
#include <vector>

#include <glm/mat4x4.hpp>
#include <glm/matrix.hpp>

#include "reference_rig.h"

namespace dermis::test {

using Quaternion = std::array<double, 4>;  // w x y z

/// Higham 1986: X ← ½ (X + X⁻ᵀ) converges to the orthogonal factor of a matrix of full rank.
inline glm::dmat3 orthogonalFactor(glm::dmat3 x) {
  for (int step = 0; step < 100; ++step) {
    const double scale = std::pow(std::abs(glm::determinant(x)), -1.0 / 3);
    const glm::dmat3 scaled = step < 8 ? x * scale : x;
    x = (scaled + glm::transpose(glm::inverse(scaled))) * 0.5;
  }
  return x;
}

/// The column of q qᵀ with the largest diagonal element, which is linear in the rotation matrix.
inline Quaternion quaternionOf(const glm::dmat3& r) {
  const auto at = [&](int row, int column) { return r[column - 1][row - 1]; };
  const double outer[4][4] = {{1 + at(1, 1) + at(2, 2) + at(3, 3), at(3, 2) - at(2, 3),
                               at(1, 3) - at(3, 1), at(2, 1) - at(1, 2)},
                              {at(3, 2) - at(2, 3), 1 + at(1, 1) - at(2, 2) - at(3, 3),
                               at(1, 2) + at(2, 1), at(1, 3) + at(3, 1)},
                              {at(1, 3) - at(3, 1), at(1, 2) + at(2, 1),
                               1 - at(1, 1) + at(2, 2) - at(3, 3), at(2, 3) + at(3, 2)},
                              {at(2, 1) - at(1, 2), at(1, 3) + at(3, 1), at(2, 3) + at(3, 2),
                               1 - at(1, 1) - at(2, 2) + at(3, 3)}};
  std::size_t best = 0;
  for (std::size_t i = 1; i < 4; ++i) {
    if (outer[i][i] > outer[best][best]) best = i;
  }
  Quaternion q{};
  double square = 0;
  for (std::size_t i = 0; i < 4; ++i) square += outer[i][best] * outer[i][best];
  for (std::size_t i = 0; i < 4; ++i) q[i] = outer[i][best] / std::sqrt(square);
  return q;
}

inline Quaternion times(const Quaternion& a, const Quaternion& b) {
  return {a[0] * b[0] - a[1] * b[1] - a[2] * b[2] - a[3] * b[3],
          a[0] * b[1] + a[1] * b[0] + a[2] * b[3] - a[3] * b[2],
          a[0] * b[2] - a[1] * b[3] + a[2] * b[0] + a[3] * b[1],
          a[0] * b[3] + a[1] * b[2] - a[2] * b[1] + a[3] * b[0]};
}

/// The rotation matrix of a quaternion of any length but 0.
inline glm::dmat3 rotationOf(const Quaternion& q) {
  double square = 0;
  for (const double part : q) square += part * part;
  const glm::dvec3 v(q[1], q[2], q[3]);
  glm::dmat3 rotation;
  for (int column = 0; column < 3; ++column) {
    glm::dvec3 e(0.0);
    e[column] = 1;
    rotation[column] = ((q[0] * q[0] - glm::dot(v, v)) * e + 2.0 * glm::dot(v, e) * v +
                        2.0 * q[0] * glm::cross(v, e)) /
                       square;
  }
  return rotation;
}

/// The angle of the rotation that leads from one to the other, 0 to π.
inline double angleBetween(const glm::dmat3& a, const glm::dmat3& b) {
  const Quaternion q = quaternionOf(glm::transpose(a) * b);
  return 2 * std::atan2(std::hypot(q[1], q[2], q[3]), std::abs(q[0]));
}

struct Parts {
  glm::dmat3 rotation, scaleShear;
  glm::dvec3 translation;
};

inline Parts partsOf(const JointMatrix& joint) {
  const glm::dmat3 c = linearOf(joint);
  const glm::dmat3 rotation = orthogonalFactor(glm::determinant(c) < 0 ? -c : c);
  return {rotation, glm::transpose(rotation) * c, offsetOf(joint)};
}

/// A rigid transform as a matrix.
inline glm::dmat4 matrixOf(const glm::dmat3& rotation, const glm::dvec3& translation) {
  glm::dmat4 matrix(rotation);
  matrix[3] = glm::dvec4(translation, 1);
  return matrix;
}

/// Of a 3×3 or a 4×4.
template <typename Matrix>
double largestEntry(const Matrix& m) {
  constexpr int size = Matrix::length();
  double largest = 0;
  for (int i = 0; i < size * size; ++i)
    largest = std::max(largest, std::abs(m[i / size][i % size]));
  return largest;
}

/// Taylor's series of the matrix over 2^k, squared k times.
inline glm::dmat4 exponentialOf(const glm::dmat4& matrix) {
  constexpr int squarings = 6;
  const glm::dmat4 part = matrix * std::ldexp(1.0, -squarings);
  glm::dmat4 sum(1.0), term(1.0);
  for (int i = 1; i < 20; ++i) {
    term = term * part * (1.0 / i);
    sum += term;
  }
  for (int i = 0; i < squarings; ++i) sum = sum * sum;
  return sum;
}

/// Square roots by Denman and Beavers 1976 until the matrix is near to 1, then the series of
/// log(1 + x). The principal logarithm: of rotations below half a turn.
inline glm::dmat4 logarithmOf(glm::dmat4 matrix) {
  int roots = 0;
  while (largestEntry(matrix - glm::dmat4(1.0)) > 0.02) {
    glm::dmat4 y = matrix, z(1.0);
    for (int step = 0; step < 30; ++step) {
      const glm::dmat4 next = (y + glm::inverse(z)) * 0.5;
      z = (z + glm::inverse(y)) * 0.5;
      y = next;
    }
    matrix = y;
    ++roots;
  }
  const glm::dmat4 x = matrix - glm::dmat4(1.0);
  glm::dmat4 sum(0.0), power(1.0);
  for (int i = 1; i < 20; ++i) {
    power = power * x;
    sum += power * ((i % 2 == 1 ? 1.0 : -1.0) / i);
  }
  return sum * std::ldexp(1.0, roots);
}

inline glm::dmat3 randomSymmetric(RigRandom& random, double low, double high) {
  const glm::dmat3 frame = rotationAbout(random.direction(), random.between(0, pi));
  return frame *
         diagonalMatrix(random.between(low, high), random.between(low, high),
                        random.between(low, high)) *
         glm::transpose(frame);
}

inline glm::dmat3 randomRotation(RigRandom& random) {
  return rotationAbout(random.direction(), random.between(-pi, pi));
}

enum class Joints { rigid, scaled, mirrored, mixed };
inline constexpr std::array allJoints{Joints::rigid, Joints::scaled, Joints::mirrored,
                                      Joints::mixed};

/// Turned by less than `mostAngle`.
inline JointMatrix randomJoint(RigRandom& random, Joints kind, double mostAngle = pi) {
  const glm::dmat3 rotation =
      rotationAbout(random.direction(), random.between(-mostAngle, mostAngle));
  if (kind == Joints::mixed) kind = allJoints[random.below(3)];
  const glm::dmat3 scale = kind == Joints::rigid    ? glm::dmat3(1.0)
                           : kind == Joints::scaled ? randomSymmetric(random, 0.4, 2.5)
                                                    : randomSymmetric(random, -2.5, -0.4);
  return jointOf(rotation * scale, random.vector(1));
}

inline std::vector<JointMatrix> randomJoints(RigRandom& random, Joints kind, int count,
                                             double mostAngle = pi) {
  std::vector<JointMatrix> pose;
  for (int joint = 0; joint < count; ++joint) pose.push_back(randomJoint(random, kind, mostAngle));
  return pose;
}

/// Scattered, with shares of its own for every vertex.
inline OwnedMesh meshWithShares(RigRandom& random, std::uint32_t vertices, std::uint32_t joints,
                                std::uint32_t influences) {
  OwnedMesh mesh = scatteredMesh(random, vertices, joints, influences);
  for (std::uint32_t vertex = 0; vertex < vertices; ++vertex) {
    mesh.dualQuaternionWeights.push_back(static_cast<float>(random.between(0, 1)));
    mesh.bulgeStrengths.push_back(static_cast<float>(random.between(0, 1)));
  }
  return mesh;
}

/// A vertex with its joints taken apart by hand, normalized weights, and what two phases have in
/// common.
struct ByHand {
  struct Influence {
    double weight;
    Parts parts;
    JointMatrix matrix;
  };

  /// `parts` of the joints, if the test knows them.
  ByHand(const OwnedMesh& mesh, std::size_t vertex, std::span<const JointMatrix> pose,
         std::span<const Parts> parts = {})
      : position(bindPosition(mesh, vertex)), normal(bindNormal(mesh, vertex)) {
    for (int i = 0; i < 3; ++i)
      center[i] =
          static_cast<double>(mesh.centersOfRotation[3 * vertex + static_cast<std::size_t>(i)]);
    double sum = 0;
    for (std::uint32_t slot = 0; slot < mesh.influencesPerVertex; ++slot) {
      const std::size_t entry = vertex * mesh.influencesPerVertex + slot;
      const auto weight = static_cast<double>(mesh.weights[entry]);
      const std::uint32_t joint = mesh.joints[entry];
      influences.push_back(
          {weight, parts.empty() ? partsOf(pose[joint]) : parts[joint], pose[joint]});
      sum += weight;
    }
    std::size_t pivot = 0;
    for (std::size_t i = 0; i < influences.size(); ++i) {
      influences[i].weight /= sum;
      m += influences[i].weight * influences[i].parts.scaleShear;
      if (influences[i].weight > influences[pivot].weight) pivot = i;
    }
    const Quaternion towards = quaternionOf(influences[pivot].parts.rotation);
    for (const Influence& influence : influences) {
      const Quaternion q = quaternionOf(influence.parts.rotation);
      const glm::dvec3& t = influence.parts.translation;
      const Quaternion d = times({0, t.x / 2, t.y / 2, t.z / 2}, q);
      double dot = 0;
      for (std::size_t i = 0; i < 4; ++i) dot += q[i] * towards[i];
      ambiguous |= std::abs(dot) < 1e-5;
      for (std::size_t i = 0; i < 4; ++i) {
        real[i] += (dot < 0 ? -1 : 1) * influence.weight * q[i];
        dual[i] += (dot < 0 ? -1 : 1) * influence.weight * d[i];
      }
    }
    rotation = rotationOf(real);
  }

  glm::dvec3 linear(const glm::dvec3& p) const {
    glm::dvec3 sum(0.0);
    for (const Influence& influence : influences)
      sum += influence.weight * (linearOf(influence.matrix) * p + offsetOf(influence.matrix));
    return sum;
  }
  glm::dvec3 rigidLinear(const glm::dvec3& p) const {
    glm::dvec3 sum(0.0);
    for (const Influence& influence : influences)
      sum += influence.weight * (influence.parts.rotation * p + influence.parts.translation);
    return sum;
  }
  /// Dual quaternions move M p by this besides the rotation.
  glm::dvec3 dualTranslation() const {
    double square = 0;
    for (const double part : real) square += part * part;
    const Quaternion t = times(dual, {real[0], -real[1], -real[2], -real[3]});
    return 2.0 / square * glm::dvec3(t[1], t[2], t[3]);
  }
  glm::dvec3 dualQuaternions(const glm::dvec3& p) const {
    return rotation * (m * p) + dualTranslation();
  }
  /// By the inverse transpose of M, then turned.
  glm::dvec3 turnedNormal(const glm::dmat3& turn) const {
    return glm::normalize(turn * (glm::transpose(glm::inverse(m)) * normal));
  }

  glm::dvec3 position, normal, center{0.0};
  std::vector<Influence> influences;
  glm::dmat3 m{0.0};    ///< Σ w S
  glm::dmat3 rotation;  ///< of the blended quaternion
  Quaternion real{}, dual{};
  bool ambiguous = false;
};

struct Moved {
  glm::dvec3 position, normal;
};

inline Moved dualQuaternionsByHand(const ByHand& vertex) {
  return {vertex.dualQuaternions(vertex.position), vertex.turnedNormal(vertex.rotation)};
}

struct Tolerance {
  Tolerance(double positions) : Tolerance(positions, 100 * positions) {}
  Tolerance(double positions, double normals) : position(positions), normal(normals) {}
  double position, normal;
};

/// `compared` counts vertices, normals apart.
inline void expectFormula(OwnedMesh& mesh, std::span<const JointMatrix> pose, Method method,
                          const Tolerance& tolerance,
                          const std::function<Moved(const ByHand&)>& formula) {
  const reference::AnalyzedMesh result = skinned(mesh, pose, method);
  std::size_t compared = 0;
  for (std::size_t vertex = 0; vertex < mesh.vertexCount(); ++vertex) {
    const ByHand byHand(mesh, vertex, pose);
    const reference::Conditioning& conditioning = result.conditioning[vertex];
    if (byHand.ambiguous || conditioning.signAmbiguous) continue;
    ++compared;
    const Moved expected = formula(byHand);
    expectNear(toVector(result.positions[vertex]), expected.position, tolerance.position);
    if (conditioning.normalAlignment < 1e-2) continue;
    expectNear(toVector(result.normals[vertex]), expected.normal, tolerance.normal);
  }
  EXPECT_GE(compared, mesh.vertexCount() * 3 / 4);
}

}  // namespace dermis::test
