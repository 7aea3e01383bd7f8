#include "dermis/mesh.h"

#include <algorithm>
#include <bit>
#include <cstring>
#include <span>
#include <string>

#include "abi.h"
#include "attribute.h"
#include "check_mesh.h"
#include "pack/check.h"
#include "pack/influences.h"
#include "strict_floating_point.h"
#include "text.h"

namespace dermis {
namespace {

using abi::alignToUnit;

/// A target's displacements, read by element.
class Displacements {
 public:
  Displacements(const MeshView& mesh, const MorphTargetView& target) : target_(target) {
    if (target.positions && anyOf(abi::MORPH_HAS_POSITIONS))
      attributes_ |= abi::MORPH_HAS_POSITIONS;
    if (mesh.normals && target.normals && anyOf(abi::MORPH_HAS_NORMALS))
      attributes_ |= abi::MORPH_HAS_NORMALS;
    if (mesh.tangents && target.tangents && anyOf(abi::MORPH_HAS_TANGENTS))
      attributes_ |= abi::MORPH_HAS_TANGENTS;
  }

  std::uint32_t attributes() const { return attributes_; }

  std::uint32_t count() const {
    if (!target_.vertices.empty()) return static_cast<std::uint32_t>(target_.vertices.size());
    for (const AttributeView* view : {&target_.positions, &target_.normals, &target_.tangents}) {
      if (*view) return view->count;
    }
    return 0;
  }
  std::uint32_t vertex(std::uint32_t element) const {
    return target_.vertices.empty() ? element : target_.vertices[element];
  }
  bool isZero(std::uint32_t element) const {
    for (const std::uint32_t attribute :
         {abi::MORPH_HAS_POSITIONS, abi::MORPH_HAS_NORMALS, abi::MORPH_HAS_TANGENTS}) {
      if ((attributes_ & attribute) != 0 && !isZero(attribute, element)) return false;
    }
    return true;
  }
  void append(std::uint32_t element, std::vector<std::uint32_t>& words) const {
    for (const std::uint32_t attribute :
         {abi::MORPH_HAS_POSITIONS, abi::MORPH_HAS_NORMALS, abi::MORPH_HAS_TANGENTS}) {
      if ((attributes_ & attribute) == 0) continue;
      for (std::uint32_t component = 0; component < 3; ++component)
        words.push_back(std::bit_cast<std::uint32_t>(load(attribute, element, component)));
    }
  }

 private:
  float load(std::uint32_t attribute, std::uint32_t element, std::uint32_t component) const {
    if (attribute == abi::MORPH_HAS_POSITIONS)
      return loadMorphPosition(target_, element, component);
    return loadFloat(attribute == abi::MORPH_HAS_NORMALS ? target_.normals : target_.tangents,
                     element, component);
  }
  bool isZero(std::uint32_t attribute, std::uint32_t element) const {
    return load(attribute, element, 0) == 0 && load(attribute, element, 1) == 0 &&
           load(attribute, element, 2) == 0;
  }
  bool anyOf(std::uint32_t attribute) const {
    for (std::uint32_t element = 0; element < count(); ++element) {
      if (!isZero(attribute, element)) return true;
    }
    return false;
  }

  const MorphTargetView& target_;
  std::uint32_t attributes_ = 0;
};

void appendTarget(const Displacements& displacements, std::size_t record,
                  std::vector<std::uint32_t>& words) {
  std::vector<std::uint32_t> elements;
  if (displacements.attributes() != 0) {
    for (std::uint32_t element = 0; element < displacements.count(); ++element) {
      if (!displacements.isZero(element)) elements.push_back(element);
    }
  }
  if (elements.empty()) return;

  const auto blockOf = [&](std::uint32_t element) {
    return displacements.vertex(element) / abi::MORPH_BLOCK_VERTICES;
  };
  const std::uint32_t firstBlock = blockOf(elements.front());
  const std::uint32_t blockCount = blockOf(elements.back()) - firstBlock + 1;
  alignToUnit(words);
  const std::size_t blocks = words.size();
  words.resize(blocks + std::size_t{blockCount} * abi::MORPH_BLOCK_WORDS, 0u);
  abi::store(words, record,
             abi::MorphRecord{firstBlock, blockCount, static_cast<std::uint32_t>(blocks),
                              displacements.attributes()});
  for (const std::uint32_t element : elements) {
    const std::size_t place =
        blocks + std::size_t{blockOf(element) - firstBlock} * abi::MORPH_BLOCK_WORDS;
    auto block = abi::load<abi::MorphBlockRecord>(words, place);
    if (block.maskLow == 0 && block.maskHigh == 0)
      block.displacements = static_cast<std::uint32_t>(words.size());
    const std::uint32_t lane = displacements.vertex(element) % abi::MORPH_BLOCK_VERTICES;
    (lane < 32 ? block.maskLow : block.maskHigh) |= 1u << lane % 32;
    abi::store(words, place, block);
    displacements.append(element, words);
  }
}

}  // namespace

std::uint32_t appendMorphs(const MeshView& mesh, std::vector<std::uint32_t>& words) {
  alignToUnit(words);
  const std::size_t records = words.size();
  words.resize(records + mesh.morphTargets.size() * abi::MORPH_WORDS, 0u);
  for (std::size_t target = 0; target < mesh.morphTargets.size(); ++target) {
    appendTarget(Displacements(mesh, mesh.morphTargets[target]),
                 records + target * abi::MORPH_WORDS, words);
  }
  return static_cast<std::uint32_t>(records);
}

namespace {

static_assert(std::endian::native == std::endian::little, "packed meshes are little-endian words");

constexpr std::uint64_t mostWords = 0xffffffffu;

std::uint32_t offsetOf(const std::vector<std::uint32_t>& words) {
  return static_cast<std::uint32_t>(words.size());
}

/// Appends one record more than there are vertices. The begin of the influences is filled in later.
std::uint32_t appendPositions(const MeshView& mesh, std::vector<std::uint32_t>& words) {
  const std::uint32_t offset = offsetOf(words);
  words.resize(words.size() + (std::size_t{mesh.vertexCount} + 1) * abi::VERTEX_WORDS);
  std::uint32_t* record = words.data() + offset;
  for (std::uint32_t vertex = 0; vertex < mesh.vertexCount; ++vertex, record += abi::VERTEX_WORDS) {
    for (std::uint32_t component = 0; component < 3; ++component)
      record[component] = std::bit_cast<std::uint32_t>(loadPosition(mesh, vertex, component));
  }
  return offset;
}

/// Three or four components to a record; 0 if the mesh has none.
std::uint32_t appendVectors(const AttributeView& view, std::uint32_t components,
                            std::vector<std::uint32_t>& words) {
  if (!view) return 0;
  const std::uint32_t offset = offsetOf(words);
  words.resize(words.size() + std::size_t{view.count} * abi::VERTEX_WORDS);
  std::uint32_t* record = words.data() + offset;
  for (std::uint32_t vertex = 0; vertex < view.count; ++vertex, record += abi::VERTEX_WORDS) {
    for (std::uint32_t component = 0; component < components; ++component)
      record[component] = std::bit_cast<std::uint32_t>(loadFloat(view, vertex, component));
  }
  return offset;
}

/// One a vertex; 0 if the mesh has none.
std::uint32_t appendFloats(const AttributeView& view, std::vector<std::uint32_t>& words) {
  if (!view) return 0;
  const std::uint32_t offset = offsetOf(words);
  for (std::uint32_t vertex = 0; vertex < view.count; ++vertex)
    words.push_back(std::bit_cast<std::uint32_t>(loadFloat(view, vertex, 0)));
  return offset;
}

/// Appends the influences after the positions, and stores in each position record where the
/// influences of the vertex begin.
void appendInfluences(const MeshView& mesh, abi::MeshHeader& header,
                      std::vector<std::uint32_t>& words) {
  const std::size_t offset = words.size();
  header.influences = offsetOf(words);
  const auto setBegin = [&](std::uint32_t vertex, std::uint32_t begin) {
    const std::size_t place = header.positions + std::size_t{vertex} * abi::VERTEX_WORDS;
    auto record = abi::load<abi::PositionRecord>(words, place);
    record.influences = begin;
    abi::store(words, place, record);
  };
  std::vector<PackedInfluence> influences;
  std::uint32_t requiredJoints = 1, maxInfluences = 0, minInfluences = ~0u;
  for (std::uint32_t vertex = 0; vertex < mesh.vertexCount; ++vertex) {
    const auto unit = static_cast<std::uint32_t>((words.size() - offset) / 4);
    packInfluences(mesh, vertex, influences);
    const auto count = static_cast<std::uint32_t>(influences.size());
    setBegin(vertex, unit * 2 + count % 2);
    for (const PackedInfluence& influence : influences) {
      words.resize(words.size() + abi::INFLUENCE_WORDS);
      abi::store(words, words.size() - abi::INFLUENCE_WORDS,
                 abi::InfluenceRecord{static_cast<float>(influence.weight), influence.joint});
      requiredJoints = std::max(requiredJoints, influence.joint + 1);
    }
    alignToUnit(words);
    maxInfluences = std::max(maxInfluences, count);
    minInfluences = std::min(minInfluences, count);
  }
  setBegin(mesh.vertexCount, static_cast<std::uint32_t>((words.size() - offset) / 4 * 2));
  header.requiredJoints = requiredJoints;
  header.maxInfluences = maxInfluences;
  header.minInfluences = std::min(minInfluences, maxInfluences);
}

/// An upper limit of the size of a packed mesh in words.
std::uint64_t wordsNeeded(const MeshView& mesh) {
  std::uint64_t perVertex = abi::INFLUENCE_WORDS;  // of padding
  for (const AttributeView* view :
       {&mesh.positions, &mesh.normals, &mesh.tangents, &mesh.centersOfRotation})
    perVertex += *view ? abi::VERTEX_WORDS : 0u;
  perVertex += (mesh.dualQuaternionWeights ? 1u : 0u) + (mesh.bulgeStrengths ? 1u : 0u);
  for (const InfluenceSet& set : mesh.influenceSets)
    perVertex += std::uint64_t{set.weights.components} * abi::INFLUENCE_WORDS;
  std::uint64_t words =
      abi::MESH_HEADER_WORDS + 2 * abi::VERTEX_WORDS + mesh.vertexCount * perVertex;
  for (const MorphTargetView& target : mesh.morphTargets) {
    const std::uint64_t displaced =
        target.vertices.empty() ? mesh.vertexCount : target.vertices.size();
    words += 2 * abi::MORPH_WORDS + displaced * 9 + mesh.vertexCount / 16 + abi::MORPH_BLOCK_WORDS;
  }
  return words;
}

}  // namespace

Result<PackedMesh> pack(const MeshView& mesh, std::uint32_t jointCount) {
  if (const Result<void> good = checkPackable(mesh, jointCount); !good) return good.error();

  if (wordsNeeded(mesh) > mostWords) {
    return Error{ErrorCode::limitExceeded,
                 "mesh " + inQuotes(mesh.name) + ": the packed mesh might be larger than 16 GiB"};
  }

  PackedMesh packed;
  std::vector<std::uint32_t>& words = packed.words_;
  words.assign(abi::MESH_HEADER_WORDS, 0u);
  abi::MeshHeader header{};
  header.magic = abi::MESH_MAGIC;
  header.version = abi::MESH_VERSION;
  header.vertexCount = mesh.vertexCount;
  header.positions = appendPositions(mesh, words);
  header.normals = appendVectors(mesh.normals, 3, words);
  header.tangents = appendVectors(mesh.tangents, 4, words);
  header.centers = appendVectors(mesh.centersOfRotation, 3, words);
  appendInfluences(mesh, header, words);
  header.dualQuaternionWeights = appendFloats(mesh.dualQuaternionWeights, words);
  header.dualQuaternionWeight = mesh.dualQuaternionWeight;
  header.bulgeStrengths = appendFloats(mesh.bulgeStrengths, words);
  header.bulgeStrength = mesh.bulgeStrength;
  header.morphs = appendMorphs(mesh, words);
  header.morphCount = static_cast<std::uint32_t>(mesh.morphTargets.size());
  while (words.size() % (packedMeshAlignment / 4) != 0) words.push_back(0);

  abi::store(words, 0, header);
  finishStored(words);
  return packed;
}

Result<PackedMesh> PackedMesh::fromBytes(std::span<const std::byte> bytes) {
  if (bytes.size() % packedMeshAlignment != 0) {
    return storedMesh.damaged("its length of " + std::to_string(bytes.size()) +
                              " bytes is not a multiple of " + std::to_string(packedMeshAlignment));
  }
  Result<std::vector<std::uint32_t>> words = storedMesh.wordsOf(bytes);
  if (!words) return words.error();
  if (const Result<void> good = checkMeshWords(*words); !good) return good.error();
  PackedMesh packed;
  packed.words_ = *std::move(words);
  return packed;
}

MeshInfo PackedMesh::info() const {
  const auto header = abi::load<abi::MeshHeader>(words_, 0);
  MeshInfo info;
  info.byteSize = bytes().size();
  info.vertexCount = header.vertexCount;
  info.requiredJoints = header.requiredJoints;
  info.maxInfluences = header.maxInfluences;
  info.minInfluences = header.minInfluences;
  info.morphTargetCount = header.morphCount;
  info.hasNormals = header.normals != 0;
  info.hasTangents = header.tangents != 0;
  info.hasCentersOfRotation = header.centers != 0;
  return info;
}

}  // namespace dermis
