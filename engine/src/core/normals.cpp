#include "dermis/mesh.h"

#include <array>
#include <cmath>
#include <cstddef>
#include <limits>
#include <string>

#include "attribute.h"
#include "check_mesh.h"
#include "linear_algebra.h"
#include "strict_floating_point.h"
#include "text.h"

namespace dermis {
namespace {

using math::Vec3;

Vec3 positionOf(const MeshView& mesh, std::uint32_t vertex) {
  return Vec3(math::Vec3f(loadPosition(mesh, vertex, 0), loadPosition(mesh, vertex, 1),
                          loadPosition(mesh, vertex, 2)));
}

/// Twice the area of a triangle, times its normal.
Vec3 areaOf(const MeshView& mesh, std::span<const std::uint32_t> triangle) {
  const Vec3 a = positionOf(mesh, triangle[0]);
  return cross(positionOf(mesh, triangle[1]) - a, positionOf(mesh, triangle[2]) - a);
}

std::array<float, 3> unitOf(const Vec3& vector) {
  const double size = length(vector);
  const Vec3 unit = size > 0 && std::isfinite(size) ? vector / size : Vec3(0, 0, 1);
  return {static_cast<float>(unit.x), static_cast<float>(unit.y), static_cast<float>(unit.z)};
}

Result<void> check(const MeshView& mesh, std::span<const std::uint32_t> triangles) {
  const Result<void> positions = checkPositions(mesh);
  return positions ? checkTriangles(mesh, triangles) : positions;
}

}  // namespace

Result<void> checkTriangles(const MeshView& mesh, std::span<const std::uint32_t> triangles) {
  const std::string name = "mesh " + inQuotes(mesh.name);
  if (triangles.size() % 3 != 0) {
    return Error{ErrorCode::invalidArgument, name + ": " + std::to_string(triangles.size()) +
                                                 " vertex indices: not a multiple of 3"};
  }
  if (triangles.size() / 3 > std::numeric_limits<std::uint32_t>::max()) {
    return Error{ErrorCode::limitExceeded, name + ": there are more than 2^32 - 1 triangles: " +
                                               std::to_string(triangles.size() / 3)};
  }
  for (std::size_t i = 0; i < triangles.size(); ++i) {
    if (triangles[i] >= mesh.vertexCount) {
      return Error{ErrorCode::invalidArgument, name + ", triangle " + std::to_string(i / 3) +
                                                   ": vertex " + std::to_string(triangles[i]) +
                                                   " is outside the mesh, which has " +
                                                   std::to_string(mesh.vertexCount) + " vertices"};
    }
  }
  return {};
}

Result<std::vector<float>> smoothNormals(const MeshView& mesh,
                                         std::span<const std::uint32_t> triangles) {
  if (const Result<void> good = check(mesh, triangles); !good) return good.error();
  std::vector<Vec3> sums(mesh.vertexCount);
  for (std::size_t corner = 0; corner < triangles.size(); corner += 3) {
    const Vec3 area = areaOf(mesh, triangles.subspan(corner, 3));
    for (const std::uint32_t vertex : triangles.subspan(corner, 3))
      sums[vertex] = sums[vertex] + area;
  }
  std::vector<float> normals;
  normals.reserve(3 * sums.size());
  for (const Vec3& sum : sums) {
    const std::array<float, 3> normal = unitOf(sum);
    normals.insert(normals.end(), normal.begin(), normal.end());
  }
  return normals;
}

Result<std::vector<float>> flatNormals(const MeshView& mesh,
                                       std::span<const std::uint32_t> triangles) {
  if (const Result<void> good = check(mesh, triangles); !good) return good.error();
  std::vector<float> normals;
  normals.reserve(3 * triangles.size());
  for (std::size_t corner = 0; corner < triangles.size(); corner += 3) {
    const std::array<float, 3> normal = unitOf(areaOf(mesh, triangles.subspan(corner, 3)));
    for (int i = 0; i < 3; ++i) normals.insert(normals.end(), normal.begin(), normal.end());
  }
  return normals;
}

}  // namespace dermis
