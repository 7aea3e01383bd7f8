// Adds the displacements of active morph targets to vertices in bind pose.
#pragma once

#include <bit>
#include <cstddef>
#include <cstdint>
#include <span>

#include "abi.h"
#include "cpu/mesh_data.h"
#include "dermis/mesh.h"

namespace dermis::cpu {

/// The record of a target.
abi::MorphRecord morphTarget(const MeshData& mesh, std::uint32_t target);

/// What a target displaces of eight vertices.
struct Displacements {
  std::uint32_t mask = 0;  ///< one bit for each vertex
  /// Those of the first displaced vertex; those of the others follow. Each has three floats for
  /// each attribute of the target.
  const std::uint32_t* words = nullptr;
  std::size_t size = 0;  ///< words for each vertex
};

/// Those of a block. Inline, so that the code of an instruction set counts bits by its own.
inline Displacements displacementsOf(const MeshData& mesh, const abi::MorphRecord& target,
                                     std::uint32_t block) {
  const std::uint32_t vertex = block * blockVertices;
  const std::uint32_t number = vertex / abi::MORPH_BLOCK_VERTICES - target.firstBlock;
  if (number >= target.blockCount) return {};  // a block before the first one wraps around
  const auto record = abi::load<abi::MorphBlockRecord>(
      mesh.packed, target.blocks + std::size_t{number} * abi::MORPH_BLOCK_WORDS);
  const std::uint64_t mask = record.maskLow | std::uint64_t{record.maskHigh} << 32;
  const std::uint32_t shift = vertex % abi::MORPH_BLOCK_VERTICES;
  if ((mask >> shift & 0xff) == 0) return {};
  const auto before =
      static_cast<std::size_t>(std::popcount(mask & ((std::uint64_t{1} << shift) - 1)));
  const std::size_t size = static_cast<std::size_t>(std::popcount(target.attributes)) * 3;
  return {static_cast<std::uint32_t>(mask >> shift & 0xff),
          mesh.packed.data() + record.displacements + before * size, size};
}

/// Adds them to a block, times `weight`. `positions`, `normals` and `tangents` have three
/// components each; null if not wanted.
void displace(const Displacements& displacements, std::uint32_t attributes, float weight,
              Lanes* positions, Lanes* normals, Lanes* tangents);

}  // namespace dermis::cpu
