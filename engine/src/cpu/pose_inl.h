// Converts poses to what vertices read: unit dual quaternions of joints and of pairs, and
// scale/shear parts. The formulas are those of the palette kernel (shaders/palette.comp).
#pragma once

#include <algorithm>
#include <cmath>
#include <cstring>
#include <limits>
#include <span>

#include "cpu/mesh_data.h"
#include "cpu/polar.h"
#include "cpu/simd_inl.h"
#include "dermis/mesh.h"

HWY_BEFORE_NAMESPACE();
namespace dermis::cpu::HWY_NAMESPACE {

/// One joint matrix per lane.
template <class D>
struct Joints {
  Vec3<D> r0, r1, r2;  ///< rows of the 3×3 parts
  Vec3<D> translation;
};

template <class D>
struct DualQuaternions {
  Vec4<D> real, dual;
};

/// det > 0, and the absolute values of each row of CᵀC − 1 sum to at most 8e-6.
template <class D>
DERMIS_INLINE auto areRigid(D d, const Joints<D>& j) {
  const Vec3<D> c0{j.r0.x, j.r1.x, j.r2.x};
  const Vec3<D> c1{j.r0.y, j.r1.y, j.r2.y};
  const Vec3<D> c2{j.r0.z, j.r1.z, j.r2.z};
  const Vec<D> one = hn::Set(d, 1.0f);
  const Vec<D> xy = hn::Abs(dot3(c0, c1));
  const Vec<D> xz = hn::Abs(dot3(c0, c2));
  const Vec<D> yz = hn::Abs(dot3(c1, c2));
  const Vec<D> x = hn::Add(hn::Abs(hn::Sub(dot3(c0, c0), one)), hn::Add(xy, xz));
  const Vec<D> y = hn::Add(hn::Abs(hn::Sub(dot3(c1, c1), one)), hn::Add(xy, yz));
  const Vec<D> z = hn::Add(hn::Abs(hn::Sub(dot3(c2, c2), one)), hn::Add(xz, yz));
  const Vec<D> most = hn::Set(d, 8e-6f);
  const auto near = hn::And(hn::Le(x, most), hn::And(hn::Le(y, most), hn::Le(z, most)));
  return hn::And(hn::Gt(dot3(j.r0, cross3(j.r1, j.r2)), hn::Zero(d)), near);
}

/// The unit quaternion of a matrix that is nearly a rotation: a first guess from the component of
/// the quaternion with the largest square (Shepperd 1978), then one step of the power method.
template <class D>
DERMIS_INLINE Vec4<D> quaternionOf(D d, const Joints<D>& j) {
  const Vec<D> one = hn::Set(d, 1.0f);
  const Vec<D> more = hn::Add(one, j.r0.x), less = hn::Sub(one, j.r0.x);
  const Vec<D> x = hn::Sub(hn::Sub(more, j.r1.y), j.r2.z);
  const Vec<D> y = hn::Sub(hn::Add(less, j.r1.y), j.r2.z);
  const Vec<D> z = hn::Add(hn::Sub(less, j.r1.y), j.r2.z);
  const Vec<D> w = hn::Add(hn::Add(more, j.r1.y), j.r2.z);
  const Vec3<D> sums{hn::Add(j.r1.z, j.r2.y), hn::Add(j.r0.z, j.r2.x), hn::Add(j.r0.y, j.r1.x)};
  const Vec3<D> diff{hn::Sub(j.r2.y, j.r1.z), hn::Sub(j.r0.z, j.r2.x), hn::Sub(j.r1.x, j.r0.y)};
  // Columns: of x (x, sz, sy, dx), of y (sz, y, sx, dy), of z (sy, sx, z, dz), of w (dx, dy, dz,
  // w).
  const auto yz = hn::Ge(y, z);
  Vec4<D> guess{hn::IfThenElse(yz, sums.z, sums.y), hn::IfThenElse(yz, y, sums.x),
                hn::IfThenElse(yz, sums.x, z), hn::IfThenElse(yz, diff.y, diff.z)};
  const auto isX = hn::And(hn::Ge(x, y), hn::Ge(x, z));
  guess = {hn::IfThenElse(isX, x, guess.x), hn::IfThenElse(isX, sums.z, guess.y),
           hn::IfThenElse(isX, sums.y, guess.z), hn::IfThenElse(isX, diff.x, guess.w)};
  const auto isW = hn::And(hn::Ge(w, x), hn::And(hn::Ge(w, y), hn::Ge(w, z)));
  guess = {hn::IfThenElse(isW, diff.x, guess.x), hn::IfThenElse(isW, diff.y, guess.y),
           hn::IfThenElse(isW, diff.z, guess.z), hn::IfThenElse(isW, w, guess.w)};
  const auto column = [&](Vec<D> a, Vec<D> b, Vec<D> c, Vec<D> e) HWY_ATTR {
    return hn::Add(hn::Add(hn::Add(hn::Mul(guess.x, a), hn::Mul(guess.y, b)), hn::Mul(guess.z, c)),
                   hn::Mul(guess.w, e));
  };
  const Vec4<D> q{column(x, sums.z, sums.y, diff.x), column(sums.z, y, sums.x, diff.y),
                  column(sums.y, sums.x, z, diff.z), column(diff.x, diff.y, diff.z, w)};
  const Vec<D> square = hn::Add(dot3(q.x, q.y, q.z, q.x, q.y, q.z), hn::Mul(q.w, q.w));
  const Vec<D> inverse = hn::Div(one, hn::Sqrt(square));
  return {hn::Mul(q.x, inverse), hn::Mul(q.y, inverse), hn::Mul(q.z, inverse),
          hn::Mul(q.w, inverse)};
}

/// The dual part of rigid transforms: ½ (t, 0) q.
template <class D>
DERMIS_INLINE Vec4<D> dualPart(D d, const Vec4<D>& q, const Vec3<D>& t) {
  const Vec3<D> axis{q.x, q.y, q.z};
  const Vec<D> half = hn::Set(d, 0.5f);
  const Vec3<D> vector = scale3(add3(scale3(t, q.w), cross3(t, axis)), half);
  return {vector.x, vector.y, vector.z, hn::Mul(hn::Set(d, -0.5f), dot3(t, axis))};
}

/// Dual quaternions of joints or pairs. Real parts are `stride` floats apart; each dual part is
/// `dual` floats after its real part. Scale/shear parts have the same layout: first the diagonal
/// and one mixed entry, then the two other entries.
template <class T>
struct DualQuaternionArray {
  T* first;
  std::size_t stride = 8;
  std::size_t dual = 4;
};

/// The joints of a section, and the destination of their converted poses.
struct PoseTask {
  std::span<const std::uint32_t> joints;
  std::span<const JointMatrix> pose;
  DualQuaternionArray<float> dualQuaternions;
  DualQuaternionArray<float> scaleShears;  ///< same layout, two times four floats per joint
};

/// The matrices of `count` joints from `first` on, 12 floats each: in place if they are contiguous,
/// otherwise in `copies`.
DERMIS_INLINE const float* matricesOf(const PoseTask& task, std::size_t first, std::size_t count,
                                      float* copies) {
  const std::uint32_t begin = task.joints[first];
  bool isRow = first + count <= task.joints.size();
  for (std::size_t i = 1; isRow && i < count; ++i) isRow = task.joints[first + i] == begin + i;
  if (isRow && begin != stillJoint && begin + count <= task.pose.size())
    return numbersOf(&task.pose[begin]);
  for (std::size_t i = 0; i < count; ++i) {
    const std::uint32_t joint =
        first + i < task.joints.size() ? task.joints[first + i] : stillJoint;
    const JointMatrix still;
    std::memcpy(copies + i * 12, joint == stillJoint ? still.m : task.pose[joint].m,
                sizeof(JointMatrix));
  }
  return copies;
}

/// Decomposes a joint that is not rigid into its rotation and its scale/shear part.
inline void convertOther(const float* matrix, float rotation[4], ScaleShear& part) {
  float rows[3][4];
  std::memcpy(rows, matrix, sizeof(rows));
  bool isFinite = true;
  for (const auto& row : rows) {
    for (const float value : row) isFinite = isFinite && std::isfinite(value);
  }
  if (isFinite) {
    polarParts(rows, rotation, part);
  } else {
    std::fill(rotation, rotation + 4, std::numeric_limits<float>::quiet_NaN());
  }
}

/// Whether normals can use the cofactors of blended matrices without scaling: no entry is larger
/// than 2^40, and the largest entry of each joint is at least 2^-10. A determinant, a sum of
/// products of three entries, is then at most about 2^120 and at most 2^30 times smaller than if
/// each matrix were scaled to entries of about 1, as the kernels do.
inline bool areModerate(std::span<const std::uint32_t> joints, std::span<const JointMatrix> pose) {
  constexpr float most = 0x1p40f, least = 0x1p-10f;
  bool are = true;
  for (const std::uint32_t joint : joints) {
    if (joint == stillJoint) continue;
    float largest = 0;
    for (const auto& row : pose[joint].m) {
      for (std::size_t column = 0; column < 3; ++column)
        largest = std::max(largest, std::abs(row[column]));
    }
    are = are && largest <= most && largest >= least;
  }
  return are;
}

/// Converts all joints. Returns whether any of them scales or shears.
inline HWY_ATTR bool convertJoints(const PoseTask& task) {
  const Wide d;
  constexpr std::size_t lanes = hn::MaxLanes(d);
  HWY_ALIGN float copies[lanes * 12], isRigid[lanes], rotations[lanes * 4];
  bool scales = false;
  for (std::size_t first = 0; first < task.joints.size(); first += lanes) {
    const float* const matrices = matricesOf(task, first, lanes, copies);
    const Vec4<Wide> row0 = loadRows(d, matrices, 12);
    const Vec4<Wide> row1 = loadRows(d, matrices + 4, 12);
    const Vec4<Wide> row2 = loadRows(d, matrices + 8, 12);
    const Joints<Wide> joints{{row0.x, row0.y, row0.z},
                              {row1.x, row1.y, row1.z},
                              {row2.x, row2.y, row2.z},
                              {row0.w, row1.w, row2.w}};
    const auto rigid = areRigid(d, joints);
    Vec4<Wide> real = quaternionOf(d, joints);
    ScaleShear parts[lanes];
    if (!hn::AllTrue(d, rigid)) {
      storeRows(d, real, rotations, 4);
      hn::Store(hn::IfThenElseZero(rigid, hn::Set(d, 1.0f)), d, isRigid);
      for (std::size_t lane = 0; lane < lanes; ++lane) {
        if (isRigid[lane] == 0)
          convertOther(matrices + lane * 12, rotations + lane * 4, parts[lane]);
      }
      real = loadRows(d, rotations, 4);
      scales = true;
    }
    const DualQuaternionArray<float>& to = task.dualQuaternions;
    storeRows(d, real, to.first + first * to.stride, to.stride);
    storeRows(d, dualPart(d, real, joints.translation), to.first + first * to.stride + to.dual,
              to.stride);
    for (std::size_t lane = 0; lane < lanes; ++lane) {
      const DualQuaternionArray<float>& shears = task.scaleShears;
      float* const part = shears.first + (first + lane) * shears.stride;
      const ScaleShear& own = parts[lane];
      const float low[4] = {own.diagonal[0], own.diagonal[1], own.diagonal[2], own.mixed[0]};
      const float high[4] = {own.mixed[1], own.mixed[2], 0, 0};
      std::memcpy(part, low, sizeof(low));
      std::memcpy(part + shears.dual, high, sizeof(high));
    }
  }
  return scales;
}

/// Writes a dual quaternion for each pair, in the hemisphere of its pivot: eight floats each.
inline HWY_ATTR void convertPairs(std::span<const Pair> pairs,
                                  const DualQuaternionArray<const float>& joints, float* to) {
  const Four d;
  const hn::Repartition<double, Four> dd;
  const auto [first, stride, apart] = joints;  // which what is stored could change
  for (const Pair& pair : pairs) {
    const float* const joint = first + pair.joint * stride;
    const Vec<Four> pivot = hn::LoadU(d, first + pair.pivot * stride);
    const Vec<Four> real = hn::LoadU(d, joint);
    const Vec<Four> dual = hn::LoadU(d, joint + apart);
    Vec<Four> sum = hn::Mul(pivot, real);
    sum = hn::Add(sum, hn::Reverse2(d, sum));
    sum = hn::Add(sum, hn::BitCast(d, hn::Reverse2(dd, hn::BitCast(dd, sum))));
    const auto flip = hn::And(sum, hn::SignBit(d));
    hn::Store(hn::Xor(real, flip), d, to);
    hn::Store(hn::Xor(dual, flip), d, to + 4);
    to += 8;
  }
}

/// Writes a scale/shear part for each pair: eight floats each. A pivot with itself gets what it
/// has, and another joint the difference to it.
inline HWY_ATTR void subtractPivots(std::span<const Pair> pairs,
                                    const DualQuaternionArray<const float>& parts, float* to) {
  const Four d;
  for (const Pair& pair : pairs) {
    const float* const joint = parts.first + std::size_t{pair.joint} * parts.stride;
    const float* const pivot = parts.first + std::size_t{pair.pivot} * parts.stride;
    for (const std::size_t quad : {std::size_t{0}, parts.dual}) {
      const Vec<Four> own = hn::LoadU(d, joint + quad);
      const bool isPivot = pair.pivot == pair.joint;
      hn::Store(isPivot ? own : hn::Sub(own, hn::LoadU(d, pivot + quad)), d, to);
      to += 4;
    }
  }
}

}  // namespace dermis::cpu::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();
