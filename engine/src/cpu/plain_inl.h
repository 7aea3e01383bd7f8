// What most instances need, as fast as it can be: positions and normals in float32, side by side,
// by dual quaternions that do not scale. Several instances at a time: weights and numbers of joints
// are read once for all of them, and each has its own 128 bits of a vector, so that nothing crosses
// from one to another before it is stored.

// clang-format off
#if defined(DERMIS_CPU_PLAIN_INL_H) == defined(HWY_TARGET_TOGGLE)
#ifdef DERMIS_CPU_PLAIN_INL_H
#undef DERMIS_CPU_PLAIN_INL_H
#else
#define DERMIS_CPU_PLAIN_INL_H
#endif
// clang-format on

#include <type_traits>

#include "cpu/general_inl.h"

HWY_BEFORE_NAMESPACE();
namespace dermis::cpu::HWY_NAMESPACE {

/// Whole blocks of a run.
struct PlainTask {
  const MeshData& mesh;
  const Run& run;
  std::uint32_t firstBlock, blockEnd;
  std::uint32_t outputBlock;  ///< the one that stands at the beginning of the output
};

inline constexpr std::size_t vertexFloats = 6;
inline constexpr std::size_t blockFloats = blockVertices * vertexFloats;

/// Calls `skin` with the number of influences of the run: as a constant, or 0 where it is too large
/// to be one.
template <class Skin>
HWY_INLINE void byInfluences(const Run& run, const Skin& skin) {
  switch (run.influences) {
    case 1:
      return skin(std::integral_constant<int, 1>());
    case 2:
      return skin(std::integral_constant<int, 2>());
    case 3:
      return skin(std::integral_constant<int, 3>());
    case 4:
      return skin(std::integral_constant<int, 4>());
    default:
      return skin(std::integral_constant<int, 0>());
  }
}

/// Four vertices of each block: positions and normals, component by component, to where each block
/// begins.
HWY_INLINE void storeBlocks(Four d, const Vec<Four> chunks[6], float* const to[1]) {
  for (std::size_t k = 0; k < 6; ++k) hn::StoreU(chunks[k], d, to[0] + k * 4);
}
#if HWY_MAX_BYTES >= 32
HWY_INLINE void storeBlocks(Eight d, const Vec<Eight> chunks[6], float* const to[2]) {
  for (std::size_t k = 0; k < 6; k += 2) {
    hn::StoreU(hn::ConcatLowerLower(d, chunks[k + 1], chunks[k]), d, to[0] + k * 4);
    hn::StoreU(hn::ConcatUpperUpper(d, chunks[k + 1], chunks[k]), d, to[1] + k * 4);
  }
}
#endif
#if HWY_MAX_BYTES >= 64
HWY_INLINE void storeBlocks(Sixteen d, const Vec<Sixteen> chunks[6], float* const to[4]) {
  const Eight half;
  for (std::size_t k = 0; k < 6; k += 2) {
    // The even blocks of both chunks, and the odd ones.
    const auto even = hn::OddEvenBlocks(hn::SwapAdjacentBlocks(chunks[k + 1]), chunks[k]);
    const auto odd = hn::OddEvenBlocks(chunks[k + 1], hn::SwapAdjacentBlocks(chunks[k]));
    hn::StoreU(hn::LowerHalf(half, even), half, to[0] + k * 4);
    hn::StoreU(hn::LowerHalf(half, odd), half, to[1] + k * 4);
    hn::StoreU(hn::UpperHalf(half, even), half, to[2] + k * 4);
    hn::StoreU(hn::UpperHalf(half, odd), half, to[3] + k * 4);
  }
  static_cast<void>(d);
}
#endif

template <class D>
HWY_INLINE void storeVertices(D d, const Vec3<D>& p, const Vec3<D>& n, float* const* to) {
  const hn::Repartition<double, D> dd;
  const auto pair = [&](Vec<D> a, Vec<D> b, bool upper) HWY_ATTR {
    return hn::BitCast(dd, upper ? hn::InterleaveUpper(d, a, b) : hn::InterleaveLower(d, a, b));
  };
  Vec<D> chunks[6];
  for (int half = 0; half < 2; ++half) {
    const auto xy = pair(p.x, p.y, half == 1);
    const auto zx = pair(p.z, n.x, half == 1);
    const auto yz = pair(n.y, n.z, half == 1);
    chunks[half * 3] = hn::BitCast(d, hn::InterleaveLower(dd, xy, zx));
    chunks[half * 3 + 1] = hn::BitCast(d, hn::OddEven(xy, yz));
    chunks[half * 3 + 2] = hn::BitCast(d, hn::InterleaveUpper(dd, zx, yz));
  }
  storeBlocks(d, chunks, to);
}

/// The three components of four vertices, in each block.
struct InEveryBlock {
  std::size_t first;

  template <class D>
  HWY_INLINE Vec3<D> load(D d, const Lanes* lanes) const {
    return {hn::LoadDup128(d, lanes[0].v + first), hn::LoadDup128(d, lanes[1].v + first),
            hn::LoadDup128(d, lanes[2].v + first)};
  }
};
/// Of eight vertices.
struct InAllLanes {
  template <class D>
  HWY_INLINE Vec3<D> load(D d, const Lanes* lanes) const {
    return loadVector(d, lanes, 0);
  }
};

/// What is read of a block late stays out of registers until then.
template <class D, class Place>
HWY_INLINE void turnAndStore(D d, const Vec<D> q[8], const Lanes* positions, const Lanes* normals,
                             const Place& place, float* const* to) {
  const Vec4<D> real{q[0], q[1], q[2], q[3]}, dual{q[4], q[5], q[6], q[7]};
  const Vec<D> factor = turningFactor(d, real);
  const Vec3<D> position = movePoint(real, dual, factor, place.load(d, positions));
  storeVertices(d, position, turnDirection(real, factor, place.load(d, normals)), to);
}

/// As many instances as D has blocks. `pairs`: of each pair the real parts of all of them; the dual
/// parts stand `dual` floats behind.
template <int influences, class D>
HWY_INLINE void turnInstances(D d, const PlainTask& task, const float* HWY_RESTRICT pairs,
                              std::size_t dual, float* const* outputs) {
  constexpr std::size_t lanes = hn::MaxLanes(d), blocks = lanes / 4;
  const std::size_t count = influences != 0 ? influences : task.run.influences;
  const std::uint64_t slot = task.run.slotOf(task.firstBlock);
  const std::uint16_t* HWY_RESTRICT number = task.mesh.pairNumbers.data() + slot;
  const float* HWY_RESTRICT weight = task.mesh.weights.data() + slot;
  const float* HWY_RESTRICT duals = pairs + dual;
  float* to[blocks];
  for (std::size_t i = 0; i < blocks; ++i)
    to[i] = outputs[i] + std::size_t{task.firstBlock - task.outputBlock} * blockFloats;
  for (std::uint32_t block = task.firstBlock; block < task.blockEnd; ++block) {
    const Lanes* const positions = task.mesh.positions.data() + std::size_t{block} * 3;
    const Lanes* const normals = task.mesh.normals.data() + std::size_t{block} * 3;
    for (std::size_t half = 0; half < blockVertices; half += 4) {
      Vec<D> q[8];
      for (std::size_t vertex = 0; vertex < 4; ++vertex) {
        std::size_t entry = std::size_t{number[0]} * blocks / 2;
        Vec<D> w = hn::Set(d, weight[0]);
        Vec<D> realSum = hn::Mul(w, hn::Load(d, pairs + entry));
        Vec<D> dualSum = hn::Mul(w, hn::Load(d, duals + entry));
        for (std::size_t i = 1; i < count; ++i) {
          entry = std::size_t{number[i]} * blocks / 2;
          w = hn::Set(d, weight[i]);
          realSum = hn::Add(realSum, hn::Mul(w, hn::Load(d, pairs + entry)));
          dualSum = hn::Add(dualSum, hn::Mul(w, hn::Load(d, duals + entry)));
        }
        q[vertex] = realSum;
        q[vertex + 4] = dualSum;
        number += count;
        weight += count;
      }
      transpose4(d, q[0], q[1], q[2], q[3]);
      transpose4(d, q[4], q[5], q[6], q[7]);
      turnAndStore(d, q, positions, normals, InEveryBlock{half}, to);
      for (float*& place : to) place += 4 * vertexFloats;
    }
  }
}

/// The same by blended matrices. `rows`: of a joint, the first rows of all instances; the other
/// rows stand `rowFloats` and twice as many floats behind.
template <int influences, class D>
HWY_INLINE void moveInstances(D d, const PlainTask& task, const float* HWY_RESTRICT rows,
                              std::size_t rowFloats, float* const* outputs) {
  constexpr std::size_t lanes = hn::MaxLanes(d), blocks = lanes / 4;
  const std::size_t count = influences != 0 ? influences : task.run.influences;
  const std::uint64_t slot = task.run.slotOf(task.firstBlock);
  const std::uint16_t* HWY_RESTRICT number = task.mesh.jointNumbers.data() + slot;
  const float* HWY_RESTRICT weight = task.mesh.weights.data() + slot;
  float* to[blocks];
  for (std::size_t i = 0; i < blocks; ++i)
    to[i] = outputs[i] + std::size_t{task.firstBlock - task.outputBlock} * blockFloats;
  for (std::uint32_t block = task.firstBlock; block < task.blockEnd; ++block) {
    const Lanes* const positions = task.mesh.positions.data() + std::size_t{block} * 3;
    const Lanes* const normals = task.mesh.normals.data() + std::size_t{block} * 3;
    for (std::size_t half = 0; half < blockVertices; half += 4) {
      Vec<D> m[3][4];
      for (std::size_t vertex = 0; vertex < 4; ++vertex) {
        const float* entry = rows + std::size_t{number[0]} * blocks / 2;
        Vec<D> w = hn::Set(d, weight[0]);
        Vec<D> row0 = hn::Mul(w, hn::Load(d, entry));
        Vec<D> row1 = hn::Mul(w, hn::Load(d, entry + rowFloats));
        Vec<D> row2 = hn::Mul(w, hn::Load(d, entry + 2 * rowFloats));
        for (std::size_t i = 1; i < count; ++i) {
          entry = rows + std::size_t{number[i]} * blocks / 2;
          w = hn::Set(d, weight[i]);
          row0 = hn::Add(row0, hn::Mul(w, hn::Load(d, entry)));
          row1 = hn::Add(row1, hn::Mul(w, hn::Load(d, entry + rowFloats)));
          row2 = hn::Add(row2, hn::Mul(w, hn::Load(d, entry + 2 * rowFloats)));
        }
        m[0][vertex] = row0;
        m[1][vertex] = row1;
        m[2][vertex] = row2;
        number += count;
        weight += count;
      }
      for (auto& row : m) transpose4(d, row[0], row[1], row[2], row[3]);
      const Matrix<D> matrix{{m[0][0], m[0][1], m[0][2], m[0][3]},
                             {m[1][0], m[1][1], m[1][2], m[1][3]},
                             {m[2][0], m[2][1], m[2][2], m[2][3]}};
      const InEveryBlock from{half};
      storeVertices(d, throughMatrix(matrix, from.load(d, positions)),
                    normalThrough(d, matrix, from.load(d, normals), true), to);
      for (float*& place : to) place += 4 * vertexFloats;
    }
  }
}

#if HWY_MAX_BYTES >= 32
/// One instance: a vector holds a dual quaternion, and then a component of eight vertices.
template <int influences>
HWY_INLINE void turnInstance(Eight d, const PlainTask& task, const float* HWY_RESTRICT pairs,
                             float* output) {
  const std::size_t count = influences != 0 ? influences : task.run.influences;
  const std::uint64_t slot = task.run.slotOf(task.firstBlock);
  const std::uint16_t* HWY_RESTRICT number = task.mesh.pairNumbers.data() + slot;
  const float* HWY_RESTRICT weight = task.mesh.weights.data() + slot;
  float* to = output + std::size_t{task.firstBlock - task.outputBlock} * blockFloats;
  for (std::uint32_t block = task.firstBlock; block < task.blockEnd; ++block) {
    Vec<Eight> rows[8];
    for (Vec<Eight>& row : rows) {
      row = hn::Mul(hn::Set(d, weight[0]), hn::Load(d, pairs + number[0]));
      for (std::size_t i = 1; i < count; ++i)
        row = hn::Add(row, hn::Mul(hn::Set(d, weight[i]), hn::Load(d, pairs + number[i])));
      number += count;
      weight += count;
    }
    Vec<Eight> q[8];
    for (std::size_t k = 0; k < 4; ++k) {
      q[k] = hn::ConcatLowerLower(d, rows[k + 4], rows[k]);
      q[k + 4] = hn::ConcatUpperUpper(d, rows[k + 4], rows[k]);
    }
    transpose4(d, q[0], q[1], q[2], q[3]);
    transpose4(d, q[4], q[5], q[6], q[7]);
    float* const halves[2] = {to, to + 4 * vertexFloats};
    turnAndStore(d, q, task.mesh.positions.data() + std::size_t{block} * 3,
                 task.mesh.normals.data() + std::size_t{block} * 3, InAllLanes(), halves);
    to += blockFloats;
  }
}
#endif

}  // namespace dermis::cpu::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#endif  // per target
