// What the stages hand to each other: some vertices of several instances, or of a lone one.
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

/// Vertices of the instances, in units: a vector for each component. A unit has four vertices of
/// each instance, or as many of a lone one as there are lanes.
template <class D>
struct Tile {
  static constexpr std::size_t most = 8;  ///< units

  Vec<D> dualQuaternions[most][8], parts[most][8], rows[most][12];  ///< blended
  /// Positions, normals and tangents, four vectors each: first their components, then their words.
  Vec<D> slots[most][12];
  Vec<D> positions[most][3], normals[most][3], tangents[most][4];  ///< in bind pose, if morphed
  Vec<D> givenNormals[most][3], givenTangents[most][4];
  MorphedBlock blocks[most];  ///< of one instance
};

/// The vertices of a tile that belong to the job: `first` to `end`, counted from the tile's first.
struct VertexRange {
  std::size_t first = 0, end = 0;
};

/// The vertices of a unit in the lanes of a block, in order.
template <bool isLone, class D>
inline constexpr std::size_t unitVertices = isLone ? hn::MaxLanes(D()) : 4;

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
    const std::size_t vertex = unit * unitVertices<isLone, D> + (isLone ? lane : lane % 4);
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
