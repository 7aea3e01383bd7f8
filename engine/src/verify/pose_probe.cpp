#include "verify/pose_probe.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <map>

#include <glm/common.hpp>
#include <glm/geometric.hpp>
#include <glm/matrix.hpp>

#include "strict_floating_point.h"
#include "verify/bind_vertex.h"

namespace dermis::diagnosis {
namespace {

using glm::dmat3;
using glm::dvec3;

constexpr std::size_t maxReadEdges = 20'000;
constexpr std::size_t maxEdges = 800;
/// Edges count as at least so long, in mesh sizes: the stretch of tiny ones is not seen.
constexpr double shortestEdge = 0.01;
/// A joint is loose if it is further from where its parent takes it, in lengths of its bone.
constexpr double looseJoint = 0.05;
/// Joints count as at least so far from the middle of the mesh, in mesh sizes.
constexpr double leastSpread = 0.1;

/// The squares of the columns' lengths, as a mean: the scale of a joint, squared.
double squaredScale(const dmat3& m) {
  return (glm::dot(m[0], m[0]) + glm::dot(m[1], m[1]) + glm::dot(m[2], m[2])) / 3;
}

/// The angle between two rotations with scale, as a share of 180°.
double angleBetween(const dmat3& a, const dmat3& b) {
  const double scales = 3 * std::sqrt(squaredScale(a) * squaredScale(b));
  const double trace = glm::dot(a[0], b[0]) + glm::dot(a[1], b[1]) + glm::dot(a[2], b[2]);
  const double cosine = scales > 0 ? (3 * trace / scales - 1) / 2 : 1;
  return std::acos(std::clamp(cosine, -1.0, 1.0)) / std::acos(-1.0);
}

std::vector<std::pair<std::uint32_t, std::uint32_t>> edgesOfTriangles(
    std::span<const std::uint32_t> triangles) {
  std::vector<std::pair<std::uint32_t, std::uint32_t>> edges;
  const std::size_t count = triangles.size() / 3;
  const std::size_t step = std::max<std::size_t>(1, count * 3 / maxReadEdges);
  for (std::size_t triangle = 0; triangle < count; triangle += step) {
    for (std::size_t corner = 0; corner < 3; ++corner) {
      edges.emplace_back(triangles[3 * triangle + corner],
                         triangles[3 * triangle + (corner + 1) % 3]);
    }
  }
  return edges;
}

/// Joins each vertex with the next one in the same cell of a grid, or in the next cell of a row.
std::vector<std::pair<std::uint32_t, std::uint32_t>> edgesOfNeighbors(const MeshView& mesh,
                                                                      const dvec3& low,
                                                                      const dvec3& size) {
  const double cells = std::max(1.0, std::cbrt(mesh.vertexCount / 4.0));
  std::vector<std::pair<std::array<int, 3>, std::uint32_t>> placed;
  for (std::uint32_t vertex = 0; vertex < mesh.vertexCount; ++vertex) {
    const dvec3 p = reference::readPosition(mesh, vertex) - low;
    std::array<int, 3> cell{};
    for (int axis = 0; axis < 3; ++axis)
      cell[static_cast<std::size_t>(axis)] =
          size[axis] > 0 ? static_cast<int>(p[axis] / size[axis] * cells) : 0;
    placed.emplace_back(cell, vertex);
  }
  std::ranges::sort(placed);
  std::vector<std::pair<std::uint32_t, std::uint32_t>> edges;
  const std::size_t step = std::max<std::size_t>(1, placed.size() / maxReadEdges);
  for (std::size_t i = 0; i + 1 < placed.size(); i += step) {
    const auto& [a, first] = placed[i];
    const auto& [b, second] = placed[i + 1];
    if (a[0] == b[0] && a[1] == b[1] && b[2] - a[2] <= 1) edges.emplace_back(first, second);
  }
  return edges;
}

/// Half the sum of differences of weights: from 0 (equal) to 1 (no common joint).
double difference(const std::vector<reference::Influence>& a,
                  const std::vector<reference::Influence>& b) {
  double common = 0;
  for (const reference::Influence& of : a) {
    for (const reference::Influence& other : b)
      if (of.joint == other.joint) common += std::min(of.weight, other.weight);
  }
  return 1 - common;
}

template <typename T>
void thin(std::vector<T>& values, std::size_t limit) {
  if (values.size() <= limit) return;
  std::vector<T> kept;
  for (std::size_t i = 0; i < limit; ++i) kept.push_back(values[i * values.size() / limit]);
  values = std::move(kept);
}

}  // namespace

Affine operator*(const Affine& a, const Affine& b) {
  return {a.linear * b.linear, a.linear * b.translation + a.translation, a.guessed || b.guessed};
}

Affine inverse(const Affine& a) {
  const dmat3 linear = glm::inverse(a.linear);
  return {linear, -(linear * a.translation), a.guessed};
}

Affine toAffine(const JointMatrix& matrix) {
  Affine a;
  for (int row = 0; row < 3; ++row) {
    for (int column = 0; column < 3; ++column) a.linear[column][row] = matrix.m[row][column];
    a.translation[row] = matrix.m[row][3];
  }
  return a;
}

JointMatrix toJointMatrix(const Affine& a) {
  JointMatrix matrix;
  for (int row = 0; row < 3; ++row) {
    for (int column = 0; column < 3; ++column)
      matrix.m[row][column] = static_cast<float>(a.linear[column][row]);
    matrix.m[row][3] = static_cast<float>(a.translation[row]);
  }
  return matrix;
}

bool isFinite(const Affine& a) {
  const dvec3 sum = a.linear[0] + a.linear[1] + a.linear[2] + a.translation;
  return std::isfinite(sum.x) && std::isfinite(sum.y) && std::isfinite(sum.z);
}

double sizeOf(std::span<const dvec3> points) {
  if (points.empty()) return 0;
  dvec3 low = points[0], high = points[0];
  for (const dvec3& p : points) {
    low = glm::min(low, p);
    high = glm::max(high, p);
  }
  return glm::distance(low, high);
}

PoseProbe::PoseProbe(const MeshView& mesh, std::span<const std::uint32_t> triangles) {
  dvec3 low = reference::readPosition(mesh, 0), high = low;
  for (std::size_t vertex = 1; vertex < mesh.vertexCount; ++vertex) {
    const dvec3 p = reference::readPosition(mesh, vertex);
    low = glm::min(low, p);
    high = glm::max(high, p);
  }
  meshSize_ = glm::distance(low, high);
  std::vector<Edge> edges = edgesOfTriangles(triangles);
  if (edges.empty()) edges = edgesOfNeighbors(mesh, low, high - low);
  keepEdges(mesh, edges);
  findCenters(mesh);
}

void PoseProbe::keepEdges(const MeshView& mesh, const std::vector<Edge>& edges) {
  std::map<std::uint32_t, std::vector<reference::Influence>> influences;
  const auto influencesOf = [&](std::uint32_t vertex) -> const std::vector<reference::Influence>& {
    const auto [place, isNew] = influences.try_emplace(vertex);
    if (isNew) reference::readInfluences(mesh, vertex, place->second);
    return place->second;
  };
  // Edges between joints show what is wrong. The others show scale and shear.
  std::vector<Edge> between, within;
  for (const Edge& edge : edges) {
    const auto& a = influencesOf(edge.first);
    const auto& b = influencesOf(edge.second);
    if (a.empty() || b.empty()) continue;  // a vertex without weight stays where it is
    (difference(a, b) > 0.01 ? between : within).push_back(edge);
  }
  thin(between, maxEdges);
  thin(within, std::max<std::size_t>(between.size() / 4, 100));
  between.insert(between.end(), within.begin(), within.end());
  std::map<std::uint32_t, std::uint32_t> sampled;
  const auto sample = [&](std::uint32_t vertex) {
    const auto [place, isNew] =
        sampled.try_emplace(vertex, static_cast<std::uint32_t>(vertices_.size()));
    if (isNew) {
      const std::size_t first = weights_.size();
      for (const reference::Influence& influence : influences[vertex])
        weights_.push_back({influence.joint, influence.weight});
      vertices_.push_back({reference::readPosition(mesh, vertex), first, weights_.size()});
    }
    return place->second;
  };
  for (const Edge& edge : between) {
    const std::uint32_t first = sample(edge.first);
    edges_.emplace_back(first, sample(edge.second));
  }
  for (const Weight& weight : weights_) usedJoints_.push_back(weight.joint);
  std::ranges::sort(usedJoints_);
  usedJoints_.erase(std::unique(usedJoints_.begin(), usedJoints_.end()), usedJoints_.end());
}

std::vector<dvec3> PoseProbe::skin(const Pose& pose) const {
  std::vector<dvec3> positions;
  positions.reserve(vertices_.size());
  for (const Vertex& vertex : vertices_) {
    dvec3 sum(0);
    for (std::size_t i = vertex.firstWeight; i < vertex.endWeight; ++i) {
      const Affine& joint = pose[weights_[i].joint];
      sum += weights_[i].weight * (joint.linear * vertex.position + joint.translation);
    }
    positions.push_back(sum);
  }
  return positions;
}

void PoseProbe::findCenters(const MeshView& mesh) {
  std::map<std::uint32_t, Moved> moved;
  std::vector<reference::Influence> influences;
  const std::size_t step = std::max<std::size_t>(1, mesh.vertexCount / maxReadEdges);
  for (std::size_t vertex = 0; vertex < mesh.vertexCount; vertex += step) {
    reference::readInfluences(mesh, vertex, influences);
    const dvec3 position = reference::readPosition(mesh, vertex);
    for (const reference::Influence& influence : influences) {
      Moved& joint =
          moved.try_emplace(influence.joint, Moved{influence.joint, 0, dvec3(0)}).first->second;
      joint.weight += influence.weight;
      joint.center += influence.weight * position;
    }
  }
  for (auto& [number, joint] : moved) {
    if (!(joint.weight > 0)) continue;
    joint.center /= joint.weight;
    moved_.push_back(joint);
  }
}

double PoseProbe::stretchOf(const Pose& pose, double scale) const {
  const std::vector<dvec3> posed = skin(pose);
  const double shortest = shortestEdge * meshSize_;
  double sum = 0;
  for (const auto& [a, b] : edges_) {
    const double bind = glm::distance(vertices_[a].position, vertices_[b].position);
    const double now = glm::distance(posed[a], posed[b]) / scale;
    sum += std::abs(std::log((now + shortest) / (bind + shortest)));
  }
  return edges_.empty() ? 0 : sum / static_cast<double>(edges_.size());
}

void PoseProbe::addJoints(const Pose& pose, const BindSkeleton& skeleton, PoseScore& score) const {
  std::size_t pairs = 0, guessed = 0;
  for (std::size_t joint = 0; joint < skeleton.parents.size(); ++joint) {
    const std::uint32_t parent = skeleton.parents[joint];
    if (parent == noJoint || !isFinite(pose[joint]) || !isFinite(pose[parent])) continue;
    if (pose[joint].guessed || pose[parent].guessed) {
      ++guessed;
      continue;
    }
    ++pairs;
    score.bend += angleBetween(pose[joint].linear, pose[parent].linear);
    if (skeleton.inverseBind.empty()) continue;
    const double scale = std::sqrt(squaredScale(pose[parent].linear));
    const dvec3 place = inverse(skeleton.inverseBind[joint]).translation;
    const dvec3 origin = inverse(skeleton.inverseBind[parent]).translation;
    const dvec3 there = pose[joint].linear * place + pose[joint].translation;
    const dvec3 expected = pose[parent].linear * place + pose[parent].translation;
    const double bone = std::max(glm::distance(place, origin), shortestEdge * meshSize_);
    const double moved = glm::distance(there, expected) / (scale * bone);
    score.apart += moved < 1 ? moved : 1;
    score.loose += moved < looseJoint ? 0 : 1;
  }
  // Too few joints are known: that is no evidence for the pose.
  if (2 * guessed > pairs) {
    score.bend += 0.5 * static_cast<double>(guessed);
    score.apart += static_cast<double>(guessed);
    score.loose += static_cast<double>(guessed);
    pairs += guessed;
  }
  if (pairs == 0) return;
  score.bend /= static_cast<double>(pairs);
  score.apart /= static_cast<double>(pairs);
  score.loose /= static_cast<double>(pairs);
}

double PoseProbe::misfitOf(const BindSkeleton& skeleton) const {
  if (skeleton.inverseBind.empty() || moved_.size() < 2) return 0;
  dvec3 middle(0);
  double weight = 0;
  for (const Moved& joint : moved_) {
    middle += joint.weight * joint.center;
    weight += joint.weight;
  }
  middle /= weight;
  double away = 0, spread = 0;
  for (const Moved& joint : moved_) {
    const dvec3 off = inverse(skeleton.inverseBind[joint.joint]).translation - joint.center;
    const dvec3 out = joint.center - middle;
    away += joint.weight * glm::dot(off, off);
    spread += joint.weight * glm::dot(out, out);
  }
  // Of a mesh with few joints they may be near each other.
  const double least = leastSpread * meshSize_;
  return std::sqrt(away / (spread + weight * least * least));
}

PoseScore PoseProbe::score(const Pose& pose, const BindSkeleton& skeleton) const {
  PoseScore score;
  const PoseScore bad{std::numeric_limits<double>::infinity(), 0, 0, 0, 0};
  // The scale of the whole model: of a joint in the middle.
  std::vector<double> scales;
  for (const std::uint32_t joint : usedJoints_) {
    if (!isFinite(pose[joint])) return bad;
    scales.push_back(std::sqrt(squaredScale(pose[joint].linear)));
  }
  if (scales.empty() || !(meshSize_ > 0)) return score;
  const auto middle = scales.begin() + static_cast<std::ptrdiff_t>(scales.size() / 2);
  std::ranges::nth_element(scales, middle);
  if (!(*middle > 0)) return bad;
  score.stretch = stretchOf(pose, *middle);
  addJoints(pose, skeleton, score);
  score.misfit = misfitOf(skeleton);
  return score;
}

}  // namespace dermis::diagnosis
