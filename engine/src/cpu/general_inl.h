// The general path: every method, format and option, one instance at a time. plain_inl.h has a
// faster path for the common case, with the same operations in the same order.
#pragma once

#include <array>
#include <cstring>
#include <type_traits>

#include "cpu/encode_inl.h"
#include "cpu/morph.h"
#include "cpu/pose_inl.h"
#include "cpu/task.h"

HWY_BEFORE_NAMESPACE();
namespace dermis::cpu::HWY_NAMESPACE {

// -- Vertices.

template <class D>
struct Vertex {
  Vec3<D> position;
  Vec3<D> normal, tangent;            ///< of unit length, or zero
  Vec3<D> givenNormal, givenTangent;  ///< before normalizing; scale/shear parts apply to these
  Vec<D> hand;
};

template <class D>
DERMIS_INLINE Vec3<D> loadVector(D d, const Lanes* lanes, std::size_t first) {
  return {hn::Load(d, lanes[0].v + first), hn::Load(d, lanes[1].v + first),
          hn::Load(d, lanes[2].v + first)};
}

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
  const Vec<D> square = hn::Add(dot3(q.x, q.y, q.z, q.x, q.y, q.z), hn::Mul(q.w, q.w));
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
  DirectionMap<D> map{r0, r1, r2, hn::Zero(d)};
  if (!isModerate) {
    const Vec<D> scale = powerScale(d, hn::Max(largest3(r0), hn::Max(largest3(r1), largest3(r2))));
    map = {scale3(r0, scale), scale3(r1, scale), scale3(r2, scale), scale};
  }
  map.side = sideOf(d, dot3(map.r0, cross3(map.r1, map.r2)));
  return map;
}
/// Multiplies by the cofactor matrix and the sign of the determinant, so that a mirror gives the
/// direction of the inverse transpose.
template <class D>
DERMIS_INLINE Vec3<D> mapNormal(const DirectionMap<D>& map, const Vec3<D>& n) {
  const Vec3<D> turned{dot3(cross3(map.r1, map.r2), n), dot3(cross3(map.r2, map.r0), n),
                       dot3(cross3(map.r0, map.r1), n)};
  return scale3(turned, map.side);
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
template <class D>
DERMIS_INLINE Vec3<D> normalThrough(D d, const Matrix<D>& m, const Vec3<D>& normal,
                                    bool isModerate) {
  return unitOr(d, mapNormal(directionMap(d, m, isModerate), normal), normal);
}

/// Selects the directions of a vertex that are stored; the others are not computed.
template <bool withTangents>
struct Wanted {
  static constexpr bool tangents = withTangents;
  bool normals = false;

  bool any() const { return normals || tangents; }
};

/// Transforms `normal` and `tangent` by a map and stores them in `v`. A direction that becomes zero
/// keeps its value in `v`.
template <class D, class Wanted>
DERMIS_INLINE void mapDirections(D d, const DirectionMap<D>& map, const Vec3<D>& normal,
                                 const Vec3<D>& tangent, Wanted wanted, Vertex<D>& v) {
  if (wanted.normals) v.normal = unitOr(d, mapNormal(map, normal), v.normal);
  if constexpr (Wanted::tangents) {
    v.tangent = unitOr(d, mapTangent(map, tangent), v.tangent);
    v.hand = hn::Mul(v.hand, map.side);
  }
}

/// Transforms a vertex by a blended matrix.
template <class D, class Wanted>
DERMIS_INLINE Vertex<D> throughMatrix(D d, const Matrix<D>& m, const Vertex<D>& v, Wanted wanted,
                                      bool isModerate) {
  Vertex<D> skinned = v;
  skinned.position = throughMatrix(m, v.position);
  if (wanted.any()) {
    mapDirections(d, directionMap(d, m, isModerate), v.normal, v.tangent, wanted, skinned);
  }
  return skinned;
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

// -- Sums over influences.

/// The influence slots of a block's vertices, starting at one of its lanes.
struct Slots {
  const std::uint16_t* joints;
  const std::uint16_t* pairs;
  const float* weights;
  std::uint32_t influences;
};

/// Calls `sum` with the number of influences: a compile-time constant up to 4, or 0 for more.
template <class Sum>
DERMIS_INLINE void byInfluences([[maybe_unused]] std::uint32_t influences, const Sum& sum) {
#ifdef DERMIS_CPU_GENERAL_ONLY
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

/// Σ w e of one vertex, over as many floats of each entry as there are lanes. An entry has
/// 8 · `units` floats. If `influences` is 0, `count` is the number of influences.
template <int influences, class D>
DERMIS_INLINE Vec<D> sumVertex(D d, const float* HWY_RESTRICT entries, std::size_t units,
                               const std::uint16_t* HWY_RESTRICT numbers,
                               const float* HWY_RESTRICT weights, std::size_t count) {
  if (influences != 0) count = influences;
  Vec<D> sum = hn::Mul(hn::Set(d, weights[0]), hn::Load(d, entries + numbers[0] * units));
  for (std::size_t i = 1; i < count; ++i)
    sum = hn::Add(sum, hn::Mul(hn::Set(d, weights[i]), hn::Load(d, entries + numbers[i] * units)));
  return sum;
}

#if HWY_MAX_BYTES >= 32
/// Transposes the lower and the upper halves of eight rows of eight floats.
DERMIS_INLINE void columnsOf(Eight d, const Vec<Eight> rows[8], Vec4<Eight>& low,
                             Vec4<Eight>& high) {
  low = {hn::ConcatLowerLower(d, rows[4], rows[0]), hn::ConcatLowerLower(d, rows[5], rows[1]),
         hn::ConcatLowerLower(d, rows[6], rows[2]), hn::ConcatLowerLower(d, rows[7], rows[3])};
  high = {hn::ConcatUpperUpper(d, rows[4], rows[0]), hn::ConcatUpperUpper(d, rows[5], rows[1]),
          hn::ConcatUpperUpper(d, rows[6], rows[2]), hn::ConcatUpperUpper(d, rows[7], rows[3])};
  transpose4(d, low.x, low.y, low.z, low.w);
  transpose4(d, high.x, high.y, high.z, high.w);
}

/// Σ w e of eight vertices, over the first 4 K floats of each entry.
template <std::size_t K>
HWY_NOINLINE HWY_ATTR void sumEntries(Eight d, const float* entries, std::size_t units,
                                      const std::uint16_t* numbers, const Slots& slots,
                                      Vec4<Eight>* sums) {
  const std::size_t count = slots.influences;
  byInfluences(slots.influences, [&](auto influences) HWY_ATTR {
    Vec<Eight> rows[8];
    for (std::size_t vertex = 0; vertex < 8; ++vertex) {
      rows[vertex] = sumVertex<influences()>(d, entries, units, numbers + vertex * count,
                                             slots.weights + vertex * count, count);
    }
    columnsOf(d, rows, sums[0], sums[1]);
    if (K < 3) return;
    const Four four;
    Vec<Four> thirds[8];
    for (std::size_t vertex = 0; vertex < 8; ++vertex) {
      thirds[vertex] = sumVertex<influences()>(four, entries + 8, units, numbers + vertex * count,
                                               slots.weights + vertex * count, count);
    }
    Vec4<Eight>& third = sums[K - 1];
    third = {hn::Combine(d, thirds[4], thirds[0]), hn::Combine(d, thirds[5], thirds[1]),
             hn::Combine(d, thirds[6], thirds[2]), hn::Combine(d, thirds[7], thirds[3])};
    transpose4(d, third.x, third.y, third.z, third.w);
  });
}
#else
template <std::size_t K>
HWY_NOINLINE HWY_ATTR void sumEntries(Four d, const float* entries, std::size_t units,
                                      const std::uint16_t* numbers, const Slots& slots,
                                      Vec4<Four>* sums) {
  const std::size_t count = slots.influences;
  byInfluences(slots.influences, [&](auto influences) HWY_ATTR {
    for (std::size_t k = 0; k < K; ++k) {
      Vec<Four> rows[4];
      for (std::size_t vertex = 0; vertex < 4; ++vertex) {
        rows[vertex] = sumVertex<influences()>(d, entries + k * 4, units, numbers + vertex * count,
                                               slots.weights + vertex * count, count);
      }
      transpose4(d, rows[0], rows[1], rows[2], rows[3]);
      sums[k] = {rows[0], rows[1], rows[2], rows[3]};
    }
  });
}
#endif

/// Gathers the entry of each vertex's pivot, one per lane.
template <std::size_t K, class D>
DERMIS_INLINE void pivotEntries(D d, const float* entries, const Slots& slots, Vec4<D>* found) {
  constexpr std::size_t lanes = hn::MaxLanes(d);
  HWY_ALIGN float all[lanes * 4 * K];
  for (std::size_t lane = 0; lane < lanes; ++lane)
    std::memcpy(all + lane * 4 * K, entries + slots.joints[lane * slots.influences], 16 * K);
  for (std::size_t k = 0; k < K; ++k) found[k] = loadRows(d, all + k * 4, 4 * K);
}

// -- Palettes: one instance's pose in the form that the vertices of a section read.

struct Palette {
  const float* pairs = nullptr;        ///< dual quaternions, 8 floats each
  const float* scaleShears = nullptr;  ///< of joints, 8 floats each
  const float* scalePairs = nullptr;   ///< of pairs: the joint's part minus the pivot's
  const float* rows = nullptr;         ///< of joints, 16 floats each
  bool scales = false;
  bool isModerate = false;  ///< result of `areModerate`, for linear blending
};

inline float* floatsOf(std::vector<CacheLine>& memory, std::size_t count) {
  const std::size_t lines = (count + std::size(CacheLine().v) - 1) / std::size(CacheLine().v);
  if (memory.size() < lines) {
    memory.reserve(lines);  // exact size, no geometric growth
    memory.resize(lines);
  }
  return memory.data()->v;
}

inline bool needsRows(Method method) {
  return method == Method::linear || method == Method::blended || needsCentersOfRotation(method);
}

/// Writes R S | t of a decomposed joint.
inline void writeRows(const float* q, const float* part, const JointMatrix& matrix, float* to) {
  const float x = q[0], y = q[1], z = q[2], w = q[3];
  const float r[3][3] = {{1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)},
                         {2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)},
                         {2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)}};
  for (int row = 0; row < 3; ++row) {
    float* const out = to + row * 4;
    if (part == nullptr) {
      std::memcpy(out, r[row], sizeof(r[row]));
    } else {
      const float a = r[row][0], b = r[row][1], c = r[row][2];
      out[0] = part[0] * a + part[3] * b + part[4] * c;
      out[1] = part[3] * a + part[1] * b + part[5] * c;
      out[2] = part[4] * a + part[5] * b + part[2] * c;
    }
    out[3] = matrix.m[row][3];
  }
}

inline std::span<const std::uint32_t> jointsOf(const MeshData& mesh, const Section& section) {
  return std::span(mesh.joints).subspan(section.firstJoint, section.jointCount());
}
inline std::span<const Pair> pairsOf(const MeshData& mesh, const Section& section) {
  return std::span(mesh.pairs).subspan(section.firstPair, section.pairCount());
}

inline const JointMatrix stillMatrix;

inline HWY_ATTR Palette makePalette(const MeshData& mesh, const Section& section, Method method,
                                    std::span<const JointMatrix> pose, bool mayScale,
                                    Scratch& scratch) {
  Palette palette;
  const std::span<const std::uint32_t> joints = jointsOf(mesh, section);
  const std::span<const Pair> pairs = pairsOf(mesh, section);
  const auto matrixOf = [&](std::size_t joint) -> const JointMatrix& {
    return joints[joint] == stillJoint ? stillMatrix : pose[joints[joint]];
  };
  float* const rows = needsRows(method) ? floatsOf(scratch.rows, joints.size() * 16) : nullptr;
  palette.rows = rows;
  if (method == Method::linear) {
    palette.isModerate = areModerate(joints, pose);
    for (std::size_t joint = 0; joint < joints.size(); ++joint)
      std::memcpy(rows + joint * 16, &matrixOf(joint), sizeof(JointMatrix));
    return palette;
  }
  // Joints are converted in whole vectors, so the last one may write beyond the last joint.
  float* const converted = floatsOf(scratch.dualQuaternions, (joints.size() + 8) * 8);
  float* const parts = floatsOf(scratch.scaleShears, (joints.size() + 8) * 8);
  palette.scales = convertJoints({joints, pose, {converted}, {parts}}) && mayScale;
  float* const signedPairs = floatsOf(scratch.pairs, pairs.size() * 8);
  convertPairs(Four(), pairs, {converted}, {signedPairs});
  palette.pairs = signedPairs;
  if (palette.scales) {
    float* const differences = floatsOf(scratch.scalePairs, pairs.size() * 8);
    subtractPivots(Four(), pairs, {parts}, {differences});
    palette.scaleShears = parts;
    palette.scalePairs = differences;
  }
  if (rows != nullptr) {
    for (std::size_t joint = 0; joint < joints.size(); ++joint) {
      writeRows(converted + joint * 8, palette.scales ? parts + joint * 8 : nullptr,
                matrixOf(joint), rows + joint * 16);
    }
  }
  return palette;
}

// -- Methods.

/// Additional inputs per vertex that some methods read.
template <class D>
struct MethodInputs {
  Vec3<D> center;
  Vec<D> share;  ///< weight of the dual quaternion result, or bulge control strength
};

template <class D>
DERMIS_INLINE Part<D> blendParts(D d, const Palette& palette, const Slots& slots) {
  Vec4<D> pivot[2], sum[2];
  pivotEntries<2>(d, palette.scaleShears, slots, pivot);
  sumEntries<2>(d, palette.scalePairs, 1, slots.pairs, slots, sum);
  return partOf<D>(hn::Add(pivot[0].x, sum[0].x), hn::Add(pivot[0].y, sum[0].y),
                   hn::Add(pivot[0].z, sum[0].z), hn::Add(pivot[0].w, sum[0].w),
                   hn::Add(pivot[1].x, sum[1].x), hn::Add(pivot[1].y, sum[1].y));
}

template <class D>
DERMIS_INLINE Matrix<D> blendRows(D d, const Palette& palette, const Slots& slots) {
  Vec4<D> rows[3];
  sumEntries<3>(d, palette.rows, 2, slots.joints, slots, rows);
  return {rows[0], rows[1], rows[2]};
}

/// Interpolates between a linearly blended vertex and a rotated one. Handedness comes from the
/// latter.
template <class D, class Wanted>
DERMIS_INLINE Vertex<D> mixVertices(D d, const Vertex<D>& straight, const Vertex<D>& turned,
                                    Vec<D> share, Wanted wanted) {
  const Vec<D> one = hn::Set(d, 1.0f), rest = hn::Sub(one, share);
  const auto mix = [&](const Vec3<D>& a, const Vec3<D>& b)
                       HWY_ATTR { return add3(scale3(a, rest), scale3(b, share)); };
  const auto isTurned = hn::Ge(share, one);
  Vertex<D> mixed = turned;
  mixed.position = choose3(isTurned, turned.position, mix(straight.position, turned.position));
  const auto mixDirection = [&](const Vec3<D>& a, const Vec3<D>& b)
                                HWY_ATTR { return choose3(isTurned, b, unitOr(d, mix(a, b), b)); };
  if (wanted.normals) mixed.normal = mixDirection(straight.normal, turned.normal);
  if constexpr (Wanted::tangents) mixed.tangent = mixDirection(straight.tangent, turned.tangent);
  return mixed;
}

/// `scales`: the palette has scale/shear parts.
template <bool scales, class D, class Wanted>
DERMIS_INLINE Vertex<D> skinVertex(D d, Method method, const Vertex<D>& bind, const Slots& slots,
                                   const Palette& palette, const MethodInputs<D>& inputs,
                                   Wanted wanted) {
  if (method == Method::linear)
    return throughMatrix(d, blendRows(d, palette, slots), bind, wanted, palette.isModerate);
  Vec4<D> blend[2];
  sumEntries<2>(d, palette.pairs, 1, slots.pairs, slots, blend);
  const Vec4<D>&real = blend[0], &dual = blend[1];
  const Vec<D> factor = turningFactor(d, real);

  // First phase: scale and shear in bind space.
  Vertex<D> scaled = bind;
  Vec3<D> center = inputs.center;
  const bool isAboutCenter = method == Method::centerOfRotation;
  Part<D> part{};
  if constexpr (scales) {
    part = blendParts(d, palette, slots);
    if (wanted.any()) {
      mapDirections(d, directionMap(d, part.r0, part.r1, part.r2, false), bind.givenNormal,
                    bind.givenTangent, wanted, scaled);
    }
  }
  const Vec3<D> point = isAboutCenter ? sub3(bind.position, center) : bind.position;
  const Vec3<D> scaledPoint = scales ? throughPart(part, point) : point;

  // Second phase: rotate and translate.
  Vertex<D> turned = scaled;
  if (wanted.normals) turned.normal = turnDirection(real, factor, scaled.normal);
  if constexpr (Wanted::tangents) turned.tangent = turnDirection(real, factor, scaled.tangent);
  if (isAboutCenter) {
    const Matrix<D> rows = blendRows(d, palette, slots);
    turned.position = add3(turnDirection(real, factor, scaledPoint), throughMatrix(rows, center));
    return turned;
  }
  turned.position = movePoint(real, dual, factor, scaledPoint);
  if (method == Method::bulgeControlled) {
    const Matrix<D> rows = blendRows(d, palette, slots);
    if constexpr (scales) center = throughPart(part, center);
    const Vec3<D> bulged = movePoint(real, dual, factor, center);
    const Vec3<D> pull = sub3(throughMatrix(rows, inputs.center), bulged);
    turned.position = add3(turned.position, scale3(pull, inputs.share));
  }
  if (method == Method::blended) {
    const Vertex<D> straight = throughMatrix(d, blendRows(d, palette, slots), bind, wanted, false);
    return mixVertices(d, straight, turned, inputs.share, wanted);
  }
  return turned;
}

// -- Instances.

/// Bounds (per lane) and number of clamped vertices of one instance.
struct Findings {
  HWY_ALIGN float least[3][blockVertices];
  HWY_ALIGN float greatest[3][blockVertices];
  std::uint32_t clamped = 0;

  Findings() {
    for (auto& lanes : least) std::ranges::fill(lanes, std::numeric_limits<float>::infinity());
    for (auto& lanes : greatest) std::ranges::fill(lanes, -std::numeric_limits<float>::infinity());
  }
};

/// Mask of lanes `first` to `end`.
template <class D>
DERMIS_INLINE hn::Mask<D> lanesFrom(D d, std::size_t first, std::size_t end) {
  return hn::AndNot(hn::FirstN(d, first), hn::FirstN(d, end));
}

template <class D>
DERMIS_INLINE void addPositions(D d, const Vec3<D>& position, hn::Mask<D> counts,
                                Findings& findings) {
  const Vec<D> all[3] = {position.x, position.y, position.z};
  for (std::size_t axis = 0; axis < 3; ++axis) {
    // NaN leaves the bounds unchanged: both comparisons are false.
    const Vec<D> value = all[axis];
    const Vec<D> least = hn::Load(d, findings.least[axis]);
    const Vec<D> greatest = hn::Load(d, findings.greatest[axis]);
    const auto isLess = hn::And(counts, hn::Lt(value, least));
    const auto isGreater = hn::And(counts, hn::Gt(value, greatest));
    hn::Store(hn::IfThenElse(isLess, value, least), d, findings.least[axis]);
    hn::Store(hn::IfThenElse(isGreater, value, greatest), d, findings.greatest[axis]);
  }
}

/// A range of vertices of one run, for one instance.
struct GeneralTask {
  const Task& task;
  const Run& run;
  const TaskInstance& instance;
  const Palette& palette;
  std::uint32_t firstVertex, vertexEnd;
  std::array<std::uint32_t, 3> sizes;  ///< bytes of positions, normals, tangents
  bool areSideBySide = false;          ///< positions and normals, in float32
};

/// One block's vertices in bind pose, after morphing.
struct BlockVertices {
  Lanes positions[3], normals[3], tangents[4];
};

inline void loadBlock(const MeshData& mesh, std::uint32_t block,
                      std::span<const MorphWeight> morphs, BlockVertices& to) {
  const auto copy = [&](const std::vector<Lanes>& from, std::size_t components, Lanes* lanes) {
    if (!from.empty()) std::copy_n(from.data() + block * components, components, lanes);
  };
  copy(mesh.positions, 3, to.positions);
  copy(mesh.givenNormals, 3, to.normals);
  copy(mesh.givenTangents, 4, to.tangents);
  morphBlock(mesh, block, morphs, to.positions, to.normals, to.tangents);
}

template <class D, class Wanted>
DERMIS_INLINE Vertex<D> bindVertex(D d, const MeshData& mesh, std::uint32_t block, std::size_t lane,
                                   const BlockVertices* morphed, Wanted wanted) {
  const Vec3<D> none{hn::Zero(d), hn::Zero(d), hn::Zero(d)};
  Vertex<D> v{none, none, none, none, none, hn::Set(d, 1.0f)};
  const auto at = [&](const std::vector<Lanes>& lanes, std::size_t components)
                      HWY_ATTR { return loadVector(d, lanes.data() + block * components, lane); };
  v.position = morphed != nullptr ? loadVector(d, morphed->positions, lane) : at(mesh.positions, 3);
  if (wanted.normals) {
    v.givenNormal =
        morphed != nullptr ? loadVector(d, morphed->normals, lane) : at(mesh.givenNormals, 3);
    v.normal = morphed != nullptr ? unitOr(d, v.givenNormal, none) : at(mesh.normals, 3);
  }
  if constexpr (Wanted::tangents) {
    v.givenTangent =
        morphed != nullptr ? loadVector(d, morphed->tangents, lane) : at(mesh.givenTangents, 4);
    v.tangent = morphed != nullptr ? unitOr(d, v.givenTangent, none) : at(mesh.tangents, 4);
    v.hand = hn::Load(d, mesh.tangents[std::size_t{block} * 4 + 3].v + lane);
  }
  return v;
}

/// Maps a position from the instance's box to [-1, 1].
template <class D>
DERMIS_INLINE Vec3<D> relativeTo(D d, const TaskInstance& instance, const Vec3<D>& position) {
  const auto along = [&](Vec<D> v, std::size_t axis) HWY_ATTR {
    return hn::Mul(hn::Sub(v, hn::Set(d, instance.boxCenter[axis])),
                   hn::Set(d, instance.boxInverse[axis]));
  };
  return {along(position.x, 0), along(position.y, 1), along(position.z, 2)};
}

/// Skins lanes `first` to `end` of the vector that starts at lane `lane` of a block.
template <bool scales, bool tangents, class D>
DERMIS_INLINE void skinLanes(D d, const GeneralTask& task, std::uint32_t block, std::size_t lane,
                             std::size_t first, std::size_t end, const BlockVertices* morphed,
                             Findings& findings) {
  const Task& job = task.task;
  const MeshData& mesh = *job.mesh;
  const VertexPlaces& places = job.places;
  const std::size_t vertex = std::size_t{block} * blockVertices + lane;
  const auto placeOf = [&](Stream stream) {
    return task.instance.outputs[stream] + vertex * places[stream].stride;
  };
  const std::uint64_t slot = task.run.slotOf(block) + lane * task.run.influences;
  const Slots slots{mesh.jointNumbers.data() + slot, mesh.pairNumbers.data() + slot,
                    mesh.weights.data() + slot, task.run.influences};
  MethodInputs<D> inputs{{hn::Zero(d), hn::Zero(d), hn::Zero(d)}, hn::Zero(d)};
  if (needsCentersOfRotation(job.method))
    inputs.center = loadVector(d, mesh.centers.data() + std::size_t{block} * 3, lane);
  if (job.method == Method::blended)
    inputs.share = hn::Load(d, mesh.dualQuaternionWeights[block].v + lane);
  if (job.method == Method::bulgeControlled)
    inputs.share = hn::Load(d, mesh.bulgeStrengths[block].v + lane);

  const Wanted<tangents> wanted{places[Stream::normals].format != VertexFormat::none};
  const Vertex<D> skinned =
      skinVertex<scales>(d, job.method, bindVertex(d, mesh, block, lane, morphed, wanted), slots,
                         task.palette, inputs, wanted);
  const VertexFormat format = places[Stream::positions].format;
  const std::uint32_t bytes = task.sizes[0];
  const auto encode = [&](const Vec3<D>& position) HWY_ATTR {
    if (!isSnormPosition(format)) return encodePosition(d, format, position);
    const Vec3<D> relative = relativeTo(d, task.instance, position);
    // A vertex on a face of the engine's box may lie outside by a rounding error.
    const auto isBeyond = [&](Vec<D> component)
                              HWY_ATTR { return hn::Gt(hn::Abs(component), hn::Set(d, 1.00001f)); };
    const auto isOutside =
        hn::Or(isBeyond(relative.x), hn::Or(isBeyond(relative.y), isBeyond(relative.z)));
    findings.clamped +=
        static_cast<std::uint32_t>(hn::CountTrue(d, hn::And(isOutside, lanesFrom(d, first, end))));
    return encodePosition(d, format, relative);
  };
  if (task.instance.result != nullptr)
    addPositions(d, skinned.position, lanesFrom(d, first, end), findings);
  std::byte* const to = placeOf(Stream::positions);
  std::byte* const toPrevious = placeOf(Stream::previousPositions);
  const Encoded<D> encoded = encode(skinned.position);
  if (places.hasMotion() && !task.instance.restartsMotion) {
    copyLanes(toPrevious, places[Stream::previousPositions].stride, to,
              places[Stream::positions].stride, bytes, first, end);
  } else if (places.hasMotion()) {
    storeLanes(d, encoded, bytes, toPrevious, places[Stream::previousPositions].stride, first, end);
  }
  if (task.areSideBySide && end - first == hn::MaxLanes(d)) {
    storeWhole(d, skinned.position, skinned.normal, reinterpret_cast<float*>(to));
  } else {
    storeLanes(d, encoded, bytes, to, places[Stream::positions].stride, first, end);
    if (wanted.normals) {
      storeLanes(d, encodeNormal(d, places[Stream::normals].format, skinned.normal), task.sizes[1],
                 placeOf(Stream::normals), places[Stream::normals].stride, first, end);
    }
  }
  if constexpr (tangents) {
    storeLanes(d, encodeTangent(d, places[Stream::tangents].format, skinned.tangent, skinned.hand),
               task.sizes[2], placeOf(Stream::tangents), places[Stream::tangents].stride, first,
               end);
  }
}

template <bool scales, bool tangents>
inline HWY_ATTR void skinRun(const GeneralTask& task, Findings& findings) {
  const Wide d;
  constexpr std::uint32_t lanes = hn::MaxLanes(d);
  BlockVertices morphed;
  for (std::uint32_t block = task.firstVertex / blockVertices;
       block * blockVertices < task.vertexEnd; ++block) {
    const bool isMorphed = !task.instance.morphs.empty();
    if (isMorphed) loadBlock(*task.task.mesh, block, task.instance.morphs, morphed);
    for (std::uint32_t lane = 0; lane < blockVertices; lane += lanes) {
      const std::uint32_t vertex = block * blockVertices + lane;
      const std::uint32_t first = std::max(vertex, task.firstVertex);
      const std::uint32_t end = std::min(vertex + lanes, task.vertexEnd);
      if (first >= end) continue;
      skinLanes<scales, tangents>(d, task, block, lane, first - vertex, end - vertex,
                                  isMorphed ? &morphed : nullptr, findings);
    }
  }
}

inline HWY_ATTR void skinGeneral(const GeneralTask& task, Findings& findings) {
  const bool tangents = task.task.places[Stream::tangents].format != VertexFormat::none;
  if (task.palette.scales) {
    tangents ? skinRun<true, true>(task, findings) : skinRun<true, false>(task, findings);
  } else {
    tangents ? skinRun<false, true>(task, findings) : skinRun<false, false>(task, findings);
  }
}

}  // namespace dermis::cpu::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();
