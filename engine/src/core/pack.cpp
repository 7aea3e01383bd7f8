#include "dermis/pack.h"

#include <algorithm>
#include <array>
#include <bit>
#include <cstring>
#include <string>

#include "abi.h"
#include "attribute.h"
#include "dermis/types.h"
#include "dermis/validate.h"

namespace dermis {
namespace {

static_assert(std::endian::native == std::endian::little, "packed meshes are little-endian words");

struct Influence {
  std::uint32_t joint = 0;
  double weight = 0;
};

/// FNV-1a, a word at a time: each step is a bijection, so that no single damaged word goes
/// unnoticed.
std::uint32_t checksum(std::span<const std::uint32_t> words) {
  std::uint32_t hash = 2166136261u;
  for (const std::uint32_t word : words) hash = (hash ^ word) * 16777619u;
  return hash;
}

std::uint32_t checksumOfBlob(std::span<const std::uint32_t> words) {
  return checksum(words.subspan(abi::MESH_HEADER_CHECKSUM + 1));
}

/// The influences of a vertex as stored, those of one joint added up, none of weight 0; the pivot
/// first, the rest by falling weight. One order for everybody is what makes results equal to the
/// bit.
void gatherInfluences(const MeshView& mesh, std::uint32_t vertex,
                      std::vector<Influence>& influences) {
  influences.clear();
  for (const InfluenceSet& set : mesh.influenceSets) {
    for (std::uint32_t slot = 0; slot < set.weights.components; ++slot) {
      const double weight = loadWeight(set.weights, vertex, slot);
      if (weight != 0) influences.push_back({loadUnsigned(set.joints, vertex, slot), weight});
    }
  }
  std::stable_sort(influences.begin(), influences.end(),
                   [](const Influence& a, const Influence& b) { return a.joint < b.joint; });
  std::size_t kept = 0;
  for (const Influence& influence : influences) {
    if (kept > 0 && influences[kept - 1].joint == influence.joint) {
      influences[kept - 1].weight += influence.weight;
    } else {
      influences[kept++] = influence;
    }
  }
  influences.resize(kept, Influence{});
  std::sort(influences.begin(), influences.end(), [](const Influence& a, const Influence& b) {
    return a.weight != b.weight ? a.weight > b.weight : a.joint < b.joint;
  });
}

/// Divides by the sum, rounds to float32, and gives what rounding left over to the strongest, so
/// that linear blending does not scale the mesh.
void normalizeInfluences(std::vector<Influence>& influences) {
  double sum = 0;
  for (const Influence& influence : influences) sum += influence.weight;
  double roundedSum = 0;
  for (Influence& influence : influences) {
    influence.weight = static_cast<double>(static_cast<float>(influence.weight / sum));
    roundedSum += influence.weight;
  }
  std::erase_if(influences, [](const Influence& influence) { return influence.weight == 0; });
  if (influences.empty()) return;
  influences[0].weight =
      static_cast<double>(static_cast<float>(influences[0].weight + (1 - roundedSum)));
}

/// The influences of up to `BLOCK_VERTICES` vertices, one after another.
struct Block {
  std::vector<Influence> influences;
  std::array<std::size_t, abi::BLOCK_VERTICES + 1> begin{};
  std::uint32_t vertices = 0;
  std::uint32_t slots = 0;

  std::span<const Influence> of(std::uint32_t lane) const {
    return std::span(influences).subspan(begin[lane], begin[lane + 1] - begin[lane]);
  }
};

void gatherBlock(const MeshView& mesh, std::uint32_t firstVertex, std::vector<Influence>& scratch,
                 Block& block) {
  block.influences.clear();
  block.slots = 0;
  block.vertices = std::min(abi::BLOCK_VERTICES, mesh.vertexCount - firstVertex);
  for (std::uint32_t lane = 0; lane < block.vertices; ++lane) {
    gatherInfluences(mesh, firstVertex + lane, scratch);
    normalizeInfluences(scratch);
    block.begin[lane] = block.influences.size();
    block.influences.insert(block.influences.end(), scratch.begin(), scratch.end());
    block.begin[lane + 1] = block.influences.size();
    block.slots = std::max(block.slots, static_cast<std::uint32_t>(scratch.size()));
  }
}

std::size_t blockRows(std::uint32_t slots) {
  return std::size_t{slots} + (slots + 1) / 2;
}

/// Rows of weights, then rows of pairs of joints. An empty slot carries the pivot's joint: a valid
/// index, never used.
void appendBlock(const Block& block, std::vector<std::uint32_t>& words) {
  const std::size_t base = words.size();
  words.resize(base + blockRows(block.slots) * abi::BLOCK_VERTICES, 0u);
  const std::size_t joints = base + std::size_t{block.slots} * abi::BLOCK_VERTICES;
  for (std::uint32_t lane = 0; lane < block.vertices; ++lane) {
    const std::span<const Influence> influences = block.of(lane);
    for (std::uint32_t slot = 0; slot < block.slots; ++slot) {
      const bool used = slot < influences.size();
      const float weight = used ? static_cast<float>(influences[slot].weight) : 0.0f;
      const std::uint32_t joint = used                 ? influences[slot].joint
                                  : influences.empty() ? 0
                                                       : influences[0].joint;
      words[base + std::size_t{slot} * abi::BLOCK_VERTICES + lane] =
          std::bit_cast<std::uint32_t>(weight);
      words[joints + std::size_t{slot / 2} * abi::BLOCK_VERTICES + lane] |=
          joint << (slot % 2 == 0 ? 0 : 16);
    }
  }
}

std::uint32_t appendFloats(const AttributeView& view, std::vector<std::uint32_t>& words) {
  const auto offset = static_cast<std::uint32_t>(words.size());
  for (std::uint32_t vertex = 0; vertex < view.count; ++vertex) {
    for (std::uint32_t component = 0; component < 3; ++component) {
      words.push_back(loadComponent<std::uint32_t>(view, vertex, component));
    }
  }
  return offset;
}

void alignWords(std::vector<std::uint32_t>& words) {
  while (words.size() % (packedMeshAlignment / 4) != 0) words.push_back(0);
}

std::uint32_t blockCountOf(std::uint32_t vertexCount) {
  return vertexCount / abi::BLOCK_VERTICES + (vertexCount % abi::BLOCK_VERTICES != 0 ? 1 : 0);
}

Error damaged(const std::string& what) {
  return {ErrorCode::invalidData, "packed mesh: " + what};
}

/// Whether `count` words from `offset` on lie behind the header and inside the blob.
bool isSection(std::uint64_t offset, std::uint64_t count, std::uint64_t total) {
  return offset >= abi::MESH_HEADER_WORDS && offset <= total && count <= total - offset;
}

Result<void> checkBlocks(std::span<const std::uint32_t> words) {
  const std::uint32_t blocks = blockCountOf(words[abi::MESH_HEADER_VERTEX_COUNT]);
  for (std::uint32_t block = 0; block < blocks; ++block) {
    const std::size_t record =
        words[abi::MESH_HEADER_BLOCKS] + std::size_t{block} * abi::BLOCK_WORDS;
    const std::uint32_t slots = words[record + abi::BLOCK_SLOTS];
    const std::size_t offset = words[record + abi::BLOCK_OFFSET];
    if (slots > words[abi::MESH_HEADER_MAX_INFLUENCES] ||
        !isSection(offset, blockRows(slots) * abi::BLOCK_VERTICES, words.size())) {
      return damaged("block " + std::to_string(block) + " lies outside the blob");
    }
    const std::size_t joints = offset + std::size_t{slots} * abi::BLOCK_VERTICES;
    for (const std::uint32_t pair :
         words.subspan(joints, std::size_t{(slots + 1) / 2} * abi::BLOCK_VERTICES)) {
      if (std::max(pair & 0xffffu, pair >> 16) >= words[abi::MESH_HEADER_REQUIRED_JOINTS]) {
        return damaged("block " + std::to_string(block) + " has a joint index above its largest");
      }
    }
  }
  return {};
}

Result<void> checkBlob(std::span<const std::uint32_t> words) {
  if (words.size() < abi::MESH_HEADER_WORDS || words[abi::MESH_HEADER_MAGIC] != abi::MESH_MAGIC) {
    return damaged("the bytes do not begin with the header of a packed mesh");
  }
  if (words[abi::MESH_HEADER_VERSION] != abi::MESH_VERSION) {
    return Error{ErrorCode::unsupportedVersion,
                 "packed mesh: version " + std::to_string(words[abi::MESH_HEADER_VERSION]) +
                     ", this library reads version " + std::to_string(abi::MESH_VERSION)};
  }
  if (words[abi::MESH_HEADER_WORDS_TOTAL] != words.size()) {
    return damaged("it has " + std::to_string(words.size() * 4) + " bytes, its header says " +
                   std::to_string(std::uint64_t{words[abi::MESH_HEADER_WORDS_TOTAL]} * 4));
  }
  if (checksumOfBlob(words) != words[abi::MESH_HEADER_CHECKSUM])
    return damaged("the checksum does not match");

  const std::uint64_t vertices = words[abi::MESH_HEADER_VERTEX_COUNT];
  const std::uint32_t normals = words[abi::MESH_HEADER_NORMALS];
  if (vertices == 0 || words[abi::MESH_HEADER_REQUIRED_JOINTS] > maxPaletteJoints ||
      words[abi::MESH_HEADER_REQUIRED_JOINTS] == 0 ||
      !isSection(words[abi::MESH_HEADER_POSITIONS], vertices * 3, words.size()) ||
      (normals != 0 && !isSection(normals, vertices * 3, words.size())) ||
      !isSection(
          words[abi::MESH_HEADER_BLOCKS],
          std::uint64_t{blockCountOf(words[abi::MESH_HEADER_VERTEX_COUNT])} * abi::BLOCK_WORDS,
          words.size())) {
    return damaged("its header does not fit its sections");
  }
  return checkBlocks(words);
}

}  // namespace

Result<PackedMesh> pack(const MeshView& mesh, std::uint32_t jointCount) {
  if (jointCount == 0 || jointCount > maxPaletteJoints) {
    return Error{ErrorCode::invalidArgument, "mesh '" + std::string(mesh.name) +
                                                 "': a palette has 1 to " +
                                                 std::to_string(maxPaletteJoints) +
                                                 " joints, not " + std::to_string(jointCount)};
  }
  const MeshReport report = validate(mesh, jointCount);
  for (const Finding& finding : report.findings) {
    if (refusedByPack(finding.problem)) return Error{ErrorCode::invalidMesh, finding.message};
  }

  PackedMesh packed;
  std::vector<std::uint32_t>& words = packed.words_;
  words.assign(abi::MESH_HEADER_WORDS, 0u);
  words[abi::MESH_HEADER_MAGIC] = abi::MESH_MAGIC;
  words[abi::MESH_HEADER_VERSION] = abi::MESH_VERSION;
  words[abi::MESH_HEADER_VERTEX_COUNT] = mesh.vertexCount;
  words[abi::MESH_HEADER_POSITIONS] = appendFloats(mesh.positions, words);
  if (mesh.normals) words[abi::MESH_HEADER_NORMALS] = appendFloats(mesh.normals, words);

  const std::uint32_t blocks = blockCountOf(mesh.vertexCount);
  const std::size_t blockTable = words.size();
  words.resize(blockTable + std::size_t{blocks} * abi::BLOCK_WORDS);
  words[abi::MESH_HEADER_BLOCKS] = static_cast<std::uint32_t>(blockTable);

  Block block;
  std::vector<Influence> scratch;
  std::uint32_t requiredJoints = 1, maxInfluences = 0;
  for (std::uint32_t index = 0; index < blocks; ++index) {
    gatherBlock(mesh, index * abi::BLOCK_VERTICES, scratch, block);
    for (const Influence& influence : block.influences)
      requiredJoints = std::max(requiredJoints, influence.joint + 1);
    maxInfluences = std::max(maxInfluences, block.slots);
    words[blockTable + std::size_t{index} * abi::BLOCK_WORDS + abi::BLOCK_OFFSET] =
        static_cast<std::uint32_t>(words.size());
    words[blockTable + std::size_t{index} * abi::BLOCK_WORDS + abi::BLOCK_SLOTS] = block.slots;
    appendBlock(block, words);
    if (words.size() > 0xffffffffu - abi::BLOCK_VERTICES) {
      return Error{ErrorCode::limitExceeded,
                   "mesh '" + std::string(mesh.name) + "': packed, it would be larger than 16 GiB"};
    }
  }
  alignWords(words);

  words[abi::MESH_HEADER_REQUIRED_JOINTS] = requiredJoints;
  words[abi::MESH_HEADER_MAX_INFLUENCES] = maxInfluences;
  words[abi::MESH_HEADER_WORDS_TOTAL] = static_cast<std::uint32_t>(words.size());
  words[abi::MESH_HEADER_CHECKSUM] = checksumOfBlob(words);
  return packed;
}

Result<PackedMesh> PackedMesh::fromBytes(std::span<const std::byte> bytes) {
  if (bytes.size() % packedMeshAlignment != 0) {
    return damaged("its length of " + std::to_string(bytes.size()) +
                   " bytes is not a multiple of " + std::to_string(packedMeshAlignment));
  }
  PackedMesh packed;
  packed.words_.resize(bytes.size() / 4);
  if (!bytes.empty()) std::memcpy(packed.words_.data(), bytes.data(), bytes.size());
  if (const Result<void> good = checkBlob(packed.words_); !good) return good.error();
  return packed;
}

MeshInfo PackedMesh::info() const {
  return {bytes().size(), vertexCount(), requiredJoints(), maxInfluences(), hasNormals()};
}

std::uint32_t PackedMesh::vertexCount() const {
  return words_[abi::MESH_HEADER_VERTEX_COUNT];
}
std::uint32_t PackedMesh::requiredJoints() const {
  return words_[abi::MESH_HEADER_REQUIRED_JOINTS];
}
std::uint32_t PackedMesh::maxInfluences() const {
  return words_[abi::MESH_HEADER_MAX_INFLUENCES];
}
bool PackedMesh::hasNormals() const {
  return words_[abi::MESH_HEADER_NORMALS] != 0;
}

}  // namespace dermis
