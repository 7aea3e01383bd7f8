#include "worst_rig.h"

#include <algorithm>
#include <cmath>

#include <glm/geometric.hpp>
#include <glm/gtc/quaternion.hpp>
#include <glm/mat3x3.hpp>

namespace dermis::test {
namespace {

glm::dmat3 rotationOf(const double (&q)[4]) {
  return glm::mat3_cast(glm::normalize(glm::dquat(q[3], q[0], q[1], q[2])));
}

void makePerpendicular(double (&q)[4], const double (&to)[4]) {
  double along = 0, square = 0;
  for (int k = 0; k < 4; ++k) {
    along += q[k] * to[k];
    square += to[k] * to[k];
  }
  for (int k = 0; k < 4; ++k) q[k] -= along / square * to[k];
}

}  // namespace

WorstRig::WorstRig(std::uint32_t seed, std::uint32_t vertices, std::uint32_t influences,
                   JointRange range)
    : engine_(seed), influences_(influences), range_(range) {
  for (std::uint32_t i = 0; i < vertices; ++i) best_.push_back(randomVertex());
  tried_ = best_;
  worst_.assign(vertices, -1);
}

WorstRig::Joint WorstRig::randomJoint() {
  Joint joint{};
  for (double& x : joint.rotation) x = normal();
  for (double& x : joint.stretchFrame) x = normal();
  for (double& x : joint.stretch) x = between(-1, 1);
  for (double& x : joint.translation) x = between(-1, 1);
  for (double& x : joint.deviation) x = between(-1, 1);
  joint.scale = between(-1, 1);
  return joint;
}

WorstRig::Vertex WorstRig::randomVertex() {
  Vertex vertex{};
  for (double(*vector)[3] : {&vertex.position, &vertex.normal, &vertex.tangent, &vertex.center}) {
    for (double& x : *vector) x = normal();
  }
  vertex.share = between(0, 1);
  for (std::uint32_t i = 0; i < influences_; ++i) {
    vertex.weights.push_back(between(0.01, 1));
    vertex.joints.push_back(randomJoint());
  }
  if (engine_() % 2 == 0) oppose(vertex);
  return vertex;
}

/// Pairs of joints that all but cancel, of equal weight, and all but at right angles to the first:
/// what they blend to is hardly longer than the first one's weight.
void WorstRig::oppose(Vertex& vertex) {
  const auto& pivot = vertex.joints[0].rotation;
  const double weight = vertex.weights[0] * between(0.9, 1);
  for (std::size_t i = 1; i < vertex.joints.size(); ++i) {
    auto& rotation = vertex.joints[i].rotation;
    if (i % 2 == 0) {
      for (int k = 0; k < 4; ++k) rotation[k] = -vertex.joints[i - 1].rotation[k];
    } else {
      makePerpendicular(rotation, pivot);
    }
    vertex.weights[i] = weight;
  }
  // Towards the pivot by a little: at 0 the sign is arbitrary.
  const double towards = std::pow(10, between(-4, -1));
  for (std::size_t i = 1; i < vertex.joints.size(); ++i) {
    for (int k = 0; k < 4; ++k) vertex.joints[i].rotation[k] += towards * pivot[k];
  }
}

void WorstRig::change(Joint& joint, double size) {
  const auto move = [&](double& x) { x = std::clamp(x + size * normal(), -1.0, 1.0); };
  switch (engine_() % 6) {
    case 0:
    case 1:
      for (double& x : joint.rotation) x += size * normal();
      break;
    case 2:
      for (double& x : joint.translation) move(x);
      break;
    case 3:
      for (double& x : joint.stretchFrame) x += size * normal();
      break;
    case 4:
      for (double& x : joint.deviation) move(x);
      break;
    default:
      for (double& x : joint.stretch) move(x);
      move(joint.scale);
      break;
  }
}

void WorstRig::change(Vertex& vertex) {
  // From new starts to the last bits: rounding errors are rough.
  const double size = std::pow(10, between(-7, 0));
  const auto move = [&](double& x) { x += size * normal(); };
  switch (engine_() % 4) {
    case 0:
      for (double(*vector)[3] :
           {&vertex.position, &vertex.normal, &vertex.tangent, &vertex.center}) {
        for (double& x : *vector) move(x);
      }
      vertex.share = std::clamp(vertex.share + size * normal(), 0.0, 1.0);
      break;
    case 1:
      for (double& weight : vertex.weights) {
        weight = std::clamp(weight * (1 + size * normal()), 0.01, 1.0);
      }
      break;
    default:
      change(vertex.joints[engine_() % influences_], size);
      break;
  }
}

JointMatrix WorstRig::matrixOf(const Joint& joint) const {
  glm::dmat3 stretch(1.0);
  const double scale = std::pow(range_.scale, joint.scale);
  for (int i = 0; i < 3; ++i) stretch[i][i] = scale * std::pow(range_.stretch, joint.stretch[i]);
  const glm::dmat3 frame = rotationOf(joint.stretchFrame);
  const glm::dmat3 linear = rotationOf(joint.rotation) * frame * stretch * glm::transpose(frame);
  JointMatrix matrix;
  for (int row = 0; row < 3; ++row) {
    for (int column = 0; column < 3; ++column) {
      matrix.m[row][column] = static_cast<float>(
          linear[column][row] + range_.deviation * joint.deviation[row * 3 + column]);
    }
    matrix.m[row][3] = static_cast<float>(range_.translation * joint.translation[row]);
  }
  return matrix;
}

void WorstRig::propose() {
  tried_ = best_;
  for (std::size_t i = 0; i < tried_.size(); ++i) {
    if (worst_[i] < 0) {
      tried_[i] = randomVertex();
    } else {
      change(tried_[i]);
    }
  }
  build();
}

void WorstRig::build() {
  mesh_ = {};
  mesh_.influencesPerVertex = influences_;
  pose_.clear();
  const auto append = [](std::vector<float>& values, const double(&vector)[3], bool unit) {
    const double length = std::hypot(vector[0], vector[1], vector[2]);
    for (const double x : vector) values.push_back(static_cast<float>(unit ? x / length : x));
  };
  for (const Vertex& vertex : tried_) {
    append(mesh_.positions, vertex.position, false);
    append(mesh_.normals, vertex.normal, true);
    append(mesh_.tangents, vertex.tangent, true);
    mesh_.tangents.push_back(1);
    append(mesh_.centersOfRotation, vertex.center, false);
    mesh_.dualQuaternionWeights.push_back(static_cast<float>(vertex.share));
    mesh_.bulgeStrengths.push_back(static_cast<float>(vertex.share));
    for (std::uint32_t i = 0; i < influences_; ++i) {
      mesh_.joints.push_back(static_cast<std::uint32_t>(pose_.size()));
      mesh_.weights.push_back(static_cast<float>(vertex.weights[i]));
      pose_.push_back(matrixOf(vertex.joints[i]));
    }
  }
}

void WorstRig::judge(std::span<const double> shares) {
  for (std::size_t i = 0; i < best_.size(); ++i) {
    if (!(shares[i] > worst_[i])) continue;
    worst_[i] = shares[i];
    best_[i] = tried_[i];
  }
}

}  // namespace dermis::test
