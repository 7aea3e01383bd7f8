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
constexpr std::size_t maxEdges = 1'500;
/// Edges count as at least so long, in mesh sizes: the stretch of tiny ones is not seen.
constexpr double shortestEdge = 0.01;

/// The squares of the columns' lengths, as a mean: the scale of a joint, squared.
double squaredScale(const dmat3& m) {
  return (glm::dot(m[0], m[0]) + glm::dot(m[1], m[1]) + glm::dot(m[2], m[2])) / 3;
}

double distance(const dmat3& a, const dmat3& b) {
  return std::sqrt(3 * squaredScale(a - b));
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
  return {a.linear * b.linear, a.linear * b.translation + a.translation};
}

Affine inverse(const Affine& a) {
  const dmat3 linear = glm::inverse(a.linear);
  return {linear, -(linear * a.translation)};
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
  const auto repeated = std::ranges::unique(usedJoints_);
  usedJoints_.erase(repeated.begin(), repeated.end());
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

PoseScore PoseProbe::score(const Pose& pose, const BindSkeleton& skeleton) const {
  PoseScore score;
  const PoseScore bad{std::numeric_limits<double>::infinity(), 0, 0};
  // The scale of the whole model: of a joint in the middle.
  std::vector<double> scales;
  for (const std::uint32_t joint : usedJoints_) {
    if (!isFinite(pose[joint])) return bad;
    scales.push_back(std::sqrt(squaredScale(pose[joint].linear)));
  }
  if (scales.empty() || !(meshSize_ > 0)) return score;
  const auto middle = scales.begin() + static_cast<std::ptrdiff_t>(scales.size() / 2);
  std::ranges::nth_element(scales, middle);
  const double scale = *middle;
  if (!(scale > 0)) return bad;

  const std::vector<dvec3> posed = skin(pose);
  const double shortest = shortestEdge * meshSize_;
  for (const auto& [a, b] : edges_) {
    const double bind = glm::distance(vertices_[a].position, vertices_[b].position);
    const double now = glm::distance(posed[a], posed[b]) / scale;
    score.stretch += std::abs(std::log((now + shortest) / (bind + shortest)));
  }
  if (!edges_.empty()) score.stretch /= static_cast<double>(edges_.size());

  std::size_t pairs = 0;
  for (const std::uint32_t joint : usedJoints_) {
    const std::uint32_t parent = skeleton.parents.empty() ? noJoint : skeleton.parents[joint];
    if (parent == noJoint || !isFinite(pose[parent])) continue;
    ++pairs;
    score.bend += distance(pose[joint].linear, pose[parent].linear) / scale / std::sqrt(8.0);
    if (skeleton.inverseBind.empty()) continue;
    const dvec3 place = inverse(skeleton.inverseBind[joint]).translation;
    const dvec3 there = pose[joint].linear * place + pose[joint].translation;
    const dvec3 expected = pose[parent].linear * place + pose[parent].translation;
    score.apart += glm::distance(there, expected) / scale / meshSize_;
  }
  if (pairs != 0) {
    score.bend /= static_cast<double>(pairs);
    score.apart /= static_cast<double>(pairs);
  }
  return score;
}

}  // namespace dermis::diagnosis
