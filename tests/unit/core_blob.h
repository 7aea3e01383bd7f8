// Reads a packed mesh as the comments of shaders/abi.h lay it out, without the library's code.
#pragma once

#include <bit>
#include <cstddef>
#include <cstdint>
#include <cstring>
#include <span>
#include <vector>

#include "abi.h"

namespace dermis::test {

struct BlobInfluence {
  std::uint32_t joint;
  float weight;
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
    return number(std::size_t{word(abi::MESH_HEADER_POSITIONS)} + vertex * 3 + component);
  }
  float normal(std::uint32_t vertex, std::uint32_t component) const {
    return number(std::size_t{word(abi::MESH_HEADER_NORMALS)} + vertex * 3 + component);
  }
  std::uint32_t slotsOfBlock(std::uint32_t block) const {
    return word(blockRecord(block) + abi::BLOCK_SLOTS);
  }
  /// What stands in a slot of a vertex, used or not.
  BlobInfluence slot(std::uint32_t vertex, std::uint32_t slot) const {
    const std::uint32_t block = vertex / abi::BLOCK_VERTICES, lane = vertex % abi::BLOCK_VERTICES;
    const std::size_t rows = word(blockRecord(block) + abi::BLOCK_OFFSET);
    const std::size_t pairs = rows + std::size_t{slotsOfBlock(block)} * abi::BLOCK_VERTICES;
    const std::uint32_t pair = word(pairs + std::size_t{slot / 2} * abi::BLOCK_VERTICES + lane);
    return {slot % 2 == 0 ? pair & 0xffffu : pair >> 16,
            number(rows + std::size_t{slot} * abi::BLOCK_VERTICES + lane)};
  }
  /// The influences of a vertex: its slots up to the first of weight 0.
  std::vector<BlobInfluence> influences(std::uint32_t vertex) const {
    std::vector<BlobInfluence> result;
    for (std::uint32_t i = 0; i < slotsOfBlock(vertex / abi::BLOCK_VERTICES); ++i) {
      if (slot(vertex, i).weight == 0) break;
      result.push_back(slot(vertex, i));
    }
    return result;
  }

  /// Makes the checksum right again: FNV-1a by words, of all that follow it.
  void seal() {
    std::uint32_t hash = 0x811c9dc5u;
    for (std::size_t i = abi::MESH_HEADER_CHECKSUM + 1; i < words_.size(); ++i) {
      hash ^= words_[i];
      hash *= 0x01000193u;
    }
    words_.at(abi::MESH_HEADER_CHECKSUM) = hash;
  }

 private:
  std::size_t blockRecord(std::uint32_t block) const {
    return std::size_t{word(abi::MESH_HEADER_BLOCKS)} + std::size_t{block} * abi::BLOCK_WORDS;
  }

  std::vector<std::uint32_t> words_;
};

}  // namespace dermis::test
