// libFuzzer: any bytes as a stored packed mesh. What is accepted must be safe to plan with and to
// skin.

#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <cstring>
#include <span>
#include <vector>

#include "abi.h"
#include "changed_blob.h"
#include "dermis/plan.h"
#include "kernel_reads.h"

using namespace dermis;
using fuzz::require;

namespace {

constexpr std::uint32_t vertexCount = 150, jointCount = 9;

/// A mesh with all that a blob may hold, and no reason to be refused.
std::vector<std::uint32_t> makeGoodBlob() {
  std::vector<float> positions, normals, tangents, weights;
  std::vector<std::uint8_t> joints;
  for (std::uint32_t vertex = 0; vertex < vertexCount; ++vertex) {
    const float f = static_cast<float>(vertex);
    positions.insert(positions.end(), {f, std::sin(f), 1});
    normals.insert(normals.end(), {0, 0, 1});
    tangents.insert(tangents.end(), {1, 0, 0, -1});
    for (std::uint32_t slot = 0; slot < 3; ++slot) {
      joints.push_back(static_cast<std::uint8_t>((vertex + slot) % jointCount));
      weights.push_back(slot <= vertex % 4 ? 0.25f : 0);
    }
  }
  const std::vector<std::uint32_t> some{3, 4, 63, 64, 100, 149};
  const InfluenceSet set{{joints.data(), vertexCount, 3, ComponentType::uint8, 3},
                         attributeView(weights.data(), vertexCount, 3)};
  std::array<MorphTargetView, 3> targets;
  targets[0].positions = attributeView(positions.data(), vertexCount, 3);
  targets[1].vertices = some;
  targets[1].positions = attributeView(normals.data(), 6, 3);
  targets[1].normals = attributeView(tangents.data(), 6, 3);
  targets[1].tangents = attributeView(normals.data(), 6, 3);
  MeshView mesh;
  mesh.vertexCount = vertexCount;
  mesh.positions = attributeView(positions.data(), vertexCount, 3);
  mesh.normals = attributeView(normals.data(), vertexCount, 3);
  mesh.tangents = attributeView(tangents.data(), vertexCount, 4);
  mesh.influenceSets = {&set, 1};
  mesh.morphTargets = targets;
  const Result<PackedMesh> packed = pack(mesh, jointCount);
  require(packed.ok());
  return fuzz::wordsOf(packed->bytes());
}

/// All other bytes, with a header that says what they are.
std::vector<std::uint32_t> blobOf(std::span<const std::uint8_t> data) {
  std::vector<std::uint32_t> words(data.size() / 16 * 4);
  if (!words.empty()) std::memcpy(words.data(), data.data(), words.size() * 4);
  if (words.size() > abi::MESH_HEADER_WORDS) {
    auto header = abi::load<abi::MeshHeader>(words, 0);
    header.magic = abi::MESH_MAGIC;
    header.version = abi::MESH_VERSION;
    header.wordCount = static_cast<std::uint32_t>(words.size());
    abi::store(words, 0, header);
  }
  return words;
}

/// A job with all attributes that the mesh claims to have, and its first and last morph target.
void planWith(const MeshInfo& info) {
  const PoseDescription palette{info.requiredJoints, 0, JointPromise::scaling};
  std::vector<MorphWeight> morphs;
  if (info.morphTargetCount > 1) morphs.push_back({info.morphTargetCount - 1, 0.5f});
  if (info.morphTargetCount > 0) morphs.push_back({0, -2});
  constexpr std::uint32_t stride = 40;
  Job job;
  job.mesh = info;
  job.places[Stream::positions] = {0, stride, VertexFormat::float32x3};
  if (info.hasNormals) job.places[Stream::normals] = {12, stride, VertexFormat::float32x3};
  if (info.hasTangents) job.places[Stream::tangents] = {24, stride, VertexFormat::float32x4};
  job.morphs = morphs;
  Batch batch;
  batch.poses = {&palette, 1};
  batch.jobs = {&job, 1};
  batch.meshesSize = info.byteSize;
  batch.posesSize = std::uint64_t{info.requiredJoints} * sizeof(JointMatrix);
  batch.outputSizes.fill(std::uint64_t{info.vertexCount} * stride);
  Plan plan;
  require(makePlan(batch, {}, {}, plan).ok());
  std::vector<std::byte> tables(plan.buffer(BufferRole::tables).size);
  require(writeTables(plan, tables).ok());
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  if (size == 0) return 0;
  static const std::vector<std::uint32_t> good = makeGoodBlob();
  const std::span<const std::uint8_t> rest(data + 1, size - 1);
  std::vector<std::uint32_t> words =
      data[0] % 2 == 0 ? blobOf(rest) : fuzz::changedBlob(good, rest);
  fuzz::putChecksumRight(words);
  const Result<PackedMesh> mesh = PackedMesh::fromBytes(std::as_bytes(std::span(words)));
  if (!mesh) {
    require(!mesh.error().message.empty());
    return 0;
  }
  fuzz::KernelReads(*mesh).readAll();
  planWith(mesh->info());
  return 0;
}
