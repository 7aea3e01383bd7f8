// Where the attributes of skinned vertices are written: offset and stride for one instance
// (`OutputAttribute`), or a layout for many instances (`VertexLayout`).
#pragma once

#include <cstdint>

#include "dermis/export.h"
#include "dermis/result.h"
#include "dermis/vertex_format.h"

namespace dermis {

/// Where one attribute of the skinned vertices is written. Vertex v is at `offset + v * stride` in
/// the output buffer of that attribute. Bytes between attributes are never written.
///
/// Positions, normals and tangents, in this order, form a run if they follow each other without a
/// gap and have the same stride. An attribute alone is a run, too; previous positions always are.
///
/// Rules of batches and scenes. For `cpu::skin` there is none but the minimum of the stride.
/// - A run begins at a multiple of 4 bytes. Its length and its stride are multiples of 4. For
///   example, float16x3 and octahedral8x2 are a run of 8 bytes; float32x3 and octahedral8x2 twice
///   are one of 16. But float16x3 alone needs float16x4 instead.
/// - All attributes must go to one buffer (`OutputSizes::isOneBuffer`) if positions, normals and
///   tangents, as far as they are written, are one run of at least two attributes, or if the size
///   of one of the three is not a multiple of 4 bytes.
/// - If positions and normals are float32x3, normals directly follow positions, and both have the
///   same stride, a multiple of 8: the offset of the positions must be a multiple of 8, and both
///   must be in one buffer, wherever tangents are.
struct OutputAttribute {
  std::uint64_t offset = 0;                  ///< bytes
  std::uint32_t stride = 0;                  ///< bytes, at least `formatSize(format)`
  VertexFormat format = VertexFormat::none;  ///< `none`: the attribute is not written
};

/// Where previous positions come from. An engine needs them for motion vectors.
enum class Motion : std::uint8_t {
  none = 0,  ///< there are no previous positions
  /// Copied from the output before it is overwritten: the positions of the last time that the
  /// instance was skinned. Costs a read and a write. The output must persist between frames.
  kept = 1,
};

/// How the attributes of many vertices are arranged.
enum class Arrangement : std::uint8_t {
  /// One vertex after the other. In each vertex: position, normal, tangent, previous position, each
  /// at a multiple of `formatAlignment`.
  interleaved = 0,
  /// One attribute after the other. Each begins at a multiple of 48 bytes.
  planar = 1,
};

/// The attributes of skinned vertices, their formats and their arrangement. Method and layout
/// decide which pipelines are needed (`PipelineNeeds`).
struct VertexLayout {
  VertexFormat positions = VertexFormat::float32x3;  ///< `isPositionFormat`
  /// `isNormalFormat`, or `none`. It must be `none` if the mesh has no normals.
  VertexFormat normals = VertexFormat::none;
  /// `isTangentFormat`, or `none`. It must be `none` if the mesh has no tangents.
  VertexFormat tangents = VertexFormat::none;
  /// Whether there are previous positions. Their format is that of the positions. In a scene they
  /// are the positions that the output had in the last committed frame in which the instance was
  /// visible.
  Motion motion = Motion::none;
  Arrangement arrangement = Arrangement::interleaved;
  /// For interleaved layouts: bytes from one vertex to the next. It may leave room for attributes
  /// of the engine after those of Dermis. 0: the minimum, rounded up to a multiple of 4.
  std::uint32_t stride = 0;

  friend bool operator==(const VertexLayout&, const VertexLayout&) = default;
};

/// Where the attributes of all vertices of an instance are. `placeVertices` returns it.
struct VertexPlaces {
  OutputAttribute positions, normals, tangents, previousPositions;
  Motion motion = Motion::none;
  std::uint64_t size = 0;  ///< bytes of all vertices
  /// Bytes: the offset of the vertices must be a multiple of this, which need not be a power of
  /// two. For interleaved layouts it is the stride, so that a draw can use `firstVertex`.
  std::uint64_t alignment = 1;
};

/// Places `vertexCount` vertices at byte `offset` of a buffer. Fails with `invalidArgument`
/// - if a member of the layout is none of the values that it may have;
/// - if the stride is too small, or the layout is planar and has a stride;
/// - if `offset` is not a multiple of `VertexPlaces::alignment`.
DERMIS_CORE_API Result<VertexPlaces> placeVertices(const VertexLayout& layout,
                                                   std::uint32_t vertexCount,
                                                   std::uint64_t offset = 0);

}  // namespace dermis
