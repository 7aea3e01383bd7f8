// The first stage: blends what a method needs, and skins the vertices of a tile by it. Blocks of a
// company that no other stage changes are stored here, too.
#pragma once

#include <algorithm>
#include <type_traits>

#include "cpu/bind_inl.h"
#include "cpu/store_inl.h"
#include "cpu/sums_inl.h"
#include "cpu/vertex_inl.h"

HWY_BEFORE_NAMESPACE();
namespace dermis::cpu::HWY_NAMESPACE {

template <class D>
DERMIS_INLINE Vec4<D> quadOf(const Vec<D>* v) {
  return {v[0], v[1], v[2], v[3]};
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

/// The first phase: scales and shears the directions of a unit in bind space, into its slots.
/// Returns the blended part `p`.
template <bool tangents, From place, class D>
DERMIS_INLINE Part<D> scaleDirections(D d, const Vec<D>* p, const Reader<place, D>& read,
                                      bool isModerate, bool normals, Vec<D>* to) {
  const Part<D> part = partOf<D>(p[0], p[1], p[2], p[3], p[4], p[5]);
  if (!normals && !tangents) return part;
  const DirectionMap<D> map = directionMap(d, part.r0, part.r1, part.r2, isModerate);
  if (normals) {
    const Vec3<D> given = loadThree<place>(d, read.from.givenNormals, 3, read.unit);
    setThree(to + 4, unitOr(d, mapNormal(map, given), read.normal(), map.side));
  }
  if constexpr (tangents) {
    const Vec3<D> given = loadThree<place>(d, read.from.givenTangents, 4, read.unit);
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
  if (normals) setThree(to + 4, unitOr(d, mapNormal(map, read.normal()), read.normal(), map.side));
  if constexpr (tangents) {
    setThree(to + 8, unitOr(d, mapTangent(map, read.tangent()), read.tangent()));
    to[11] = hn::Mul(read.hand(), map.side);
  }
}

/// What the vertices of a tile are skinned by.
struct Skinning {
  const Palette& palette;
  Slots slots;
  Source from;
  bool normals;
};

/// What is blended for a unit.
template <class D>
struct Blended {
  const Vec<D>*quaternion, *part, *rows;
};

/// Skins a unit into its slots. What is read is read late, and what is known is stored at once:
/// there are few registers. `scales`: the palette has scale/shear parts.
template <Method method, bool scales, bool tangents, From place, From mesh, class D>
DERMIS_INLINE void skinUnit(D d, const Skinning& by, const Blended<D>& blended, std::size_t unit,
                            Vec<D>* to) {
  const bool isModerate = by.palette.isModerate, normals = by.normals;
  const Reader<place, D> read{d, by.from, unit};
  if constexpr (method == Method::linear) {
    return moveUnit<tangents>(d, matrixOf<D>(blended.rows), isModerate, read, normals, to);
  }
  Part<D> part{};
  if constexpr (scales)
    part = scaleDirections<tangents>(d, blended.part, read, isModerate, normals, to);
  const auto scaled = [&](const Vec3<D>& point)
                          HWY_ATTR { return scales ? throughPart(part, point) : point; };
  const Vec4<D> real = quadOf<D>(blended.quaternion);
  const Vec<D> factor = turningFactor(d, real);
  const auto move = [&](const Vec3<D>& point) HWY_ATTR {
    return movePoint(real, quadOf<D>(blended.quaternion + 4), factor, point);
  };

  // The second phase: rotate and translate.
  if constexpr (method == Method::dualQuaternion || method == Method::blended) {
    setThree(to, move(scaled(read.position())));
  } else {
    const Vec3<D> center = loadThree<mesh>(d, by.from.centers, 3, unit);
    const Vec3<D> straight = throughMatrix(matrixOf<D>(blended.rows), center);
    if constexpr (method == Method::centerOfRotation) {
      const Vec3<D> point = scaled(sub3(read.position(), center));
      setThree(to, add3(turnDirection(real, factor, point), straight));
    } else {
      const Vec3<D> pull = sub3(straight, move(scaled(center)));
      const Vec<D> share = loadComponent<mesh>(d, by.from.shares, 1, 0, unit);
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
  if constexpr (method != Method::blended) return;

  // Between the linearly blended vertex and this one, whose handedness stays.
  Vec<D> straight[12];
  moveUnit<tangents>(d, matrixOf<D>(blended.rows), isModerate, read, normals, straight);
  const Vec<D> share = loadComponent<mesh>(d, by.from.shares, 1, 0, unit);
  const Vec<D> one = hn::Set(d, 1.0f), rest = hn::Sub(one, share);
  const auto isTurned = hn::Ge(share, one);
  const auto mix = [&](std::size_t slot, bool isDirection) HWY_ATTR {
    const Vec3<D> turned = threeOf<D>(to + slot);
    const Vec3<D> mixed = add3(scale3(threeOf<D>(straight + slot), rest), scale3(turned, share));
    setThree(to + slot, choose3(isTurned, turned, isDirection ? unitOr(d, mixed, turned) : mixed));
  };
  mix(0, false);
  if (normals) mix(4, true);
  if constexpr (tangents) mix(8, true);
}

/// Blends what a unit needs.
template <bool isLone, std::size_t influences, Method method, bool scales, class D>
DERMIS_INLINE void blendUnit(D d, const Palette& palette, const Slots& slots, std::size_t unit,
                             Vec<D>* quaternion, Vec<D>* part, Vec<D>* rows) {
  if constexpr (needsRows(method))
    sumUnit<isLone, influences, 12, false>(d, palette.rows, nullptr, slots.joints, slots, unit,
                                           rows);
  if constexpr (scales) {
    sumUnit<isLone, influences, 6, true>(d, palette.partPairs, palette.parts, slots.pairs, slots,
                                         unit, part);
  }
  constexpr std::size_t numbers = method == Method::centerOfRotation ? 4 : 8;
  if constexpr (method != Method::linear) {
    sumUnit<isLone, influences, numbers, false>(d, palette.pairs, nullptr, slots.pairs, slots, unit,
                                                quaternion);
  }
}

/// Where whole blocks are stored as soon as they are skinned: record i of instance k at `to[i][k]`.
template <class D>
struct Direct {
  const Records& records;
  float* to[streamCount][hn::MaxLanes(D())];
  Kept<D> kept;
};

/// Blends what units of a lone instance need, into the tile: `count` from `first` on. A loop of its
/// own: one for all would be too long for a processor to begin a unit before the last one ends.
template <Method method, bool scales, class D>
HWY_NOINLINE HWY_ATTR void blendLone(D d, const Palette& palette, const Slots& slots,
                                     std::size_t first, std::size_t count, Tile<D>& tile) {
  const auto blend = [&](auto influences) HWY_ATTR {
    for (std::size_t i = 0; i < count; ++i) {
      blendUnit<true, influences(), method, scales>(
          d, palette, slots, first + i, tile.quaternions[i], tile.parts[i], tile.rows[i]);
    }
  };
#ifndef DERMIS_CPU_SMALL
  if (slots.influences == 4) return blend(std::integral_constant<std::size_t, 4>());
#endif
  blend(std::integral_constant<std::size_t, 0>());
}

/// Skins units into the tile. If they are stored directly, they are those of whole blocks.
template <bool isLone, Method method, bool scales, bool tangents, From place, class D>
HWY_NOINLINE HWY_ATTR void skinUnits(D d, const Skinning& given, std::size_t units,
                                     Direct<D>* direct, Tile<D>& tile) {
  // Copies, which stores into the tile cannot change.
  const Palette palette = given.palette;
  const Skinning by{palette, given.slots, given.from, given.normals};
  constexpr std::size_t step = isLone ? Tile<D>::mostLone : blockVertices;
  for (std::size_t first = 0; first < units; first += step) {
    const std::size_t count = isLone ? std::min(step, units - first) : step;
    Vec<D>(*const own)[slotCount] = tile.slots + (direct == nullptr ? first : 0);
    if constexpr (isLone) {
      blendLone<method, scales>(d, palette, by.slots, first, count, tile);
      for (std::size_t i = 0; i < count; ++i) {
        skinUnit<method, scales, tangents, place, From::lone>(
            d, by, {tile.quaternions[i], tile.parts[i], tile.rows[i]}, first + i, own[i]);
      }
    } else {
      for (std::size_t i = 0; i < count; ++i) {
        Vec<D> quaternion[8], part[8], rows[12];
        blendUnit<false, 0, method, scales>(d, palette, by.slots, first + i, quaternion, part,
                                            rows);
        skinUnit<method, scales, tangents, place, From::company>(d, by, {quaternion, part, rows},
                                                                 first + i, own[i]);
      }
    }
    if (direct == nullptr || (place == From::tile && !isLone)) continue;  // or morphed
    for (std::size_t i = 0; direct->records.keepsPositions && i < count; ++i) {
      const std::size_t vertex = (first + i) * unitVertices<isLone, D>;
      keepUnit(d, direct->kept, vertex * direct->kept.stride, own[i]);
    }
    for (std::size_t number = 0; number < direct->records.count; ++number) {
      const Record& record = direct->records.all[number];
      if constexpr (isLone) {
        storeDenseUnits(d, record, direct->to[number][0], own, count);
        direct->to[number][0] += count * hn::MaxLanes(d) * record.slots;
      } else {
        storeBlock(d, record, direct->to[number], own[0]);
        for (float*& next : direct->to[number]) next += record.slots * blockVertices;
      }
    }
  }
}

}  // namespace dermis::cpu::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();
