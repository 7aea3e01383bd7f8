// Reads a packed mesh as the comments of shaders/abi.h lay it out, without the library's code. Its
// accessors throw where they would leave the blob.
#pragma once

#include <array>
#include <bit>
#include <cstddef>
#include <cstdint>
#include <cstring>
#include <optional>
#include <span>
#include <vector>

#include "abi.h"

namespace dermis::test {

/// Words of a morph target's record, and of its blocks'.
inline constexpr std::size_t morphFirstBlock = offsetof(abi::MorphRecord, firstBlock) / 4;
inline constexpr std::size_t morphBlockCount = offsetof(abi::MorphRecord, blockCount) / 4;
inline constexpr std::size_t morphBlocks = offsetof(abi::MorphRecord, blocks) / 4;
inline constexpr std::size_t morphAttributes = offsetof(abi::MorphRecord, attributes) / 4;
inline constexpr std::size_t morphBlockMask = offsetof(abi::MorphBlockRecord, maskLow) / 4;
inline constexpr std::size_t morphBlockDisplacements =
    offsetof(abi::MorphBlockRecord, displacements) / 4;

struct BlobInfluence {
  std::uint32_t joint;
  float weight;
};

/// What a morph target adds to one vertex; zeros for attributes that it does not displace.
struct BlobDisplacement {
  std::array<float, 3> position{}, normal{}, tangent{};

  friend bool operator==(const BlobDisplacement&, const BlobDisplacement&) = default;
};

class Blob {
 public:
  explicit Blob(std::span<const std::byte> bytes) : words_(bytes.size() / 4) {
    if (!bytes.empty()) std::memcpy(words_.data(), bytes.data(), words_.size() * 4);
  }

  std::uint32_t word(std::size_t index) const { return words_.at(index); }
  float number(std::size_t index) const { return std::bit_cast<float>(words_.at(index)); }
  std::size_t size() const { return words_.size(); }
  std::vector<std::uint32_t>& words() { return words_; }
  std::span<const std::byte> bytes() const { return std::as_bytes(std::span(words_)); }

  std::uint32_t vertexCount() const { return word(abi::MESH_HEADER_VERTEX_COUNT); }
  float position(std::uint32_t vertex, std::uint32_t component) const {
    return number(std::size_t{word(abi::MESH_HEADER_POSITIONS)} + vertex * 4 + component);
  }
  float normal(std::uint32_t vertex, std::uint32_t component) const {
    return number(std::size_t{word(abi::MESH_HEADER_NORMALS)} + vertex * 4 + component);
  }
  float tangent(std::uint32_t vertex, std::uint32_t component) const {
    return number(std::size_t{word(abi::MESH_HEADER_TANGENTS)} + vertex * 4 + component);
  }

  float center(std::uint32_t vertex, std::uint32_t component) const {
    return number(std::size_t{word(abi::MESH_HEADER_CENTERS)} + vertex * 4 + component);
  }
  /// The vertex' own, or the mesh's.
  float dualQuaternionWeight(std::uint32_t vertex) const {
    const std::size_t section = word(abi::MESH_HEADER_DUAL_QUATERNION_WEIGHTS);
    return number(section != 0 ? section + vertex : abi::MESH_HEADER_DUAL_QUATERNION_WEIGHT);
  }
  float bulgeStrength(std::uint32_t vertex) const {
    const std::size_t section = word(abi::MESH_HEADER_BULGE_STRENGTHS);
    return number(section != 0 ? section + vertex : abi::MESH_HEADER_BULGE_STRENGTH);
  }

  /// The word that says where a vertex' influences begin; that of the next ends them.
  std::size_t firstOf(std::uint32_t vertex) const {
    return std::size_t{word(abi::MESH_HEADER_POSITIONS)} + vertex * 4 + 3;
  }
  /// Padding counts, too.
  std::size_t influenceWord(std::uint32_t influence) const {
    return word(abi::MESH_HEADER_INFLUENCES) + std::size_t{influence} * abi::INFLUENCE_WORDS;
  }
  std::vector<BlobInfluence> influences(std::uint32_t vertex) const {
    std::vector<BlobInfluence> result;
    const std::uint32_t begin = word(firstOf(vertex)) / 2 * 2;
    const std::uint32_t padding = word(firstOf(vertex)) % 2;
    const std::uint32_t end = word(firstOf(vertex + 1)) / 2 * 2 - padding;
    for (std::uint32_t i = begin; i < end; ++i) {
      result.push_back({word(influenceWord(i) + abi::INFLUENCE_JOINT),
                        number(influenceWord(i) + abi::INFLUENCE_WEIGHT)});
    }
    return result;
  }

  std::uint32_t morphCount() const { return word(abi::MESH_HEADER_MORPH_COUNT); }
  std::size_t morphRecord(std::uint32_t target) const {
    return word(abi::MESH_HEADER_MORPHS) + std::size_t{target} * abi::MORPH_WORDS;
  }
  /// The record of a block, counted from the target's first.
  std::size_t morphBlock(std::uint32_t target, std::uint32_t block) const {
    return word(morphRecord(target) + morphBlocks) + std::size_t{block} * abi::MORPH_BLOCK_WORDS;
  }
  /// Nothing where the target leaves the vertex alone.
  std::optional<BlobDisplacement> displacement(std::uint32_t target, std::uint32_t vertex) const {
    const std::uint32_t firstBlock = word(morphRecord(target) + morphFirstBlock);
    const std::uint32_t blockCount = word(morphRecord(target) + morphBlockCount);
    const std::uint32_t vertexBlock = vertex / abi::MORPH_BLOCK_VERTICES;
    if (vertexBlock < firstBlock || vertexBlock - firstBlock >= blockCount) return std::nullopt;
    const std::size_t block = morphBlock(target, vertexBlock - firstBlock);
    const auto isDisplaced = [&](std::uint32_t lane) {
      return (word(block + morphBlockMask + lane / 32) >> lane % 32 & 1u) != 0;
    };
    const std::uint32_t lane = vertex % abi::MORPH_BLOCK_VERTICES;
    if (!isDisplaced(lane)) return std::nullopt;
    std::size_t before = 0;
    for (std::uint32_t other = 0; other < lane; ++other) before += isDisplaced(other) ? 1u : 0u;

    const std::uint32_t attributes = word(morphRecord(target) + morphAttributes);
    std::size_t each = 0;
    for (const std::uint32_t attribute : {1u, 2u, 4u})
      each += (attributes & attribute) != 0 ? 3u : 0u;
    std::size_t place = word(block + morphBlockDisplacements) + before * each;
    const auto next = [&](std::uint32_t attribute) {
      std::array<float, 3> vector{};
      if ((attributes & attribute) == 0) return vector;
      for (float& component : vector) component = number(place++);
      return vector;
    };
    BlobDisplacement result;
    result.position = next(abi::MORPH_HAS_POSITIONS);
    result.normal = next(abi::MORPH_HAS_NORMALS);
    result.tangent = next(abi::MORPH_HAS_TANGENTS);
    return result;
  }

  /// Makes the checksum right again: FNV-1a by words, of all that follow it.
  void seal() {
    std::uint32_t hash = 0x811c9dc5u;
    for (std::size_t i = abi::MESH_HEADER_CHECKSUM + 1; i < words_.size(); ++i) {
      hash ^= words_[i];
      hash *= 0x01000193u;
      hash = hash << 15 | hash >> 17;
    }
    words_.at(abi::MESH_HEADER_CHECKSUM) = hash;
  }

 private:
  std::vector<std::uint32_t> words_;
};

}  // namespace dermis::test
