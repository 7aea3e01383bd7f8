// A mesh as the kernels read it: one relocatable blob, made once at import.
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include "dermis/export.h"
#include "dermis/mesh.h"
#include "dermis/result.h"

namespace dermis {

/// Where a packed mesh may stand in the engine's mesh buffer: a multiple of this many bytes.
inline constexpr std::uint32_t packedMeshAlignment = 16;

/// What `makePlan` has to know of a packed mesh. Keep this by the mesh, and free the blob once its
/// bytes are on the GPU.
struct MeshInfo {
  std::uint64_t byteSize = 0;  ///< of the blob
  std::uint32_t vertexCount = 0;
  std::uint32_t requiredJoints =
      0;  ///< the fewest joints of a pose for this mesh: its largest joint index + 1
  std::uint32_t maxInfluences = 0;  ///< the most influences of one vertex
  std::uint32_t minInfluences = 0;  ///< the fewest
  std::uint32_t morphTargetCount = 0;
  bool hasNormals = false;
  bool hasTangents = false;
  bool hasCentersOfRotation = false;  ///< what `centerOfRotation` and `bulgeControlled` need
};

/// A packed mesh owns a blob of little-endian 32-bit words. It is relocatable (offsets count from
/// its start) and versioned, so that an asset cooker can store it. The order of vertices is that of
/// the mesh.
///
/// The same bytes go into the mesh buffer on the GPU, at a multiple of `packedMeshAlignment`.
class DERMIS_CORE_API PackedMesh {
 public:
  /// A packed mesh from stored bytes, which are copied. O(bytes): checks the length, the version,
  /// the checksum and every index, so that no stored blob can make a kernel read outside its mesh
  /// or pose. Fails with `invalidData` or `unsupportedVersion`.
  static Result<PackedMesh> fromBytes(std::span<const std::byte> bytes);

  /// The blob; its size is a multiple of `packedMeshAlignment`.
  std::span<const std::byte> bytes() const { return std::as_bytes(std::span(words_)); }

  MeshInfo info() const;
  std::uint32_t vertexCount() const { return info().vertexCount; }

 private:
  friend DERMIS_CORE_API Result<PackedMesh> pack(const MeshView& mesh, std::uint32_t jointCount);
  PackedMesh() = default;
  std::vector<std::uint32_t> words_;
};

/// Packs a mesh for poses of `jointCount` joints or more: no influence may name another joint. Per
/// vertex: attributes as float32; weights of
/// one joint added up, zero weights dropped, the pivot chosen (the strongest influence, the lowest
/// joint index on a tie) and stored first, the rest by falling weight; weights normalised in double
/// precision and rounded to float32 so that they sum to exactly 1. A vertex takes 8 bytes for each
/// influence that it has. Of morph targets the displaced vertices are stored.
/// O(vertices × influences + displacements).
/// Fails with `invalidMesh` where `validate` reports a problem that is `refusedByPack`, with that
/// finding's sentence, and with `limitExceeded` above 2^32 words.
DERMIS_CORE_API Result<PackedMesh> pack(const MeshView& mesh, std::uint32_t jointCount);

}  // namespace dermis
