// A search for the vertices that a kernel gets most wrong: many at a time, each with joints of its
// own, changed at random and kept where that made the error larger in units of its bound.
#pragma once

#include <cstdint>
#include <functional>
#include <random>
#include <span>
#include <vector>

#include "random_rig.h"

namespace dermis::test {

/// What a joint may do besides turning and moving.
struct JointRange {
  double stretch = 1;  ///< singular values of 1 / `stretch` to `stretch` times the joint's scale
  double scale = 1;    ///< the joint's scale, 1 / `scale` to `scale`
  double translation = 1;
  /// How far a joint may be from a rotation: entries are moved by so much.
  double deviation = 0;
};

class WorstRig {
 public:
  WorstRig(std::uint32_t seed, std::uint32_t vertices, std::uint32_t influences, JointRange range);

  std::uint32_t vertexCount() const { return static_cast<std::uint32_t>(best_.size()); }
  /// The rig to try: in every vertex something was changed.
  void propose();
  OwnedMesh& mesh() { return mesh_; }
  std::span<const JointMatrix> pose() const { return pose_; }
  /// Keeps the changes of the vertices that got worse.
  void judge(std::span<const double> shares);
  /// The worst share that was kept of every vertex.
  std::span<const double> worst() const { return worst_; }

 private:
  struct Joint {
    double rotation[4], stretchFrame[4], stretch[3], scale, translation[3], deviation[9];
  };
  struct Vertex {
    double position[3], normal[3], tangent[3], center[3], share;
    std::vector<double> weights;
    std::vector<Joint> joints;
  };

  double normal() { return std::normal_distribution<double>()(engine_); }
  double between(double low, double high) {
    return std::uniform_real_distribution<double>(low, high)(engine_);
  }
  Joint randomJoint();
  Vertex randomVertex();
  void oppose(Vertex& vertex);
  void change(Vertex& vertex);
  void change(Joint& joint, double size);
  JointMatrix matrixOf(const Joint& joint) const;
  void build();

  std::mt19937 engine_;
  std::uint32_t influences_;
  JointRange range_;
  std::vector<Vertex> best_, tried_;
  std::vector<double> worst_;
  OwnedMesh mesh_;
  std::vector<JointMatrix> pose_;
};

}  // namespace dermis::test
