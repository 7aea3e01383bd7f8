// What a cpu::Mesh consists of. Vertices stand in blocks of eight, attribute by attribute,
// component by component; the last block is filled up with vertices of no influences.
#pragma once

#include <array>
#include <cstdint>
#include <span>
#include <vector>

#include "abi.h"
#include "dermis/cpu/mesh.h"
#include "dermis/mesh.h"
#include "dermis/pack.h"

namespace dermis::cpu {

inline constexpr std::uint32_t blockVertices = 8;

/// One component of the vertices of a block.
struct alignas(32) Lanes {
  float v[blockVertices] = {};
};

/// Stands for a joint that leaves everything where it is: the only one of vertices without
/// influences.
inline constexpr std::uint32_t stillJoint = 0xffffffff;

/// The joints of influences are numbers into the lists of a section, times this, so that processors
/// find an entry by one address.
inline constexpr std::uint32_t indexScale = 8;

/// A pivot and a joint of some of its vertices, as numbers into `Section`'s joints. Each pose gives
/// a dual quaternion for each pair, in the pivot's hemisphere: vertices then add without looking.
struct Pair {
  std::uint16_t pivot = 0;
  std::uint16_t joint = 0;
};

/// Blocks, one behind the other, that share lists of joints and pairs.
struct Section {
  std::uint32_t firstJoint = 0, jointEnd = 0;  ///< of `MeshData::joints`
  std::uint32_t firstPair = 0, pairEnd = 0;    ///< of `MeshData::pairs`

  std::uint32_t jointCount() const { return jointEnd - firstJoint; }
  std::uint32_t pairCount() const { return pairEnd - firstPair; }
};

/// Blocks, one behind the other, of one section, in which each vertex has `influences` slots. Those
/// that it does not need have weight 0 and its pivot. Slots stand vertex by vertex.
struct Run {
  std::uint32_t section = 0;
  std::uint32_t firstBlock = 0, blockEnd = 0;
  std::uint32_t influences = 0;
  std::size_t firstSlot = 0;

  std::size_t slotOf(std::uint32_t block) const {
    return firstSlot + std::size_t{block - firstBlock} * blockVertices * influences;
  }
};

struct MeshData {
  MeshInfo info;
  std::vector<Lanes> positions;     ///< 3 a block
  std::vector<Lanes> normals;       ///< 3 a block, of unit length; empty if there are none
  std::vector<Lanes> givenNormals;  ///< as the mesh has them
  std::vector<Lanes> tangents;      ///< 4 a block: unit length, and 1 or -1
  std::vector<Lanes> givenTangents;
  std::vector<Lanes> centers;                ///< of rotation, 3 a block
  std::vector<Lanes> dualQuaternionWeights;  ///< 1 a block
  std::vector<Lanes> bulgeStrengths;         ///< 1 a block
  std::vector<float> weights;                ///< of each slot
  std::vector<std::uint16_t> jointNumbers;   ///< of each slot, times `indexScale`
  std::vector<std::uint16_t> pairNumbers;    ///< likewise
  std::vector<std::uint32_t> joints;         ///< of sections: joints of the pose
  std::vector<Pair> pairs;                   ///< of sections
  std::vector<Section> sections;
  std::vector<Run> runs;              ///< in the order of blocks
  std::vector<std::uint32_t> packed;  ///< with morph targets: the packed mesh

  std::uint32_t runOf(std::uint32_t block) const;
  /// Those that count, the pivot first.
  std::vector<abi::InfluenceRecord> influencesOf(std::uint32_t vertex) const;
  /// Some of the vertices, displaced, and without directions: they come out where they do here.
  MeshData select(std::span<const std::uint32_t> vertices,
                  std::span<const MorphWeight> morphs) const;
};

inline const MeshData& dataOf(const Mesh& mesh) {
  return *mesh.data_;
}

}  // namespace dermis::cpu
