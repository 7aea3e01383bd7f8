// libFuzzer: any bytes as a stored packed mesh. What is accepted must be safe to plan with.

#include <cstddef>
#include <cstdint>
#include <cstdlib>
#include <span>
#include <vector>

#include "abi.h"
#include "dermis/plan.h"

using namespace dermis;

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  // The checksum would stop nearly every input: it is put right, so that what lies behind it is
  // attacked.
  std::vector<std::uint32_t> words(size / 16 * 4);
  for (std::size_t i = 0; i < words.size() * 4; ++i)
    words[i / 4] |= std::uint32_t{data[i]} << (i % 4 * 8);
  if (words.size() > abi::MESH_HEADER_WORDS) {
    words[abi::MESH_HEADER_MAGIC] = abi::MESH_MAGIC;
    words[abi::MESH_HEADER_VERSION] = abi::MESH_VERSION;
    words[abi::MESH_HEADER_WORDS_TOTAL] = static_cast<std::uint32_t>(words.size());
    std::uint32_t hash = 2166136261u;
    for (std::size_t i = abi::MESH_HEADER_CHECKSUM + 1; i < words.size(); ++i)
      hash = (hash ^ words[i]) * 16777619u;
    words[abi::MESH_HEADER_CHECKSUM] = hash;
  }
  const Result<PackedMesh> mesh = PackedMesh::fromBytes(std::as_bytes(std::span(words)));
  if (!mesh) return 0;
  // What the kernels will read of every vertex lies inside the blob.
  const std::span<const std::byte> bytes = mesh->bytes();
  const auto* blob = reinterpret_cast<const std::uint32_t*>(bytes.data());
  volatile std::uint32_t sink = 0;
  for (std::uint32_t vertex = 0; vertex < mesh->vertexCount(); ++vertex) {
    sink = blob[blob[abi::MESH_HEADER_POSITIONS] + vertex * 3 + 2];
    const std::uint32_t* block =
        blob + blob[abi::MESH_HEADER_BLOCKS] + vertex / abi::BLOCK_VERTICES * abi::BLOCK_WORDS;
    for (std::uint32_t slot = 0; slot < block[abi::BLOCK_SLOTS]; ++slot) {
      const std::uint32_t* weights = blob + block[abi::BLOCK_OFFSET];
      const std::uint32_t lane = vertex % abi::BLOCK_VERTICES;
      sink = weights[slot * abi::BLOCK_VERTICES + lane];
      const std::uint32_t pair =
          weights[(block[abi::BLOCK_SLOTS] + slot / 2) * abi::BLOCK_VERTICES + lane];
      if ((slot % 2 == 0 ? pair & 0xffffu : pair >> 16) >= mesh->requiredJoints()) std::abort();
    }
  }
  static_cast<void>(sink);
  return 0;
}
