#include "pack/check.h"

#include <bit>
#include <cstddef>

#include "abi.h"
#include "dermis/mesh.h"

namespace dermis {
namespace {

/// Whether `count` words from `offset` on are after the header and inside the blob.
bool isSection(std::uint64_t offset, std::uint64_t count, std::uint64_t total) {
  return offset >= abi::MESH_HEADER_WORDS && offset <= total && count <= total - offset;
}

/// The same for `count` vertex records, which are read in units of four words.
bool isUnitSection(std::uint64_t offset, std::uint64_t count, std::uint64_t total) {
  return offset % 4 == 0 && isSection(offset, count * abi::VERTEX_WORDS, total);
}

/// Positions must have been checked before.
Result<void> checkInfluences(std::span<const std::uint32_t> words, const abi::MeshHeader& header) {
  const std::size_t vertices = header.vertexCount;
  const std::uint32_t offset = header.influences;
  const auto begin = [&](std::size_t vertex) {
    return abi::load<abi::PositionRecord>(words, header.positions + vertex * abi::VERTEX_WORDS)
        .influences;
  };
  for (std::size_t vertex = 0; vertex < vertices; ++vertex) {
    const std::uint32_t first = begin(vertex), next = begin(vertex + 1), isOdd = first % 2;
    const std::uint64_t count = std::uint64_t{next / 2 - first / 2} * 2 - isOdd;
    if (next / 2 < first / 2 + isOdd || count > header.maxInfluences ||
        count < header.minInfluences) {
      return storedMesh.damaged("the influences of vertex " + std::to_string(vertex) +
                                " do not follow those of the vertex before it");
    }
  }
  const std::uint64_t count = begin(vertices);
  if (count % 2 != 0) return storedMesh.damaged("the number of its influences is odd");
  if (offset % 4 != 0 || !isSection(offset, count * abi::INFLUENCE_WORDS, words.size())) {
    return storedMesh.damaged("its influences lie outside the blob");
  }
  for (std::uint64_t influence = 0; influence < count; ++influence) {
    const std::size_t record = static_cast<std::size_t>(offset + influence * abi::INFLUENCE_WORDS);
    if (abi::load<abi::InfluenceRecord>(words, record).joint >= header.requiredJoints) {
      return storedMesh.damaged("influence " + std::to_string(influence) +
                                " has a joint index above its largest");
    }
  }
  return {};
}

/// Checks a target whose blocks must begin at word `behind` or later, and sets `behind` to their
/// end. Since blocks of targets do not overlap, checking all targets is O(words of the blob).
Result<void> checkMorph(std::span<const std::uint32_t> words, const abi::MeshHeader& header,
                        std::uint32_t target, std::uint64_t& behind) {
  const std::uint32_t vertices = header.vertexCount;
  const auto morph =
      abi::load<abi::MorphRecord>(words, header.morphs + std::size_t{target} * abi::MORPH_WORDS);
  const std::uint64_t blockCount = morph.blockCount;
  if (blockCount == 0) return {};
  const std::uint64_t allBlocks =
      (std::uint64_t{vertices} + abi::MORPH_BLOCK_VERTICES - 1) / abi::MORPH_BLOCK_VERTICES;
  if (morph.firstBlock + blockCount > allBlocks || morph.attributes > 7 ||
      !isUnitSection(morph.blocks, blockCount, words.size())) {
    return storedMesh.damaged("morph target " + std::to_string(target) + " lies outside the blob");
  }
  if (morph.blocks < behind)
    return storedMesh.damaged("morph target " + std::to_string(target) +
                              " overlaps the one before");
  behind = morph.blocks + blockCount * abi::MORPH_BLOCK_WORDS;
  const std::uint64_t displacementWords =
      std::uint64_t{3} * static_cast<std::uint32_t>(std::popcount(morph.attributes));
  for (std::uint64_t number = 0; number < blockCount; ++number) {
    const auto block = abi::load<abi::MorphBlockRecord>(
        words, static_cast<std::size_t>(morph.blocks + number * abi::MORPH_BLOCK_WORDS));
    const std::uint64_t displaced = static_cast<std::uint64_t>(std::popcount(block.maskLow)) +
                                    static_cast<std::uint64_t>(std::popcount(block.maskHigh));
    if (displaced != 0 &&
        !isSection(block.displacements, displaced * displacementWords, words.size())) {
      return storedMesh.damaged("displacements of morph target " + std::to_string(target) +
                                " lie outside the blob");
    }
  }
  return {};
}

}  // namespace

Result<void> checkMeshWords(std::span<const std::uint32_t> words) {
  const auto header = abi::load<abi::MeshHeader>(words, 0);
  const std::uint64_t vertices = header.vertexCount;
  const auto areVectors = [&](std::uint32_t offset) {
    return offset == 0 || isUnitSection(offset, vertices, words.size());
  };
  const auto areFloats = [&](std::uint32_t offset) {
    return offset == 0 || isSection(offset, vertices, words.size());
  };
  if (vertices == 0 || header.requiredJoints > maxPoseJoints || header.requiredJoints == 0 ||
      !isUnitSection(header.positions, vertices + 1, words.size()) || !areVectors(header.normals) ||
      !areVectors(header.tangents) || !areVectors(header.centers) ||
      !areFloats(header.dualQuaternionWeights) || !areFloats(header.bulgeStrengths) ||
      !isUnitSection(header.morphs, header.morphCount, words.size())) {
    return storedMesh.damaged("its header does not fit its sections");
  }
  if (Result<void> good = checkInfluences(words, header); !good) return good;
  std::uint64_t behind = 0;
  for (std::uint32_t target = 0; target < header.morphCount; ++target) {
    if (Result<void> good = checkMorph(words, header, target, behind); !good) return good;
  }
  return {};
}

}  // namespace dermis
