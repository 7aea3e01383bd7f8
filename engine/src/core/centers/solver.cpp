#include <limits>
#include <string>
#include <utility>

#include "centers/gather.h"
#include "dermis/centers_of_rotation.h"
#include "dermis/text.h"
#include "dermis/types.h"
#include "dermis/validate.h"

namespace dermis {
namespace {

using centers::Influence;
using centers::Moment;
using centers::PairIndex;
using centers::Vertices;

Error invalid(const MeshView& mesh, ErrorCode code, const std::string& what) {
  return {code, "mesh " + inQuotes(mesh.name) + what};
}

Result<void> checkTriangles(const MeshView& mesh, std::span<const std::uint32_t> triangles) {
  if (triangles.size() % 3 != 0) {
    return invalid(mesh, ErrorCode::invalidArgument,
                   ": " + std::to_string(triangles.size()) +
                       " vertex indices make no whole number of triangles");
  }
  if (triangles.size() / 3 > std::numeric_limits<std::uint32_t>::max()) {
    return invalid(
        mesh, ErrorCode::limitExceeded,
        ": there are more than 2^32 - 1 triangles: " + std::to_string(triangles.size() / 3));
  }
  for (std::size_t i = 0; i < triangles.size(); ++i) {
    if (triangles[i] >= mesh.vertexCount) {
      return invalid(mesh, ErrorCode::invalidArgument,
                     ", triangle " + std::to_string(i / 3) + ": vertex " +
                         std::to_string(triangles[i]) + " is outside the mesh, which has " +
                         std::to_string(mesh.vertexCount) + " vertices");
    }
  }
  return {};
}

Result<void> check(const MeshView& mesh, std::uint32_t jointCount,
                   std::span<const std::uint32_t> triangles) {
  if (jointCount == 0 || jointCount > maxPaletteJoints) {
    return invalid(mesh, ErrorCode::invalidArgument,
                   ": a palette has 1 to " + std::to_string(maxPaletteJoints) + " joints, not " +
                       std::to_string(jointCount));
  }
  // Centres that the mesh has already, good or bad, have no say.
  MeshView bare = mesh;
  bare.centersOfRotation = {};
  if (Result<void> accepted = validate(bare, jointCount).accepted(); !accepted) return accepted;
  return checkTriangles(mesh, triangles);
}

}  // namespace

struct CenterOfRotationSolver::State {
  State(Vertices gathered, std::span<const std::uint32_t> indices)
      : vertices(std::move(gathered)), triangles(centers::indexTriangles(vertices, indices)) {}

  glm::vec3 center(std::uint32_t vertex) const {
    const std::span<const Influence> influences = vertices.influences[vertex];
    Moment moment;
    for (std::size_t second = 1; second < influences.size(); ++second) {
      for (std::size_t first = 0; first < second; ++first) {
        triangles.addSimilar(influences[first], influences[second], moment);
      }
    }
    if (moment.sum == 0) return vertices.positions[vertex];
    return glm::vec3(glm::dvec3(moment.x, moment.y, moment.z) / moment.sum);
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
    return Error{ErrorCode::invalidArgument, "centres have 3 floats each, of which " +
                                                 std::to_string(centers.size()) +
                                                 " is no multiple"};
  }
  if (firstVertex > vertexCount() || count > vertexCount() - firstVertex) {
    return Error{ErrorCode::invalidArgument,
                 "vertices " + std::to_string(firstVertex) + " to " +
                     std::to_string(std::uint64_t{firstVertex} + count) +
                     " (excluded) are not all in the mesh, which has " +
                     std::to_string(vertexCount())};
  }
  for (std::size_t i = 0; i < count; ++i) {
    const glm::vec3 center = state_->center(firstVertex + static_cast<std::uint32_t>(i));
    for (int axis = 0; axis < 3; ++axis) {
      centers[3 * i + static_cast<std::size_t>(axis)] = center[axis];
    }
  }
  return {};
}

}  // namespace dermis
