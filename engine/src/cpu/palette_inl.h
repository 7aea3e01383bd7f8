// The poses of the instances that are skinned together, in the form that the vertices of a section
// read.
#pragma once

#include <cstring>
#include <span>
#include <vector>

#include "cpu/pose_inl.h"
#include "cpu/task.h"
#include "cpu/vertex_inl.h"

HWY_BEFORE_NAMESPACE();
namespace dermis::cpu::HWY_NAMESPACE {

/// Maximum number of instances skinned at a time: a *company*, with one of them in each lane. If
/// there are too few, the vertices of a *lone* instance are in the lanes.
inline constexpr std::size_t mostInstances = HWY_MAX_BYTES >= 64 ? 16 : HWY_MAX_BYTES >= 32 ? 8 : 4;

inline float* floatsOf(std::vector<CacheLine>& memory, std::size_t count) {
  const std::size_t lines = (count + std::size(CacheLine().v) - 1) / std::size(CacheLine().v);
  if (memory.size() < lines) {
    memory.reserve(lines);  // exact size, no geometric growth
    memory.resize(lines);
  }
  return numbersOf(memory.data());
}

constexpr bool needsRows(Method method) {
  return method == Method::linear || method == Method::blended || needsCentersOfRotation(method);
}

inline std::span<const std::uint32_t> jointsOf(const MeshData& mesh, const Section& section) {
  return std::span(mesh.joints).subspan(section.firstJoint, section.jointCount());
}
inline std::span<const Pair> pairsOf(const MeshData& mesh, const Section& section) {
  return std::span(mesh.pairs).subspan(section.firstPair, section.pairCount());
}

inline const JointMatrix stillMatrix;

/// Instances that are skinned together, and their converted poses.
struct Group {
  std::size_t count = 0;
  const TaskInstance* instances[mostInstances] = {};
  bool scales = false;
  /// For each joint, the real parts of all instances; the dual parts follow. The same for its
  /// scale/shear parts.
  DualQuaternionArray<float> joints{nullptr, mostInstances * 4};
  DualQuaternionArray<float> parts = joints;

  void assign(Scratch& scratch, std::size_t jointCount) {
    // Joints are converted in whole vectors, so the last one may write beyond the last joint.
    joints.dual = parts.dual = (jointCount + blockVertices) * joints.stride;
    joints.first = floatsOf(scratch.dualQuaternions, joints.dual * 2);
    parts.first = floatsOf(scratch.scaleShears, joints.dual * 2);
  }
  DualQuaternionArray<float> jointsOf(std::size_t instance) const {
    return {joints.first + instance * 4, joints.stride, joints.dual};
  }
  DualQuaternionArray<float> partsOf(std::size_t instance) const {
    return {parts.first + instance * 4, parts.stride, parts.dual};
  }
};

template <class T>
inline DualQuaternionArray<const T> readOnly(const DualQuaternionArray<T>& array) {
  return {array.first, array.stride, array.dual};
}

/// Entries of eight numbers, those of `rows` of sixteen: floats of a lone instance, or vectors of a
/// company, with an instance in each lane. Influences have the numbers of entries times eight.
struct Palette {
  const float* pairs = nullptr;  ///< dual quaternions: real and dual part
  const float* parts = nullptr;  ///< scale/shear parts of pairs, relative to the pivot's
  const float* rows = nullptr;   ///< of the matrices of joints, and four unused numbers
  bool scales = false;
  bool isModerate = false;  ///< result of `areModerate`, for directions
};

/// R of a unit quaternion, with a translation.
template <class D>
DERMIS_INLINE Matrix<D> rotationRows(D d, const Vec4<D>& q, const Vec3<D>& t) {
  const Vec<D> one = hn::Set(d, 1.0f), two = hn::Set(d, 2.0f);
  const auto diagonal = [&](Vec<D> a, Vec<D> b) HWY_ATTR {
    return hn::Sub(one, hn::Mul(two, hn::Add(hn::Mul(a, a), hn::Mul(b, b))));
  };
  const auto sum = [&](Vec<D> a, Vec<D> b, Vec<D> c)
                       HWY_ATTR { return hn::Mul(two, hn::Add(hn::Mul(a, b), hn::Mul(q.w, c))); };
  const auto difference = [&](Vec<D> a, Vec<D> b, Vec<D> c) HWY_ATTR {
    return hn::Mul(two, hn::Sub(hn::Mul(a, b), hn::Mul(q.w, c)));
  };
  return {{diagonal(q.y, q.z), difference(q.x, q.y, q.z), sum(q.x, q.z, q.y), t.x},
          {sum(q.x, q.y, q.z), diagonal(q.x, q.z), difference(q.y, q.z, q.x), t.y},
          {difference(q.x, q.z, q.y), sum(q.y, q.z, q.x), diagonal(q.x, q.y), t.z}};
}

/// A row of R S: `row` of R, with a scale/shear part by its two quads.
template <class D>
DERMIS_INLINE Vec4<D> scaleRow(const Vec4<D>& row, const Vec4<D>& low, const Vec4<D>& high) {
  return {dot3(low.x, low.w, high.x, row.x, row.y, row.z),
          dot3(low.w, low.y, high.y, row.x, row.y, row.z),
          dot3(high.x, high.y, low.z, row.x, row.y, row.z), row.w};
}

/// The palette of the instance at `lone` of a group.
inline HWY_ATTR Palette makePalette(const MeshData& mesh, const Section& section, Method method,
                                    const Group& group, std::size_t lone, Scratch& scratch) {
  const std::span<const std::uint32_t> joints = jointsOf(mesh, section);
  const std::span<const Pair> pairs = pairsOf(mesh, section);
  Palette palette;
  palette.scales = group.scales;
  if (method != Method::linear) {
    float* const to = floatsOf(scratch.pairs, pairs.size() * 8);
    convertPairs(pairs, readOnly(group.jointsOf(lone)), to);
    palette.pairs = to;
  }
  const DualQuaternionArray<float> own = group.jointsOf(lone), parts = group.partsOf(lone);
  if (palette.scales) {
    float* const to = floatsOf(scratch.scalePairs, pairs.size() * 8);
    subtractPivots(pairs, readOnly(parts), to);
    palette.parts = to;
  }
  if (!needsRows(method)) return palette;
  float* const rows = floatsOf(scratch.rows, joints.size() * 16);
  for (std::size_t joint = 0; joint < joints.size(); ++joint) {
    const JointMatrix& matrix =
        joints[joint] == stillJoint ? stillMatrix : group.instances[lone]->pose[joints[joint]];
    float* const to = rows + joint * 16;
    if (method == Method::linear) {
      std::memcpy(to, matrix.m, sizeof(matrix.m));
      continue;
    }
    using One = hn::FixedTag<float, 1>;
    const One one;
    const auto quad = [&](const float* v) HWY_ATTR {
      return Vec4<One>{hn::Set(one, v[0]), hn::Set(one, v[1]), hn::Set(one, v[2]),
                       hn::Set(one, v[3])};
    };
    const Matrix<One> turned = rotationRows(
        one, quad(own.first + joint * own.stride),
        {hn::Set(one, matrix.m[0][3]), hn::Set(one, matrix.m[1][3]), hn::Set(one, matrix.m[2][3])});
    const float* const low = parts.first + joint * parts.stride;
    float* next = to;
    for (Vec4<One> row : {turned.r0, turned.r1, turned.r2}) {
      if (palette.scales) row = scaleRow(row, quad(low), quad(low + parts.dual));
      for (const Vec<One> value : {row.x, row.y, row.z, row.w}) *next++ = hn::GetLane(value);
    }
  }
  palette.rows = rows;
  return palette;
}

// -- The palette of a company.

/// Four vectors side by side.
template <class D>
DERMIS_INLINE Vec4<D> loadQuad(D d, const float* from) {
  constexpr std::size_t lanes = hn::MaxLanes(d);
  return {hn::Load(d, from), hn::Load(d, from + lanes), hn::Load(d, from + 2 * lanes),
          hn::Load(d, from + 3 * lanes)};
}
template <class D>
DERMIS_INLINE void setQuad(D d, const Vec4<D>& quad, float* to) {
  constexpr std::size_t lanes = hn::MaxLanes(d);
  hn::Store(quad.x, d, to);
  hn::Store(quad.y, d, to + lanes);
  hn::Store(quad.z, d, to + 2 * lanes);
  hn::Store(quad.w, d, to + 3 * lanes);
}

/// Instances of a group from `first` on, one for each lane. Lanes without an instance repeat the
/// last one.
template <class D>
struct Members {
  static constexpr std::size_t most = hn::MaxLanes(D());

  const TaskInstance* instances[most];
  std::size_t count;  ///< without repetitions
  const float *joints[most], *parts[most], *poses[most];

  Members(const Group& group, std::size_t first, std::size_t number) : count(number) {
    for (std::size_t lane = 0; lane < most; ++lane) {
      const std::size_t member = first + std::min(lane, number - 1);
      instances[lane] = group.instances[member];
      joints[lane] = group.jointsOf(member).first;
      parts[lane] = group.partsOf(member).first;
      poses[lane] = numbersOf(instances[lane]->pose.data());
    }
  }
};

/// The entries of all joints.
template <class D>
inline HWY_ATTR void spreadJoints(D d, const float* const* from,
                                  const DualQuaternionArray<float>& array, std::size_t count,
                                  float* to) {
  constexpr std::size_t quad = 4 * hn::MaxLanes(d);
  for (std::size_t joint = 0; joint < count; ++joint) {
    setQuad(d, gatherRows(d, from, joint * array.stride), to);
    setQuad(d, gatherRows(d, from, joint * array.stride + array.dual), to + quad);
    to += 2 * quad;
  }
}

template <class D>
inline HWY_ATTR Palette makePalette(D d, const MeshData& mesh, const Section& section,
                                    Method method, const Group& group, const Members<D>& members,
                                    Scratch& scratch) {
  constexpr std::size_t quad = 4 * hn::MaxLanes(d), entry = 2 * quad;
  const std::span<const std::uint32_t> joints = jointsOf(mesh, section);
  const std::span<const Pair> pairs = pairsOf(mesh, section);
  Palette palette;
  palette.scales = group.scales;
  float* own = nullptr;
  if (method != Method::linear) {
    own = floatsOf(scratch.companyJoints, joints.size() * entry);
    spreadJoints(d, members.joints, group.joints, joints.size(), own);
    float* to = floatsOf(scratch.pairs, pairs.size() * entry);
    palette.pairs = to;
    for (const Pair& pair : pairs) {
      const Vec4<D> pivot = loadQuad(d, own + pair.pivot * entry);
      const float* const joint = own + pair.joint * entry;
      const Vec4<D> real = loadQuad(d, joint), dual = loadQuad(d, joint + quad);
      const Vec<D> product = hn::Add(hn::Add(hn::Mul(pivot.x, real.x), hn::Mul(pivot.y, real.y)),
                                     hn::Add(hn::Mul(pivot.z, real.z), hn::Mul(pivot.w, real.w)));
      const Vec<D> flip = hn::And(product, hn::SignBit(d));
      const auto flipped = [&](const Vec4<D>& q) HWY_ATTR {
        return Vec4<D>{hn::Xor(q.x, flip), hn::Xor(q.y, flip), hn::Xor(q.z, flip),
                       hn::Xor(q.w, flip)};
      };
      setQuad(d, flipped(real), to);
      setQuad(d, flipped(dual), to + quad);
      to += entry;
    }
  }
  float* parts = nullptr;
  if (palette.scales) {
    float* to = floatsOf(scratch.scalePairs, (pairs.size() + joints.size()) * entry);
    parts = to + pairs.size() * entry;
    palette.parts = to;
    spreadJoints(d, members.parts, group.parts, joints.size(), parts);
    for (const Pair& pair : pairs) {
      const float *const joint = parts + pair.joint * entry, *const pivot =
                                                                 parts + pair.pivot * entry;
      const bool isPivot = pair.joint == pair.pivot;
      for (std::size_t i = 0; i < entry; i += hn::MaxLanes(d)) {
        const Vec<D> part = hn::Load(d, joint + i);
        hn::Store(isPivot ? part : hn::Sub(part, hn::Load(d, pivot + i)), d, to + i);
      }
      to += entry;
    }
  }
  if (!needsRows(method)) return palette;
  float* const rows = floatsOf(scratch.rows, joints.size() * 2 * entry);
  palette.rows = rows;
  const float* still[Members<D>::most];
  std::fill_n(still, Members<D>::most, numbersOf(&stillMatrix));
  for (std::size_t joint = 0; joint < joints.size(); ++joint) {
    const bool isStill = joints[joint] == stillJoint;
    const float* const* const from = isStill ? still : members.poses;
    const std::size_t offset = isStill ? 0 : joints[joint] * std::size_t{12};
    Matrix<D> matrix{gatherRows(d, from, offset), gatherRows(d, from, offset + 4),
                     gatherRows(d, from, offset + 8)};
    if (method != Method::linear) {
      matrix = rotationRows(d, loadQuad(d, own + joint * entry),
                            {matrix.r0.w, matrix.r1.w, matrix.r2.w});
      if (palette.scales) {
        const Vec4<D> low = loadQuad(d, parts + joint * entry),
                      high = loadQuad(d, parts + joint * entry + quad);
        matrix = {scaleRow(matrix.r0, low, high), scaleRow(matrix.r1, low, high),
                  scaleRow(matrix.r2, low, high)};
      }
    }
    float* const to = rows + joint * 2 * entry;
    setQuad(d, matrix.r0, to);
    setQuad(d, matrix.r1, to + quad);
    setQuad(d, matrix.r2, to + 2 * quad);
  }
  return palette;
}

}  // namespace dermis::cpu::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();
