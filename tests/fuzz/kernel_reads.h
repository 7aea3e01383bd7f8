// What the skin kernel reads of a packed mesh, read as it does (shaders/mesh_access.glsl,
// shaders/morph.glsl): the sanitizer sees where that leaves the blob.
#pragma once

#include <bit>
#include <cstddef>
#include <cstdint>
#include <cstdlib>
#include <cstring>
#include <vector>

#include "abi.h"
#include "dermis/mesh.h"

namespace dermis::fuzz {

inline void require(bool condition) {
  if (!condition) std::abort();
}

/// Its memory is as large as the blob and no larger, whatever a vector would keep in reserve.
class KernelReads {
 public:
  explicit KernelReads(const PackedMesh& mesh)
      : words_(new std::uint32_t[mesh.bytes().size() / 4]), info_(mesh.info()) {
    const auto* bytes = reinterpret_cast<const std::uint32_t*>(mesh.bytes().data());
    for (std::size_t i = 0; i < mesh.bytes().size() / 4; ++i) words_[i] = bytes[i];
    std::memcpy(&header_, words_, sizeof(header_));
  }
  ~KernelReads() { delete[] words_; }
  KernelReads(const KernelReads&) = delete;
  KernelReads& operator=(const KernelReads&) = delete;

  void readAll() {
    for (std::uint32_t vertex = 0; vertex < info_.vertexCount; ++vertex) {
      read(header_.positions + vertex * 4, 8);  // the next one says the end
      if (info_.hasNormals) read(header_.normals + vertex * 4, 4);
      if (info_.hasTangents) read(header_.tangents + vertex * 4, 4);
      if (info_.hasCentersOfRotation) read(header_.centers + vertex * 4, 4);
      for (const std::uint32_t shares : {header_.dualQuaternionWeights, header_.bulgeStrengths}) {
        if (shares != 0) read(shares + vertex, 1);
      }
      readInfluences(vertex);
    }
    for (std::uint32_t target = 0; target < info_.morphTargetCount; ++target) readMorph(target);
  }

  /// The word at which a target displaces a vertex, or 0. As the kernel finds it.
  std::uint32_t findDisplacement(std::uint32_t target, std::uint32_t vertex) const {
    const abi::MorphRecord record = morph(target);
    const std::uint32_t number = vertex / abi::MORPH_BLOCK_VERTICES - record.firstBlock;
    if (number >= record.blockCount) return 0;
    abi::MorphBlockRecord block;
    std::memcpy(&block, words_ + record.blocks + number * abi::MORPH_BLOCK_WORDS, sizeof(block));
    const std::uint64_t mask = block.maskLow | std::uint64_t{block.maskHigh} << 32;
    const std::uint64_t bit = std::uint64_t{1} << vertex % abi::MORPH_BLOCK_VERTICES;
    if ((mask & bit) == 0) return 0;
    const auto before = static_cast<std::uint32_t>(std::popcount(mask & (bit - 1)));
    return block.displacements + before * displacementWords(target);
  }
  std::uint32_t attributes(std::uint32_t target) const { return morph(target).attributes; }
  float floatAt(std::uint32_t word) const { return std::bit_cast<float>(words_[word]); }

 private:
  abi::MorphRecord morph(std::uint32_t target) const {
    abi::MorphRecord record;
    std::memcpy(&record, words_ + header_.morphs + target * abi::MORPH_WORDS, sizeof(record));
    return record;
  }
  std::uint32_t displacementWords(std::uint32_t target) const {
    return 3 * static_cast<std::uint32_t>(std::popcount(attributes(target)));
  }
  void read(std::uint32_t word, std::uint32_t count) {
    for (std::uint32_t i = 0; i < count; ++i) sink_ = words_[word + i];
  }
  void readInfluences(std::uint32_t vertex) {
    const std::uint32_t* record = words_ + header_.positions + vertex * 4;
    const std::uint32_t first = record[3], end = record[7], padding = first % 2;
    const std::uint32_t count = (end / 2 - first / 2) * 2 - padding;
    require(count >= info_.minInfluences && count <= info_.maxInfluences);
    // Two are read at a time.
    for (std::uint32_t influence = first / 2 * 2; influence < first / 2 * 2 + count + padding;
         ++influence) {
      const std::uint32_t word = header_.influences + influence * abi::INFLUENCE_WORDS;
      read(word, abi::INFLUENCE_WORDS);
      require(words_[word + offsetof(abi::InfluenceRecord, joint) / 4] < info_.requiredJoints);
    }
  }
  void readMorph(std::uint32_t target) {
    for (std::uint32_t vertex = 0; vertex < info_.vertexCount; ++vertex) {
      const std::uint32_t word = findDisplacement(target, vertex);
      if (word != 0) read(word, displacementWords(target));
    }
  }

  std::uint32_t* words_;
  abi::MeshHeader header_;
  MeshInfo info_;
  volatile std::uint32_t sink_ = 0;
};

}  // namespace dermis::fuzz
