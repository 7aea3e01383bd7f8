// The stages that every method, format and option is made of. A few vertices of several instances,
// or of a lone one, pass through all of them at a time, so that what one stage hands to the next
// stays in the nearest cache: sums over influences, the method, results, encoding, storing.
// plain_inl.h joins the stages for the common case, with the same operations in the same order.
#pragma once

#include <algorithm>
#include <array>
#include <bit>
#include <cstring>
#include <limits>
#include <span>
#include <type_traits>
#include <utility>

#include "cpu/encode_inl.h"
#include "cpu/morph.h"
#include "cpu/palette_inl.h"
#include "cpu/vertex_inl.h"
#include "hwy/cache_control.h"

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

// -- Sums over influences.

/// The influence slots of a tile's vertices.
struct Slots {
  const std::uint16_t* joints;
  const std::uint16_t* pairs;
  const float* weights;
  std::uint32_t influences;
};

/// Calls `sum` with the number of influences: a compile-time constant up to 4, or 0 for more.
template <class Sum>
DERMIS_INLINE void byInfluences([[maybe_unused]] std::uint32_t influences, const Sum& sum) {
#ifdef DERMIS_CPU_STAGES_ONLY
  influences = 0;
#endif
  switch (influences) {
    case 1:
      return sum(std::integral_constant<int, 1>());
    case 2:
      return sum(std::integral_constant<int, 2>());
    case 3:
      return sum(std::integral_constant<int, 3>());
    case 4:
      return sum(std::integral_constant<int, 4>());
    default:
      return sum(std::integral_constant<int, 0>());
  }
}

/// Σ w e of one vertex, over as many floats of each entry as there are lanes, from influence
/// `begin` on. An entry has 8 · `units` floats. If `influences` is 0, `count` is the number of
/// influences.
template <int influences, std::size_t begin, class D>
DERMIS_INLINE Vec<D> sumVertex(D d, const float* HWY_RESTRICT entries, std::size_t units,
                               const std::uint16_t* HWY_RESTRICT numbers,
                               const float* HWY_RESTRICT weights, std::size_t count) {
  if (influences != 0) count = influences;
  Vec<D> sum = hn::Zero(d);
  for (std::size_t i = begin; i < count; ++i) {
    const Vec<D> part = hn::Mul(hn::Set(d, weights[i]), hn::Load(d, entries + numbers[i] * units));
    sum = i == begin ? part : hn::Add(sum, part);
  }
  return sum;
}

#if HWY_MAX_BYTES >= 32
/// Transposes the lower and the upper halves of eight rows of eight floats.
DERMIS_INLINE void columnsOf(Eight d, const Vec<Eight> rows[8], Vec<Eight> columns[8]) {
  for (std::size_t i = 0; i < 4; ++i) {
    columns[i] = hn::ConcatLowerLower(d, rows[i + 4], rows[i]);
    columns[i + 4] = hn::ConcatUpperUpper(d, rows[i + 4], rows[i]);
  }
  transpose4(d, columns[0], columns[1], columns[2], columns[3]);
  transpose4(d, columns[4], columns[5], columns[6], columns[7]);
}
#endif

/// Σ w e of four vertices of each instance, over K quads. sums[k] gets the components of quad k, a
/// vertex in each lane of a block. If there are `pivots`, entries are differences to the pivot's,
/// which is added; the first influence, the pivot itself, has none.
template <int influences, std::size_t K, bool hasPivots, class D>
DERMIS_INLINE void sumFour(D d, const float* const* quads, const float* const* pivots,
                           const std::uint16_t* HWY_RESTRICT numbers,
                           const std::uint16_t* HWY_RESTRICT joints,
                           const float* HWY_RESTRICT weights, std::size_t count,
                           Vec<D> sums[K][4]) {
  if (influences != 0) count = influences;
  constexpr std::size_t begin = hasPivots ? 1 : 0;
  for (std::size_t vertex = 0; vertex < 4; ++vertex) {
    const std::size_t first = vertex * count;
    Vec<D> sum[K];
    for (std::size_t k = 0; k < K; ++k) sum[k] = hn::Zero(d);
    for (std::size_t i = begin; i < count; ++i) {
      const std::size_t entry = std::size_t{numbers[first + i]} * blocksOf<D> / 2;
      const Vec<D> w = hn::Set(d, weights[first + i]);
      for (std::size_t k = 0; k < K; ++k) {
        const Vec<D> part = hn::Mul(w, hn::Load(d, quads[k] + entry));
        sum[k] = i == begin ? part : hn::Add(sum[k], part);
      }
    }
    if constexpr (hasPivots) {
      const std::size_t entry = std::size_t{joints[first]} * blocksOf<D> / 2;
      for (std::size_t k = 0; k < K; ++k) sum[k] = hn::Add(hn::Load(d, pivots[k] + entry), sum[k]);
    }
    for (std::size_t k = 0; k < K; ++k) sums[k][vertex] = sum[k];
  }
  for (std::size_t k = 0; k < K; ++k) transpose4(d, sums[k][0], sums[k][1], sums[k][2], sums[k][3]);
}

/// Σ w e of each vertex, over the first K quads of each entry, plus the pivot's entry if there are
/// `pivots`. Writes 4 K vectors for each unit.
template <bool isLone, std::size_t K, bool hasPivots, class D, std::size_t size>
HWY_NOINLINE HWY_ATTR void sumUnits(D d, const float* const* quads, const float* const* pivots,
                                    const std::uint16_t* numbers, const Slots& slots,
                                    std::size_t units, Vec<D> (*to)[size]) {
  byInfluences(slots.influences, [&](auto influences) HWY_ATTR {
    const std::size_t count = influences() != 0 ? influences() : slots.influences;
    const std::uint16_t* HWY_RESTRICT number = numbers;
    const std::uint16_t* HWY_RESTRICT joint = slots.joints;
    const float* HWY_RESTRICT weight = slots.weights;
    for (std::size_t unit = 0; unit < units; ++unit) {
      Vec<D>* const own = to[unit];
      if constexpr (!isLone) {
        Vec<D> sums[K][4];
        sumFour<influences(), K, hasPivots>(d, quads, pivots, number, joint, weight, count, sums);
        for (std::size_t k = 0; k < K; ++k) {
          for (std::size_t i = 0; i < 4; ++i) own[k * 4 + i] = sums[k][i];
        }
        number += 4 * count;
        joint += 4 * count;
        weight += 4 * count;
      } else {
#if HWY_MAX_BYTES >= 32
        if constexpr (K >= 2) {
          constexpr std::size_t begin = hasPivots ? 1 : 0;
          Vec<D> rows[8];
          for (std::size_t i = 0; i < 8; ++i) {
            rows[i] = sumVertex<influences(), begin>(d, quads[0], K == 3 ? 2 : 1,
                                                     number + i * count, weight + i * count, count);
            if (hasPivots) rows[i] = hn::Add(hn::LoadU(d, pivots[0] + joint[i * count]), rows[i]);
          }
          columnsOf(d, rows, own);
        }
        if constexpr (K != 2) {
          const Four four;
          Vec<Four> rows[8];
          for (std::size_t i = 0; i < 8; ++i) {
            rows[i] = sumVertex<influences(), 0>(four, quads[K - 1], K == 3 ? 2 : 1,
                                                 number + i * count, weight + i * count, count);
          }
          Vec<D>* const last = own + (K - 1) * 4;
          for (std::size_t i = 0; i < 4; ++i) last[i] = hn::Combine(d, rows[i + 4], rows[i]);
          transpose4(d, last[0], last[1], last[2], last[3]);
        }
        number += 8 * count;
        joint += 8 * count;
        weight += 8 * count;
#endif
      }
    }
  });
}

// -- Vertices in bind pose.

/// Where the vertices of a tile are read from. In the mesh a vertex is the same for all instances.
struct Source {
  const float *positions = nullptr, *normals = nullptr, *tangents = nullptr;
  const float *givenNormals = nullptr, *givenTangents = nullptr;
  const float *centers = nullptr, *shares = nullptr;
  bool isWhole = false;  ///< a vector for each component, except of centers and shares
};

/// Component `index` of `components` of a unit's vertices.
template <bool isWhole, class D>
DERMIS_INLINE Vec<D> loadComponent(D d, const float* first, std::size_t components,
                                   std::size_t index, std::size_t unit) {
  if constexpr (isWhole) {
    return hn::Load(d, first + (unit * components + index) * hn::MaxLanes(d));
  } else {
    return hn::LoadDup128(d,
                          first + (unit / 2 * components + index) * blockVertices + unit % 2 * 4);
  }
}
template <bool isWhole, class D>
DERMIS_INLINE Vec3<D> loadThree(D d, const float* first, std::size_t components, std::size_t unit) {
  return {loadComponent<isWhole>(d, first, components, 0, unit),
          loadComponent<isWhole>(d, first, components, 1, unit),
          loadComponent<isWhole>(d, first, components, 2, unit)};
}

inline const float* blockOf(const std::vector<Lanes>& lanes, std::size_t components,
                            std::uint32_t block) {
  return lanes.empty() ? nullptr : lanes[block * components].v;
}

inline Source sourceOf(const MeshData& mesh, Method method, std::uint32_t block, bool isLone) {
  Source from;
  from.positions = blockOf(mesh.positions, 3, block);
  from.normals = blockOf(mesh.normals, 3, block);
  from.givenNormals = blockOf(mesh.givenNormals, 3, block);
  from.tangents = blockOf(mesh.tangents, 4, block);
  from.givenTangents = blockOf(mesh.givenTangents, 4, block);
  from.centers = blockOf(mesh.centers, 3, block);
  from.shares = method == Method::blended ? blockOf(mesh.dualQuaternionWeights, 1, block)
                                          : blockOf(mesh.bulgeStrengths, 1, block);
  from.isWhole = isLone;
  return from;
}

/// Adds the displacements of a target to all vertices of a block. `components`: positions, then
/// normals and tangents if the target displaces them; null if not wanted.
inline HWY_ATTR void displaceAll(const Displacements& displacements, float weight,
                                 Lanes* const* components) {
  const Wide d;
  const Vec<Wide> w = hn::Set(d, weight);
  const std::size_t size = displacements.size;
  for (std::size_t lane = 0; lane < blockVertices; lane += hn::MaxLanes(d)) {
    const auto* const from = reinterpret_cast<const float*>(displacements.words) + lane * size;
    const auto add = [&](std::size_t component, Vec<Wide> value) HWY_ATTR {
      if (components[component] == nullptr) return;
      float* const to = components[component]->v + lane;
      hn::Store(hn::Add(hn::Load(d, to), hn::Mul(w, value)), d, to);
    };
    if (size == 3) {
      Vec<Wide> x, y, z;
      hn::LoadInterleaved3(d, from, x, y, z);
      add(0, x);
      add(1, y);
      add(2, z);
      continue;
    }
    // Four components at a time. The last four may begin with some that were added before.
    for (std::size_t done = 0; done < size;) {
      const std::size_t first = std::min(done, size - 4);
      const Vec4<Wide> rows = loadRows(d, from + first, size);
      const Vec<Wide> four[4] = {rows.x, rows.y, rows.z, rows.w};
      for (; done < first + 4; ++done) add(done, four[done - first]);
    }
  }
}

inline HWY_ATTR void morphBlocks(const MeshData& mesh, std::uint32_t firstBlock,
                                 std::uint32_t blockEnd, std::span<const MorphWeight> morphs,
                                 const abi::MorphRecord* targets, MorphedBlock* blocks) {
  Lanes* const noLanes = nullptr;
  for (std::size_t i = 0; i < morphs.size(); ++i) {
    const abi::MorphRecord& target = targets[i];
    const float weight = morphs[i].weight;
    const std::uint32_t first = firstBlock * blockVertices / abi::MORPH_BLOCK_VERTICES;
    const std::uint32_t last = (blockEnd * blockVertices - 1) / abi::MORPH_BLOCK_VERTICES;
    if (weight == 0 || last < target.firstBlock || first >= target.firstBlock + target.blockCount)
      continue;
    for (std::uint32_t number = firstBlock; number < blockEnd; ++number) {
      const Displacements found = displacementsOf(mesh, target, number);
      if (found.mask == 0) continue;
      MorphedBlock& block = blocks[number - firstBlock];
      Lanes* const normals = mesh.normals.empty() ? noLanes : block.normals;
      Lanes* const tangents = mesh.tangents.empty() ? noLanes : block.tangents;
      if (found.mask != 0xff) {
        displace(found, target.attributes, weight, block.positions, normals, tangents);
        continue;
      }
      Lanes* components[9];
      std::size_t count = 0;
      for (const auto& [attribute, lanes] : {std::pair{abi::MORPH_HAS_POSITIONS, block.positions},
                                             {abi::MORPH_HAS_NORMALS, normals},
                                             {abi::MORPH_HAS_TANGENTS, tangents}}) {
        if ((target.attributes & attribute) == 0) continue;
        for (std::size_t k = 0; k < 3; ++k)
          components[count++] = lanes == nullptr ? nullptr : lanes + k;
      }
      displaceAll(found, weight, components);
    }
  }
}

/// Morphs the blocks of a tile for instances that have active targets. `targets`: those of the
/// first instance, then those of the others.
template <bool isLone, class D>
HWY_NOINLINE HWY_ATTR void morphTile(D d, const MeshData& mesh, std::uint32_t firstBlock,
                                     std::uint32_t blockEnd, const TaskInstance* const* instances,
                                     const abi::MorphRecord* targets, Tile<D>& tile, Source& from) {
  const auto scatter = [&](const Lanes& lanes, std::size_t unit, std::size_t i, Vec<D>* to) {
    // The memory of a vector is its lanes, in order.
    auto* const memory = reinterpret_cast<std::byte*>(to);
    if constexpr (isLone) {
      std::memcpy(memory, lanes.v, sizeof(lanes.v));
    } else {
      std::memcpy(memory + i * 16, lanes.v + unit % 2 * 4, 16);
    }
  };
  constexpr std::size_t unitsEach = isLone ? 1 : 2;
  const std::size_t units =
      std::min<std::size_t>((blockEnd - firstBlock) * unitsEach, Tile<D>::most);
  const bool normals = !mesh.normals.empty(), tangents = !mesh.tangents.empty();
  for (std::size_t i = 0; i < (isLone ? 1 : blocksOf<D>); ++i) {
    for (std::size_t k = 0; k < units / unitsEach; ++k) {
      MorphedBlock& block = tile.blocks[k];
      const std::size_t number = firstBlock + k;
      std::copy_n(mesh.positions.data() + number * 3, 3, block.positions);
      if (normals) std::copy_n(mesh.givenNormals.data() + number * 3, 3, block.normals);
      if (tangents) {
        std::copy_n(mesh.givenTangents.data() + number * 4, 3, block.tangents);
        block.tangents[3] = mesh.tangents[number * 4 + 3];
      }
    }
    const std::span<const MorphWeight> morphs = instances[i]->morphs;
    morphBlocks(mesh, firstBlock, blockEnd, morphs, targets, tile.blocks);
    targets += morphs.size();
    for (std::size_t unit = 0; unit < units; ++unit) {
      const MorphedBlock& block = tile.blocks[unit / unitsEach];
      for (std::size_t c = 0; c < 3; ++c) {
        scatter(block.positions[c], unit, i, &tile.positions[unit][c]);
        if (normals) scatter(block.normals[c], unit, i, &tile.givenNormals[unit][c]);
        if (tangents) scatter(block.tangents[c], unit, i, &tile.givenTangents[unit][c]);
      }
      if (tangents) scatter(block.tangents[3], unit, i, &tile.tangents[unit][3]);
    }
  }
  const Vec3<D> none{hn::Zero(d), hn::Zero(d), hn::Zero(d)};
  const auto unitVector = [&](const Vec<D>* given, Vec<D>* to) HWY_ATTR {
    const Vec3<D> unit = unitOr(d, Vec3<D>{given[0], given[1], given[2]}, none);
    to[0] = unit.x;
    to[1] = unit.y;
    to[2] = unit.z;
  };
  for (std::size_t unit = 0; unit < units; ++unit) {
    if (normals) unitVector(tile.givenNormals[unit], tile.normals[unit]);
    if (tangents) unitVector(tile.givenTangents[unit], tile.tangents[unit]);
  }
  const auto first = [](const auto& vectors) { return reinterpret_cast<const float*>(vectors); };
  from.positions = first(tile.positions);
  from.normals = first(tile.normals);
  from.givenNormals = first(tile.givenNormals);
  from.tangents = first(tile.tangents);
  from.givenTangents = first(tile.givenTangents);
  from.isWhole = true;
}

// -- Methods.

template <class D>
DERMIS_INLINE Vec4<D> quadOf(const Vec<D>* v) {
  return {v[0], v[1], v[2], v[3]};
}
template <class D>
DERMIS_INLINE Matrix<D> matrixOf(const Vec<D>* v) {
  return {quadOf<D>(v), quadOf<D>(v + 4), quadOf<D>(v + 8)};
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

enum class Formula : std::uint8_t { linear, turned, other };

/// Reads the vertices of a unit late, since there are few registers.
template <bool isWhole, class D>
struct Reader {
  D d;
  const Source& from;
  std::size_t unit;

  DERMIS_INLINE Vec3<D> position() const { return loadThree<isWhole>(d, from.positions, 3, unit); }
  DERMIS_INLINE Vec3<D> normal() const { return loadThree<isWhole>(d, from.normals, 3, unit); }
  DERMIS_INLINE Vec3<D> tangent() const { return loadThree<isWhole>(d, from.tangents, 4, unit); }
  DERMIS_INLINE Vec<D> hand() const { return loadComponent<isWhole>(d, from.tangents, 4, 3, unit); }
};

/// The first phase: scales and shears the directions of a unit in bind space, into its slots.
/// Returns the blended part.
template <bool tangents, bool isWhole, class D>
DERMIS_INLINE Part<D> scaleDirections(D d, const Reader<isWhole, D>& read, bool isModerate,
                                      bool normals, Tile<D>& tile) {
  const Vec<D>* const p = tile.parts[read.unit];
  const Part<D> part = partOf<D>(p[0], p[1], p[2], p[3], p[4], p[5]);
  if (!normals && !tangents) return part;
  const DirectionMap<D> map = directionMap(d, part.r0, part.r1, part.r2, isModerate);
  Vec<D>* const to = tile.slots[read.unit];
  if (normals) {
    const Vec3<D> given = loadThree<isWhole>(d, read.from.givenNormals, 3, read.unit);
    setThree(to + 4, unitOr(d, mapNormal(map, given), read.normal()));
  }
  if constexpr (tangents) {
    const Vec3<D> given = loadThree<isWhole>(d, read.from.givenTangents, 4, read.unit);
    setThree(to + 8, unitOr(d, mapTangent(map, given), read.tangent()));
    to[11] = hn::Mul(read.hand(), map.side);
  }
  return part;
}

/// Skins a unit by a blended matrix into its slots.
template <bool tangents, class D, class Reader>
DERMIS_INLINE void moveUnit(D d, const Matrix<D>& matrix, bool isModerate, const Reader& read,
                            bool normals, Vec<D>* to) {
  setThree(to, throughMatrix(matrix, read.position()));
  if (!normals && !tangents) return;
  const DirectionMap<D> map = directionMap(d, matrix, isModerate);
  if (normals) setThree(to + 4, unitOr(d, mapNormal(map, read.normal()), read.normal()));
  if constexpr (tangents) {
    setThree(to + 8, unitOr(d, mapTangent(map, read.tangent()), read.tangent()));
    to[11] = hn::Mul(read.hand(), map.side);
  }
}

/// Skins the vertices of a tile into its slots. What is read is read late, and what is known is
/// stored at once: there are few registers. `scales`: the palette has scale/shear parts.
template <Formula formula, bool scales, bool tangents, bool isWhole, bool isLone, class D>
HWY_NOINLINE HWY_ATTR void skinUnits(D d, Method method, bool isModerate, const Source& from,
                                     bool normals, std::size_t units, Tile<D>& tile) {
  for (std::size_t unit = 0; unit < units; ++unit) {
    Vec<D>* const to = tile.slots[unit];
    const Reader<isWhole, D> read{d, from, unit};
    if constexpr (formula == Formula::linear) {
      moveUnit<tangents>(d, matrixOf<D>(tile.rows[unit]), isModerate, read, normals, to);
      continue;
    }
    Part<D> part{};
    if constexpr (scales) part = scaleDirections<tangents>(d, read, isModerate, normals, tile);
    const auto scaled = [&](const Vec3<D>& point)
                            HWY_ATTR { return scales ? throughPart(part, point) : point; };
    const Vec4<D> real = quadOf<D>(tile.dualQuaternions[unit]);
    const Vec<D> factor = turningFactor(d, real);
    const auto move = [&](const Vec3<D>& point) HWY_ATTR {
      return movePoint(real, quadOf<D>(tile.dualQuaternions[unit] + 4), factor, point);
    };

    // The second phase: rotate and translate.
    if (formula == Formula::turned || method == Method::blended) {
      setThree(to, move(scaled(read.position())));
    } else {
      const Vec3<D> center = loadThree<isLone>(d, from.centers, 3, unit);
      const Vec3<D> straight = throughMatrix(matrixOf<D>(tile.rows[unit]), center);
      if (method == Method::centerOfRotation) {
        const Vec3<D> point = scaled(sub3(read.position(), center));
        setThree(to, add3(turnDirection(real, factor, point), straight));
      } else {
        const Vec3<D> pull = sub3(straight, move(scaled(center)));
        const Vec<D> share = loadComponent<isLone>(d, from.shares, 1, 0, unit);
        setThree(to, add3(move(scaled(read.position())), scale3(pull, share)));
      }
    }
    if (normals) {
      const Vec3<D> normal = scales ? threeOf<D>(to + 4) : read.normal();
      setThree(to + 4, turnDirection(real, factor, normal));
    }
    if constexpr (tangents) {
      const Vec3<D> tangent = scales ? threeOf<D>(to + 8) : read.tangent();
      setThree(to + 8, turnDirection(real, factor, tangent));
      if (!scales) to[11] = read.hand();
    }
    if (formula != Formula::other || method != Method::blended) continue;

    // Between the linearly blended vertex and this one, whose handedness stays.
    Vec<D> straight[12];
    moveUnit<tangents>(d, matrixOf<D>(tile.rows[unit]), isModerate, read, normals, straight);
    const Vec<D> share = loadComponent<isLone>(d, from.shares, 1, 0, unit);
    const Vec<D> one = hn::Set(d, 1.0f), rest = hn::Sub(one, share);
    const auto isTurned = hn::Ge(share, one);
    const auto mix = [&](std::size_t slot, bool isDirection) HWY_ATTR {
      const Vec3<D> turned = threeOf<D>(to + slot);
      const Vec3<D> mixed = add3(scale3(threeOf<D>(straight + slot), rest), scale3(turned, share));
      setThree(to + slot,
               choose3(isTurned, turned, isDirection ? unitOr(d, mixed, turned) : mixed));
    };
    mix(0, false);
    if (normals) mix(4, true);
    if constexpr (tangents) mix(8, true);
  }
}

// -- Results.

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

/// The bounds, and the numbers of clamped vertices, of the instances in the blocks of a vector.
template <class D>
struct Findings {
  Vec<D> least[3], greatest[3];
  std::uint32_t clamped[blocksOf<D>] = {};

  explicit Findings(D d) {
    for (Vec<D>& value : least) value = hn::Set(d, std::numeric_limits<float>::infinity());
    for (Vec<D>& value : greatest) value = hn::Set(d, -std::numeric_limits<float>::infinity());
  }
};

template <bool isLone, class D>
HWY_NOINLINE HWY_ATTR void findBounds(D d, const Tile<D>& tile, std::size_t units,
                                      const VertexRange& range, Findings<D>& findings) {
  for (std::size_t unit = 0; unit < units; ++unit) {
    const bool whole = isWhole<isLone, D>(range, unit);
    for (std::size_t axis = 0; axis < 3; ++axis) {
      // NaN leaves the bounds unchanged: both comparisons are false.
      const Vec<D> value = tile.slots[unit][axis];
      Vec<D>&least = findings.least[axis], &greatest = findings.greatest[axis];
      auto isLess = hn::Lt(value, least), isGreater = hn::Gt(value, greatest);
      if (!whole) {
        const auto wanted = lanesInRange<isLone>(d, range, unit);
        isLess = hn::And(wanted, isLess);
        isGreater = hn::And(wanted, isGreater);
      }
      least = hn::IfThenElse(isLess, value, least);
      greatest = hn::IfThenElse(isGreater, value, greatest);
    }
  }
}

/// Adds what was found of the instance in lanes `first` to `end`.
template <class D>
inline HWY_ATTR void addFindings(D d, const Findings<D>& findings, std::size_t first,
                                 std::size_t end, std::uint32_t clamped, InstanceResult& result) {
  const auto ordered = [](float value) {
    const auto bits = std::bit_cast<std::uint32_t>(value == 0 ? 0.0f : value);
    return (bits & 0x80000000u) != 0 ? ~bits : bits | 0x80000000u;
  };
  InstanceResult found;
  found.clampedVertices = clamped;
  for (std::size_t axis = 0; axis < 3; ++axis) {
    HWY_ALIGN float lanes[2][hn::MaxLanes(d)];
    hn::Store(findings.least[axis], d, lanes[0]);
    hn::Store(findings.greatest[axis], d, lanes[1]);
    const float least = *std::min_element(lanes[0] + first, lanes[0] + end);
    const float greatest = *std::max_element(lanes[1] + first, lanes[1] + end);
    if (!(least <= greatest)) continue;
    found.orderedMin[axis] = ordered(least);
    found.orderedMax[axis] = ordered(greatest);
  }
  addResult(result, found);
}

// -- Encoding.

/// Maps positions from the boxes of their instances to [-1, 1], and counts those outside.
template <bool isLone, class D>
HWY_NOINLINE HWY_ATTR void relateToBoxes(D d, const TaskInstance* const* instances,
                                         std::size_t units, const VertexRange& range, Tile<D>& tile,
                                         Findings<D>& findings) {
  constexpr std::size_t lanes = hn::MaxLanes(d);
  HWY_ALIGN float centers[3][lanes], inverses[3][lanes], counts[lanes];
  for (std::size_t lane = 0; lane < lanes; ++lane) {
    const TaskInstance& instance = *instances[isLone ? 0 : lane / 4];
    for (std::size_t axis = 0; axis < 3; ++axis) {
      centers[axis][lane] = instance.boxCenter[axis];
      inverses[axis][lane] = instance.boxInverse[axis];
    }
  }
  for (std::size_t unit = 0; unit < units; ++unit) {
    auto isOutside = hn::Ne(hn::Zero(d), hn::Zero(d));
    for (std::size_t axis = 0; axis < 3; ++axis) {
      Vec<D>& value = tile.slots[unit][axis];
      value = hn::Mul(hn::Sub(value, hn::Load(d, centers[axis])), hn::Load(d, inverses[axis]));
      // A vertex on a face of the engine's box may lie outside by a rounding error.
      isOutside = hn::Or(isOutside, hn::Gt(hn::Abs(value), hn::Set(d, 1.00001f)));
    }
    if (hn::AllFalse(d, isOutside)) continue;
    isOutside = hn::And(isOutside, lanesInRange<isLone>(d, range, unit));
    hn::Store(hn::IfThenElseZero(isOutside, hn::Set(d, 1.0f)), d, counts);
    for (std::size_t lane = 0; lane < lanes; ++lane) {
      if (counts[lane] != 0) ++findings.clamped[isLone ? 0 : lane / 4];
    }
  }
}

/// Replaces the components of an attribute by its words.
template <Stream stream, class D>
HWY_NOINLINE HWY_ATTR void encodeUnits(D d, VertexFormat format, std::size_t units, Tile<D>& tile) {
  if (format == VertexFormat::float32x3 ||
      (stream == Stream::tangents && format == VertexFormat::float32x4))
    return;
  for (std::size_t unit = 0; unit < units; ++unit) {
    Vec<D>* const own = tile.slots[unit] + static_cast<std::size_t>(stream) * 4;
    const Vec3<D> v{own[0], own[1], own[2]};
    Encoded<D> encoded;
    if constexpr (stream == Stream::positions) {
      encoded = encodePosition(d, format, v);
    } else if constexpr (stream == Stream::normals) {
      encoded = encodeNormal(d, format, v);
    } else {
      encoded = encodeTangent(d, format, v, own[3]);
    }
    for (std::size_t k = 0; k < 4; ++k) own[k] = hn::BitCast(d, encoded.words[k]);
  }
}

// -- Storing.

/// Copies the positions of vertices `first` to `end` to their previous positions.
inline void keepPositions(const Task& task, const TaskInstance& instance, std::size_t first,
                          std::size_t end) {
  const OutputAttribute &from = task.places[Stream::positions],
                        &to = task.places[Stream::previousPositions];
  copyLanes(instance.outputs[Stream::previousPositions], to.stride,
            instance.outputs[Stream::positions], from.stride, formatSize(from.format), first, end);
}

/// Attributes that are side by side in every instance, so that they are stored at once.
struct Record {
  Stream stream{};             ///< of the first
  std::uint32_t bytes = 0;     ///< more than 4 only in whole words
  std::uint32_t slots = 0;     ///< number of `slot`
  std::uint8_t slot[12] = {};  ///< in the order of words
};

struct Records {
  Record all[3];
  std::size_t count = 0;
};

inline Records recordsOf(const VertexPlaces& places, const TaskInstance* const* instances,
                         std::size_t instanceCount) {
  Records records;
  for (const Stream stream : {Stream::positions, Stream::normals, Stream::tangents}) {
    const OutputAttribute& attribute = places[stream];
    if (attribute.format == VertexFormat::none) continue;
    const std::uint32_t bytes = formatSize(attribute.format);
    const auto follows = [&](const Record& record) {
      if (record.bytes % 4 != 0 || bytes % 4 != 0 ||
          places[record.stream].stride != attribute.stride)
        return false;
      return std::all_of(instances, instances + instanceCount, [&](const TaskInstance* instance) {
        return instance->outputs[stream] == instance->outputs[record.stream] + record.bytes;
      });
    };
    if (records.count == 0 || !follows(records.all[records.count - 1])) {
      records.all[records.count++] = {stream, 0, 0, {}};
    }
    Record& record = records.all[records.count - 1];
    record.bytes += bytes;
    for (std::uint32_t k = 0; k < (bytes + 3) / 4; ++k)
      record.slot[record.slots++] =
          static_cast<std::uint8_t>(static_cast<std::size_t>(stream) * 4 + k);
  }
  return records;
}

/// Stores the first `size` bytes of a block.
template <std::size_t size>
DERMIS_INLINE void storeQuad(Vec<Four> value, std::byte* to) {
  const hn::FixedTag<std::uint8_t, 16> bytes;
  auto* const memory = reinterpret_cast<std::uint8_t*>(to);
  if constexpr (size == 16) {
    hn::StoreU(hn::BitCast(bytes, value), bytes, memory);
  } else if constexpr (size == 8 || size == 12) {
    const hn::Half<decltype(bytes)> half;
    hn::StoreU(hn::LowerHalf(half, hn::BitCast(bytes, value)), half, memory);
    if constexpr (size == 12) {
      const float last = hn::ExtractLane(value, 2);
      std::memcpy(memory + 8, &last, 4);
    }
  } else {
    HWY_ALIGN float words[4];
    hn::Store(value, Four(), words);
    std::memcpy(memory, words, size);
  }
}

/// Stores the first `size` bytes of each block: block i to `to[i]`, `offset` bytes on.
template <std::size_t size>
DERMIS_INLINE void storeEach(Four, Vec<Four> value, std::byte* const* to, std::size_t offset) {
  storeQuad<size>(value, to[0] + offset);
}
#if HWY_MAX_BYTES >= 32
template <std::size_t size>
DERMIS_INLINE void storeEach(Eight, Vec<Eight> value, std::byte* const* to, std::size_t offset) {
  const Four four;
  storeQuad<size>(hn::LowerHalf(four, value), to[0] + offset);
  storeQuad<size>(hn::UpperHalf(four, value), to[1] + offset);
}
#endif
#if HWY_MAX_BYTES >= 64
template <std::size_t size>
DERMIS_INLINE void storeEach(Sixteen, Vec<Sixteen> value, std::byte* const* to,
                             std::size_t offset) {
  const Eight half;
  storeEach<size>(half, hn::LowerHalf(half, value), to, offset);
  storeEach<size>(half, hn::UpperHalf(half, value), to + 2, offset);
}
#endif

/// Four slots, or fewer of a record's last, that are side by side in each vertex.
struct Quad {
  std::uint8_t slot[4];
  std::size_t bytes, offset;  ///< in the record
};

/// Stores a quad of the vertices of whole units. `to`: where the first vertex of each block goes.
/// `isDense`: a vertex may be stored with some bytes after it, which the next one overwrites.
template <bool isLone, std::size_t size, bool isDense, class D>
HWY_NOINLINE HWY_ATTR void storeUnits(D d, const Quad& quad, std::size_t stride,
                                      std::byte* const* to, std::size_t first, std::size_t end,
                                      const Tile<D>& tile) {
  const std::size_t step = unitVertices<isLone, D> * stride;
  std::byte* places[blocksOf<D>];
  for (std::size_t i = 0; i < blocksOf<D>; ++i)
    places[i] = to[isLone ? 0 : i] + first * step + (isLone ? i * 4 * stride : 0) + quad.offset;
  const Vec<D>* const a = tile.slots[0] + quad.slot[0];
  const Vec<D>* const b = tile.slots[0] + quad.slot[1];
  const Vec<D>* const c = tile.slots[0] + quad.slot[2];
  const Vec<D>* const e = tile.slots[0] + quad.slot[3];
  for (std::size_t unit = first; unit < end; ++unit) {
    const std::size_t place = unit * std::size(tile.slots[0]);
    if constexpr (size > 4) {
      Vec<D> v0 = a[place], v1 = b[place], v2 = c[place], v3 = e[place];
      transpose4(d, v0, v1, v2, v3);
      constexpr std::size_t most = isDense ? 16 : size;
      storeEach<most>(d, v0, places, 0);
      storeEach<most>(d, v1, places, stride);
      storeEach<most>(d, v2, places, 2 * stride);
      storeEach<size>(d, v3, places, 3 * stride);
    } else if constexpr (isDense) {
      storeEach<16>(d, a[place], places, 0);
    } else {
      HWY_ALIGN float words[hn::MaxLanes(d)];
      hn::Store(a[place], d, words);
      for (std::size_t lane = 0; lane < hn::MaxLanes(d); ++lane)
        std::memcpy(places[lane / 4] + lane % 4 * stride, words + lane, size);
    }
    for (std::byte*& next : places) next += step;
  }
}

/// Stores positions and normals as float32x3, side by side, of whole units.
template <bool isLone, class D>
HWY_NOINLINE HWY_ATTR void storeSideBySide(D d, std::byte* const* to, std::size_t first,
                                           std::size_t end, const Tile<D>& tile) {
  float* places[blocksOf<D>];
  for (std::size_t i = 0; i < blocksOf<D>; ++i) {
    places[i] = reinterpret_cast<float*>(to[isLone ? 0 : i]) +
                (first * unitVertices<isLone, D> + (isLone ? i * 4 : 0)) * vertexFloats;
  }
  for (std::size_t unit = first; unit < end; ++unit) {
    const Vec<D>* const v = tile.slots[unit];
    storeVertices(d, threeOf<D>(v), threeOf<D>(v + 4), places);
    for (float*& next : places) next += unitVertices<isLone, D> * vertexFloats;
  }
}

/// Stores a quad of those vertices of a unit that are in the range.
template <bool isLone, class D>
HWY_NOINLINE HWY_ATTR void storeSome(D d, const Quad& quad, std::size_t stride,
                                     std::byte* const* to, std::size_t unit,
                                     const VertexRange& range, const Tile<D>& tile) {
  Vec<D> words[4];
  for (std::size_t k = 0; k < 4; ++k) words[k] = tile.slots[unit][quad.slot[k]];
  transpose4(d, words[0], words[1], words[2], words[3]);
  HWY_ALIGN float all[4][hn::MaxLanes(d)];
  for (std::size_t vertex = 0; vertex < 4; ++vertex) hn::Store(words[vertex], d, all[vertex]);
  for (std::size_t i = 0; i < blocksOf<D>; ++i) {
    for (std::size_t vertex = 0; vertex < 4; ++vertex) {
      const std::size_t number = unit * unitVertices<isLone, D> + (isLone ? i * 4 : 0) + vertex;
      if (number < range.first || number >= range.end) continue;
      std::memcpy(to[isLone ? 0 : i] + number * stride + quad.offset, all[vertex] + i * 4,
                  quad.bytes);
    }
  }
}

/// Stores the vertices of a tile. `to`: where the first vertex of each instance goes.
/// `isSideBySide`: the record is what `storeSideBySide` stores.
template <bool isLone, class D>
inline HWY_ATTR void storeRecord(D d, const Record& record, bool isSideBySide, std::size_t stride,
                                 std::byte* const* to, const VertexRange& range,
                                 const Tile<D>& tile) {
  constexpr std::size_t vertices = unitVertices<isLone, D>;
  const std::size_t whole = (range.first + vertices - 1) / vertices;
  const std::size_t wholeEnd = std::max(whole, range.end / vertices);
  if (isSideBySide) storeSideBySide<isLone>(d, to, whole, wholeEnd, tile);
  for (std::size_t first = 0; first < record.slots; first += 4) {
    Quad quad{{}, std::min<std::size_t>(record.bytes - first * 4, 16), first * 4};
    for (std::size_t k = 0; k < 4; ++k)
      quad.slot[k] = record.slot[std::min<std::size_t>(first + k, record.slots - 1)];
    if (range.first != whole * vertices)
      storeSome<isLone>(d, quad, stride, to, range.first / vertices, range, tile);
    if (!isSideBySide) {
      bySize(static_cast<std::uint32_t>(quad.bytes), [&](auto size) HWY_ATTR {
        if (size() % 4 == 0 && stride == size()) {
          storeUnits<isLone, size(), size() < 16>(d, quad, stride, to, whole, wholeEnd, tile);
        } else {
          storeUnits<isLone, size(), false>(d, quad, stride, to, whole, wholeEnd, tile);
        }
      });
    }
    if (range.end > wholeEnd * vertices)
      storeSome<isLone>(d, quad, stride, to, wholeEnd, range, tile);
  }
}

// -- All stages.

/// Whole blocks of a run.
struct Blocks {
  const Run& run;
  std::uint32_t first, end;
};

/// The instances of a vector, and what is the same for all tiles.
struct Company {
  const Task& task;
  const TaskInstance* const* instances;
  std::size_t count;
  const Palette& palette;
  const abi::MorphRecord* targets;  ///< the active ones of all instances, one after the other
  Records records = recordsOf(task.places, instances, count);
  bool isMorphed = !instances[0]->morphs.empty();
  bool isSideBySide = areSideBySide(task.places, instances, count);
  bool hasResults = std::any_of(instances, instances + count, [](const TaskInstance* instance) {
    return instance->result != nullptr;
  });
};

/// Skins a tile. Only vertices in the range are stored and count for results.
template <bool isLone, class D>
inline HWY_ATTR void skinTile(D d, const Company& company, const Blocks& blocks,
                              const VertexRange& range, Tile<D>& tile, Findings<D>& findings) {
  const Task& task = company.task;
  const TaskInstance* const* const instances = company.instances;
  const Palette& palette = company.palette;
  const MeshData& mesh = *task.mesh;
  const Method method = task.method;
  const std::size_t units = (blocks.end - blocks.first) * (isLone ? 1 : 2);
  const std::uint64_t slot = blocks.run.slotOf(blocks.first);
  const Slots slots{mesh.jointNumbers.data() + slot, mesh.pairNumbers.data() + slot,
                    mesh.weights.data() + slot, blocks.run.influences};
  // What is stored last is fetched first, beside the sums.
  for (std::size_t number = 0; number < company.records.count; ++number) {
    const Stream stream = company.records.all[number].stream;
    const std::size_t stride = task.places[stream].stride;
    for (std::size_t i = 0; i < company.count; ++i) {
      const std::byte* const place =
          instances[i]->outputs[stream] + std::size_t{blocks.first} * blockVertices * stride;
      const std::size_t step = std::max<std::size_t>(stride, 64);
      for (std::size_t byte = range.first * stride; byte < range.end * stride; byte += step)
        hwy::Prefetch(place + byte);
    }
  }

  Source from = sourceOf(mesh, method, blocks.first, isLone);
  if (company.isMorphed)
    morphTile<isLone>(d, mesh, blocks.first, blocks.end, instances, company.targets, tile, from);
  const VertexPlaces& places = task.places;
  const bool normals = places[Stream::normals].format != VertexFormat::none;
  const bool tangents = places[Stream::tangents].format != VertexFormat::none;
  const auto skin = [&](auto formula, auto scales, auto withTangents) HWY_ATTR {
    if (isLone || from.isWhole) {
      skinUnits<formula(), scales(), withTangents(), true, isLone>(d, method, palette.isModerate,
                                                                   from, normals, units, tile);
    } else {
      skinUnits<formula(), scales(), withTangents(), false, isLone>(d, method, palette.isModerate,
                                                                    from, normals, units, tile);
    }
  };
  const auto byTangents = [&](auto formula, auto scales) HWY_ATTR {
    tangents ? skin(formula, scales, std::true_type()) : skin(formula, scales, std::false_type());
  };
  const auto byScale = [&](auto formula) HWY_ATTR {
    palette.scales ? byTangents(formula, std::true_type()) : byTangents(formula, std::false_type());
  };
  if (method == Method::centerOfRotation) {
    sumUnits<isLone, 1, false>(d, palette.pairs, nullptr, slots.pairs, slots, units,
                               tile.dualQuaternions);
  } else if (method != Method::linear) {
    sumUnits<isLone, 2, false>(d, palette.pairs, nullptr, slots.pairs, slots, units,
                               tile.dualQuaternions);
  }
  if (palette.scales) {
    sumUnits<isLone, 2, true>(d, palette.partPairs, palette.parts, slots.pairs, slots, units,
                              tile.parts);
  }
  if (needsRows(method))
    sumUnits<isLone, 3, false>(d, palette.rows, nullptr, slots.joints, slots, units, tile.rows);

  if (method == Method::linear) {
    byTangents(std::integral_constant<Formula, Formula::linear>(), std::false_type());
  } else if (method == Method::dualQuaternion) {
    byScale(std::integral_constant<Formula, Formula::turned>());
  } else {
    byScale(std::integral_constant<Formula, Formula::other>());
  }

  constexpr std::size_t instanceCount = isLone ? 1 : blocksOf<D>;
  if (company.hasResults) findBounds<isLone>(d, tile, units, range, findings);
  if (isSnormPosition(places[Stream::positions].format))
    relateToBoxes<isLone>(d, instances, units, range, tile, findings);
  encodeUnits<Stream::positions>(d, places[Stream::positions].format, units, tile);
  if (normals) encodeUnits<Stream::normals>(d, places[Stream::normals].format, units, tile);
  if (tangents) encodeUnits<Stream::tangents>(d, places[Stream::tangents].format, units, tile);

  const std::size_t vertex = std::size_t{blocks.first} * blockVertices;
  // The previous positions are those in the output, or those that are stored now.
  const auto copyPositions = [&](bool restart) HWY_ATTR {
    if (!places.hasMotion()) return;
    for (std::size_t i = 0; i < instanceCount; ++i) {
      if (instances[i]->restartsMotion == restart)
        keepPositions(task, *instances[i], vertex + range.first, vertex + range.end);
    }
  };
  copyPositions(false);
  for (std::size_t number = 0; number < company.records.count; ++number) {
    const Record& record = company.records.all[number];
    const std::size_t stride = places[record.stream].stride;
    std::byte* to[instanceCount];
    for (std::size_t i = 0; i < instanceCount; ++i)
      to[i] = instances[i]->outputs[record.stream] + vertex * stride;
    storeRecord<isLone>(d, record, company.isSideBySide && record.stream == Stream::positions,
                        stride, to, range, tile);
  }
  copyPositions(true);
}

}  // namespace dermis::cpu::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();
