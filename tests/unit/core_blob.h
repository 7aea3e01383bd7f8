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

/// Words of a packed mesh's header.
namespace header {
#define DERMIS_HEADER_WORD(name) \
  inline constexpr std::uint32_t name = offsetof(abi::MeshHeader, name) / 4;
DERMIS_HEADER_WORD(magic)
DERMIS_HEADER_WORD(version)
DERMIS_HEADER_WORD(checksum)
DERMIS_HEADER_WORD(wordCount)
DERMIS_HEADER_WORD(vertexCount)
DERMIS_HEADER_WORD(requiredJoints)
DERMIS_HEADER_WORD(maxInfluences)
DERMIS_HEADER_WORD(minInfluences)
DERMIS_HEADER_WORD(morphCount)
DERMIS_HEADER_WORD(positions)
DERMIS_HEADER_WORD(normals)
DERMIS_HEADER_WORD(tangents)
DERMIS_HEADER_WORD(influences)
DERMIS_HEADER_WORD(centers)
DERMIS_HEADER_WORD(morphs)
DERMIS_HEADER_WORD(dualQuaternionWeights)
DERMIS_HEADER_WORD(dualQuaternionWeight)
DERMIS_HEADER_WORD(bulgeStrengths)
DERMIS_HEADER_WORD(bulgeStrength)
#undef DERMIS_HEADER_WORD
}  // namespace header

/// Words of an influence, of a morph target's record, and of its blocks'.
inline constexpr std::size_t influenceWeight = offsetof(abi::InfluenceRecord, weight) / 4;
inline constexpr std::size_t influenceJoint = offsetof(abi::InfluenceRecord, joint) / 4;
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

  std::uint32_t vertexCount() const { return word(header::vertexCount); }
  float position(std::uint32_t vertex, std::uint32_t component) const {
    return number(std::size_t{word(header::positions)} + vertex * 4 + component);
  }
  float normal(std::uint32_t vertex, std::uint32_t component) const {
    return number(std::size_t{word(header::normals)} + vertex * 4 + component);
  }
  float tangent(std::uint32_t vertex, std::uint32_t component) const {
    return number(std::size_t{word(header::tangents)} + vertex * 4 + component);
  }

  float center(std::uint32_t vertex, std::uint32_t component) const {
    return number(std::size_t{word(header::centers)} + vertex * 4 + component);
  }
  /// The vertex' own, or the mesh's.
  float dualQuaternionWeight(std::uint32_t vertex) const {
    const std::size_t section = word(header::dualQuaternionWeights);
    return number(section != 0 ? section + vertex : header::dualQuaternionWeight);
  }
  float bulgeStrength(std::uint32_t vertex) const {
    const std::size_t section = word(header::bulgeStrengths);
    return number(section != 0 ? section + vertex : header::bulgeStrength);
  }

  /// The word that says where a vertex' influences begin; that of the next ends them.
  std::size_t firstOf(std::uint32_t vertex) const {
    return std::size_t{word(header::positions)} + vertex * 4 + 3;
  }
  /// Padding counts, too.
  std::size_t influenceWord(std::uint32_t influence) const {
    return word(header::influences) + std::size_t{influence} * abi::INFLUENCE_WORDS;
  }
  std::vector<BlobInfluence> influences(std::uint32_t vertex) const {
    std::vector<BlobInfluence> result;
    const std::uint32_t begin = word(firstOf(vertex)) / 2 * 2;
    const std::uint32_t padding = word(firstOf(vertex)) % 2;
    const std::uint32_t end = word(firstOf(vertex + 1)) / 2 * 2 - padding;
    for (std::uint32_t i = begin; i < end; ++i) {
      result.push_back(
          {word(influenceWord(i) + influenceJoint), number(influenceWord(i) + influenceWeight)});
    }
    return result;
  }

  std::uint32_t morphCount() const { return word(header::morphCount); }
  std::size_t morphRecord(std::uint32_t target) const {
    return word(header::morphs) + std::size_t{target} * abi::MORPH_WORDS;
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
    for (std::size_t i = header::checksum + 1; i < words_.size(); ++i) {
      hash ^= words_[i];
      hash *= 0x01000193u;
      hash = hash << 15 | hash >> 17;
    }
    words_.at(header::checksum) = hash;
  }

 private:
  std::vector<std::uint32_t> words_;
};

}  // namespace dermis::test
