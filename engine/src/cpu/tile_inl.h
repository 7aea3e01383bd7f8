// What the stages hand to each other: some vertices of a company, or of a lone instance.
#pragma once

#include <cstddef>

#include "cpu/mesh_data.h"
#include "cpu/palette_inl.h"

HWY_BEFORE_NAMESPACE();
namespace dermis::cpu::HWY_NAMESPACE {

/// The vertices of a block in bind pose.
struct MorphedBlock {
  Lanes positions[3], normals[3], tangents[4];
};

/// Vectors for what is stored of a unit.
inline constexpr std::size_t slotCount = 4 * streamCount;

/// Vertices of the instances, in units: a vector for each component. A unit has one vertex of each
/// member of a company, or as many of a lone instance as there are lanes.
template <class D>
struct Tile {
  static constexpr std::size_t most = 16;     ///< units: two blocks of a company
  static constexpr std::size_t mostLone = 8;  ///< of a lone instance

  /// Of a lone instance: what was blended. `rows`, then: the linearly blended vertices of both.
  Vec<D> quaternions[mostLone][8], parts[mostLone][8], rows[mostLone][12];
  /// Of each stream four vectors: first its components, then its words.
  Vec<D> slots[most][slotCount];
  Vec<D> positions[most][3], normals[most][3], tangents[most][4];  ///< in bind pose, if morphed
  Vec<D> givenNormals[most][3], givenTangents[most][4];
  MorphedBlock block;  ///< of a lone instance
};

/// The vertices of a tile that belong to the job: `first` to `end`, counted from the tile's first.
struct VertexRange {
  std::size_t first = 0, end = 0;
};

/// The vertices of a unit of each instance, in order.
template <bool isLone, class D>
inline constexpr std::size_t unitVertices = isLone ? hn::MaxLanes(D()) : 1;

/// The units of a block.
template <bool isLone, class D>
inline constexpr std::size_t unitsOf = blockVertices / unitVertices<isLone, D>;

/// How many blocks fit into a tile.
template <bool isLone, class D>
inline constexpr std::uint32_t tileBlocks =
    (isLone ? Tile<D>::mostLone : Tile<D>::most) / unitsOf<isLone, D>;

/// Whether all vertices of a unit belong to the job.
template <bool isLone, class D>
DERMIS_INLINE bool isWhole(const VertexRange& range, std::size_t unit) {
  const std::size_t first = unit * unitVertices<isLone, D>;
  return first >= range.first && first + unitVertices<isLone, D> <= range.end;
}

/// Mask of the lanes whose vertices are in the range.
template <bool isLone, class D>
DERMIS_INLINE hn::Mask<D> lanesInRange(D d, const VertexRange& range, std::size_t unit) {
  constexpr std::size_t lanes = hn::MaxLanes(d);
  HWY_ALIGN float wanted[lanes];
  for (std::size_t lane = 0; lane < lanes; ++lane) {
    const std::size_t vertex = unit * unitVertices<isLone, D> + (isLone ? lane : 0);
    wanted[lane] = vertex >= range.first && vertex < range.end ? 1.0f : 0.0f;
  }
  return hn::Ne(hn::Load(d, wanted), hn::Zero(d));
}

template <class D>
DERMIS_INLINE Vec3<D> threeOf(const Vec<D>* v) {
  return {v[0], v[1], v[2]};
}
template <class D>
DERMIS_INLINE void setThree(Vec<D>* to, const Vec3<D>& v) {
  to[0] = v.x;
  to[1] = v.y;
  to[2] = v.z;
}

}  // namespace dermis::cpu::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();
