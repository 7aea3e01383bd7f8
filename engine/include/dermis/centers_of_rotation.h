// Centres of rotation: for each vertex the point about which its joints' blended rotation turns it.
// Made once from the bind pose, at import; they depend on no pose. After "Real-time skeletal
// skinning with optimized centers of rotation", Le and Hodgins 2016.
//
// Two vectors of weights, i and t, are the more similar the more joints they share in the same
// proportion (σ = 0.1):
//
//   s(i, t) = Σ_{j≠k} w_ij w_ik w_tj w_tk exp(−(w_ij w_tk − w_ik w_tj)² / σ²)
//
// The centre of vertex i is the mean of the centroids of all triangles t of the mesh, weighted by
// s(i, t) and by their areas. A triangle's weights are the mean of those of its vertices.
#pragma once

#include <cstdint>
#include <memory>
#include <span>
#include <vector>

#include "dermis/export.h"
#include "dermis/mesh.h"
#include "dermis/result.h"

namespace dermis {

/// Finds the centres of a mesh, 3 floats a vertex, in bind space. `make` sorts the triangles once;
/// `solve` then takes any part of the vertices, on any thread, so that an engine's job system can
/// share the work. It starts no thread. `solve(0, all)` does all of it on the calling thread.
///
/// Weights are those that `pack` stores: normalised, a joint's added up, those below 2^-49 dropped.
/// A vertex without weight adds nothing to the weights of its triangles, and a triangle without
/// area adds nothing to a centre. Centres are finite and lie among the triangles' centroids. A
/// vertex has its own bind position as the centre if it has fewer than two influences (with one
/// joint the centre makes no difference), or if no triangle has two of its joints.
///
/// Sums are in double precision and in an order of their own: the result differs from the exact
/// centre by the rounding of weights and centres to float32 only.
///
/// Takes some 4 ns for each vertex, triangle and pair of joints that the two share (x86-64, one
/// core). That is O(vertices × triangles) for each pair of joints: 0.5 s for a body of 10,000
/// vertices, 20,000 triangles and 26 joints. The worst case, the same four joints in all vertices,
/// takes 5 s for 10,000 vertices and a hundred times that for ten times as many. Triangles of equal
/// weights count as one.
///
/// Owns what it needs: the memory of mesh and triangles may be released. Movable, not copyable. A
/// moved-from solver may only be destroyed or assigned to.
class DERMIS_CORE_API CenterOfRotationSolver {
 public:
  /// Sorts the triangles by the pairs of joints that move them: O(triangles × joints²), with the
  /// joints of one triangle. Takes 20 bytes of memory for each pair of each triangle, which has 6
  /// to 15 pairs if vertices have four influences, and as much again while it runs.
  ///
  /// `triangles` has three vertex indices for each triangle. Pass the whole surface: what is left
  /// out draws no centre towards it. Pass a mesh that was cut up, by material say, as one.
  ///
  /// Fails with `invalidMesh` if `pack` would refuse the mesh, with that finding's sentence; with
  /// `invalidArgument` for a `jointCount` of 0 or above `maxPoseJoints`, a number of indices
  /// that is no multiple of 3, or an index outside the mesh; with `limitExceeded` above 2^32 − 1
  /// triangles. Any thread.
  static Result<CenterOfRotationSolver> make(const MeshView& mesh, std::uint32_t jointCount,
                                             std::span<const std::uint32_t> triangles);
  ~CenterOfRotationSolver();
  CenterOfRotationSolver(CenterOfRotationSolver&&) noexcept;
  CenterOfRotationSolver& operator=(CenterOfRotationSolver&&) noexcept;

  std::uint32_t vertexCount() const;

  /// Terms in the sums of all vertices: one for each vertex, triangle (those of equal weights count
  /// as one) and pair of joints that the two share. Some 4 ns each (x86-64, one core). Check it
  /// before solving a mesh of unknown origin. O(vertices × influences²).
  std::uint64_t termCount() const;

  /// Writes the centres of the vertices from `firstVertex` on, as many as `centers` has room for at
  /// 3 floats each. Any number of threads may call it at a time. The bits do not depend on how the
  /// mesh is divided; 64 vertices are enough for a job. Allocates nothing unless it fails: with
  /// `invalidArgument`, nothing written, if the size of `centers` is no multiple of 3 or the
  /// vertices are not all in the mesh.
  Result<void> solve(std::uint32_t firstVertex, std::span<float> centers) const;

 private:
  struct State;
  explicit CenterOfRotationSolver(std::unique_ptr<const State> state);
  std::unique_ptr<const State> state_;
};

}  // namespace dermis
