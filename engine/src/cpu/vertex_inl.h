// How the vertex in each lane is skinned: the formulas of the methods.
#pragma once

#include "cpu/mesh_data.h"
#include "cpu/simd_inl.h"

HWY_BEFORE_NAMESPACE();
namespace dermis::cpu::HWY_NAMESPACE {

/// Rotates v by q, where `factor` is 2 / |q|²: v + factor r × (r × v + w v).
template <class D>
DERMIS_INLINE Vec3<D> turnDirection(const Vec4<D>& q, Vec<D> factor, const Vec3<D>& v) {
  const Vec3<D> axis{q.x, q.y, q.z};
  const Vec3<D> inner = add3(cross3(axis, v), scale3(v, q.w));
  return add3(v, scale3(cross3(axis, inner), factor));
}

/// Rotates and translates a point: p + factor (r × (r × p + w p + d) + w d − dw r).
template <class D>
DERMIS_INLINE Vec3<D> movePoint(const Vec4<D>& q, const Vec4<D>& dual, Vec<D> factor,
                                const Vec3<D>& p) {
  const Vec3<D> axis{q.x, q.y, q.z}, shift{dual.x, dual.y, dual.z};
  const Vec3<D> inner = add3(add3(cross3(axis, p), scale3(p, q.w)), shift);
  const Vec3<D> outer = sub3(add3(cross3(axis, inner), scale3(shift, q.w)), scale3(axis, dual.w));
  return add3(p, scale3(outer, factor));
}

template <class D>
DERMIS_INLINE Vec<D> turningFactor(D d, const Vec4<D>& q) {
  const Vec<D> square = hn::Add(hn::Add(hn::Mul(q.x, q.x), hn::Mul(q.y, q.y)),
                                hn::Add(hn::Mul(q.z, q.z), hn::Mul(q.w, q.w)));
  return hn::Div(hn::Set(d, 2.0f), square);
}

/// Rows of a 3×4 matrix.
template <class D>
struct Matrix {
  Vec4<D> r0, r1, r2;
};

template <class D>
DERMIS_INLINE Vec3<D> throughMatrix(const Matrix<D>& m, const Vec3<D>& p) {
  return {hn::Add(dot3(m.r0.x, m.r0.y, m.r0.z, p.x, p.y, p.z), m.r0.w),
          hn::Add(dot3(m.r1.x, m.r1.y, m.r1.z, p.x, p.y, p.z), m.r1.w),
          hn::Add(dot3(m.r2.x, m.r2.y, m.r2.z, p.x, p.y, p.z), m.r2.w)};
}

/// The 3×3 matrix that transforms directions, by its rows, and the sign of its determinant. Unless
/// `isModerate` (see `directionMap`), it is scaled so that no product of two or three entries
/// overflows, and the square of the largest entry does not underflow.
template <class D>
struct DirectionMap {
  Vec3<D> r0, r1, r2;
  Vec<D> side;
};

/// `isModerate`: no entry is so large or small that the matrix must be scaled.
template <class D>
DERMIS_INLINE DirectionMap<D> directionMap(D d, const Vec3<D>& r0, const Vec3<D>& r1,
                                           const Vec3<D>& r2, bool isModerate) {
  DirectionMap<D> map;
  if (isModerate) {
    // Copies of whole structures would go through memory, half a vector at a time.
    map.r0 = {r0.x, r0.y, r0.z};
    map.r1 = {r1.x, r1.y, r1.z};
    map.r2 = {r2.x, r2.y, r2.z};
  } else {
    const Vec<D> scale = powerScale(d, hn::Max(largest3(r0), hn::Max(largest3(r1), largest3(r2))));
    map.r0 = scale3(r0, scale);
    map.r1 = scale3(r1, scale);
    map.r2 = scale3(r2, scale);
  }
  map.side = sideOf(d, dot3(map.r0, cross3(map.r1, map.r2)));
  return map;
}
/// Multiplies by the cofactor matrix. Times the sign of the determinant, it has the direction of
/// the inverse transpose, also where a matrix mirrors.
template <class D>
DERMIS_INLINE Vec3<D> mapNormal(const DirectionMap<D>& map, const Vec3<D>& n) {
  return {dot3(cross3(map.r1, map.r2), n), dot3(cross3(map.r2, map.r0), n),
          dot3(cross3(map.r0, map.r1), n)};
}
template <class D>
DERMIS_INLINE Vec3<D> mapTangent(const DirectionMap<D>& map, const Vec3<D>& t) {
  return {dot3(map.r0, t), dot3(map.r1, t), dot3(map.r2, t)};
}

template <class D>
DERMIS_INLINE DirectionMap<D> directionMap(D d, const Matrix<D>& m, bool isModerate) {
  return directionMap(d, Vec3<D>{m.r0.x, m.r0.y, m.r0.z}, Vec3<D>{m.r1.x, m.r1.y, m.r1.z},
                      Vec3<D>{m.r2.x, m.r2.y, m.r2.z}, isModerate);
}

/// A blended scale/shear part.
template <class D>
struct Part {
  Vec3<D> r0, r1, r2;
};

template <class D>
DERMIS_INLINE Part<D> partOf(Vec<D> xx, Vec<D> yy, Vec<D> zz, Vec<D> xy, Vec<D> xz, Vec<D> yz) {
  return {{xx, xy, xz}, {xy, yy, yz}, {xz, yz, zz}};
}

template <class D>
DERMIS_INLINE Vec3<D> throughPart(const Part<D>& part, const Vec3<D>& p) {
  return {dot3(part.r0, p), dot3(part.r1, p), dot3(part.r2, p)};
}

}  // namespace dermis::cpu::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();
