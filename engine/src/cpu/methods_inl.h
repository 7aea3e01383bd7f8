// The second stage: skins the vertices of a tile by a method.
#pragma once

#include "cpu/bind_inl.h"
#include "cpu/tile_inl.h"
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

}  // namespace dermis::cpu::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();
