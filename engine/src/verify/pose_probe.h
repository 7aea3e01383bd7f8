// Measures how a pose deforms a mesh, on a sample of its edges: for `diagnose`.
#pragma once

#include <cstdint>
#include <span>
#include <utility>
#include <vector>

#include <glm/mat3x3.hpp>
#include <glm/vec3.hpp>

#include "dermis/mesh.h"

namespace dermis::diagnosis {

struct Affine {
  glm::dmat3 linear{1};
  glm::dvec3 translation{0};
  /// The transform of a joint is not known: it moves with another one. A product with it is not
  /// known, either.
  bool guessed = false;
};

Affine operator*(const Affine& a, const Affine& b);
/// Not finite if the matrix is singular.
Affine inverse(const Affine& a);
Affine toAffine(const JointMatrix& matrix);
JointMatrix toJointMatrix(const Affine& a);
bool isFinite(const Affine& a);

using Pose = std::vector<Affine>;  ///< one transform for each joint

/// A joint that does not exist.
inline constexpr std::uint32_t noJoint = 0xffffffffu;

/// What is known of a skeleton in bind pose. Each is empty or has one element for each joint.
struct BindSkeleton {
  Pose inverseBind;
  std::vector<std::uint32_t> parents;  ///< the nearest joint above, or `noJoint`
};

/// How far a pose is from a sound one. All are 0 in bind pose except `misfit`, and do not depend on
/// a transform of the whole model or on its size.
struct PoseScore {
  double stretch = 0;  ///< mean of |log| of the edges' lengths against those in bind pose
  /// Mean distance of a joint from where its parent takes it, in lengths of its bone, at most 1.
  double apart = 0;
  double loose = 0;  ///< share of joints that are not where their parents take them
  double bend = 0;   ///< mean angle between a joint and its parent, against bind pose: 1 is 180°
  /// How far joints are from the vertices that they move, in bind pose: 0 if each joint is in the
  /// middle of its vertices, 1 if all joints were in the middle of the mesh.
  double misfit = 0;
};

class PoseProbe {
 public:
  /// The mesh must be valid for the poses. Without triangles the edges join vertices that are near
  /// each other.
  PoseProbe(const MeshView& mesh, std::span<const std::uint32_t> triangles);

  /// The positions of the sampled vertices, by linear blending.
  std::vector<glm::dvec3> skin(const Pose& pose) const;
  PoseScore score(const Pose& pose, const BindSkeleton& skeleton) const;

 private:
  struct Weight {
    std::uint32_t joint;
    double weight;
  };
  struct Vertex {
    glm::dvec3 position;
    std::size_t firstWeight, endWeight;
  };

  using Edge = std::pair<std::uint32_t, std::uint32_t>;
  void keepEdges(const MeshView& mesh, const std::vector<Edge>& edges);
  void findCenters(const MeshView& mesh);
  double stretchOf(const Pose& pose, double scale) const;
  void addJoints(const Pose& pose, const BindSkeleton& skeleton, PoseScore& score) const;
  double misfitOf(const BindSkeleton& skeleton) const;

  std::vector<Vertex> vertices_;
  std::vector<Weight> weights_;
  std::vector<Edge> edges_;  ///< pairs of sampled vertices
  std::vector<std::uint32_t> usedJoints_;
  struct Moved {
    std::uint32_t joint;
    double weight;
    glm::dvec3 center;
  };
  std::vector<Moved> moved_;  ///< by joint: the middle of its vertices
  double meshSize_ = 0;
};

/// The diagonal of the box around points.
double sizeOf(std::span<const glm::dvec3> points);

}  // namespace dermis::diagnosis
