// Adds the displacements of active morph targets to vertices in bind pose.
#pragma once

#include <bit>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <span>
#include <vector>

#include "abi.h"
#include "cpu/mesh_data.h"
#include "dermis/mesh.h"

namespace dermis::cpu {

/// A target with a weight other than 0 for one or more of the instances that are skinned together.
struct ActiveTarget {
  abi::MorphRecord record;
  alignas(64) float weights[16] = {};  ///< for each
};

/// For one instance.
ActiveTarget activeTarget(const MeshData& mesh, const MorphWeight& morph);

/// What a target displaces of the vertices of a mesh, `abi::MORPH_BLOCK_VERTICES` of them.
struct BlockDisplacements {
  std::uint64_t mask = 0;  ///< one bit for each vertex
  /// Those of the first displaced vertex; those of the others follow. Each has three floats for
  /// each attribute of the target.
  const std::uint32_t* words = nullptr;
  std::size_t size = 0;  ///< words for each vertex
  std::uint32_t attributes = 0;
  const ActiveTarget* target = nullptr;
};

/// Those of block `number`, or nothing. Inline, so that the code of an instruction set counts bits
/// by its own.
inline std::optional<BlockDisplacements> displacementsOf(const MeshData& mesh,
                                                         const ActiveTarget& active,
                                                         std::uint32_t number) {
  const abi::MorphRecord& target = active.record;
  const std::uint32_t place = number - target.firstBlock;
  if (place >= target.blockCount) return {};  // a block before the first one wraps around
  const auto record = abi::load<abi::MorphBlockRecord>(
      mesh.packed, target.blocks + std::size_t{place} * abi::MORPH_BLOCK_WORDS);
  const std::uint64_t mask = record.maskLow | std::uint64_t{record.maskHigh} << 32;
  if (mask == 0) return {};
  const std::size_t size = static_cast<std::size_t>(std::popcount(target.attributes)) * 3;
  return BlockDisplacements{mask, mesh.packed.data() + record.displacements, size,
                            target.attributes, &active};
}

/// The part of it that displaces eight vertices.
struct Displacements {
  std::uint32_t mask;  ///< one bit for each vertex
  const std::uint32_t* words;
  const BlockDisplacements* of;
};

/// What active targets displace of the vertices that were asked for last.
struct ActiveTargets {
  std::vector<ActiveTarget> all;  ///< in ascending order
  std::uint32_t number = 0;       ///< of the block
  std::vector<BlockDisplacements> displacements;
  std::vector<Displacements> parts;  ///< of eight of them

  /// `morphs`: those of each instance that are not in `all` yet, in ascending order of targets.
  void begin(const MeshData& mesh, std::span<std::span<const MorphWeight>> morphs);
  void find(const MeshData& mesh, std::uint32_t block) {
    if (block == number) return;
    number = block;
    displacements.clear();
    for (const ActiveTarget& target : all) {
      if (const auto found = displacementsOf(mesh, target, block)) displacements.push_back(*found);
    }
  }
};

/// Those of a block of the CPU path's mesh.
inline Displacements partOf(const BlockDisplacements& displacements, std::uint32_t block) {
  const std::uint32_t shift = block * blockVertices % abi::MORPH_BLOCK_VERTICES;
  const std::uint64_t before = displacements.mask & ((std::uint64_t{1} << shift) - 1);
  return {
      static_cast<std::uint32_t>(displacements.mask >> shift & 0xff),
      displacements.words + static_cast<std::size_t>(std::popcount(before)) * displacements.size,
      &displacements};
}

/// Adds them to a block of the first instance. `positions`, `normals` and `tangents` have three
/// components each; null if not wanted.
void displace(const Displacements& part, const BlockDisplacements& displacements, Lanes* positions,
              Lanes* normals, Lanes* tangents);

}  // namespace dermis::cpu
