#include "cpu/morph.h"

#include <bit>
#include <utility>

#include "abi.h"
#include "strict_floating_point.h"

namespace dermis::cpu {

void morphBlock(const MeshData& mesh, std::uint32_t block, std::span<const MorphWeight> morphs,
                Lanes* positions, Lanes* normals, Lanes* tangents) {
  const std::span<const std::uint32_t> words(mesh.packed);
  const auto header = abi::load<abi::MeshHeader>(words, 0);
  const std::uint32_t first = block * blockVertices;
  const std::uint32_t shift = first % abi::MORPH_BLOCK_VERTICES;
  for (const MorphWeight& morph : morphs) {
    if (morph.weight == 0) continue;
    const auto target = abi::load<abi::MorphRecord>(
        words, header.morphs + std::size_t{morph.target} * abi::MORPH_WORDS);
    const std::uint32_t number = first / abi::MORPH_BLOCK_VERTICES - target.firstBlock;
    if (number >= target.blockCount) continue;  // a block before the first one wraps around
    const auto record = abi::load<abi::MorphBlockRecord>(
        words, target.blocks + std::size_t{number} * abi::MORPH_BLOCK_WORDS);
    const std::uint64_t mask = record.maskLow | std::uint64_t{record.maskHigh} << 32;
    const auto before =
        static_cast<std::uint32_t>(std::popcount(mask & ((std::uint64_t{1} << shift) - 1)));
    const auto attributes = static_cast<std::uint32_t>(std::popcount(target.attributes));
    std::size_t word = record.displacements + std::size_t{before} * attributes * 3;
    for (std::uint32_t lane = 0; lane < blockVertices; ++lane) {
      if ((mask >> (shift + lane) & 1) == 0) continue;
      for (const auto& [attribute, lanes] : {std::pair{abi::MORPH_HAS_POSITIONS, positions},
                                             {abi::MORPH_HAS_NORMALS, normals},
                                             {abi::MORPH_HAS_TANGENTS, tangents}}) {
        if ((target.attributes & attribute) == 0) continue;
        for (std::size_t k = 0; lanes != nullptr && k < 3; ++k)
          lanes[k].v[lane] += morph.weight * std::bit_cast<float>(words[word + k]);
        word += 3;
      }
    }
  }
}

}  // namespace dermis::cpu
