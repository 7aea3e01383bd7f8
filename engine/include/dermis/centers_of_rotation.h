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

#include "dermis/mesh.h"
#include "dermis/result.h"

namespace dermis {

/// What `centersOfRotation` may use, and whom it tells how far it is.
struct CentersOfRotationOptions {
  /// Threads at work, the calling thread among them: 1 starts none, 0 means as many as the machine
  /// runs at once. The result is the same to the bit. Where the system refuses a thread the program
  /// ends, as where it refuses memory.
  std::uint32_t threadCount = 0;
  /// Called on the calling thread only, every few dozen vertices of its own, with the part of all
  /// vertices that is done: 0 once the triangles are sorted, never falling, and 1 once, last, when
  /// the work is. Returning false stops the work, and the call fails with `cancelled`; it must not
  /// throw. Null: nobody asks.
  bool (*progress)(void* user, float fraction) = nullptr;
  void* user = nullptr;  ///< Handed to `progress`, otherwise not touched.
};

/// The centres of a mesh, 3 floats a vertex, in bind space. `triangles` has three vertex indices
/// for each triangle: the whole surface, for what is left out draws no centre towards it. A mesh
/// that was cut up, by material say, should be handed over as one.
///
/// Weights are those that `pack` stores: normalised, a joint's added up, those below 2^-49 dropped.
/// A vertex without weight adds nothing to the weights of its triangles, and a triangle without
/// area adds nothing to a centre. Centres are finite and lie among the triangles' centroids, except
/// where there is none to be had, which is the vertex' own bind position then: with fewer than two
/// influences (with one joint the centre makes no difference), or if no
/// triangle has two of its joints.
///
/// Sums are in double precision and in an order of their own: all that differs from the exact
/// centre is the rounding of weights and centres to float32.
///
/// Takes some 4 ns for each vertex, triangle and pair of joints that the two share (x86-64, one
/// core). That is O(vertices × triangles) for each pair of joints: 0.5 s for a body of 10,000
/// vertices, 20,000 triangles and 26 joints, and at worst, where all vertices have the same four
/// joints, 5 s, and a hundred times that for ten times as many. Triangles of equal weights count as
/// one.
///
/// Fails with `invalidMesh` where `pack` would refuse the mesh, with that finding's sentence; with
/// `invalidArgument` for a `jointCount` of 0 or above `maxPaletteJoints`, a number of indices that
/// is no multiple of 3, or an index outside the mesh; with `limitExceeded` above 2^32 − 1
/// triangles; and with `cancelled`. Any thread.
Result<std::vector<float>> centersOfRotation(const MeshView& mesh, std::uint32_t jointCount,
                                             std::span<const std::uint32_t> triangles,
                                             const CentersOfRotationOptions& options = {});

/// The same in pieces, for an engine's own job system. Owns what it needs: the memory of mesh and
/// triangles may go. Movable, not copyable; one that was moved from may be destroyed or assigned
/// to, nothing else.
class CenterOfRotationSolver {
 public:
  /// Sorts the triangles by the pairs of joints that move them: O(triangles × joints²), with the
  /// joints of one triangle. Takes 20 bytes of memory for each pair of each triangle, which has 6
  /// to 15 pairs where vertices have four influences, and as much again while it runs. Fails as
  /// `centersOfRotation` does, except with `cancelled`.
  static Result<CenterOfRotationSolver> make(const MeshView& mesh, std::uint32_t jointCount,
                                             std::span<const std::uint32_t> triangles);
  ~CenterOfRotationSolver();
  CenterOfRotationSolver(CenterOfRotationSolver&&) noexcept;
  CenterOfRotationSolver& operator=(CenterOfRotationSolver&&) noexcept;

  std::uint32_t vertexCount() const;

  /// How many terms the sums of all vertices have: one for each vertex, triangle (those of equal
  /// weights count as one) and pair of joints that the two share. Some 4 ns each (x86-64, one
  /// core): ask before a mesh of unknown origin. O(vertices × influences²).
  std::uint64_t termCount() const;

  /// Writes the centres of the vertices from `firstVertex` on, as many as `centers` has room for at
  /// 3 floats each. Any number of threads may call it at a time. However the mesh is cut into
  /// pieces, the bits are the same; some 64 vertices make a job worth its while. Allocates nothing
  /// unless it fails: with `invalidArgument`, nothing written, where the size of `centers` is no
  /// multiple of 3 or the vertices are not all in the mesh.
  Result<void> solve(std::uint32_t firstVertex, std::span<float> centers) const;

 private:
  struct State;
  explicit CenterOfRotationSolver(std::unique_ptr<const State> state);
  std::unique_ptr<const State> state_;
};

}  // namespace dermis
