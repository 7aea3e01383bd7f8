// Computes centers of rotation: for each vertex, the point about which the blended rotation of its
// joints rotates it. They are computed once, at import, from the bind pose. Source: Le and Hodgins
// 2016, "Real-time skeletal skinning with optimized centers of rotation".
//
// The similarity of two weight vectors i and t is large if they share joints with the same ratio of
// weights (σ = 0.1):
//
//     s(i, t) = Σ_{j≠k} w_ij w_ik w_tj w_tk exp(−(w_ij w_tk − w_ik w_tj)² / σ²)
//
// The center of vertex i is the mean of the centroids of all triangles t of the mesh, weighted by
// s(i, t) and by their areas. The weights of a triangle are the mean of the weights of its
// vertices.
#pragma once

#include <cstdint>
#include <memory>
#include <span>
#include <vector>

#include "dermis/export.h"
#include "dermis/mesh.h"
#include "dermis/result.h"

namespace dermis {

/// Computes the centers of rotation of a mesh, 3 floats per vertex, in bind space. `make` sorts the
/// triangles once. `solve` then computes the centers of any range of vertices, on any thread, so
/// that an engine's job system can share the work. The solver starts no threads.
///
/// Weights are those that `pack` stores: normalized, those of one joint added, and those below
/// 2^-49 dropped. A vertex without weight adds nothing to the weights of its triangles. A triangle
/// without area adds nothing to a center. If a vertex has fewer than two influences, or no triangle
/// has two of its joints, its center is its own position in bind pose; with one joint the center
/// makes no difference. Every other center lies in the convex hull of the triangles' centroids.
/// Centers are finite.
///
/// Sums are computed in double precision. The result differs from the exact center only by the
/// rounding of weights and centers to float32.
///
/// There is one term for each vertex, triangle, and pair of joints that the two share; triangles
/// with equal weights count as one. `solve` takes about 4 ns per term (x86-64, one core), so its
/// time is O(vertices × triangles) for each pair of joints. A body of 10,000 vertices, 20,000
/// triangles and 26 joints takes 0.5 s. The worst case is a mesh with the same four joints in all
/// vertices: 10,000 vertices take 5 s, and ten times as many take a hundred times as long.
///
/// The solver owns its data: the memory of mesh and triangles may be released after `make`.
/// Movable, not copyable. A moved-from solver may only be destroyed or assigned to.
class DERMIS_CORE_API CenterOfRotationSolver {
 public:
  /// Sorts the triangles by the pairs of joints that move them. O(triangles × joints²), where
  /// joints is the number of joints of one triangle. Takes 20 bytes for each pair of each triangle,
  /// and temporarily the same amount again. A triangle has 6 to 15 pairs if vertices have four
  /// influences.
  ///
  /// `triangles` has three vertex indices for each triangle. Pass the whole surface, as one mesh,
  /// even if it is split, for example by material: the centers depend on all of it.
  ///
  /// `MeshView::centersOfRotation` is ignored. Fails with `invalidMesh` if `pack` refuses the rest
  /// of the mesh, with the same message; with
  /// `invalidArgument` if `jointCount` is 0 or above `maxPoseJoints`, if the number of indices is
  /// not a multiple of 3, or if an index is outside the mesh; with `limitExceeded` above 2^32 − 1
  /// triangles. Any thread.
  static Result<CenterOfRotationSolver> make(const MeshView& mesh, std::uint32_t jointCount,
                                             std::span<const std::uint32_t> triangles);
  ~CenterOfRotationSolver();
  CenterOfRotationSolver(CenterOfRotationSolver&&) noexcept;
  CenterOfRotationSolver& operator=(CenterOfRotationSolver&&) noexcept;

  /// Number of vertices of the mesh.
  std::uint32_t vertexCount() const;

  /// Number of terms in the sums of all vertices; see above for the time that a term takes. Check
  /// it before you solve a mesh of unknown origin. O(vertices × influences²).
  std::uint64_t termCount() const;

  /// Computes the centers of `centers.size()` / 3 vertices, beginning with `firstVertex`. Any
  /// number of threads may call it at the same time. Results are the same to the bit however the
  /// vertices are divided among calls; 64 vertices are enough for a job. Allocates nothing unless
  /// it fails. Fails with `invalidArgument`, and writes nothing, if the size of `centers` is not a
  /// multiple of 3 or a vertex is not in the mesh.
  Result<void> solve(std::uint32_t firstVertex, std::span<float> centers) const;

 private:
  struct State;
  explicit CenterOfRotationSolver(std::unique_ptr<const State> state);
  std::unique_ptr<const State> state_;
};

}  // namespace dermis
