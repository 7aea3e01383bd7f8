// Computes centers of rotation: first reads the inputs from the views of the mesh, then solves each
// vertex independently.

#include "dermis/mesh.h"

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <numeric>
#include <span>
#include <string>
#include <utility>
#include <vector>

#include "attribute.h"
#include "centers/pair_index.h"
#include "check_mesh.h"
#include "linear_algebra.h"
#include "pack/influences.h"
#include "strict_floating_point.h"
#include "text.h"

namespace dermis::centers {
namespace {

/// Lists of influences, one after the other.
class InfluenceLists {
 public:
  void add(std::span<const Influence> list) {
    influences_.insert(influences_.end(), list.begin(), list.end());
    ends_.push_back(influences_.size());
  }
  std::span<const Influence> operator[](std::size_t list) const {
    const std::size_t first = list == 0 ? 0 : ends_[list - 1];
    return std::span(influences_).subspan(first, ends_[list] - first);
  }
  std::size_t size() const { return ends_.size(); }

 private:
  std::vector<Influence> influences_;
  std::vector<std::size_t> ends_;
};

struct Vertices {
  std::vector<math::Vec3f> positions;
  InfluenceLists influences;  ///< as `pack` stores them, the strongest first
};

/// The triangles that contribute, in their order.
struct Triangles {
  InfluenceLists influences;  ///< the mean of their vertices', in ascending order of joints
  std::vector<Moment> moments;
};

using Corners = std::span<const std::uint32_t>;

/// In double precision neither overflows, nor comes to 0 by underflow, for any float32 positions.
Moment momentOf(const Vertices& vertices, Corners corners) {
  const math::Vec3 a(vertices.positions[corners[0]]);
  const math::Vec3 b(vertices.positions[corners[1]]);
  const math::Vec3 c(vertices.positions[corners[2]]);
  const double area = 0.5 * math::length(math::cross(b - a, c - a));
  const math::Vec3 moment = area * ((a + b + c) / 3.0);
  return {moment.x, moment.y, moment.z, area};
}

/// Sums are exact, as the weights are multiples of 2^-48: they do not depend on the corners' order.
void meanInfluences(const Vertices& vertices, Corners corners, std::vector<Influence>& mean) {
  mean.clear();
  for (const std::uint32_t corner : corners) {
    const std::span<const Influence> influences = vertices.influences[corner];
    mean.insert(mean.end(), influences.begin(), influences.end());
  }
  mergeJoints(mean);
  for (Influence& influence : mean) influence.weight /= 3;
}

Triangles gatherTriangles(const Vertices& vertices, std::span<const std::uint32_t> indices) {
  Triangles triangles;
  std::vector<Influence> mean;
  for (std::size_t first = 0; first < indices.size(); first += 3) {
    const Corners corners = indices.subspan(first, 3);
    const Moment moment = momentOf(vertices, corners);
    if (moment.sum == 0) continue;
    meanInfluences(vertices, corners, mean);
    if (mean.size() < 2) continue;
    triangles.influences.add(mean);
    triangles.moments.push_back(moment);
  }
  return triangles;
}

bool less(std::span<const Influence> a, std::span<const Influence> b) {
  return std::lexicographical_compare(
      a.begin(), a.end(), b.begin(), b.end(), [](const Influence& x, const Influence& y) {
        return x.joint != y.joint ? x.joint < y.joint : x.weight < y.weight;
      });
}

bool equal(std::span<const Influence> a, std::span<const Influence> b) {
  return std::equal(a.begin(), a.end(), b.begin(), b.end(),
                    [](const Influence& x, const Influence& y) {
                      return x.joint == y.joint && x.weight == y.weight;
                    });
}

/// Triangles with the same influences become one group; groups with the same joints are
/// consecutive.
std::vector<Group> group(const Triangles& triangles) {
  std::vector<std::uint32_t> order(triangles.moments.size());
  std::iota(order.begin(), order.end(), 0u);
  std::stable_sort(order.begin(), order.end(), [&](std::uint32_t a, std::uint32_t b) {
    return less(triangles.influences[a], triangles.influences[b]);
  });
  std::vector<Group> groups;
  for (const std::uint32_t triangle : order) {
    const std::span<const Influence> influences = triangles.influences[triangle];
    if (groups.empty() || !equal(groups.back().influences, influences)) {
      groups.push_back({influences, {}});
    }
    groups.back().moment.add(triangles.moments[triangle], 1);
  }
  return groups;
}

/// The mesh must be one that `pack` takes.
Vertices gatherVertices(const MeshView& mesh) {
  Vertices vertices;
  std::vector<Influence> influences;
  for (std::uint32_t vertex = 0; vertex < mesh.vertexCount; ++vertex) {
    vertices.positions.emplace_back(loadPosition(mesh, vertex, 0), loadPosition(mesh, vertex, 1),
                                    loadPosition(mesh, vertex, 2));
    packInfluences(mesh, vertex, influences);
    vertices.influences.add(influences);
  }
  return vertices;
}

/// The triangles that have an area and at least two joints. Every index must lie within the
/// vertices.
PairIndex indexTriangles(const Vertices& vertices, std::span<const std::uint32_t> indices) {
  const Triangles triangles = gatherTriangles(vertices, indices);
  return PairIndex(group(triangles));
}

}  // namespace
}  // namespace dermis::centers

namespace dermis {
namespace {

using centers::Influence;
using centers::Moment;
using centers::PairIndex;
using centers::Vertices;

Result<void> check(const MeshView& mesh, std::uint32_t jointCount,
                   std::span<const std::uint32_t> triangles) {
  // Centers that the mesh already has are ignored, valid or not.
  MeshView bare = mesh;
  bare.centersOfRotation = {};
  if (Result<void> good = checkPackable(bare, jointCount); !good) return good;
  return checkTriangles(mesh, triangles);
}

}  // namespace

struct CenterOfRotationSolver::State {
  State(Vertices gathered, std::span<const std::uint32_t> indices)
      : vertices(std::move(gathered)), triangles(centers::indexTriangles(vertices, indices)) {}

  math::Vec3f center(std::uint32_t vertex) const {
    const std::span<const Influence> influences = vertices.influences[vertex];
    Moment moment;
    for (std::size_t second = 1; second < influences.size(); ++second) {
      for (std::size_t first = 0; first < second; ++first) {
        triangles.addSimilar(influences[first], influences[second], moment);
      }
    }
    if (moment.sum == 0) return vertices.positions[vertex];
    return math::Vec3f(math::Vec3(moment.x, moment.y, moment.z) / moment.sum);
  }

  Vertices vertices;
  PairIndex triangles;
};

CenterOfRotationSolver::CenterOfRotationSolver(std::unique_ptr<const State> state)
    : state_(std::move(state)) {}
CenterOfRotationSolver::~CenterOfRotationSolver() = default;
CenterOfRotationSolver::CenterOfRotationSolver(CenterOfRotationSolver&&) noexcept = default;
CenterOfRotationSolver& CenterOfRotationSolver::operator=(CenterOfRotationSolver&&) noexcept =
    default;

Result<CenterOfRotationSolver> CenterOfRotationSolver::make(
    const MeshView& mesh, std::uint32_t jointCount, std::span<const std::uint32_t> triangles) {
  if (const Result<void> good = check(mesh, jointCount, triangles); !good) return good.error();
  return CenterOfRotationSolver(
      std::make_unique<const State>(centers::gatherVertices(mesh), triangles));
}

std::uint32_t CenterOfRotationSolver::vertexCount() const {
  return static_cast<std::uint32_t>(state_->vertices.positions.size());
}

std::uint64_t CenterOfRotationSolver::termCount() const {
  std::uint64_t terms = 0;
  for (std::size_t vertex = 0; vertex < state_->vertices.influences.size(); ++vertex) {
    const std::span<const Influence> influences = state_->vertices.influences[vertex];
    for (std::size_t second = 1; second < influences.size(); ++second) {
      for (std::size_t first = 0; first < second; ++first)
        terms += state_->triangles.entryCount(influences[first], influences[second]);
    }
  }
  return terms;
}

Result<void> CenterOfRotationSolver::solve(std::uint32_t firstVertex,
                                           std::span<float> centers) const {
  const std::size_t count = centers.size() / 3;
  if (centers.size() % 3 != 0) {
    return Error{ErrorCode::invalidArgument, "centers have 3 floats each; " +
                                                 std::to_string(centers.size()) +
                                                 " floats are not a multiple of 3"};
  }
  if (firstVertex > vertexCount() || count > vertexCount() - firstVertex) {
    return Error{ErrorCode::invalidArgument,
                 "vertices " + std::to_string(firstVertex) + " to " +
                     std::to_string(std::uint64_t{firstVertex} + count) +
                     " (exclusive) are not all in the mesh, which has " +
                     std::to_string(vertexCount())};
  }
  for (std::size_t i = 0; i < count; ++i) {
    const math::Vec3f center = state_->center(firstVertex + static_cast<std::uint32_t>(i));
    for (std::size_t axis = 0; axis < 3; ++axis) {
      centers[3 * i + axis] = center[axis];
    }
  }
  return {};
}

}  // namespace dermis
