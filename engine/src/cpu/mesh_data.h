// The data of a cpu::Mesh. Vertices are stored in blocks of eight: attribute by attribute,
// component by component. The last block is padded with vertices without influences.
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "abi.h"
#include "dermis/cpu.h"
#include "dermis/mesh.h"

namespace dermis::cpu {

inline constexpr std::uint32_t blockVertices = 8;

/// One component of the vertices of a block.
struct alignas(32) Lanes {
  float v[blockVertices] = {};
};

/// All numbers of consecutive lines or lanes, from the first on; `v` has only those of one.
template <typename Line>
float* numbersOf(Line* lines) {
  return reinterpret_cast<float*>(lines);
}
template <typename Line>
const float* numbersOf(const Line* lines) {
  return reinterpret_cast<const float*>(lines);
}

/// Denotes an identity joint, the only joint of vertices without influences.
inline constexpr std::uint32_t stillJoint = 0xffffffff;

/// Influences store indices into the lists of a section, multiplied by this. An entry of eight
/// numbers for each of four lanes is then eight times as many bytes from the first, which an
/// address can say.
inline constexpr std::uint32_t indexScale = 16;

/// A pivot and a joint that influences vertices of that pivot, as indices into `Section`'s joints.
/// Each pose gives a dual quaternion for each pair, in the pivot's hemisphere, so that vertices add
/// them without comparing signs.
struct Pair {
  std::uint16_t pivot = 0;
  std::uint16_t joint = 0;
};

/// Consecutive blocks that share lists of joints and pairs.
struct Section {
  std::uint32_t firstJoint = 0, jointEnd = 0;  ///< in `MeshData::joints`
  std::uint32_t firstPair = 0, pairEnd = 0;    ///< in `MeshData::pairs`

  std::uint32_t jointCount() const { return jointEnd - firstJoint; }
  std::uint32_t pairCount() const { return pairEnd - firstPair; }
};

/// Consecutive blocks of one section in which each vertex has `influences` slots. Unused slots have
/// weight 0 and refer to the vertex's pivot. Slots are stored vertex by vertex.
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
  std::vector<Lanes> positions;     ///< 3 per block
  std::vector<Lanes> normals;       ///< 3 per block, of unit length; empty if there are none
  std::vector<Lanes> givenNormals;  ///< as stored in the mesh
  std::vector<Lanes> tangents;      ///< 4 per block: a unit vector, and 1 or -1
  std::vector<Lanes> givenTangents;
  std::vector<Lanes> centers;                ///< of rotation, 3 per block
  std::vector<Lanes> dualQuaternionWeights;  ///< 1 per block
  std::vector<Lanes> bulgeStrengths;         ///< 1 per block
  std::vector<float> weights;                ///< of each slot
  std::vector<std::uint16_t> jointNumbers;   ///< of each slot, times `indexScale`
  std::vector<std::uint16_t> pairNumbers;    ///< likewise
  std::vector<std::uint32_t> joints;         ///< lists of all sections: joints of the pose
  std::vector<Pair> pairs;                   ///< lists of all sections
  std::vector<Section> sections;
  std::vector<Run> runs;              ///< in ascending order of blocks
  std::vector<std::uint32_t> packed;  ///< only with morph targets: the packed mesh

  std::uint32_t runOf(std::uint32_t block) const;
  /// Influences with a weight other than 0, the pivot first.
  std::vector<abi::InfluenceRecord> influencesOf(std::uint32_t vertex) const;
  /// Copies some of the vertices, morphed and without directions. They are skinned to the same
  /// positions as here.
  MeshData select(std::span<const std::uint32_t> vertices,
                  std::span<const MorphWeight> morphs) const;
};

inline const MeshData& dataOf(const Mesh& mesh) {
  return *mesh.data_;
}

}  // namespace dermis::cpu
