// The fast path for the layouts that most engines have, skinned by dual quaternions or matrices.
// Several instances are skinned at a time: weights and joint indices are read once for all of them,
// and each instance has its own 128 bits of a vector, so that data is exchanged between instances
// only when results are stored.
#pragma once

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <cstring>

#include "cpu/stages_inl.h"

HWY_BEFORE_NAMESPACE();
namespace dermis::cpu::HWY_NAMESPACE {

/// What a vertex consists of, side by side and with nothing else.
enum class PlainVertex : std::uint8_t {
  none,      ///< another layout
  normals,   ///< positions and normals in float32x3
  tangents,  ///< and tangents in float32x4
};

template <PlainVertex vertex>
inline constexpr std::size_t vertexWords = vertex == PlainVertex::tangents ? 10 : 6;

/// Which of them the vertices of these instances are.
inline PlainVertex plainVertexOf(const VertexPlaces& places, const TaskInstance* const* instances,
                                 std::size_t count) {
  const Records records = recordsOf(places, instances, count);
  if (records.count != 1 || records.all[0].dense == 0 ||
      places[Stream::positions].format != VertexFormat::float32x3 ||
      places[Stream::normals].format != VertexFormat::float32x3)
    return PlainVertex::none;
  const VertexFormat tangents = places[Stream::tangents].format;
  if (tangents == VertexFormat::none) return PlainVertex::normals;
  return tangents == VertexFormat::float32x4 ? PlainVertex::tangents : PlainVertex::none;
}

/// Stores four vertices of each instance. `t`, `hand`: tangents, if they have them.
template <PlainVertex vertex, class D>
DERMIS_INLINE void storePlain(D d, const Vec3<D>& p, const Vec3<D>& n, const Vec3<D>& t,
                              Vec<D> hand, float* const* to) {
  if constexpr (vertex == PlainVertex::normals) {
    storeDense(d, {p.x, p.y, p.z, n.x, n.y, n.z}, to);
  } else {
    storeDense(d, {p.x, p.y, p.z, n.x, n.y, n.z, t.x, t.y, t.z, hand}, to);
  }
}

/// Whole blocks of a run.
struct PlainTask {
  const MeshData& mesh;
  const Run& run;
  std::uint32_t firstBlock, blockEnd;
  std::uint32_t outputBlock;  ///< the block at the start of the output
};

/// Loads the three components of four vertices into each block of a vector.
struct InEveryBlock {
  std::size_t first;

  template <class D>
  DERMIS_INLINE Vec3<D> load(D d, const Lanes* lanes) const {
    return {hn::LoadDup128(d, lanes[0].v + first), hn::LoadDup128(d, lanes[1].v + first),
            hn::LoadDup128(d, lanes[2].v + first)};
  }
  template <class D>
  DERMIS_INLINE Vec<D> hand(D d, const Lanes* lanes) const {
    return hn::LoadDup128(d, lanes[3].v + first);
  }
};
enum class PlainKind : std::uint8_t { moved, turned, scaled };

/// Skins as many instances as D has blocks: by matrices, or by dual quaternions in one phase or
/// two. What is not blended is loaded late, to save registers.
template <PlainKind kind, PlainVertex vertex, int influences, class D>
DERMIS_INLINE void skinInstances(D d, const PlainTask& task, const Palette& palette,
                                 float* const* outputs) {
  constexpr bool tangents = vertex == PlainVertex::tangents;
  const std::size_t count = influences != 0 ? influences : task.run.influences;
  const std::uint64_t slot = task.run.slotOf(task.firstBlock);
  const std::uint16_t* HWY_RESTRICT pair = task.mesh.pairNumbers.data() + slot;
  const std::uint16_t* HWY_RESTRICT joint = task.mesh.jointNumbers.data() + slot;
  const float* HWY_RESTRICT weight = task.mesh.weights.data() + slot;
  const float* const pairs[2] = {palette.pairs[0], palette.pairs[1]};
  const float* const rows[3] = {palette.rows[0], palette.rows[1], palette.rows[2]};
  float* to[blocksOf<D>];
  for (std::size_t i = 0; i < blocksOf<D>; ++i)
    to[i] = outputs[i] +
            std::size_t{task.firstBlock - task.outputBlock} * blockVertices * vertexWords<vertex>;
  for (std::size_t block = task.firstBlock; block < task.blockEnd; ++block) {
    const Lanes* const positions = task.mesh.positions.data() + block * 3;
    const Lanes* const normals = task.mesh.normals.data() + block * 3;
    const Lanes* const bindTangents = tangents ? task.mesh.tangents.data() + block * 4 : nullptr;
    for (std::size_t half = 0; half < blockVertices; half += 4) {
      const InEveryBlock from{half};
      Vec3<D> tangent{};
      Vec<D> hand = hn::Zero(d);
      if constexpr (kind == PlainKind::moved) {
        Vec<D> m[3][4];
        sumFour<influences, 3, false>(d, rows, nullptr, joint, nullptr, weight, count, m);
        const Matrix<D> matrix{quadOf<D>(m[0]), quadOf<D>(m[1]), quadOf<D>(m[2])};
        const DirectionMap<D> map = directionMap(d, matrix, true);
        const Vec3<D> normal = from.load(d, normals);
        if constexpr (tangents) {
          const Vec3<D> bind = from.load(d, bindTangents);
          tangent = unitOr(d, mapTangent(map, bind), bind);
          hand = hn::Mul(from.hand(d, bindTangents), map.side);
        }
        storePlain<vertex>(d, throughMatrix(matrix, from.load(d, positions)),
                           unitOr(d, mapNormal(map, normal), normal), tangent, hand, to);
      } else {
        Vec3<D> position, normal;
        if constexpr (kind == PlainKind::scaled) {
          Vec<D> s[2][4];
          sumFour<influences, 2, true>(d, palette.partPairs, palette.parts, pair, joint, weight,
                                       count, s);
          const Part<D> part = partOf<D>(s[0][0], s[0][1], s[0][2], s[0][3], s[1][0], s[1][1]);
          const DirectionMap<D> map = directionMap(d, part.r0, part.r1, part.r2, true);
          const Vec3<D> given = from.load(d, task.mesh.givenNormals.data() + block * 3);
          normal = unitOr(d, mapNormal(map, given), from.load(d, normals));
          if constexpr (tangents) {
            const Vec3<D> bind = from.load(d, task.mesh.givenTangents.data() + block * 4);
            tangent = unitOr(d, mapTangent(map, bind), from.load(d, bindTangents));
            hand = hn::Mul(from.hand(d, bindTangents), map.side);
          }
          position = throughPart(part, from.load(d, positions));
        }
        Vec<D> q[2][4];
        sumFour<influences, 2, false>(d, pairs, nullptr, pair, nullptr, weight, count, q);
        const Vec4<D> real = quadOf<D>(q[0]), dual = quadOf<D>(q[1]);
        const Vec<D> factor = turningFactor(d, real);
        if constexpr (kind == PlainKind::turned) position = from.load(d, positions);
        const Vec3<D> moved = movePoint(real, dual, factor, position);
        if constexpr (kind == PlainKind::turned) normal = from.load(d, normals);
        normal = turnDirection(real, factor, normal);
        if constexpr (tangents && kind == PlainKind::turned) {
          tangent = from.load(d, bindTangents);
          hand = from.hand(d, bindTangents);
        }
        if constexpr (tangents) tangent = turnDirection(real, factor, tangent);
        storePlain<vertex>(d, moved, normal, tangent, hand, to);
      }
      pair += 4 * count;
      joint += 4 * count;
      weight += 4 * count;
      for (float*& place : to) place += 4 * vertexWords<vertex>;
    }
  }
}

/// Calls `skin` for the blocks of a run. Whole ones are skinned in place. Those of which only some
/// vertices are in the range are skinned to a temporary buffer, from which these are copied.
template <PlainVertex vertex, class D, class Skin>
DERMIS_INLINE void skinBlocks(const MeshData& mesh, const Blocks& blocks, const VertexRange& range,
                              float* const* outputs, const Skin& skin) {
  constexpr std::size_t floats = vertexWords<vertex>;
  constexpr std::size_t lines = (blockVertices * floats + 15) / 16;
  CacheLine buffers[blocksOf<D>][lines];
  float* beside[blocksOf<D>];
  for (std::size_t i = 0; i < blocksOf<D>; ++i) beside[i] = numbersOf(buffers[i]);
  const auto skinPart = [&](std::uint32_t block, std::size_t first, std::size_t end) HWY_ATTR {
    skin(PlainTask{mesh, blocks.run, block, block + 1, block}, beside);
    for (std::size_t i = 0; i < blocksOf<D>; ++i) {
      std::memcpy(outputs[i] + (std::size_t{block} * blockVertices + first) * floats,
                  beside[i] + first * floats, (end - first) * floats * sizeof(float));
    }
  };
  const std::size_t whole = (range.first + blockVertices - 1) / blockVertices;
  const std::size_t wholeEnd = range.end / blockVertices;
  if (range.first != whole * blockVertices)
    skinPart(blocks.first, range.first, std::min<std::size_t>(range.end, blockVertices));
  if (whole < wholeEnd) {
    skin(PlainTask{mesh, blocks.run, blocks.first + static_cast<std::uint32_t>(whole),
                   blocks.first + static_cast<std::uint32_t>(wholeEnd), 0},
         outputs);
  }
  if (wholeEnd >= whole && range.end != wholeEnd * blockVertices) {
    skinPart(blocks.first + static_cast<std::uint32_t>(wholeEnd), 0,
             range.end - wholeEnd * blockVertices);
  }
}

}  // namespace dermis::cpu::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();
