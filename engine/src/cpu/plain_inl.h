// The fast path for the common case: positions and normals in float32, side by side, skinned by
// dual quaternions or matrices. Several instances are skinned at a time: weights and joint indices
// are read once for all of them, and each instance has its own 128 bits of a vector, so that data
// is exchanged between instances only when results are stored.
#pragma once

#include "cpu/general_inl.h"

HWY_BEFORE_NAMESPACE();
namespace dermis::cpu::HWY_NAMESPACE {

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
};
/// Loads the three components of eight vertices, one per lane.
struct InAllLanes {
  template <class D>
  DERMIS_INLINE Vec3<D> load(D d, const Lanes* lanes) const {
    return loadVector(d, lanes, 0);
  }
};

/// Loads positions and normals as late as possible, to save registers.
template <class D, class Place>
DERMIS_INLINE void turnAndStore(D d, const Vec4<D>& real, const Vec4<D>& dual,
                                const Lanes* positions, const Lanes* normals, const Place& place,
                                float* const* to) {
  const Vec<D> factor = turningFactor(d, real);
  const Vec3<D> position = movePoint(real, dual, factor, place.load(d, positions));
  storeVertices(d, position, turnDirection(real, factor, place.load(d, normals)), to);
}

/// Skins as many instances as D has blocks. `pairs`: for each pair, the real parts of all
/// instances; the dual parts follow `dual` floats later.
template <int influences, class D>
DERMIS_INLINE void turnInstances(D d, const PlainTask& task, const float* HWY_RESTRICT pairs,
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
      turnAndStore(d, Vec4<D>{q[0], q[1], q[2], q[3]}, Vec4<D>{q[4], q[5], q[6], q[7]}, positions,
                   normals, InEveryBlock{half}, to);
      for (float*& place : to) place += 4 * vertexFloats;
    }
  }
}

/// The palette of instances that scale or shear. Entries of all instances are stored side by side;
/// their second halves follow in separate arrays.
struct ScaledPalette {
  const float* pairs;       ///< dual quaternions of pairs
  const float* scalePairs;  ///< scale/shear parts of pairs: the joint's minus the pivot's
  const float* parts;       ///< scale/shear parts of joints
  std::size_t dual;         ///< floats from the first half of a pair to the second
  std::size_t second;       ///< floats from the first half of a joint to the second
};

/// Like `turnInstances`, with two-phase scale.
template <int influences, class D>
DERMIS_INLINE void turnScaledInstances(D d, const PlainTask& task, const ScaledPalette& palette,
                                       float* const* outputs) {
  constexpr std::size_t lanes = hn::MaxLanes(d), blocks = lanes / 4;
  const std::size_t count = influences != 0 ? influences : task.run.influences;
  const std::uint64_t slot = task.run.slotOf(task.firstBlock);
  const std::uint16_t* HWY_RESTRICT number = task.mesh.pairNumbers.data() + slot;
  const std::uint16_t* HWY_RESTRICT joint = task.mesh.jointNumbers.data() + slot;
  const float* HWY_RESTRICT weight = task.mesh.weights.data() + slot;
  float* to[blocks];
  for (std::size_t i = 0; i < blocks; ++i)
    to[i] = outputs[i] + std::size_t{task.firstBlock - task.outputBlock} * blockFloats;
  /// Blends both halves of an entry for four vertices.
  const auto blend = [&](const float* HWY_RESTRICT entries, Vec<D> sums[8]) HWY_ATTR {
    for (std::size_t vertex = 0; vertex < 4; ++vertex) {
      const std::uint16_t* const own = number + vertex * count;
      const float* const ownWeights = weight + vertex * count;
      Vec<D> low = hn::Zero(d), high = hn::Zero(d);
      for (std::size_t i = 0; i < count; ++i) {
        const float* const entry = entries + std::size_t{own[i]} * blocks / 2;
        const Vec<D> w = hn::Set(d, ownWeights[i]);
        const Vec<D> lowPart = hn::Mul(w, hn::Load(d, entry));
        const Vec<D> highPart = hn::Mul(w, hn::Load(d, entry + palette.dual));
        low = i == 0 ? lowPart : hn::Add(low, lowPart);
        high = i == 0 ? highPart : hn::Add(high, highPart);
      }
      sums[vertex] = low;
      sums[vertex + 4] = high;
    }
  };
  for (std::uint32_t block = task.firstBlock; block < task.blockEnd; ++block) {
    const Lanes* const positions = task.mesh.positions.data() + std::size_t{block} * 3;
    const Lanes* const normals = task.mesh.normals.data() + std::size_t{block} * 3;
    const Lanes* const given = task.mesh.givenNormals.data() + std::size_t{block} * 3;
    for (std::size_t half = 0; half < blockVertices; half += 4) {
      const InEveryBlock from{half};
      Vec<D> s[8];
      blend(palette.scalePairs, s);
      for (std::size_t vertex = 0; vertex < 4; ++vertex) {
        const float* const pivot = palette.parts + std::size_t{joint[vertex * count]} * blocks / 2;
        s[vertex] = hn::Add(hn::Load(d, pivot), s[vertex]);
        s[vertex + 4] = hn::Add(hn::Load(d, pivot + palette.second), s[vertex + 4]);
      }
      transpose4(d, s[0], s[1], s[2], s[3]);
      transpose4(d, s[4], s[5], s[6], s[7]);
      const Part<D> part = partOf<D>(s[0], s[1], s[2], s[3], s[4], s[5]);
      const DirectionMap<D> map = directionMap(d, part.r0, part.r1, part.r2, false);
      const Vec3<D> normal = unitOr(d, mapNormal(map, from.load(d, given)), from.load(d, normals));
      const Vec3<D> position = throughPart(part, from.load(d, positions));

      Vec<D> q[8];
      blend(palette.pairs, q);
      transpose4(d, q[0], q[1], q[2], q[3]);
      transpose4(d, q[4], q[5], q[6], q[7]);
      const Vec4<D> real{q[0], q[1], q[2], q[3]}, dual{q[4], q[5], q[6], q[7]};
      const Vec<D> factor = turningFactor(d, real);
      storeVertices(d, movePoint(real, dual, factor, position), turnDirection(real, factor, normal),
                    to);
      number += 4 * count;
      joint += 4 * count;
      weight += 4 * count;
      for (float*& place : to) place += 4 * vertexFloats;
    }
  }
}

/// Like `turnInstances`, by blended matrices. `rows`: for each joint, the first rows of all
/// instances; the second and third rows follow `rowFloats` and 2 `rowFloats` floats later.
template <int influences, class D>
DERMIS_INLINE void moveInstances(D d, const PlainTask& task, const float* HWY_RESTRICT rows,
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
/// Skins one instance: a vector first holds a dual quaternion, then a component of eight vertices.
template <int influences>
DERMIS_INLINE void turnInstance(Eight d, const PlainTask& task, const float* HWY_RESTRICT pairs,
                                float* output) {
  const std::size_t count = influences != 0 ? influences : task.run.influences;
  const std::uint64_t slot = task.run.slotOf(task.firstBlock);
  const std::uint16_t* HWY_RESTRICT number = task.mesh.pairNumbers.data() + slot;
  const float* HWY_RESTRICT weight = task.mesh.weights.data() + slot;
  float* to = output + std::size_t{task.firstBlock - task.outputBlock} * blockFloats;
  for (std::uint32_t block = task.firstBlock; block < task.blockEnd; ++block) {
    Vec<Eight> rows[8];
    for (Vec<Eight>& row : rows) {
      row = sumVertex<influences>(d, pairs, 1, number, weight, count);
      number += count;
      weight += count;
    }
    Vec4<Eight> real, dual;
    columnsOf(d, rows, real, dual);
    float* const halves[2] = {to, to + 4 * vertexFloats};
    turnAndStore(d, real, dual, task.mesh.positions.data() + std::size_t{block} * 3,
                 task.mesh.normals.data() + std::size_t{block} * 3, InAllLanes(), halves);
    to += blockFloats;
  }
}
#endif

}  // namespace dermis::cpu::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();
