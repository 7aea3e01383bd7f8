// Converts a mesh into the blob that the kernels read. This is done once, at import.
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include "dermis/export.h"
#include "dermis/mesh.h"
#include "dermis/result.h"

namespace dermis {

/// Alignment of a packed mesh in the mesh buffer, in bytes.
inline constexpr std::uint32_t packedMeshAlignment = 16;

/// What `makePlan` needs to know about a packed mesh. The engine keeps it, and may free the packed
/// mesh once its bytes are on the GPU.
struct MeshInfo {
  std::uint64_t byteSize = 0;  ///< of the blob
  std::uint32_t vertexCount = 0;
  std::uint32_t requiredJoints = 0;  ///< minimum joints of a pose: the largest joint index + 1
  std::uint32_t maxInfluences = 0;   ///< maximum influences of a vertex
  std::uint32_t minInfluences = 0;   ///< minimum influences of a vertex
  std::uint32_t morphTargetCount = 0;
  bool hasNormals = false;
  bool hasTangents = false;
  bool hasCentersOfRotation = false;  ///< required by methods that `needsCentersOfRotation`
};

/// A packed mesh: a blob of little-endian 32-bit words, which it owns. The vertices are in the
/// order of the mesh. The blob is relocatable (offsets count from its beginning) and has a version
/// number, so it can be stored with the assets.
///
/// The engine copies the same bytes to the mesh buffer on the GPU, at a multiple of
/// `packedMeshAlignment`.
class DERMIS_CORE_API PackedMesh {
 public:
  /// Makes a packed mesh from stored bytes, which it copies. O(bytes): it checks the length, the
  /// version, the checksum and every index, so that no stored blob can make a kernel read outside
  /// its mesh or pose. Fails with `invalidData` or `unsupportedVersion`.
  static Result<PackedMesh> fromBytes(std::span<const std::byte> bytes);

  /// The blob. Its size is a multiple of `packedMeshAlignment`.
  std::span<const std::byte> bytes() const { return std::as_bytes(std::span(words_)); }

  /// What `makePlan` needs to know about it.
  MeshInfo info() const;
  /// `info().vertexCount`.
  std::uint32_t vertexCount() const { return info().vertexCount; }

 private:
  friend DERMIS_CORE_API Result<PackedMesh> pack(const MeshView& mesh, std::uint32_t jointCount);
  PackedMesh() = default;
  std::vector<std::uint32_t> words_;
};

/// Packs a mesh. `jointCount` is the number of joints of its skeleton, 1 to `maxPoseJoints`: all
/// joint indices must be less. A pose may have fewer joints, but at least
/// `MeshInfo::requiredJoints`. O(vertices × influences + displacements).
///
/// - Attributes are converted to float32.
/// - The weights of a joint that occurs twice in a vertex are added. Zero weights are dropped.
/// - Weights are normalized in double precision, and rounded to float32 so that they sum to exactly
///   1. A weight below 2^-49 is dropped.
/// - The influences of a vertex are sorted by descending weight, and by ascending joint index if
///   weights are equal. The first is the pivot: the quaternions of the others are brought into its
///   hemisphere before they are blended (docs/methods.md).
/// - An influence takes 8 bytes.
/// - Of morph targets, only displaced vertices are stored.
///
/// Fails with `invalidArgument` if `jointCount` is out of range, with `limitExceeded` if the blob
/// might be larger than 2^32 words, and with `invalidMesh` if `validate` finds a problem that is
/// `refusedByPack`; the message is that of the first such finding.
DERMIS_CORE_API Result<PackedMesh> pack(const MeshView& mesh, std::uint32_t jointCount);

}  // namespace dermis
