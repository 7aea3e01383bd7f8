// The first stage: blends what a method needs, and skins the vertices of a tile by it. Blocks that
// are stored directly are encoded and stored here, too.
#pragma once

#include <algorithm>
#include <type_traits>

#include "cpu/bind_inl.h"
#include "cpu/store_inl.h"
#include "cpu/sums_inl.h"
#include "cpu/vertex_inl.h"
#include "hwy/cache_control.h"

HWY_BEFORE_NAMESPACE();
namespace dermis::cpu::HWY_NAMESPACE {

template <class D>
DERMIS_INLINE Vec4<D> quadOf(const Vec<D>* v) {
  // Not copied as a structure, which GCC might store again.
  const auto* const numbers = reinterpret_cast<const float*>(v);
  const D d;
  constexpr std::size_t lanes = hn::MaxLanes(d);
  return {hn::Load(d, numbers), hn::Load(d, numbers + lanes), hn::Load(d, numbers + 2 * lanes),
          hn::Load(d, numbers + 3 * lanes)};
}
template <class D>
DERMIS_INLINE Matrix<D> matrixOf(const Vec<D>* v) {
  return {quadOf<D>(v), quadOf<D>(v + 4), quadOf<D>(v + 8)};
}

/// Reads the vertices of a unit late, since there are few registers.
template <From place, class D>
struct Reader {
  D d;
  const Source& from;
  std::size_t unit;

  DERMIS_INLINE Vec3<D> position() const { return loadThree<place>(d, from.positions, 3, unit); }
  DERMIS_INLINE Vec3<D> normal() const { return loadThree<place>(d, from.normals, 3, unit); }
  DERMIS_INLINE Vec3<D> tangent() const { return loadThree<place>(d, from.tangents, 4, unit); }
  DERMIS_INLINE Vec<D> hand() const { return loadComponent<place>(d, from.tangents, 4, 3, unit); }
};

/// How many numbers of a blended dual quaternion a method needs.
constexpr std::size_t quaternionNumbers(Method method) {
  return method == Method::centerOfRotation ? 4 : 8;
}

/// What the vertices of a tile are skinned by.
struct Skinning {
  const Palette& palette;
  Slots slots;
  Source from;
  bool normals;

  /// Goes on by some units, which are those of whole blocks.
  template <bool isLone, From place, class D>
  DERMIS_INLINE void advance(D, std::size_t units) {
    const std::size_t vertices = units * unitVertices<isLone, D>;
    slots.advance(vertices);
    from.advance(place == From::tile ? units * hn::MaxLanes(D()) : vertices, vertices);
  }
};

/// Maps directions into the slots of a unit, which `normalizeUnit` normalizes. Until then, the slot
/// after the normal has the sign of the determinant.
template <bool tangents, From place, class D>
DERMIS_INLINE void mapUnit(D d, const Skinning& by, const DirectionMap<D>& map,
                           const float* normals, const float* givenTangents, std::size_t unit,
                           Vec<D>* to) {
  if (by.normals) {
    setThree(to + 4, mapNormal(map, loadThree<place>(d, normals, 3, unit)));
    to[7] = map.side;
  }
  if constexpr (tangents) {
    setThree(to + 8, mapTangent(map, loadThree<place>(d, givenTangents, 4, unit)));
    to[11] = hn::Mul(Reader<place, D>{d, by.from, unit}.hand(), map.side);
  }
}
template <bool tangents, From place, class D>
DERMIS_INLINE void normalizeUnit(D d, const Skinning& by, std::size_t unit, Vec<D>* to) {
  const Reader<place, D> read{d, by.from, unit};
  if (by.normals) setThree(to + 4, unitOr(d, threeOf<D>(to + 4), read.normal(), to[7]));
  if constexpr (tangents) setThree(to + 8, unitOr(d, threeOf<D>(to + 8), read.tangent()));
}

/// Skins a unit by a blended matrix into its slots. `normalizeUnit` must follow.
template <bool tangents, From place, class D>
DERMIS_INLINE void moveUnit(D d, const Skinning& by, const Vec<D>* rows, std::size_t unit,
                            Vec<D>* to) {
  const Reader<place, D> read{d, by.from, unit};
  const Matrix<D> matrix = matrixOf<D>(rows);
  setThree(to, throughMatrix(matrix, read.position()));
  if (!by.normals && !tangents) return;
  mapUnit<tangents, place>(d, by, directionMap(d, matrix, by.palette.isModerate), by.from.normals,
                           by.from.tangents, unit, to);
}

/// Where `scaleUnit` leaves the center of rotation. Later the slots get the previous position.
inline constexpr std::size_t centerSlot = 12;

/// The first phase: scales and shears a unit in bind space, by the blended part `p`, into its
/// slots. With centers of rotation, the position is relative to them, or they are scaled, too.
/// `normalizeUnit` must follow.
template <Method method, bool tangents, From place, From mesh, class D>
DERMIS_INLINE void scaleUnit(D d, const Skinning& by, const Vec<D>* p, std::size_t unit,
                             Vec<D>* to) {
  const Reader<place, D> read{d, by.from, unit};
  const Part<D> part = partOf<D>(p[0], p[1], p[2], p[3], p[4], p[5]);
  Vec3<D> point = read.position();
  if constexpr (needsCentersOfRotation(method)) {
    const Vec3<D> center = loadThree<mesh>(d, by.from.centers, 3, unit);
    if constexpr (method == Method::centerOfRotation) {
      point = sub3(point, center);
    } else {
      setThree(to + centerSlot, throughPart(part, center));
    }
  }
  setThree(to, throughPart(part, point));
  if (!by.normals && !tangents) return;
  mapUnit<tangents, place>(d, by, directionMap(d, part.r0, part.r1, part.r2, by.palette.isModerate),
                           by.from.givenNormals, by.from.givenTangents, unit, to);
}

/// The second phase: rotates and translates a unit into its slots. What is read is read late, and
/// what is known is stored at once: there are few registers. `scales`: `scaleUnit` came before.
template <Method method, bool scales, bool tangents, From place, From mesh, class D>
DERMIS_INLINE void turnUnit(D d, const Skinning& by, const Vec<D>* quaternion, const Vec<D>* rows,
                            std::size_t unit, Vec<D>* to) {
  const Reader<place, D> read{d, by.from, unit};
  const Vec4<D> real = quadOf<D>(quaternion);
  const Vec<D> factor = turningFactor(d, real);
  const Vec4<D> dual = quadOf<D>(quaternion + 4);
  if constexpr (!needsCentersOfRotation(method)) {
    setThree(to, movePoint(real, dual, factor, scales ? threeOf<D>(to) : read.position()));
  } else {
    const Vec3<D> center = loadThree<mesh>(d, by.from.centers, 3, unit);
    const Vec3<D> straight = throughMatrix(matrixOf<D>(rows), center);
    if constexpr (method == Method::centerOfRotation) {
      const Vec3<D> point = scales ? threeOf<D>(to) : sub3(read.position(), center);
      setThree(to, add3(turnDirection(real, factor, point), straight));
    } else {
      const Vec3<D> turned =
          movePoint(real, dual, factor, scales ? threeOf<D>(to + centerSlot) : center);
      const Vec3<D> moved =
          movePoint(real, dual, factor, scales ? threeOf<D>(to) : read.position());
      const Vec<D> share = loadComponent<mesh>(d, by.from.shares, 1, 0, unit);
      setThree(to, add3(moved, scale3(sub3(straight, turned), share)));
    }
  }
  if (by.normals) {
    const Vec3<D> normal = scales ? threeOf<D>(to + 4) : read.normal();
    setThree(to + 4, turnDirection(real, factor, normal));
  }
  if constexpr (tangents) {
    const Vec3<D> tangent = scales ? threeOf<D>(to + 8) : read.tangent();
    setThree(to + 8, turnDirection(real, factor, tangent));
    if (!scales) to[11] = read.hand();
  }
}

/// Moves what `turnUnit` wrote towards the linearly blended vertex. The handedness stays.
template <bool tangents, From mesh, class D>
DERMIS_INLINE void mixUnit(D d, const Skinning& by, const Vec<D>* straight, std::size_t unit,
                           Vec<D>* to) {
  const Vec<D> share = loadComponent<mesh>(d, by.from.shares, 1, 0, unit);
  const Vec<D> one = hn::Set(d, 1.0f), rest = hn::Sub(one, share);
  const auto isTurned = hn::Ge(share, one);
  const auto mix = [&](std::size_t slot, bool isDirection) HWY_ATTR {
    const Vec3<D> turned = threeOf<D>(to + slot);
    const Vec3<D> mixed = add3(scale3(threeOf<D>(straight + slot), rest), scale3(turned, share));
    setThree(to + slot, choose3(isTurned, turned, isDirection ? unitOr(d, mixed, turned) : mixed));
  };
  mix(0, false);
  if (by.normals) mix(4, true);
  if constexpr (tangents) mix(8, true);
}

/// Where whole blocks are stored as soon as they are skinned: record i of the mesh's first vertex,
/// of instance k, at `to[i][k]`.
template <class D>
struct Direct {
  const VertexPlaces& places;
  const Records& records;
  float* to[streamCount][hn::MaxLanes(D())];
  Kept<D> kept;
};

/// The output of the next block, `offset` floats from `to` of each lane; or `to` is null.
struct Ahead {
  float* const* to;
  std::size_t offset;
  bool isLong;  ///< a block has more than three cache lines
};

/// Fetches its lines, for one lane in eight: stores would wait for all of them. Those of four lanes
/// do not wait. No loop remains. Always inlined, and without a lambda: GCC removes calls of what
/// only prefetches.
template <class D>
HWY_INLINE void fetchLines(D d, const Ahead& ahead, std::size_t first) {
  constexpr std::size_t step = 8, floats = 64 / sizeof(float);
  for (std::size_t lane = 0; lane + step <= hn::MaxLanes(d); lane += step) {
    const float* const next = ahead.to[lane + first] + ahead.offset;
    for (std::size_t i = 0; i < 3; ++i) hwy::Prefetch(next + i * floats);
    for (std::size_t i = 3; ahead.isLong && i < 5; ++i) hwy::Prefetch(next + i * floats);
  }
}

/// Blends the joints of some units of a lone instance into the tile. This loop is separate so that
/// a processor can begin the next unit before the last one ends.
template <Method method, bool scales, class D>
HWY_NOINLINE HWY_ATTR void blendLone(D d, const Palette& palette, const Slots& slots,
                                     std::size_t count, Tile<D>& tile) {
  const auto blend = [&](auto influences) HWY_ATTR {
    for (std::size_t i = 0; i < count; ++i) {
      if constexpr (needsRows(method))
        sumLone<influences(), 12, false>(d, palette.rows, slots.joints, slots, i, tile.rows[i]);
      if constexpr (scales)
        sumLone<influences(), 6, true>(d, palette.parts, slots.pairs, slots, i, tile.parts[i]);
      if constexpr (method != Method::linear)
        sumLone<influences(), quaternionNumbers(method), false>(d, palette.pairs, slots.pairs,
                                                                slots, i, tile.quaternions[i]);
    }
  };
#ifndef DERMIS_CPU_SMALL
  if (slots.influences == 4) return blend(std::integral_constant<std::size_t, 4>());
#endif
  blend(std::integral_constant<std::size_t, 0>());
}

/// Skins units into slots, with what `blendLone` left in the tile, or sums for a company. In short
/// loops, so that a processor begins a unit before the last one ends.
template <bool isLone, Method method, bool scales, bool tangents, From place, class D>
DERMIS_INLINE void skinSome(D d, const Skinning& by, std::size_t count, Ahead ahead, Tile<D>& tile,
                            Vec<D> (*own)[slotCount]) {
  constexpr From mesh = isLone ? From::lone : From::company;
  const Palette& palette = by.palette;
  const Slots& slots = by.slots;
  const auto moveAll = [&](Vec<D>* to, std::size_t stride) HWY_ATTR {
    for (std::size_t i = 0; i < count; ++i) {
      Vec<D> sums[12], *const rows = isLone ? tile.rows[i] : sums;
      if constexpr (!isLone) sumCompany<12, false>(d, palette.rows, slots.joints, slots, i, rows);
      moveUnit<tangents, place>(d, by, rows, i, to + i * stride);
    }
  };
  const auto normalizeAll = [&](Vec<D>* to, std::size_t stride) HWY_ATTR {
    for (std::size_t i = 0; (by.normals || tangents) && i < count; ++i)
      normalizeUnit<tangents, place>(d, by, i, to + i * stride);
  };
  if constexpr (scales) {
    for (std::size_t i = 0; i < count; ++i) {
      Vec<D> sums[6], *const part = isLone ? tile.parts[i] : sums;
      if constexpr (!isLone) sumCompany<6, true>(d, palette.parts, slots.pairs, slots, i, part);
      scaleUnit<method, tangents, place, mesh>(d, by, part, i, own[i]);
    }
    normalizeAll(own[0], slotCount);
  }
  if constexpr (method == Method::linear) {
    moveAll(own[0], slotCount);
    normalizeAll(own[0], slotCount);
  }
  // Sums load, what follows computes: a loop of their own, where there is only one other.
  constexpr bool isSummed = isLone || (!scales && !needsCentersOfRotation(method));
  if constexpr (!isLone && isSummed && method != Method::linear) {
    for (std::size_t i = 0; i < count; ++i)
      sumCompany<8, false>(d, palette.pairs, slots.pairs, slots, i, tile.quaternions[i]);
  }
  for (std::size_t i = 0; i < count; ++i) {
    if constexpr (method != Method::linear) {
      Vec<D> sums[8], *const quaternion = isSummed ? tile.quaternions[i] : sums;
      Vec<D> more[12], *const rows = isLone ? tile.rows[i] : more;
      if constexpr (!isLone && needsCentersOfRotation(method))
        sumCompany<12, false>(d, palette.rows, slots.joints, slots, i, rows);
      if constexpr (!isSummed) {
        sumCompany<quaternionNumbers(method), false>(d, palette.pairs, slots.pairs, slots, i,
                                                     quaternion);
      }
      turnUnit<method, scales, tangents, place, mesh>(d, by, quaternion, rows, i, own[i]);
    }
    if (!isLone && ahead.to != nullptr) fetchLines(d, ahead, i);
  }
  if constexpr (method == Method::blended) {
    constexpr std::size_t stride = std::extent_v<decltype(tile.rows), 1>;
    moveAll(tile.rows[0], stride);
    normalizeAll(tile.rows[0], stride);
    for (std::size_t i = 0; i < count; ++i) mixUnit<tangents, mesh>(d, by, tile.rows[i], i, own[i]);
  }
}

/// Skins units into the tile. If they are stored directly, they are those of whole blocks, the
/// first of which begins at `vertex`.
template <bool isLone, Method method, bool scales, bool tangents, From place, class D>
HWY_NOINLINE HWY_ATTR void skinUnits(D d, const Skinning& given, std::size_t units,
                                     const Direct<D>* direct, std::size_t vertex, Tile<D>& tile) {
  // Copies, which stores into the tile cannot change.
  const Palette palette = given.palette;
  Skinning by{palette, given.slots, given.from, given.normals};
  constexpr std::size_t step = isLone ? Tile<D>::mostLone : blockVertices;
  for (std::size_t first = 0; first < units; first += step) {
    if (first != 0) by.advance<isLone, place>(d, step);
    const std::size_t count = isLone ? std::min(step, units - first) : step;
    Vec<D>(*const own)[slotCount] = tile.slots + (direct == nullptr ? first : 0);
    if constexpr (isLone) blendLone<method, scales>(d, palette, by.slots, count, tile);
    Ahead ahead{};
    if (!isLone && direct != nullptr) {
      const std::size_t slots = direct->records.all[0].slots;
      ahead = {direct->to[0], (vertex + first + blockVertices) * slots,
               slots * blockVertices * sizeof(float) > std::size_t{3} * 64};
    }
    skinSome<isLone, method, scales, tangents, place>(d, by, count, ahead, tile, own);
    if (direct == nullptr) continue;
    encodeUnits(d, direct->places, count, own);
    for (std::size_t i = 0; direct->records.keepsPositions && i < count; ++i) {
      const std::size_t number = vertex + (first + i) * unitVertices<isLone, D>;
      keepUnit(d, direct->kept, number * direct->kept.stride, own[i]);
    }
    for (std::size_t number = 0; number < direct->records.count; ++number) {
      const Record& record = direct->records.all[number];
      const std::size_t offset = (vertex + first * unitVertices<isLone, D>)*record.slots;
      if constexpr (isLone) {
        storeDenseUnits(d, record, direct->to[number][0] + offset, own, count);
      } else {
        storeBlock(d, record, direct->to[number], offset, own[0]);
      }
    }
  }
}

}  // namespace dermis::cpu::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();
