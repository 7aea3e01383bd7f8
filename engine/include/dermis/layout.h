// Where the attributes of skinned vertices stand: said of one instance by offsets and strides
// (`OutputAttribute`), or of many instances by a layout (`VertexLayout`).
#pragma once

#include <cstdint>

#include "dermis/export.h"
#include "dermis/result.h"
#include "dermis/vertex_format.h"

namespace dermis {

/// Where one attribute of the skinned vertices is written: vertex v at `offset + v * stride` in the
/// output buffer of that attribute. Bytes between attributes are never written.
///
/// If a job's attributes stand one right behind the other in the order positions, normals,
/// tangents, with equal strides, all must go to one buffer (`OutputSizes::isOneBuffer`). If
/// positions and normals are float32x3 as well and the stride is a multiple of 8, positions must
/// begin at a multiple of 8.
///
/// Offset, stride and the format's size must be multiples of 4; with `DeviceLimits::storage16Bit`,
/// of 2; with `storage8Bit` too, they may be any number. On a device with fewer storage buffers
/// than `storageBuffersWanted` they must always be multiples of 4.
struct OutputAttribute {
  std::uint64_t offset = 0;                  ///< bytes
  std::uint32_t stride = 0;                  ///< bytes, at least `formatSize(format)`
  VertexFormat format = VertexFormat::none;  ///< `none`: the attribute is not wanted
};

/// Where previous positions come from. They are for motion vectors.
enum class Motion : std::uint8_t {
  none,
  /// Copied from the output before it is overwritten: the positions from the last time that this
  /// instance was skinned. Takes a read and a write; the output must persist between frames.
  kept,
  /// Skinned again with the previous pose and morph weights. Takes a second skinning; only the
  /// pose must persist. Not in a scene.
  reskinned,
};

enum class Arrangement : std::uint8_t {
  /// Vertex after vertex: positions, normals, tangents, previous positions, each at a multiple of
  /// `formatAlignment`.
  interleaved,
  /// Attribute after attribute, each beginning at a multiple of 48 bytes.
  planar,
};

/// The attributes of skinned vertices, their formats, and how they stand together. With a method,
/// it decides on pipelines (`PipelineNeeds`).
struct VertexLayout {
  VertexFormat positions = VertexFormat::float32x3;  ///< `isPositionFormat`
  VertexFormat normals = VertexFormat::none;
  VertexFormat tangents = VertexFormat::none;
  /// Whether there are previous positions, in the format of positions. In a scene they are those of
  /// the last frame that displayed the instance.
  Motion motion = Motion::none;
  Arrangement arrangement = Arrangement::interleaved;
  /// Interleaved: bytes from vertex to vertex, for attributes of the engine's own behind those of
  /// Dermis. 0: the minimum, rounded up to a multiple of 4.
  std::uint32_t stride = 0;

  friend bool operator==(const VertexLayout&, const VertexLayout&) = default;
};

/// Where the attributes of `vertexCount` vertices stand.
struct VertexPlaces {
  OutputAttribute positions, normals, tangents, previousPositions;
  Motion motion = Motion::none;
  std::uint64_t size = 0;  ///< bytes
  /// Bytes: `offset` must be a multiple of this, which need not be a power of two. Interleaved: the
  /// stride, so that an instance may be drawn by `firstVertex`.
  std::uint64_t alignment = 1;
};

/// Places vertices from byte `offset` of a buffer on. Fails with `invalidArgument` if positions are
/// not `isPositionFormat`, if the stride is too small or the layout is planar and has one, and if
/// the offset is not a multiple of `VertexPlaces::alignment`.
DERMIS_CORE_API Result<VertexPlaces> placeVertices(const VertexLayout& layout,
                                                   std::uint32_t vertexCount,
                                                   std::uint64_t offset = 0);

}  // namespace dermis
