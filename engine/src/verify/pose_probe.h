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

/// How far a pose is from a sound one. All are 0 in bind pose, and do not depend on a transform of
/// the whole model or on its size.
struct PoseScore {
  double stretch = 0;  ///< mean of |log| of the edges' lengths against those in bind pose
  double apart = 0;    ///< mean distance of a joint from where its parent takes it, in mesh sizes
  double bend = 0;     ///< mean difference of a joint's 3×3 matrix from its parent's
  double total() const { return stretch + apart + bend / 4; }
};

class PoseProbe {
 public:
  /// The mesh must be valid for the poses. Without triangles the edges join vertices that are near
  /// each other.
  PoseProbe(const MeshView& mesh, std::span<const std::uint32_t> triangles);

  /// The positions of the sampled vertices, by linear blending.
  std::vector<glm::dvec3> skin(const Pose& pose) const;
  PoseScore score(const Pose& pose, const BindSkeleton& skeleton) const;
  /// Joints with a weight in the sample, ascending.
  const std::vector<std::uint32_t>& usedJoints() const { return usedJoints_; }
  double meshSize() const { return meshSize_; }  ///< diagonal of the box in bind pose

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

  std::vector<Vertex> vertices_;
  std::vector<Weight> weights_;
  std::vector<Edge> edges_;  ///< pairs of sampled vertices
  std::vector<std::uint32_t> usedJoints_;
  double meshSize_ = 0;
};

/// The diagonal of the box around points.
double sizeOf(std::span<const glm::dvec3> points);

}  // namespace dermis::diagnosis
